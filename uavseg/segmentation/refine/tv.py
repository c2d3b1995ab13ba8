"""Classification of the pixels around a bound of intensity by total-variation denoising.

The weights follow the local noise; see `total_variation`, `noise` and `specks`.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.refine.noise import NOISE_SIDE, estimate_noise
from uavseg.segmentation.refine.specks import drop_specks
from uavseg.segmentation.refine.total_variation import MAX_WEIGHT, classify_tv, threshold_tv
from uavseg.units import CELL, GREY_LEVELS

_WEIGHT_PER_NOISE = 0.34  # weight of a pair of neighbours / standard deviation of the noise


def refine_by_tv(
    inside: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    greys: tuple[int, int],
    separate: bool = True,
) -> NDArray[np.uint8]:
    """Classify the pixels around a bound of a range by denoised v.

    Cells with pixels on both sides and the cells around them are denoised; all other pixels are decided by
    their own value, as `inside` has them. Then, where there is noise, thin pieces and holes of fewer than
    `specks.MIN_PIECE` pixels change side.

    Parameters
    ----------
    inside : (M, N) uint8 array
        1 where a valid pixel's own grey lies in the range; refined in place. M and N are multiples of 16.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    greys : (int, int)
        The range of grey.
    separate : bool
        Whether a step between two separate groups of greys is structure, and not noise; see `noise`.

    Returns
    -------
    inside : (M, N) uint8 array, the same array
    """
    two_sided = np.empty((inside.shape[0] // CELL, inside.shape[1] // CELL), np.uint8)
    _two_sided_cells(inside, valid, np.empty((2, inside.shape[1]), np.uint8), two_sided)
    if two_sided.any():
        active = dilate(two_sided)
        bounds = [bound for bound in (greys[0], greys[1] + 1) if separate and 0 < bound < GREY_LEVELS]
        weights = _weights(estimate_noise(grey, valid, active, np.array(bounds, np.int64)), active)
        threshold_tv(grey, valid, weights, greys, inside)
        drop_specks(inside, valid, (weights > 0).view(np.uint8))
    return inside


def refine_kinds_by_tv(
    kinds: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    table: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """Classify the pixels around the bounds of several kinds by denoised v.

    Each pixel gets the kind of its denoised grey, so kinds share their borders. With one kind the result is
    that of `refine_by_tv`. A small thin piece gets the kind of most pixels around it.

    Parameters
    ----------
    kinds : (M, N) uint8 array
        The kind of each pixel's own grey, 0 where not valid; refined in place. M and N are multiples of 16.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    table : (65536,) uint8 array
        The kind of each grey, at most `MAX_REFINED`.

    Returns
    -------
    kinds : (M, N) uint8 array, the same array
    """
    two_sided = np.empty((kinds.shape[0] // CELL, kinds.shape[1] // CELL), np.uint8)
    _cells_of_two_kinds(kinds, valid, two_sided)
    if two_sided.any():
        active = dilate(two_sided)
        bounds = 1 + np.flatnonzero(table[1:] != table[:-1])
        weights = _weights(estimate_noise(grey, valid, active, bounds), active)
        classify_tv(grey, valid, weights, table, kinds)
        drop_specks(kinds, valid, (weights > 0).view(np.uint8))
    return kinds


def _weights(noise: NDArray[np.float64], active: NDArray[np.uint8]) -> NDArray[np.int16]:
    """Weights of the pixels of each cell, in units of half a grey; 0 in cells that are not active."""
    weights = np.minimum(np.rint(_WEIGHT_PER_NOISE / 2 * noise), MAX_WEIGHT).astype(np.int16)
    return weights.repeat(NOISE_SIDE // 8, axis=0).repeat(NOISE_SIDE // 8, axis=1) * active


@inlined
def add_row(inside, valid, any_in, any_out):  # type: ignore[no-untyped-def]
    """Accumulate which sides occur in each column."""
    for c in range(np.uintp(inside.shape[0])):
        any_in[c] |= inside[c]
    for c in range(np.uintp(inside.shape[0])):
        any_out[c] |= valid[c] ^ inside[c]  # a pixel inside is valid


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _two_sided_cells(inside, valid, lines, two_sided):  # type: ignore[no-untyped-def]
    any_in, any_out = lines[0], lines[1]
    for row in range(two_sided.shape[0]):
        any_in[:] = 0
        any_out[:] = 0
        for r in range(8 * row, 8 * row + 8):
            add_row(inside[r], valid[r], any_in, any_out)
        for cell in range(two_sided.shape[1]):
            found = np.uint8(0)
            for c in range(8 * cell, 8 * cell + 8):
                found |= any_in[c] | (any_out[c] << np.uint8(1))
            two_sided[row, cell] = np.uint8(found == 3)


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _cells_of_two_kinds(kinds, valid, two_sided):  # type: ignore[no-untyped-def]
    for row in range(two_sided.shape[0]):
        for cell in range(np.uintp(two_sided.shape[1])):
            minimum = np.uint8(255)
            maximum = np.uint8(0)
            for r in range(8 * row, 8 * row + 8):
                for c in range(np.uintp(8) * cell, np.uintp(8) * cell + np.uintp(8)):
                    if valid[r, c]:
                        minimum = min(minimum, kinds[r, c])
                        maximum = max(maximum, kinds[r, c])
            two_sided[row, cell] = np.uint8(minimum < maximum)
