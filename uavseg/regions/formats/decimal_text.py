"""Text of millions of coordinates, in bulk.

A coordinate is written as words of four bytes, looked up in tables; bytes that a word does not need are zero,
and all zeros are dropped at the end.
"""

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]

UNITS = 10_000_000
"""Units in a degree: seven decimals."""


def write_degrees(value: NDArray[np.int64], words: Words, after: str = "") -> None:
    """Write numbers with seven decimals.

    Parameters
    ----------
    value : (n,) int64 array
        In units of 1e-7 degrees, within -180..180 degrees; within -90..90 after a comma.
    words : (n, 3) uint32 array
        Written to: sign and degrees, point and three decimals, four decimals.
    after : str
        A byte before the number, or none.
    """
    degrees = _degrees(after)
    size = np.abs(value)
    whole = size // UNITS
    decimals = (size - whole * UNITS).astype(np.int32)
    words[:, 0] = degrees[whole + (value < 0) * (len(degrees) // 2)]
    words[:, 1] = _three_decimals()[decimals // 10_000]
    words[:, 2] = _four_decimals()[decimals % 10_000]


def words_of(texts: Iterable[str]) -> Words:
    """Texts of up to four bytes as words."""
    return np.frombuffer("".join(text.ljust(4, "\0") for text in texts).encode(), np.uint32)


def lines_of(words: Words) -> list[bytes]:
    """The lines of text in an array of words, of which the last ends with a newline too.

    Examples
    --------
    >>> words = np.empty((2, 4), np.uint32)
    >>> write_degrees(np.array([-5_000_000, 1_230_000_000]), words[:, :3])
    >>> words[:, 3] = words_of(["\\n"])
    >>> lines_of(words)
    [b'-0.5000000', b'123.0000000']
    """
    return words.tobytes().translate(None, b"\0").split(b"\n")[:-1]


@cache
def _degrees(after: str) -> Words:
    """0, 1, 2, ... and then -0, -1, -2, ..."""
    most = 90 if after else 180
    return words_of(f"{after}{sign}{whole}" for sign in ("", "-") for whole in range(most + 1))


@cache
def _three_decimals() -> Words:
    return words_of(f".{decimals:03}" for decimals in range(1000))


@cache
def _four_decimals() -> Words:
    return words_of(f"{decimals:04}" for decimals in range(10_000))
