"""Boundary refinement by total-variation denoising of the pixels of mixed cells.

The weights follow the local noise; see `total_variation`, `noise` and `specks`.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.dilation import dilate
from uavseg.segmentation.refine.noise import NOISE_SIDE, estimate_noise
from uavseg.segmentation.refine.total_variation import MAX_WEIGHT, threshold_tv

_WEIGHT_PER_NOISE = 0.34  # weight of a pair of neighbours / standard deviation of the noise


def refine_by_tv(
    inside: NDArray[np.uint8],
    mixed: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    in_range: NDArray[np.uint8],
    greys: tuple[int, int],
) -> NDArray[np.uint8]:
    """Classify the pixels of mixed cells and their neighbours by denoised v.

    The pixels of a cell stay on their side where they and all pixels of the cells around are on one side.
    Then, where there is noise, thin pieces and holes of fewer than `specks.MIN_PIECE` pixels change side.

    Parameters
    ----------
    inside : (M, N) uint8 array
        1 where a pixel belongs to a region; refined in place. M and N are multiples of 16.
    mixed : (M / 8, N / 8) uint8 array
        Not 0 where the pixels of a cell are classified one by one, from `mixed_cells`.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    in_range : (M, N) uint8 array
        1 where a valid pixel's own grey lies in the range.
    greys : (int, int)
        The range of grey.

    Returns
    -------
    inside : (M, N) uint8 array, the same array
    """
    active = dilate((mixed > 0).view(np.uint8))
    two_sided = np.empty_like(active)
    _apply_own_values(in_range, valid, active, np.empty((3, inside.shape[1]), np.uint8), inside, two_sided)
    active &= dilate(two_sided)
    if active.any():
        weights = _weights(estimate_noise(grey, valid, active), active)
        threshold_tv(grey, valid, weights, greys, inside)
        drop_specks(inside, valid, (weights > 0).view(np.uint8))
    return inside


def _weights(noise: NDArray[np.float64], active: NDArray[np.uint8]) -> NDArray[np.int16]:
    """Weights of the pixels of each cell, in units of half a grey; 0 in cells that are not active."""
    weights = np.minimum(np.rint(_WEIGHT_PER_NOISE / 2 * noise), MAX_WEIGHT).astype(np.int16)
    return weights.repeat(NOISE_SIDE // 8, axis=0).repeat(NOISE_SIDE // 8, axis=1) * active


@inlined
def add_row(in_range, valid, chosen, inside, any_in, any_out):  # type: ignore[no-untyped-def]
    """Where chosen, classify pixels by their own v; accumulate which sides occur in each column."""
    for c in range(np.uintp(chosen.shape[0])):
        inside[c] ^= (inside[c] ^ in_range[c]) & chosen[c]
    for c in range(np.uintp(chosen.shape[0])):
        any_in[c] |= in_range[c]
    for c in range(np.uintp(chosen.shape[0])):
        any_out[c] |= valid[c] ^ in_range[c]  # a pixel in range is valid


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _apply_own_values(in_range, valid, active, lines, inside, two_sided):  # type: ignore[no-untyped-def]
    # Classify the pixels of active cells by their own v, and find the cells with pixels on both sides.
    chosen, any_in, any_out = lines[0], lines[1], lines[2]
    for row in range(active.shape[0]):
        any_in[:] = 0
        any_out[:] = 0
        for cell in range(np.uintp(active.shape[1])):
            for c in range(np.uintp(8) * cell, np.uintp(8) * cell + np.uintp(8)):
                chosen[c] = active[row, cell]
        for r in range(8 * row, 8 * row + 8):
            add_row(in_range[r], valid[r], chosen, inside[r], any_in, any_out)
        for cell in range(active.shape[1]):
            found = np.uint8(0)
            for c in range(8 * cell, 8 * cell + 8):
                found |= any_in[c] | (any_out[c] << np.uint8(1))
            two_sided[row, cell] = np.uint8(found == 3) & active[row, cell]


MIN_PIECE = 12  # pixels: smaller thin pieces and thin holes are removed
_NO_DATA = np.uint8(2)  # not valid, or outside the image


def drop_specks(inside: NDArray[np.uint8], valid: NDArray[np.uint8], active: NDArray[np.uint8]) -> None:
    """Flip the components of fewer than 12 pixels that touch the other side, all at once.

    Components inside are 4-connected, as regions are; those outside are 8-connected, as holes are. A square
    of 3 x 3 pixels of one side is kept.

    Parameters
    ----------
    inside : (M, N) uint8 array
        Changed in place.
    valid : (M, N) uint8 array
    active : (M / 8, N / 8) uint8 array
        Not 0 for cells whose pixels may change.
    """
    sides = np.empty((inside.shape[0] + 2, inside.shape[1] + 2), np.uint8)
    _pad_sides(inside, valid, sides)
    lines = np.ones((8, sides.shape[1]), np.uint8)
    stack, seen = np.empty((MIN_PIECE, 2), np.int64), np.empty(2 * MIN_PIECE + 1, np.uint32)
    _drop_specks(sides, active, lines, stack, seen, inside)


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _pad_sides(inside, valid, sides):  # type: ignore[no-untyped-def]
    sides[0] = _NO_DATA
    sides[-1] = _NO_DATA
    for r in range(inside.shape[0]):
        sides[r + 1, 0] = _NO_DATA
        sides[r + 1, -1] = _NO_DATA
        for c in range(np.uintp(inside.shape[1])):
            sides[r + 1, c + np.uintp(1)] = inside[r, c] if valid[r, c] else _NO_DATA


@inlined
def changes_across(line, result):  # type: ignore[no-untyped-def]
    """Not 0 where a pixel has no data or differs from its left or right neighbour."""
    for c in range(np.uintp(result.shape[0] - 2)):
        here = line[c + np.uintp(1)]
        result[c + np.uintp(1)] = (line[c] ^ here) | (here ^ line[c + np.uintp(2)]) | (here & _NO_DATA)


@inlined
def changes_around(above, line, below, across_above, across, across_below, result):  # type: ignore[no-untyped-def]
    """1 where the 3 x 3 pixels around a pixel are not all on one side."""
    for c in range(np.uintp(1), np.uintp(result.shape[0] - 1)):
        result[c] = across_above[c] | across[c] | across_below[c]
    for c in range(np.uintp(1), np.uintp(result.shape[0] - 1)):
        result[c] = np.uint8((result[c] | (above[c] ^ line[c]) | (line[c] ^ below[c])) != 0)


@inlined
def mark_thin(above, line, below, narrow, result):  # type: ignore[no-untyped-def]
    """1 where a pixel belongs to no 3 x 3 square of one side (its piece is thin here)."""
    for c in range(np.uintp(narrow.shape[0])):
        narrow[c] = above[c] & line[c] & below[c]
    for c in range(np.uintp(narrow.shape[0] - 2)):
        result[c + np.uintp(1)] = narrow[c] & narrow[c + np.uintp(1)] & narrow[c + np.uintp(2)]


@inlined
def is_speck(sides, r, c, stack, seen):  # type: ignore[no-untyped-def]
    """Whether a pixel's component is smaller than MIN_PIECE and touches the other side (flood fill)."""
    one = np.uint32(1)
    own = sides[r, c]
    seen[:] = 0
    seen[MIN_PIECE] = one << np.uint32(MIN_PIECE)  # a bit for each visited pixel
    stack[0, 0] = r
    stack[0, 1] = c
    count = 1
    touches = False
    k = 0
    while k < count:
        row = stack[k, 0]
        col = stack[k, 1]
        for y in range(row - 1, row + 2):
            for x in range(col - 1, col + 2):
                bit = one << np.uint32(x - c + MIN_PIECE)
                if sides[y, x] != own:
                    touches |= sides[y, x] != _NO_DATA
                elif (own == 0 or y == row or x == col) and not seen[y - r + MIN_PIECE] & bit:
                    if count == MIN_PIECE - 1:
                        return False
                    seen[y - r + MIN_PIECE] |= bit
                    stack[count, 0] = y
                    stack[count, 1] = x
                    count += 1
        k += 1
    return touches


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], i8[:,::1], u4[::1], u1[:,::1])")
def _drop_specks(sides, active, lines, stack, seen, inside):  # type: ignore[no-untyped-def]
    # `sides` has a border of no data. Three rolling lines behind each other: across, around, thin.
    rows = inside.shape[0]
    across, around, narrow, result = lines[:3], lines[3:6], lines[6], lines[7]
    for step in range(rows + 4):
        if step < rows + 2:
            changes_across(sides[step], across[step % 3])
        row = step - 1
        if row > rows:
            around[row % 3] = 1
        elif row > 0:
            changes_around(
                sides[row - 1],
                sides[row],
                sides[row + 1],
                across[(row - 1) % 3],
                across[row % 3],
                across[(row + 1) % 3],
                around[row % 3],
            )
        row = step - 2
        if row < 1 or row > rows:
            continue
        mark_thin(around[(row - 1) % 3], around[row % 3], around[(row + 1) % 3], narrow, result)
        for cell in range(active.shape[1]):
            if active[(row - 1) // 8, cell]:
                for c in range(8 * cell + 1, 8 * cell + 9):
                    if result[c] and sides[row, c] != _NO_DATA and is_speck(sides, row, c, stack, seen):
                        inside[row - 1, c - 1] = np.uint8(1) - inside[row - 1, c - 1]
