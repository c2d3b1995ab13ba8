"""The block map: what every later question is answered from.

For each cell of 8 x 8 pixels the sum of its valid grey and their number, for each block of 64, 32 and 16 the
ratio R of its texture. None of it depends on a threshold or a range, so leaves for any of them follow from
here.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.division import RATIOS
from uavseg.units import CELLS

_STRIP = 64  # rows of blocks looked at together


@dataclass(frozen=True, slots=True)
class BlockMap:
    """Sums, counts and ratios over a grid of B x C blocks of 64 x 64 pixels.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image in pixels; the blocks go past its right and bottom edge.
    sums : (8 B, 8 C) uint32 array
        Sum of the grey of the valid pixels of each cell.
    counts : (8 B, 8 C) uint8 array
        Number of valid pixels of each cell, 0 to 64.
    ratios : (B, C, 21) float64 array
        R of each block, as `division.block_ratios` orders them.
    """

    shape: tuple[int, int]
    sums: NDArray[np.uint32]
    counts: NDArray[np.uint8]
    ratios: NDArray[np.float64]

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> "BlockMap":
        """A block map of an image without valid pixels."""
        rows, cols = (-(-length // (8 * CELLS)) for length in shape)
        cells = (rows * CELLS, cols * CELLS)
        return cls(
            shape, np.zeros(cells, np.uint32), np.zeros(cells, np.uint8), np.zeros((rows, cols, RATIOS))
        )

    @property
    def blocks(self) -> tuple[int, int]:
        """Rows and columns of blocks."""
        return self.ratios.shape[0], self.ratios.shape[1]


def leaves(
    blocks: BlockMap, threshold: float, intensity_step: float, rows: slice = slice(None)
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """The leaf that each cell belongs to: its side, and the mean of its valid pixels.

    Parameters
    ----------
    blocks : BlockMap
    threshold : float
        X: a block is divided where R > X.
    intensity_step : float
        Tau: a block is also divided where the means of its children differ by more; infinite for none.
    rows : slice
        Rows of blocks to look at, so that a large map can be taken in strips.

    Returns
    -------
    side : (8 b, 8 C) uint8 array
        64, 32, 16 or 8 pixels.
    mean : (8 b, 8 C) float64 array
        Mean v of the leaf, -1 where it has no valid pixel.
    """
    ratios = blocks.ratios[rows]
    cells = slice(*(index * CELLS for index in rows.indices(blocks.blocks[0])[:2]))
    side = np.empty((ratios.shape[0] * CELLS, ratios.shape[1] * CELLS), np.uint8)
    mean = np.empty(side.shape)
    _leaves(blocks.sums[cells], blocks.counts[cells], ratios, threshold, intensity_step, side, mean)
    return side, mean


def strips_of_means(
    blocks: BlockMap, threshold: float, intensity_step: float
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """The means of `leaves`, some rows of a large map at a time: rows of cells, and what those hold."""
    for top in range(0, blocks.blocks[0], _STRIP):
        _, mean = leaves(blocks, threshold, intensity_step, slice(top, top + _STRIP))
        yield slice(CELLS * top, CELLS * top + len(mean)), mean


def cell_sums(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], margin: int = 0
) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
    """Sum and number of the valid pixels of each cell of 8 x 8.

    Parameters
    ----------
    grey : (M, N) uint16 array
        0 where a pixel is not valid; M and N less the margins are multiples of 8.
    valid : (M, N) uint8 array
    margin : int
        Pixels on every side that belong to no cell.

    Returns
    -------
    sums : (m, n) uint32 array
    counts : (m, n) uint8 array
    """
    cells = ((grey.shape[0] - 2 * margin) // 8, (grey.shape[1] - 2 * margin) // 8)
    sums = np.zeros(cells, np.uint32)
    counts = np.zeros(cells, np.uint8)
    _cell_sums(grey, valid, margin, sums, counts)
    return sums, counts


@kernel("void(u2[:,::1], u1[:,::1], i8, u4[:,::1], u1[:,::1])")
def _cell_sums(grey, valid, margin, sums, counts):  # type: ignore[no-untyped-def]
    for row in range(sums.shape[0]):
        for r in range(margin + 8 * row, margin + 8 * row + 8):
            for col in range(sums.shape[1]):
                total = np.uint32(0)
                number = np.uint8(0)
                for c in range(margin + 8 * col, margin + 8 * col + 8):
                    total += np.uint32(grey[r, c])
                    number += valid[r, c]
                sums[row, col] += total
                counts[row, col] += number


@inlined
def mean_of(sums, counts, row, col, many):  # type: ignore[no-untyped-def]
    """Mean v over many x many cells; -1 where no pixel is valid."""
    total = np.int64(0)
    number = np.int64(0)
    for r in range(row, row + many):
        for c in range(col, col + many):
            total += np.int64(sums[r, c])
            number += np.int64(counts[r, c])
    if number == 0:
        return -1.0
    return total / (65535.0 * number)


@inlined
def spread_of_children(sums, counts, row, col, many):  # type: ignore[no-untyped-def]
    """How far the means of the four children of many x many cells lie apart; 0 with fewer than two."""
    low = 2.0
    high = -1.0
    half = many // 2
    for child in range(4):
        mean = mean_of(sums, counts, row + child // 2 * half, col + child % 2 * half, half)
        if mean >= 0.0:
            low = min(low, mean)
            high = max(high, mean)
    return max(high - low, 0.0)


@inlined
def mark(side, mean, row, col, many, value):  # type: ignore[no-untyped-def]
    """Write a leaf into its cells."""
    for r in range(row, row + many):
        for c in range(col, col + many):
            side[r, c] = 8 * many
            mean[r, c] = value


@inlined
def leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean):  # type: ignore[no-untyped-def]
    """Write the leaves of one block of 64 into its cells."""
    r64 = 8 * row
    c64 = 8 * col
    if not (ratios[row, col, 0] > threshold or spread_of_children(sums, counts, r64, c64, 8) > step):
        mark(side, mean, r64, c64, 8, mean_of(sums, counts, r64, c64, 8))
        return
    for half in range(4):
        r32 = r64 + half // 2 * 4
        c32 = c64 + half % 2 * 4
        texture = ratios[row, col, 1 + half]
        if not (texture > threshold or spread_of_children(sums, counts, r32, c32, 4) > step):
            mark(side, mean, r32, c32, 4, mean_of(sums, counts, r32, c32, 4))
            continue
        for quarter in range(4):
            r16 = r32 + quarter // 2 * 2
            c16 = c32 + quarter % 2 * 2
            texture = ratios[row, col, 5 + (r16 - r64) // 2 * 4 + (c16 - c64) // 2]
            if not (texture > threshold or spread_of_children(sums, counts, r16, c16, 2) > step):
                mark(side, mean, r16, c16, 2, mean_of(sums, counts, r16, c16, 2))
                continue
            for cell in range(4):
                r8 = r16 + cell // 2
                c8 = c16 + cell % 2
                mark(side, mean, r8, c8, 1, mean_of(sums, counts, r8, c8, 1))


@kernel("void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, u1[:,::1], f8[:,::1])")
def _leaves(sums, counts, ratios, threshold, step, side, mean):  # type: ignore[no-untyped-def]
    for row in range(ratios.shape[0]):
        for col in range(ratios.shape[1]):
            leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)


def undecided(
    sums: NDArray[np.uint32], counts: NDArray[np.uint8], edges: Sequence[float], intensity_step: float
) -> NDArray[np.uint32]:
    """Which R must be known before it is known in which of some intervals the mean of every leaf lies.

    Where the means of all cells of a block lie in one interval, so does the mean of any leaf made of them,
    and how the block is divided changes nothing. Nor does R where intensity divides anyway.

    Parameters
    ----------
    sums, counts : (8 B, 8 C) arrays
        Of the cells, as in `BlockMap`.
    edges : sequence of float
        Between the intervals, increasing; a mean on an edge lies in the interval below it.
    intensity_step : float
        Tau; infinite for none.

    Returns
    -------
    undecided : (B, C) uint32 array
        Bit k is set where ratio k of a block must be known, unless a larger block around it stays whole.
    """
    found = np.zeros((sums.shape[0] // CELLS, sums.shape[1] // CELLS), np.uint32)
    _undecided(sums, counts, np.array(edges, np.float64), intensity_step, found)
    return found


@inlined
def is_mixed(sums, counts, row, col, many, edges):  # type: ignore[no-untyped-def]
    """Whether the means of the cells lie in more than one interval: an edge lies between them."""
    low = 2.0
    high = -1.0
    for r in range(row, row + many):
        for c in range(col, col + many):
            mean = mean_of(sums, counts, r, c, 1)
            if mean >= 0.0:
                low = min(low, mean)
                high = max(high, mean)
    first = 0  # the first edge that is not below the lowest mean
    end = edges.shape[0]
    while first < end:
        middle = (first + end) // 2
        if edges[middle] < low:
            first = middle + 1
        else:
            end = middle
    return first < edges.shape[0] and edges[first] < high


@inlined
def undecided_in_block(sums, counts, row, col, edges, step):  # type: ignore[no-untyped-def]
    """The bits of `undecided` of one block of 64."""
    bits = np.uint32(0)
    place = 0  # of a block's ratio: side 64, then four of 32, then sixteen of 16
    many = 8
    while many >= 2:
        mixed = 0
        for r in range(8 * row, 8 * row + 8, many):
            for c in range(8 * col, 8 * col + 8, many):
                if is_mixed(sums, counts, r, c, many, edges):
                    mixed += 1
                    if spread_of_children(sums, counts, r, c, many) <= step:
                        bits |= np.uint32(1) << np.uint32(place)
                place += 1
        if mixed == 0:
            break
        many //= 2
    return bits


@kernel("void(u4[:,::1], u1[:,::1], f8[::1], f8, u4[:,::1])")
def _undecided(sums, counts, edges, step, found):  # type: ignore[no-untyped-def]
    for row in range(found.shape[0]):
        for col in range(found.shape[1]):
            found[row, col] = undecided_in_block(sums, counts, row, col, edges, step)
