"""Histograms that merge by addition: exact order statistics of more pixels than fit in memory."""

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel

Counts = NDArray[np.int64]
Values = NDArray[Any]

_HALF = 1 << 16


def rank_of(percent: Fraction, total: int) -> int:
    """Return nearest rank of a percentile among `total` sorted values, counted from 1.

    Examples
    --------
    >>> rank_of(Fraction(50), 4), rank_of(Fraction(51), 4), rank_of(Fraction(0), 4)
    (2, 3, 1)
    """
    return max(-(-percent * total // 100), 1)


def bins_of_ranks(counts: Counts, ranks: Iterable[int]) -> list[tuple[int, int]]:
    """Return for each rank the bin that contains it, and the rank within that bin.

    Examples
    --------
    >>> bins_of_ranks(np.array([2, 0, 3]), [1, 2, 3, 5])
    [(0, 1), (0, 2), (2, 1), (2, 3)]
    """
    below = np.concatenate([[0], np.cumsum(counts)])
    found = [(int(np.searchsorted(below[1:], rank)), rank) for rank in ranks]
    return [(index, rank - int(below[index])) for index, rank in found]


def count_integers(values: Values, valid: NDArray[np.bool_] | None) -> Counts:
    """Count the values of an integer type of at most 16 bits, smallest value first."""
    size = values.dtype.itemsize
    counts = np.zeros(1 << 8 * size, np.int64)
    flat = np.ascontiguousarray(values).reshape(-1).view(f"u{size}")
    (_count_u1 if size == 1 else _count_u2)(flat, _mask_bytes(valid), counts)
    return np.roll(counts, len(counts) // 2) if values.dtype.kind == "i" else counts


def count_upper_halves(values: NDArray[np.float32], valid: NDArray[np.bool_] | None) -> Counts:
    """Count the upper 16 bits of the sort keys: 32-bit integers in the order of the float values."""
    counts = np.zeros(_HALF, np.int64)
    _count_upper(_bit_patterns(values), _mask_bytes(valid), counts)
    return counts


def count_lower_halves(
    values: NDArray[np.float32], valid: NDArray[np.bool_] | None, uppers: tuple[int, ...]
) -> Counts:
    """Return histograms of the lower 16 bits of the sort keys, (n, 65536), for n upper halves."""
    counts = np.zeros((len(uppers), _HALF), np.int64)
    row_of = np.full(_HALF, -1, np.int64)
    row_of[list(uppers)] = np.arange(len(uppers))
    _count_lower(_bit_patterns(values), _mask_bytes(valid), row_of, counts)
    return counts


def value_of_key(upper: int, lower: int) -> float:
    """Return the float32 value of a sort key."""
    key = np.uint32(upper << 16 | lower)
    bits = key ^ np.uint32(0x80000000) if key & np.uint32(0x80000000) else ~key
    return float(np.array(bits, np.uint32).view(np.float32))


def _bit_patterns(values: NDArray[np.float32]) -> NDArray[np.uint32]:
    return np.ascontiguousarray(values).reshape(-1).view(np.uint32)


def _mask_bytes(valid: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Return the mask for a kernel: empty if all pixels are valid."""
    if valid is None:
        return np.empty(0, np.uint8)
    return np.ascontiguousarray(valid).reshape(-1).view(np.uint8)


def _count(values, valid, counts):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        if valid.size == 0 or valid[i]:
            counts[values[i]] += 1


_count_u1 = kernel("void(u1[::1], u1[::1], i8[::1])")(_count)
_count_u2 = kernel("void(u2[::1], u1[::1], i8[::1])")(_count)


@kernel("void(u4[::1], u1[::1], i8[::1])")
def _count_upper(patterns, valid, counts):  # type: ignore[no-untyped-def]
    for i in range(patterns.size):
        if valid.size == 0 or valid[i]:
            bits = patterns[i]
            flipped = bits ^ np.uint32(0xFFFFFFFF if bits >> np.uint32(31) else 0x80000000)
            counts[flipped >> np.uint32(16)] += 1


@kernel("void(u4[::1], u1[::1], i8[::1], i8[:,::1])")
def _count_lower(patterns, valid, row_of, counts):  # type: ignore[no-untyped-def]
    for i in range(patterns.size):
        if valid.size == 0 or valid[i]:
            bits = patterns[i]
            flipped = bits ^ np.uint32(0xFFFFFFFF if bits >> np.uint32(31) else 0x80000000)
            row = row_of[flipped >> np.uint32(16)]
            if row >= 0:
                counts[row, flipped & np.uint32(0xFFFF)] += 1
