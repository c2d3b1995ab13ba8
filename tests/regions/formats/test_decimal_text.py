"""Decimal text: as Python formats the same numbers, for any degrees of the globe."""

import numpy as np
from hypothesis import given, strategies as st

from uavseg.raster.geodesy.globe import MAX_DECIMALS, MIN_DECIMALS
from uavseg.regions.formats.text_writers import degree_words, pack_words, unpack_lines, write_degrees


@given(st.lists(st.floats(-1, 1), min_size=1), st.integers(MIN_DECIMALS, MAX_DECIMALS), st.booleans())
def test_degrees_are_written_as_python_writes_them(
    shares: list[float], decimals: int, latitudes: bool
) -> None:
    unit = 10**decimals
    values = [round(share * (90 if latitudes else 180) * unit) for share in shares]
    size = degree_words(decimals)
    words = np.empty((len(values), size + 1), np.uint32)
    write_degrees(np.array(values), words[:, :size], decimals, after="," if latitudes else "")
    words[:, size] = pack_words(["\n"])
    comma = "," if latitudes else ""
    parts = [("-" * (v < 0), *divmod(abs(v), unit)) for v in values]
    expected = [f"{comma}{sign}{whole}.{rest:0{decimals}}".encode() for sign, whole, rest in parts]
    assert unpack_lines(words) == expected


ascii_texts = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=4)


@given(st.lists(st.lists(ascii_texts, min_size=3, max_size=3), min_size=1))
def test_lines_of_words_are_their_texts_joined(rows: list[list[str]]) -> None:
    words = np.array([pack_words([*row, "\n"]) for row in rows])
    assert unpack_lines(words) == ["".join(row).encode() for row in rows]
