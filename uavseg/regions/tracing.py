"""Walking along the edges between pixels: chains of corners, tile by tile.

An edge of a region is walked with the region on the right-hand side: an exterior runs clockwise as one sees
the picture, a hole the other way. Directions are 0 right, 1 down, 2 left, 3 up. A tile walks the edges of
its own pixels; where a boundary goes on along a pixel of another tile, the chain ends, and says where it
goes on.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.components import WORD, words_of

OWNER, START, FIRST, LAST, HEAD, TAIL = range(6)  # columns of Chains.table


@dataclass(frozen=True, slots=True)
class Chains:
    """Pieces of boundaries, as corners in order.

    Parameters
    ----------
    vertices : (v, 2) int32 array
        Row and column of pixel corners. A closed chain has its corners only; an open one begins with the
        point where it starts, which may lie on a straight edge, and ends before the point where it goes on.
    pinched : (v,) uint8 array
        1 where the region touches itself or another piece of its label corner to corner.
    table : (k, 6) int64 array
        Of each chain: the label it belongs to, its first vertex, its first and its last direction, the key
        of its first edge and the key of the edge after its last one; both keys are -1 if it is closed.
    """

    vertices: NDArray[np.int32]
    pinched: NDArray[np.uint8]
    table: NDArray[np.int64]


def trace_tile(
    image: NDArray[Any], labels: NDArray[np.uint32], margin: int, corner: tuple[int, int], width: int
) -> Chains:
    """The boundaries of a tile's pixels.

    Parameters
    ----------
    image : (M + 2 m, N + 2 m) uint8 or uint32 array
        Pixels of equal value, not 0, that share an edge belong together; m is at least 1.
    labels : (M, N) uint32 array
        Which chain belongs to whom: a number for each pixel of the tile.
    margin : int
        m.
    corner : (int, int)
        Row and column of the tile's first pixel in the whole raster.
    width : int
        Columns of the whole raster, which makes the keys of edges unique.
    """
    seen = np.zeros(labels.shape, np.uint8)
    room = 1024 + labels.size // 64
    kernel_of_type = _trace_u1 if image.dtype == np.uint8 else _trace_u4
    words = words_of(image) if image.dtype == np.uint8 and margin % WORD == 0 else np.empty((0, 0), np.uint64)
    while True:
        vertices = np.empty((room, 2), np.int32)
        pinched = np.empty(room, np.uint8)
        table = np.empty((room, 6), np.int64)
        sizes = np.zeros(2, np.int64)
        kernel_of_type(
            image, words, labels, margin, corner[0], corner[1], width, seen, vertices, pinched, table, sizes
        )
        if sizes.max() <= room:
            used, chains = sizes
            return Chains(vertices[:used].copy(), pinched[:used].copy(), table[:chains].copy())
        room = int(sizes.max())
        seen[:] = 0


@inlined
def step_row(direction):  # type: ignore[no-untyped-def]
    """Rows moved by one step."""
    return (direction == 1) - (direction == 3)


@inlined
def step_col(direction):  # type: ignore[no-untyped-def]
    """Columns moved by one step."""
    return (direction == 0) - (direction == 2)


@inlined
def pixel_row(row, direction, right):  # type: ignore[no-untyped-def]
    """Row of the pixel ahead of a corner, on the right-hand or the left-hand side."""
    above = direction == 3 or (direction == 2 and right) or (direction == 0 and not right)
    return row - above


@inlined
def pixel_col(col, direction, right):  # type: ignore[no-untyped-def]
    """Column of the pixel ahead of a corner, on the right-hand or the left-hand side."""
    before = direction == 2 or (direction == 1 and right) or (direction == 3 and not right)
    return col - before


@inlined
def lies_within(row, col, shape):  # type: ignore[no-untyped-def]
    """Whether a pixel is one of the tile's own."""
    return row >= 0 and row < shape[0] and col >= 0 and col < shape[1]


@inlined
def begins_chain(image, shape, margin, row, col, direction):  # type: ignore[no-untyped-def]
    """Whether the edge from a corner is one of the tile's whose predecessor runs along another tile's
    pixel.
    """
    own_row = pixel_row(row, direction, True)
    own_col = pixel_col(col, direction, True)
    label = image[own_row + margin, own_col + margin]
    beside_row = pixel_row(row, direction, False)
    beside_col = pixel_col(col, direction, False)
    if label == 0 or image[beside_row + margin, beside_col + margin] == label:
        return False
    back = (direction + 2) % 4
    right_row = pixel_row(row, back, False)
    right_col = pixel_col(col, back, False)
    if image[right_row + margin, right_col + margin] != label:
        return False
    left_row = pixel_row(row, back, True)
    left_col = pixel_col(col, back, True)
    if image[left_row + margin, left_col + margin] != label:
        return not lies_within(right_row, right_col, shape)
    return not lies_within(left_row, left_col, shape)


@inlined
def walk(image, labels, margin, top, left, width, seen, vertices, pinched, table, sizes, row, col, direction):  # type: ignore[no-untyped-def]
    """Write the chain that begins with an edge; past the end of the arrays only count."""
    shape = labels.shape
    own_row = pixel_row(row, direction, True)
    own_col = pixel_col(col, direction, True)
    label = image[own_row + margin, own_col + margin]
    chain = sizes[1]
    first_row = row
    first_col = col
    first = direction
    if chain < table.shape[0]:
        table[chain, 0] = labels[own_row, own_col]
        table[chain, 1] = sizes[0]
        table[chain, 2] = direction
        table[chain, 4] = ((top + row) * (width + 1) + left + col) * 4 + direction
    sizes[1] += 1
    pinch = False
    turned = True
    while True:
        if turned:
            if sizes[0] < vertices.shape[0]:
                vertices[sizes[0], 0] = top + row
                vertices[sizes[0], 1] = left + col
                pinched[sizes[0]] = pinch
            sizes[0] += 1
        if direction == 0:
            seen[row, col] = 1
        row += step_row(direction)
        col += step_col(direction)
        before = direction
        ahead_row = pixel_row(row, direction, True)
        ahead_col = pixel_col(col, direction, True)
        beside_row = pixel_row(row, direction, False)
        beside_col = pixel_col(col, direction, False)
        beside = image[beside_row + margin, beside_col + margin] == label
        pinch = False
        leaves = False
        if image[ahead_row + margin, ahead_col + margin] != label:
            direction = (direction + 1) % 4
            pinch = beside
        elif not beside:
            leaves = not lies_within(ahead_row, ahead_col, shape)
        else:
            direction = (direction + 3) % 4
            leaves = not lies_within(beside_row, beside_col, shape)
        turned = direction != before
        closed = row == first_row and col == first_col and direction == first
        if closed or leaves:
            if chain < table.shape[0]:
                table[chain, 3] = before
                table[chain, 5] = ((top + row) * (width + 1) + left + col) * 4 + direction
                if closed:
                    table[chain, 4] = -1
                    table[chain, 5] = -1
                    if table[chain, 1] < vertices.shape[0]:
                        pinched[table[chain, 1]] = pinch
            return


def _trace(image, words, labels, margin, top, left, width, seen, vertices, pinched, table, sizes):  # type: ignore[no-untyped-def]
    rows, cols = labels.shape
    # Chains that come in from another tile: they begin on the tile's border.
    for r in range(rows + 1):
        for c in range(0, cols + 1, 1 if r == 0 or r == rows else cols):
            for direction in range(4):
                own_row = pixel_row(r, direction, True)
                own_col = pixel_col(c, direction, True)
                if lies_within(own_row, own_col, labels.shape) and begins_chain(
                    image, labels.shape, margin, r, c, direction
                ):
                    walk(
                        image,
                        labels,
                        margin,
                        top,
                        left,
                        width,
                        seen,
                        vertices,
                        pinched,
                        table,
                        sizes,
                        r,
                        c,
                        direction,
                    )
    # Everything else is closed, and has an upper edge.
    for r in range(rows):
        c = 0
        while c < cols:
            if words.shape[0] > 0 and c % WORD == 0:
                word = (c + margin) // WORD
                if words[r + margin, word] == words[r + margin - 1, word]:
                    c += WORD
                    continue
            label = image[r + margin, c + margin]
            if label != 0 and label != image[r + margin - 1, c + margin] and not seen[r, c]:
                walk(image, labels, margin, top, left, width, seen, vertices, pinched, table, sizes, r, c, 0)
            c += 1


_ARRAYS = "u8[:,::1], u4[:,::1], i8, i8, i8, i8, u1[:,::1], i4[:,::1], u1[::1], i8[:,::1], i8[::1])"
_trace_u1 = kernel("void(u1[:,::1], " + _ARRAYS)(_trace)
_trace_u4 = kernel("void(u4[:,::1], " + _ARRAYS)(_trace)
