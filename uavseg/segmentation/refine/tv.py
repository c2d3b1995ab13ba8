"""Boundaries to the pixel: pixels that their block leaves open are decided by v without its noise.

Total variation takes the noise away, with weights that follow the noise around; see `variation`, `noise`.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.refine.noise import NOISE_SIDE, estimate_noise, grown
from uavseg.segmentation.refine.specks import drop_specks
from uavseg.segmentation.refine.total_variation import MAX_WEIGHT, threshold_tv

_WEIGHT_PER_NOISE = 0.34  # of a pair of neighbours, over the standard deviation of the noise


def refine_by_tv(
    inside: NDArray[np.uint8],
    unsettled: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    matching: NDArray[np.uint8],
    greys: tuple[int, int],
) -> NDArray[np.uint8]:
    """Decide the pixels of unsettled cells again, and of the cells around them, by v without its noise.

    Where all pixels of a cell and of those around it are on one side, they stay there. Then thin pieces and
    holes of fewer than `specks.SPECK` pixels change sides, where there is noise.

    Parameters
    ----------
    inside : (M, N) uint8 array
        1 where a pixel belongs to a region; it is refined in place. M and N are multiples of 16.
    unsettled : (M / 8, N / 8) uint8 array
        Not 0 where a cell's pixels are to be decided one by one.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    matching : (M, N) uint8 array
        1 where a valid pixel's own grey lies in the range.
    greys : (int, int)
        The range of grey.

    Returns
    -------
    inside : (M, N) uint8 array, the same array
    """
    active = grown((unsettled > 0).view(np.uint8))
    mixed = np.empty_like(active)
    _apply_own_values(matching, valid, active, np.empty((3, inside.shape[1]), np.uint8), inside, mixed)
    active &= grown(mixed)
    if active.any():
        weights = _weights(estimate_noise(grey, valid, active), active)
        threshold_tv(grey, valid, weights, greys, inside)
        drop_specks(inside, valid, (weights > 0).view(np.uint8))
    return inside


def _weights(noise: NDArray[np.float64], active: NDArray[np.uint8]) -> NDArray[np.int16]:
    """Of the pixels of each cell, in half grey; 0 in cells that are not active."""
    weights = np.minimum(np.rint(_WEIGHT_PER_NOISE / 2 * noise), MAX_WEIGHT).astype(np.int16)
    return weights.repeat(NOISE_SIDE // 8, axis=0).repeat(NOISE_SIDE // 8, axis=1) * active


@inlined
def add_row(matching, valid, chosen, inside, some, others):  # type: ignore[no-untyped-def]
    """Where chosen, decide pixels by their own v; and what there is of either side so far."""
    for c in range(np.uintp(chosen.shape[0])):
        inside[c] ^= (inside[c] ^ matching[c]) & chosen[c]
    for c in range(np.uintp(chosen.shape[0])):
        some[c] |= matching[c]
    for c in range(np.uintp(chosen.shape[0])):
        others[c] |= valid[c] ^ matching[c]  # what fits is valid


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _apply_own_values(matching, valid, active, lines, inside, mixed):  # type: ignore[no-untyped-def]
    """Decide the pixels of active cells by their own v, and tell which of them have pixels on both sides."""
    chosen, some, others = lines[0], lines[1], lines[2]
    for row in range(active.shape[0]):
        some[:] = 0
        others[:] = 0
        for cell in range(np.uintp(active.shape[1])):
            for c in range(np.uintp(8) * cell, np.uintp(8) * cell + np.uintp(8)):
                chosen[c] = active[row, cell]
        for r in range(8 * row, 8 * row + 8):
            add_row(matching[r], valid[r], chosen, inside[r], some, others)
        for cell in range(active.shape[1]):
            found = np.uint8(0)
            for c in range(8 * cell, 8 * cell + 8):
                found |= some[c] | (others[c] << np.uint8(1))
            mixed[row, cell] = np.uint8(found == 3) & active[row, cell]
