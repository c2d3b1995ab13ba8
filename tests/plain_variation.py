"""Reference implementation of refinement by total variation: slow, on whole planes, from its description.

Masks have one element per pixel.
"""

import math
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import ndimage

Image = NDArray[np.uint8]
Grey = NDArray[np.uint16]
Ints = NDArray[np.int64]
SQUARE = np.ones((3, 3), bool)
SWEEPS, WEIGHT_PER_NOISE, MAX_WEIGHT, MIN_PIECE, SEPARATION = 5, 0.34, 16000, 12, 4.0


def refine(valid: Image, grey: Grey, lo: float, hi: float) -> Image:
    """Pixels in [lo, hi] by denoised grey; the image may have any shape."""
    shape = grey.shape
    pads = [(0, -length % 16) for length in shape]
    return denoise(np.pad(valid, pads), np.pad(grey, pads), lo, hi)[: shape[0], : shape[1]]


def denoise(valid: Image, grey: Grey, lo: float, hi: float) -> Image:
    """Reclassify the pixels of cells with both sides, and of their neighbours."""
    v = np.arange(65536) / 65535
    greys = np.flatnonzero((lo <= v) & (v <= hi))  # in the range
    mask = ((greys[0] <= grey) & (grey <= greys[-1])).astype(np.uint8) & valid
    two_sided = (per_square(mask, 8) * per_square(valid & (1 - mask), 8) > 0).astype(np.uint8)
    near = ndimage.maximum_filter(two_sided, 3, mode="constant")
    weights = weights_of(near, valid, grey, [int(greys[0]), int(greys[-1]) + 1])
    u, _ = minimise_tv(grey, weights)
    within = (greys[0] <= 2 * u) & (2 * u <= greys[-1])
    mask = np.where(u != grey // 2, within, mask).astype(np.uint8) & valid
    noisy = per_pixel(per_square(weights, 8) > 0)
    return np.where(noisy & specks(mask, valid), 1 - mask, mask).astype(np.uint8)


def weights_of(active: Image, valid: Image, grey: Grey, bounds: list[int]) -> Ints:
    """0.34 times the larger noise of pixels and of means of 4 x 4, median of 3 x 3 squares, in half grey."""
    level = without_steps(valid, grey.astype(np.int64), bounds)
    fours = per_square(level, 4)
    whole = (per_square(valid.astype(np.int64), 4) == 16).astype(np.uint8)
    noise = noise_of(16, [2, 6, 9, 13], valid, level)
    noise = np.fmax(noise, 4 * noise_of(4, [1, 2], whole, (fours + 8) // 16))
    padded = np.pad(noise, 1, constant_values=np.nan)
    around = np.sort(sliding_window_view(padded, (3, 3)).reshape(*noise.shape, 9), axis=-1)
    known = np.isfinite(around).sum(axis=-1)  # NaN come last
    median = np.take_along_axis(around, np.minimum(known // 2, 8)[..., None], axis=-1)[..., 0]
    noise = np.where(known > 0, median, 0.0) * (math.sqrt(math.pi / 2) / 6)
    weights = np.minimum(np.rint(WEIGHT_PER_NOISE / 2 * noise), MAX_WEIGHT).astype(np.int64)
    return per_pixel(weights.repeat(2, 0).repeat(2, 1) * active) * valid


def without_steps(valid: Image, grey: Ints, bounds: list[int]) -> Ints:
    """Grey without the step between two groups, where a bound parts a square of 16 into separate ones.

    Groups are separate where their means differ by more than 4 standard deviations within them; the bound
    with the most such deviations counts.
    """
    level = grey.copy()
    for row in range(0, grey.shape[0], 16):
        for col in range(0, grey.shape[1], 16):
            square = np.s_[row : row + 16, col : col + 16]
            known = grey[square][valid[square] > 0]
            most, shift, least = SEPARATION**2, 0, 0
            for bound in bounds:
                below, above = known[known < bound], known[known >= bound]
                if len(below) == 0 or len(above) == 0:
                    continue
                sums = int(below.sum()), int(above.sum())
                gap = sums[1] / len(above) - sums[0] / len(below)
                spread = float((known**2).sum()) - sums[0] ** 2 / len(below) - sums[1] ** 2 / len(above)
                if gap * gap > most * max(spread / len(known), 0.0):
                    most = gap * gap / max(spread / len(known), 1e-9)
                    shift, least = int(gap + 0.5), bound
            level[square] -= shift * (grey[square] >= least)
    return level


def noise_of(side: int, rows: list[int], valid: Image, grey: Ints) -> NDArray[np.float64]:
    """Mean |response| to Immerkaer's operator in each square, from responses within the square."""
    operator = np.outer([1, -2, 1], [1, -2, 1])
    response = np.abs(ndimage.convolve(grey, operator, mode="constant"))
    whole = ndimage.minimum_filter(valid, 3, mode="constant").astype(np.int64)
    whole[~np.isin(np.arange(len(whole)) % side, rows)] = 0
    whole[:, np.isin(np.arange(whole.shape[1]) % side, [0, side - 1])] = 0
    with np.errstate(invalid="ignore"):
        return np.asarray(per_square(response * whole, side) / per_square(whole, side))


def minimise_tv(grey: Grey, weights: Ints, sweeps: int = SWEEPS) -> tuple[Ints, list[Ints]]:
    """u in units of half a grey, and the flows between the pixels of each pair."""
    u = grey.astype(np.int64) // 2
    groups = pairs(u.shape)
    flows = [np.zeros_like(u[a]) for a, _, _ in groups]
    for _ in range(sweeps):
        for k, (a, b, share) in enumerate(groups):
            limit = np.minimum(weights[a], weights[b]) * share // 64
            half = np.trunc((u[b] - u[a]) / 2).astype(np.int64)
            bounded = np.clip(flows[k] + half, -limit, limit)
            change, flows[k] = bounded - flows[k], bounded
            u[a] += change
            u[b] -= change
    return u, flows


def pairs(shape: tuple[int, ...]) -> list[tuple[Any, Any, int]]:
    """Ends of all pairs of neighbours and the factor of their weight in 64ths, in order of relaxation."""
    rows, cols = shape
    groups = [(np.s_[:, k : cols - 1 : 2], np.s_[:, k + 1 :: 2], 64) for k in (0, 1)]
    for k in (0, 1):
        upper, lower = slice(k, rows - 1, 2), slice(k + 1, rows, 2)
        groups.append(((upper, slice(None)), (lower, slice(None)), 64))
        for first in (0, 1):  # both diagonals of a square of 2 x 2 pixels share no pixel
            left, right = slice(first, cols - 1, 2), slice(first + 1, cols, 2)
            groups.append(((upper, left), (lower, right), 45))
            groups.append(((upper, right), (lower, left), 45))
    return groups


def specks(mask: Image, valid: Image) -> NDArray[np.bool_]:
    """Components of fewer than 12 pixels that touch the other side, 4-connected inside and 8-connected
    outside, without their squares of 3 x 3 pixels.
    """
    found = np.zeros(mask.shape, bool)
    for side, joins in ((1, None), (0, SQUARE)):
        pieces, _ = ndimage.label((mask == side) & (valid > 0), joins)
        others = (mask != side) & (valid > 0)
        sizes = np.bincount(pieces.reshape(-1))
        beside = np.unique(pieces[ndimage.binary_dilation(others, SQUARE)])
        small = np.zeros(len(sizes), bool)
        small[beside] = sizes[beside] < MIN_PIECE
        small[0] = False
        found |= small[pieces] & ~ndimage.binary_opening(pieces > 0, SQUARE)
    return found


def per_pixel(cells: NDArray[Any]) -> NDArray[Any]:
    """The value of the cell of each pixel."""
    return cells.repeat(8, 0).repeat(8, 1)


def per_square(values: NDArray[Any], side: int) -> NDArray[Any]:
    """Sums over squares."""
    return np.asarray(values.reshape(len(values) // side, side, -1, side).sum(axis=(1, 3), dtype=np.int64))
