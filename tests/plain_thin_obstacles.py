"""Recovery of thin obstacles, slow and plain: whole arrays, scipy's labels, the documented formulas."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, stats

FREE, UNKNOWN, OCCUPIED = 1, 2, 3
ALPHA = 0.05
EIGHT = np.ones((3, 3))


def restored(
    states: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    valid: NDArray[np.bool_],
    limits: Any = (0.498, 0.502),
) -> NDArray[np.uint8]:
    """States with their thin obstacles occupied."""
    found = states.copy()
    candidate, chosen, _ = examined(states, grey, valid, limits)
    found[candidate & chosen] = OCCUPIED
    return found


def lost(
    states: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    valid: NDArray[np.bool_],
    limits: Any = (0.498, 0.502),
) -> int:
    """Number of thin obstacles without an occupied cell."""
    return examined(states, grey, valid, limits)[2]


def examined(states: Any, grey: Any, valid: Any, limits: Any) -> tuple[Any, Any, int]:
    """Candidates, those of them that belong to obstacles, and the number of obstacles with none occupied."""
    v = grey / 65535
    occupied = valid & (v > limits[1])
    weakest = weakest_of(grey, valid, limits)
    candidate = occupied & (states != OCCUPIED) & (v > weakest)
    kept = occupied & (states == OCCUPIED)
    if is_trinary(grey, valid, limits):
        labels, _ = ndimage.label(candidate, EIGHT)
        attached = np.unique(labels[ndimage.binary_dilation(kept, EIGHT) & candidate])
        return candidate, candidate, len(np.setdiff1d(np.unique(labels), [0, *attached]))
    needed = math.ceil(8 * math.log(valid.sum() / ALPHA))
    with np.errstate(divide="ignore"):
        eighths = np.floor(8 * np.log(np.where(v > 0.5, v, 0.5) / (1 - np.where(v > 0.5, v, 0.5))))
    chosen = np.zeros(states.shape, bool)
    strong = candidate & (v > max(0.65, limits[1]))
    number = 0
    labels, count = ndimage.label(candidate, EIGHT)
    for k in range(1, count + 1):
        structure = labels == k
        beside = (ndimage.binary_dilation(structure, EIGHT) & kept).any()
        enough = structure.sum() >= 3 or eighths[structure & strong].sum() >= needed
        if not beside and enough:
            chosen |= structure
            number += 1
    labels, count = ndimage.label(strong, EIGHT)
    for k in range(1, count + 1):
        if eighths[labels == k].sum() >= needed:
            chosen |= labels == k
    return candidate, chosen, number


def weakest_of(grey: Any, valid: Any, limits: Any) -> float:
    """The v that cells of an obstacle exceed."""
    lifted = limits[1] + deviations(int(valid.sum())) * noise(grey, valid, limits)
    return float(min(lifted, max(0.65, limits[1])))


def is_trinary(grey: Any, valid: Any, limits: Any) -> bool:
    """Whether free, unknown and occupied cells have one value each."""
    own = np.searchsorted(limits, grey / 65535)
    return all(len(np.unique(grey[valid & (own == k)])) <= 1 for k in range(3))


def noise(grey: Any, valid: Any, limits: Any) -> float:
    """Standard deviation of the noise: median absolute response to Immerkaer's mask, in every eighth row."""
    if is_trinary(grey, valid, limits):
        return 0.0
    mask = np.outer([1, -2, 1], [1, -2, 1])
    responses = np.abs(ndimage.convolve(grey.astype(np.int64), mask, mode="constant"))
    whole = ndimage.binary_erosion(valid, EIGHT)
    row, col = np.indices(grey.shape)
    used = whole & (row % 8 == 4) & (col % 64 > 0) & (col % 64 < 63)
    if not used.any():
        return 0.0
    ordered = np.sort(responses[used])
    middle = int(ordered[(len(ordered) + 1) // 2 - 1])
    return float(middle // 64 * 64 / (6 * stats.norm.ppf(0.75) * 65535))


def deviations(cells: int) -> float:
    """z, by which three cells exceed the limit together at most 0.05 times in a map."""
    return float(stats.norm.isf((ALPHA / (20 * cells)) ** (1 / 3)))
