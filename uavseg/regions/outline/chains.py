"""Boundary tracing of one tile (crack following): chains of pixel corners along the edges between pixels.

A boundary is followed with its region on the right-hand side: an exterior runs clockwise in the image, a hole
counter-clockwise. Its vertices are its turns, and its nodes: corners where what lies on its left changes. So
regions that share a border share its vertices. Directions are 0 right, 1 down, 2 left, 3 up. A tile follows
the edges of its own pixels; where a boundary continues along a pixel of another tile, the chain ends and
stores the key of the next edge.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.dataclass import dataclass
from uavseg.segmentation.components import WORD, view_as_words

OWNER, START, FIRST, LAST, HEAD, TAIL = range(6)  # columns of Chains.table
_READ = "i8[::1], i8[::1], u8[:,::1], u4[:,::1], i8, i8, i8, i8"
_WRITTEN = "u1[:,::1], i4[:,::1], u1[::1], i8[:,::1], i8[::1]"


@dataclass(frozen=True, slots=True)
class Chains:
    """Pieces of boundaries as sequences of pixel corners.

    A closed chain holds turns and nodes only; an open one begins with its first point, which may lie on a
    straight edge, and ends before the first point of its continuation. The columns of the table are OWNER,
    the label of a chain; START, its first vertex; FIRST and LAST, its first and last direction, FIRST -1
    where its first vertex is a node; HEAD and TAIL, the keys of its first edge and of the edge after its
    last, -1 if closed.
    """

    vertices: NDArray[np.int32]  # (v, 2): row and column of pixel corners
    pinched: NDArray[np.uint8]  # (v,): 1 where components of a label touch corner to corner
    table: NDArray[np.int64]  # (k, 6)


@dataclass(frozen=True, slots=True)
class PackedChains:
    """Chain code: a byte for most vertices, to save memory until chains are linked.

    The byte of a vertex is 128 where it is pinched, 32 times the direction in which it was reached, and the
    number of pixels, or 0 where it follows in four bytes; of a first vertex the pinch alone.
    """

    steps: NDArray[np.uint8]  # (b,): a byte for each vertex
    corners: NDArray[np.int32]  # (k, 2): the first vertex of each chain
    counts: NDArray[np.int64]  # (k,): vertices of each chain
    table: NDArray[np.int64]  # (k, 6): as of `Chains`; START is the first of `steps`

    def unpacked(self, which: NDArray[np.int64]) -> Chains:
        """Return some of the chains, by number and in that order."""
        counts, table = self.counts[which], self.table[which]
        table[:, START] = np.cumsum(counts) - counts
        vertices, pinched = np.empty((int(counts.sum()), 2), np.int32), np.empty(int(counts.sum()), np.uint8)
        _unpack(self.steps, self.corners, self.counts, self.table, which, vertices, pinched)
        return Chains(vertices, pinched, table)


def pack_chains(chains: Chains) -> PackedChains:
    """Pack chains into a ninth of their memory."""
    table = chains.table.copy()
    steps = np.empty(5 * len(chains.vertices), np.uint8)  # pages that are not written to take no memory
    corners, counts = np.empty((len(table), 2), np.int32), np.empty(len(table), np.int64)
    used = _pack(chains.vertices, chains.pinched, table, steps, corners, counts)
    return PackedChains(steps[:used].copy(), corners, counts, table)


def join_packed(tiles: list[PackedChains]) -> PackedChains:
    """Concatenate the chains of all tiles; the list is emptied."""
    offsets = np.cumsum([0] + [len(packed.steps) for packed in tiles])
    parts = zip(*((tile.steps, tile.corners, tile.counts, tile.table) for tile in tiles), strict=True)
    sizes = [len(tile.table) for tile in tiles]
    tiles.clear()
    steps, corners, counts, table = (np.concatenate(arrays) for arrays in parts)
    table[:, START] += np.repeat(offsets[:-1], sizes)
    return PackedChains(steps, corners, counts, table)


def trace_tile(
    image: NDArray[Any], labels: NDArray[np.uint32], margin: int, corner: tuple[int, int], width: int
) -> Chains:
    """Trace the boundaries of a tile's pixels.

    Pixels of `image`, (M + 2 m, N + 2 m), of equal value, not 0, that share an edge belong together; m, the
    `margin`, is at least 1. `labels`, (M, N), are the owners of the chains of each pixel. `corner` is the row
    and column of the tile's first pixel in the raster, `width` the columns of the raster: keys of edges are
    unique in it.
    """
    seen = np.zeros(labels.shape, np.uint8)
    # Pages of these buffers that are not written to take no memory.
    max_vertices, max_chains = 1024 + labels.size // 4, 1024 + labels.size // 16
    kernel_of_type = _trace_u1 if image.dtype == np.uint8 else _trace_u4
    stride = image.shape[1]
    ahead, steps = np.array([0, -1, -stride - 1, -stride]), np.array([1, stride, -1, -stride])
    is_aligned = image.dtype == np.uint8 and margin % WORD == 0
    words = view_as_words(image) if is_aligned else np.empty((0, 0), np.uint64)
    while True:
        vertices = np.empty((max_vertices, 2), np.int32)
        pinched = np.empty(max_vertices, np.uint8)
        table = np.empty((max_chains, 6), np.int64)
        sizes = np.zeros(2, np.int64)
        tile = (image, image.ravel(), ahead, steps, words, labels, margin, *corner, width)
        kernel_of_type(*tile, seen, vertices, pinched, table, sizes)
        used, chains = sizes
        if used <= max_vertices and chains <= max_chains:
            return Chains(vertices[:used].copy(), pinched[:used].copy(), table[:chains].copy())
        max_vertices, max_chains = int(used), int(chains)
        seen[:] = 0


@inlined
def step_row(direction):  # type: ignore[no-untyped-def]
    """Return the rows moved by one step."""
    return (direction == 1) - (direction == 3)


@inlined
def step_col(direction):  # type: ignore[no-untyped-def]
    """Return the columns moved by one step."""
    return (direction == 0) - (direction == 2)


@inlined
def pixel_row(row, direction, right):  # type: ignore[no-untyped-def]
    """Return the row of the pixel ahead of a corner, on the right-hand or the left-hand side."""
    above = direction == 3 or (direction == 2 and right) or (direction == 0 and not right)
    return row - above


@inlined
def pixel_col(col, direction, right):  # type: ignore[no-untyped-def]
    """Return the column of the pixel ahead of a corner, on the right-hand or the left-hand side."""
    before = direction == 2 or (direction == 1 and right) or (direction == 3 and not right)
    return col - before


@inlined
def lies_within(row, col, shape):  # type: ignore[no-untyped-def]
    """Check whether a pixel belongs to the tile, not to its halo."""
    return row >= 0 and row < shape[0] and col >= 0 and col < shape[1]


@inlined
def label_ahead(image, margin, row, col, direction, right):  # type: ignore[no-untyped-def]
    """Return the value of the pixel ahead of a corner."""
    return image[pixel_row(row, direction, right) + margin, pixel_col(col, direction, right) + margin]


@inlined
def begins_chain(image, shape, margin, row, col, direction):  # type: ignore[no-untyped-def]
    """Check whether an edge belongs to the tile and its predecessor to another tile."""
    label, back = label_ahead(image, margin, row, col, direction, True), (direction + 2) % 4
    if label == 0 or label_ahead(image, margin, row, col, direction, False) == label:
        return False
    if label_ahead(image, margin, row, col, back, False) != label:
        return False
    goes_on = label_ahead(image, margin, row, col, back, True) == label
    return not lies_within(pixel_row(row, back, goes_on), pixel_col(col, back, goes_on), shape)


@inlined
def steps_within(row, col, direction, shape):  # type: ignore[no-untyped-def]
    """Count steps from a corner until the pixel ahead on the right-hand side is of another tile."""
    if direction == 0:
        return shape[1] - col
    if direction == 1:
        return shape[0] - row
    return col if direction == 2 else row


@inlined
def follow_boundary(tile, written, row, col, direction):  # type: ignore[no-untyped-def]
    """Write the chain that begins with an edge; past the end of the output arrays, count only."""
    # In `tile`, `flat` is the image and `steps` holds the offset of one step in each direction. `ahead`
    # holds, for each direction, the offset from the pixel at the lower right of a corner to the pixel ahead
    # on the right-hand side; the pixel ahead on the left-hand side is that of the previous direction.
    flat, ahead, steps, labels, margin, top, left, width = tile
    seen, vertices, pinched, table, sizes = written
    shape = labels.shape
    place = (row + margin) * steps[1] + col + margin
    first, first_place = direction, place
    label = flat[place + ahead[direction]]
    chain, used = sizes[1], sizes[0]
    if chain < table.shape[0]:
        at_first = place + ahead[(direction + 3) & 3]
        node = flat[at_first] != flat[at_first - steps[direction]]
        table[chain, 0] = labels[pixel_row(row, direction, True), pixel_col(col, direction, True)]
        table[chain, 1] = used
        table[chain, 2] = -1 if node else direction
        table[chain, 4] = ((top + row) * (width + 1) + left + col) * 4 + direction
    sizes[1] += 1
    pinch = False
    while True:
        if used < vertices.shape[0]:
            vertices[used, 0] = top + row
            vertices[used, 1] = left + col
            pinched[used] = pinch
        used += 1
        if direction == 0:
            seen[row, col] = 1
        right = ahead[direction]
        left_hand = ahead[(direction + 3) & 3]
        step = steps[direction]
        run_limit = steps_within(row, col, direction, shape)
        beside = flat[place + left_hand]
        count = 0
        while True:
            place += step
            count += 1
            if flat[place + left_hand] != beside or flat[place + right] != label or count == run_limit:
                break
        same = flat[place + left_hand] == label
        row += count * step_row(direction)
        col += count * step_col(direction)
        before = direction
        pinch, exits = False, False
        if flat[place + right] != label:
            direction = (direction + 1) & 3
            pinch = same
        elif same:
            direction = (direction + 3) & 3
            exits = not lies_within(pixel_row(row, direction, True), pixel_col(col, direction, True), shape)
        else:
            exits = count == run_limit
        closed = place == first_place and direction == first
        if closed or exits:
            sizes[0] = used
            if chain < table.shape[0]:
                table[chain, 3] = before
                table[chain, 5] = ((top + row) * (width + 1) + left + col) * 4 + direction
                if closed:
                    table[chain, 4] = -1
                    table[chain, 5] = -1
                    if table[chain, 1] < vertices.shape[0]:
                        pinched[table[chain, 1]] = pinch
            return


def _trace(  # type: ignore[no-untyped-def]
    image, flat, ahead, steps, words, labels, margin, top, left, width, seen, vertices, pinched, table, sizes
):
    rows, cols = labels.shape
    stride = steps[1]
    tile = (flat, ahead, steps, labels, margin, top, left, width)
    written = (seen, vertices, pinched, table, sizes)
    # Open chains, whose previous edge belongs to another tile, begin on the tile's border.
    for r in range(rows + 1):
        for c in range(0, cols + 1, 1 if r == 0 or r == rows else cols):
            for direction in range(4):
                own_row = pixel_row(r, direction, True)
                own_col = pixel_col(c, direction, True)
                if lies_within(own_row, own_col, labels.shape) and begins_chain(
                    image, labels.shape, margin, r, c, direction
                ):
                    follow_boundary(tile, written, r, c, direction)
    # All other chains are closed, and have an upper edge that begins with a turn.
    for r in range(rows):
        c = 0
        while c < cols:
            if words.shape[0] > 0 and c % WORD == 0:
                word = (c + margin) // WORD
                if words[r + margin, word] == words[r + margin - 1, word]:
                    c += WORD
                    continue
            place = (r + margin) * stride + c + margin
            label = flat[place]
            edge = label != 0 and label != flat[place - stride] and not seen[r, c]
            if edge and (flat[place - 1] != label or flat[place - 1 - stride] == label):
                follow_boundary(tile, written, r, c, 0)
            c += 1


_trace_u1 = kernel(f"void(u1[:,::1], u1[::1], {_READ}, {_WRITTEN})")(_trace)
_trace_u4 = kernel(f"void(u4[:,::1], u4[::1], {_READ}, {_WRITTEN})")(_trace)


@kernel("i8(i4[:,::1], u1[::1], i8[:,::1], u1[::1], i4[:,::1], i8[::1])")
def _pack(vertices, pinched, table, steps, corners, counts):  # type: ignore[no-untyped-def]
    used = 0
    for chain in range(table.shape[0]):
        begin = table[chain, START]
        end = table[chain + 1, START] if chain + 1 < table.shape[0] else vertices.shape[0]
        table[chain, START] = used
        counts[chain] = end - begin
        corners[chain, 0] = vertices[begin, 0]
        corners[chain, 1] = vertices[begin, 1]
        steps[used] = pinched[begin] << 7
        used += 1
        for v in range(begin + 1, end):
            down = np.int64(vertices[v, 0]) - vertices[v - 1, 0]
            right = np.int64(vertices[v, 1]) - vertices[v - 1, 1]
            length = abs(down) + abs(right)
            direction = 0 if right > 0 else (1 if down > 0 else (2 if right < 0 else 3))
            steps[used] = (pinched[v] << 7) | (direction << 5) | (length if length < 32 else 0)
            used += 1
            if length >= 32:
                for k in range(4):
                    steps[used] = (length >> (8 * k)) & 255
                    used += 1
    return used


@kernel("void(u1[::1], i4[:,::1], i8[::1], i8[:,::1], i8[::1], i4[:,::1], u1[::1])")
def _unpack(steps, corners, counts, table, which, vertices, pinched):  # type: ignore[no-untyped-def]
    used = 0
    for chain in which:
        at = table[chain, START]
        row, col = np.int64(corners[chain, 0]), np.int64(corners[chain, 1])
        for k in range(counts[chain]):
            step = np.int64(steps[at])
            at += 1
            if k > 0:
                length = step & 31
                if length == 0:
                    for part in range(4):
                        length |= np.int64(steps[at]) << (8 * part)
                        at += 1
                direction = (step >> 5) & 3
                row += length * step_row(direction)
                col += length * step_col(direction)
            vertices[used, 0], vertices[used, 1] = row, col
            pinched[used] = step >> 7
            used += 1
