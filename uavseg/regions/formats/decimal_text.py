"""Vectorised decimal formatting: the text of millions of coordinates from lookup tables.

A coordinate is written as words of four bytes that are looked up in tables; bytes that a word does not need
are zero, and all zero bytes are removed at the end.
"""

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]

UNITS_PER_DEGREE = 10_000_000
"""Coordinates are integers of 1e-7 degrees: seven decimals."""


def write_degrees(value: NDArray[np.int64], words: Words, after: str = "") -> None:
    """Format integers of 1e-7 degrees with seven decimals.

    Parameters
    ----------
    value : (n,) int64 array
        In units of 1e-7 degrees, within -180..180 degrees; within -90..90 degrees if `after` is given.
    words : (n, 3) uint32 array
        Output: sign and degrees, point and three decimals, four decimals.
    after : str
        A single character before the number, or none.
    """
    degrees = _degrees(after)
    size = np.abs(value)
    whole = size // UNITS_PER_DEGREE
    decimals = (size - whole * UNITS_PER_DEGREE).astype(np.int32)
    words[:, 0] = degrees[whole + (value < 0) * (len(degrees) // 2)]
    words[:, 1] = _three_decimals()[decimals // 10_000]
    words[:, 2] = _four_decimals()[decimals % 10_000]


def pack_words(texts: Iterable[str]) -> Words:
    """Texts of up to four bytes as words, (n,) uint32."""
    return np.frombuffer("".join(text.ljust(4, "\0") for text in texts).encode(), np.uint32)


def unpack_lines(words: Words) -> list[bytes]:
    """Lines of text from an array of words; every line, the last one too, ends with a newline.

    Examples
    --------
    >>> words = np.empty((2, 4), np.uint32)
    >>> write_degrees(np.array([-5_000_000, 1_230_000_000]), words[:, :3])
    >>> words[:, 3] = pack_words(["\\n"])
    >>> unpack_lines(words)
    [b'-0.5000000', b'123.0000000']
    """
    return words.tobytes().translate(None, b"\0").split(b"\n")[:-1]


@cache
def _degrees(after: str) -> Words:
    """Words of 0, 1, 2, ... and then of -0, -1, -2, ..."""
    largest = 90 if after else 180
    return pack_words(f"{after}{sign}{whole}" for sign in ("", "-") for whole in range(largest + 1))


@cache
def _three_decimals() -> Words:
    return pack_words(f".{decimals:03}" for decimals in range(1000))


@cache
def _four_decimals() -> Words:
    return pack_words(f"{decimals:04}" for decimals in range(10_000))
