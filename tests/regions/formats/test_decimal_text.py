"""Decimal text: as Python formats the same numbers, for any degrees of the globe."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from uavseg.regions.formats.decimal_text import UNITS_PER_DEGREE, pack_words, unpack_lines, write_degrees


@given(st.lists(st.integers(-1_800_000_000, 1_800_000_000), min_size=1), st.booleans())
def test_degrees_are_written_as_python_writes_them(values: list[int], latitudes: bool) -> None:
    values = [value // 2 if latitudes else value for value in values]
    words = np.empty((len(values), 4), np.uint32)
    write_degrees(np.array(values), words[:, :3], after="," if latitudes else "")
    words[:, 3] = pack_words(["\n"])
    comma = "," if latitudes else ""
    unit = UNITS_PER_DEGREE
    expected = [f"{comma}{'-' * (v < 0)}{abs(v) // unit}.{abs(v) % unit:07}".encode() for v in values]
    assert unpack_lines(words) == expected


ascii_texts = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=4)


@given(st.lists(st.lists(ascii_texts, min_size=3, max_size=3), min_size=1))
def test_lines_of_words_are_their_texts_joined(rows: list[list[str]]) -> None:
    words = np.array([pack_words([*row, "\n"]) for row in rows])
    assert unpack_lines(words) == ["".join(row).encode() for row in rows]
