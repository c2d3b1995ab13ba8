"""Boundary refinement by total-variation denoising of the pixels of mixed cells.

The weights follow the local noise; see `total_variation`, `noise` and `specks`.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.dilation import dilate
from uavseg.segmentation.refine.noise import NOISE_SIDE, estimate_noise
from uavseg.segmentation.refine.specks import drop_specks
from uavseg.segmentation.refine.total_variation import MAX_WEIGHT, classify_tv, threshold_tv

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


def refine_kinds_by_tv(
    kinds: NDArray[np.uint8],
    mixed: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    table: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """Classify the pixels of mixed cells and their neighbours among several kinds by denoised v.

    Each pixel gets the kind of its denoised grey, so kinds share their borders. With one kind the result is
    that of `refine_by_tv`. A small thin piece gets the kind of most pixels around it.

    Parameters
    ----------
    kinds : (M, N) uint8 array
        The kind of each pixel's leaf, 0 for nothing; refined in place. M and N are multiples of 16.
    mixed : (M / 8, N / 8) uint8 array
        Not 0 where the pixels of a cell are classified one by one, from `mixed_cells_of_kinds`.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    table : (65536,) uint8 array
        The kind of each grey, at most `MAX_KINDS`.

    Returns
    -------
    kinds : (M, N) uint8 array, the same array
    """
    active = dilate((mixed > 0).view(np.uint8))
    two_sided = np.empty_like(active)
    _apply_own_kinds(grey, table, valid, active, kinds, two_sided)
    active &= dilate(two_sided)
    if active.any():
        weights = _weights(estimate_noise(grey, valid, active), active)
        classify_tv(grey, valid, weights, table, kinds)
        drop_specks(kinds, valid, (weights > 0).view(np.uint8))
    return kinds


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


@kernel("void(u2[:,::1], u1[::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _apply_own_kinds(grey, table, valid, active, kinds, two_sided):  # type: ignore[no-untyped-def]
    # As _apply_own_values, with the kind of each grey in place of a range.
    for row in range(active.shape[0]):
        for cell in range(np.uintp(active.shape[1])):
            two_sided[row, cell] = 0
            if not active[row, cell]:
                continue
            minimum = np.uint8(255)
            maximum = np.uint8(0)
            for r in range(8 * row, 8 * row + 8):
                for c in range(np.uintp(8) * cell, np.uintp(8) * cell + np.uintp(8)):
                    own = table[grey[r, c]]
                    kinds[r, c] = own * valid[r, c]
                    if valid[r, c]:
                        minimum = min(minimum, own)
                        maximum = max(maximum, own)
            two_sided[row, cell] = np.uint8(minimum < maximum)
