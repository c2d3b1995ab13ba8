"""Reference implementation of refinement by total variation: slow, on whole planes, from its description.

Masks have one element per pixel; cells have one per 8 x 8 pixels.
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
SWEEPS, WEIGHT_PER_NOISE, MAX_WEIGHT, MIN_PIECE = 5, 0.34, 16000, 12


def refine(cells: Image, valid: Image, grey: Grey, lo: float, hi: float) -> Image:
    """Pixels in [lo, hi]; `cells`, of whole blocks of 64, are 1 where the leaf of a cell is in range."""
    shape = grey.shape
    pads = [(0, 8 * n - length) for n, length in zip(cells.shape, shape, strict=True)]
    valid, grey = np.pad(valid, pads), np.pad(grey, pads)
    inside = per_pixel(cells) & valid
    found = denoise(inside, mixed_cells(cells, valid, grey, lo, hi), valid, grey, lo, hi)
    return found[: shape[0], : shape[1]]


def mixed_cells(cells: Image, valid: Image, grey: Grey, lo: float, hi: float) -> Image:
    """Cells whose nine means, extended on both sides by twice their range, contain a bound, or that are on
    another side than their leaf or a neighbour.
    """
    counts = per_square(valid.astype(np.int64), 8)
    means = per_square(grey.astype(np.int64) * valid, 8) / (65535.0 * np.maximum(counts, 1))
    minimum = ndimage.minimum_filter(np.where(counts > 0, means, np.inf), 3, mode="constant", cval=np.inf)
    maximum = ndimage.maximum_filter(np.where(counts > 0, means, -np.inf), 3, mode="constant", cval=-np.inf)
    outside = ndimage.maximum_filter((cells == 0) & (counts > 0), 3, mode="constant")
    within = ndimage.maximum_filter((cells == 1) & (counts > 0), 3, mode="constant")
    found = (((lo <= means) & (means <= hi)) != (cells > 0)) | (outside & within)
    with np.errstate(invalid="ignore"):
        for end in (lo, hi):
            if 0 < end < 1:
                found |= (minimum - 2 * (maximum - minimum) <= end) & (
                    end <= maximum + 2 * (maximum - minimum)
                )
    return (found & (counts > 0)).astype(np.uint8)


def denoise(inside: Image, mixed: Image, valid: Image, grey: Grey, lo: float, hi: float) -> Image:
    """Reclassify the pixels of mixed cells and their neighbours, where both sides are near."""
    near = ndimage.maximum_filter(mixed, 3, mode="constant")
    in_range = ((lo <= grey / 65535) & (grey / 65535 <= hi)).astype(np.uint8) & valid
    mask = np.where(per_pixel(near), in_range, inside)
    two_sided = per_square(in_range, 8) * per_square(valid & (1 - in_range), 8) * near > 0
    weights = weights_of(near & ndimage.maximum_filter(two_sided, 3, mode="constant"), valid, grey)
    u, _ = minimise_tv(grey, weights)
    v = np.arange(65536) / 65535
    greys = np.flatnonzero((lo <= v) & (v <= hi))  # in the range
    within = (greys[0] <= 2 * u) & (2 * u <= greys[-1])
    mask = np.where(u != grey // 2, within, mask).astype(np.uint8) & valid
    noisy = per_pixel(per_square(weights, 8) > 0)
    return np.where(noisy & specks(mask, valid), 1 - mask, mask).astype(np.uint8)


def weights_of(active: Image, valid: Image, grey: Grey) -> Ints:
    """0.34 times the larger noise of pixels and of means of 4 x 4, median of 3 x 3 squares, in half grey."""
    fours = per_square(grey.astype(np.int64), 4)
    whole = (per_square(valid.astype(np.int64), 4) == 16).astype(np.uint8)
    noise = noise_of(16, [2, 6, 10, 14], valid, grey.astype(np.int64))
    noise = np.fmax(noise, 4 * noise_of(4, [1, 2], whole, (fours + 8) // 16))
    padded = np.pad(noise, 1, constant_values=np.nan)
    around = np.sort(sliding_window_view(padded, (3, 3)).reshape(*noise.shape, 9), axis=-1)
    known = np.isfinite(around).sum(axis=-1)  # NaN come last
    median = np.take_along_axis(around, np.minimum(known // 2, 8)[..., None], axis=-1)[..., 0]
    noise = np.where(known > 0, median, 0.0) * (math.sqrt(math.pi / 2) / 6)
    weights = np.minimum(np.rint(WEIGHT_PER_NOISE / 2 * noise), MAX_WEIGHT).astype(np.int64)
    return per_pixel(weights.repeat(2, 0).repeat(2, 1) * active) * valid


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
            bounded = np.clip(flows[k] + (u[b] - u[a]) // 2, -limit, limit)
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
        groups.append(((upper, slice(0, cols - 1)), (lower, slice(1, cols)), 45))
        groups.append(((upper, slice(1, cols)), (lower, slice(0, cols - 1)), 45))
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
