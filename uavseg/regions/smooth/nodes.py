"""Nodes: pixel corners where more than two boundary arcs meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.regions.outline.rings import Rings
from uavseg.regions.sorted_keys import lower_bound, sorted_unique

Integers = NDArray[np.int64]

_PASSED = 16  # bit of a corner through which another boundary goes straight


@dataclass(frozen=True, slots=True)
class Nodes:
    """Keys of pixel corners, sorted by row and by column.

    Parameters
    ----------
    by_row : (k,) int64 array
        ``row * (cols + 1) + col``, ascending.
    by_col : (k,) int64 array
        ``col * (rows + 1) + row``, ascending.
    """

    by_row: Integers
    by_col: Integers


def find_nodes(rings: Rings, shape: tuple[int, int]) -> Nodes:
    """Find the corners where three or four region boundaries meet: borders end there, or rings touch.

    The border between two regions counts as one boundary, though a ring of each runs along it.

    Parameters
    ----------
    rings : Rings
    shape : (int, int)
        Rows and columns of the raster.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> find_nodes(trace(np.array([[1, 2], [3, 3]], np.uint32)), (2, 2)).by_row
    array([1, 3, 4, 5])
    """
    rows, cols = rings.vertices[:, 0].astype(np.int64), rings.vertices[:, 1].astype(np.int64)
    by_row = _nodes_along(rings, rows * (shape[1] + 1) + cols, 1, shape[1] + 1)
    by_col = _nodes_along(rings, cols * (shape[0] + 1) + rows, 0, shape[0] + 1)
    col, row = np.divmod(by_col, shape[0] + 1)
    nodes = sorted_unique(np.concatenate([by_row, row * (shape[1] + 1) + col]))
    row, col = np.divmod(nodes, shape[1] + 1)
    return Nodes(nodes, np.sort(col * (shape[0] + 1) + row))


def _nodes_along(rings: Rings, keys: Integers, axis: int, stride: int) -> Integers:
    """Nodes among the corners `keys` that follow from turns, and from edges along an axis."""
    corners = sorted_unique(keys)
    directions = np.zeros(len(corners), np.uint8)
    _set_directions(rings.vertices, rings.starts, corners, axis, stride, directions)
    nodes: Integers = corners[_IS_NODE[directions]]
    return nodes


_IS_NODE = np.array([bits & _PASSED > 0 or bits.bit_count() > 2 for bits in range(2 * _PASSED)])


@inlined
def direction_bit(vertices, here, there):  # type: ignore[no-untyped-def]
    """Bit of the direction from one vertex to another: 1 right, 2 left, 4 down, 8 up."""
    if vertices[here, 0] == vertices[there, 0]:
        return 1 if vertices[there, 1] > vertices[here, 1] else 2
    return 4 if vertices[there, 0] > vertices[here, 0] else 8


@kernel("void(i4[:,::1], i8[::1], i8[::1], i8, i8, u1[::1])")
def _set_directions(vertices, starts, keys, axis, stride, directions):  # type: ignore[no-untyped-def]
    for ring in range(starts.shape[0] - 1):
        before = starts[ring + 1] - 1
        for v in range(starts[ring], starts[ring + 1]):
            after = v + 1 if v + 1 < starts[ring + 1] else starts[ring]
            line = np.int64(vertices[v, 1 - axis]) * stride
            place = lower_bound(keys, line + vertices[v, axis])
            directions[place] |= direction_bit(vertices, v, before) | direction_bit(vertices, v, after)
            if vertices[v, 1 - axis] == vertices[after, 1 - axis]:
                end = line + max(vertices[v, axis], vertices[after, axis])
                k = lower_bound(keys, line + min(vertices[v, axis], vertices[after, axis]) + 1)
                while k < keys.shape[0] and keys[k] < end:
                    directions[k] |= _PASSED
                    k += 1
            before = v
