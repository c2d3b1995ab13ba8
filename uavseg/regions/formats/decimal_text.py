"""Vectorised decimal formatting: the text of millions of coordinates from lookup tables.

A coordinate is written as words of four bytes that are looked up in tables; bytes that a word does not need
are zero, and all zero bytes are removed at the end.
"""

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geodesy.globe import MIN_DECIMALS

Words = NDArray[np.uint32]


def degree_words(decimals: int) -> int:
    """Return the number of words of a coordinate with a number of decimals of degrees."""
    return 3 if decimals == MIN_DECIMALS else 4


def write_degrees(value: NDArray[np.int64], words: Words, decimals: int, after: str = "") -> None:
    """Format integers of the last decimal as degrees.

    Parameters
    ----------
    value : (n,) int64 array
        In units of the last decimal, within -180..180 degrees; within -90..90 degrees if `after` is given.
    words : (n, degree_words(decimals)) uint32 array
        Output: sign and degrees, point and three decimals, four decimals, those that follow.
    decimals : int
        7 to 11.
    after : str
        A single character before the number, or none.
    """
    degrees = _degrees(after)
    unit, rest = 10**decimals, 10 ** (decimals - MIN_DECIMALS)
    size = np.abs(value)
    whole = size // unit
    words[:, 0] = degrees[whole + (value < 0) * (len(degrees) // 2)]
    fraction = size - whole * unit
    if rest > 1:
        first = fraction // rest
        words[:, 3] = _decimals(decimals - MIN_DECIMALS)[fraction - first * rest]
        fraction = first
    fraction = fraction.astype(np.int32)
    words[:, 1] = _decimals(3, ".")[fraction // 10_000]
    words[:, 2] = _decimals(4)[fraction % 10_000]


def pack_words(texts: Iterable[str]) -> Words:
    """Pack texts of up to four bytes as words, (n,) uint32."""
    return np.frombuffer("".join(text.ljust(4, "\0") for text in texts).encode(), np.uint32)


def unpack_lines(words: Words) -> list[bytes]:
    """Return the lines of text in an array of words; the last one ends with a newline too.

    Examples
    --------
    >>> words = np.empty((2, 4), np.uint32)
    >>> write_degrees(np.array([-5_000_000, 1_230_000_000]), words[:, :3], 7)
    >>> words[:, 3] = pack_words(["\\n"])
    >>> unpack_lines(words)
    [b'-0.5000000', b'123.0000000']
    """
    return words.tobytes().translate(None, b"\0").split(b"\n")[:-1]


@cache
def _degrees(after: str) -> Words:
    """Return the words of 0, 1, 2, ... and then of -0, -1, -2, ..."""
    largest = 90 if after else 180
    return pack_words(f"{after}{sign}{whole}" for sign in ("", "-") for whole in range(largest + 1))


@cache
def _decimals(count: int, before: str = "") -> Words:
    """Return the words of all numbers of `count` digits, up to four."""
    return pack_words(f"{before}{number:0{count}}" for number in range(10**count))
