"""Nodes: pixel corners where more than two stretches of boundary meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.regions.outline.rings import Rings

Integers = NDArray[np.int64]

_LINE = 16  # mark of a corner that another boundary passes without a turn


@dataclass(frozen=True, slots=True)
class Nodes:
    """Pixel corners, each row of them in one piece, and each column.

    Parameters
    ----------
    by_row : (k,) int64 array
        ``row * (cols + 1) + col``, ascending.
    by_col : (k,) int64 array
        ``col * (rows + 1) + row``, ascending.
    """

    by_row: Integers
    by_col: Integers


def nodes_of(rings: Rings, shape: tuple[int, int]) -> Nodes:
    """Corners where three or four boundaries of regions meet: borders end there, or rings touch.

    A boundary between two regions is one, though a ring of each runs along it.

    Parameters
    ----------
    rings : Rings
    shape : (int, int)
        Rows and columns of the raster.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> nodes_of(trace(np.array([[1, 2], [3, 3]], np.uint32)), (2, 2)).by_row
    array([1, 3, 4, 5])
    """
    rows, cols = rings.vertices[:, 0].astype(np.int64), rings.vertices[:, 1].astype(np.int64)
    by_row = _meeting(rings, rows * (shape[1] + 1) + cols, 1, shape[1] + 1)
    by_col = _meeting(rings, cols * (shape[0] + 1) + rows, 0, shape[0] + 1)
    col, row = np.divmod(by_col, shape[0] + 1)
    nodes = distinct(np.concatenate([by_row, row * (shape[1] + 1) + col]))
    row, col = np.divmod(nodes, shape[1] + 1)
    return Nodes(nodes, np.sort(col * (shape[0] + 1) + row))


def distinct(keys: Integers) -> Integers:
    """Each of some numbers once, ascending; many times as quick as `numpy.unique`, which hashes them."""
    ordered = np.sort(keys)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def _meeting(rings: Rings, keys: Integers, axis: int, stride: int) -> Integers:
    """Nodes among the corners `keys`, as far as edges along an axis and turns tell."""
    known = distinct(keys)
    marks = np.zeros(len(known), np.uint8)
    _mark(rings.vertices, rings.starts, known, axis, stride, marks)
    nodes: Integers = known[_IS_NODE[marks]]
    return nodes


_IS_NODE = np.array([mark & _LINE > 0 or mark.bit_count() > 2 for mark in range(2 * _LINE)])


@inlined
def first_from(keys, key):  # type: ignore[no-untyped-def]
    """Where the keys begin that are not below a key."""
    low = 0
    high = keys.shape[0]
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@inlined
def way_bit(vertices, here, there):  # type: ignore[no-untyped-def]
    """A bit for the direction from one vertex to another: 1 right, 2 left, 4 down, 8 up."""
    if vertices[here, 0] == vertices[there, 0]:
        return 1 if vertices[there, 1] > vertices[here, 1] else 2
    return 4 if vertices[there, 0] > vertices[here, 0] else 8


@kernel("void(i4[:,::1], i8[::1], i8[::1], i8, i8, u1[::1])")
def _mark(vertices, starts, keys, axis, stride, marks):  # type: ignore[no-untyped-def]
    for ring in range(starts.shape[0] - 1):
        before = starts[ring + 1] - 1
        for v in range(starts[ring], starts[ring + 1]):
            after = v + 1 if v + 1 < starts[ring + 1] else starts[ring]
            line = np.int64(vertices[v, 1 - axis]) * stride
            place = first_from(keys, line + vertices[v, axis])
            marks[place] |= way_bit(vertices, v, before) | way_bit(vertices, v, after)
            if vertices[v, 1 - axis] == vertices[after, 1 - axis]:
                end = line + max(vertices[v, axis], vertices[after, axis])
                k = first_from(keys, line + min(vertices[v, axis], vertices[after, axis]) + 1)
                while k < keys.shape[0] and keys[k] < end:
                    marks[k] |= _LINE
                    k += 1
            before = v
