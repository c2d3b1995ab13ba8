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


def with_free_of_mixed(
    states: NDArray[np.uint8], grey: NDArray[np.uint16], limits: Any = (0.498, 0.502)
) -> NDArray[np.uint8]:
    """States of leaves, with the free pixels of unknown cells that are not near 0.5."""
    v, found = grey / 65535, states.copy()
    free = v < min(0.35, limits[0])
    far = free | (v > max(0.65, limits[1]))
    for row in range(0, states.shape[0], 8):
        for col in range(0, states.shape[1], 8):
            cell = slice(row, row + 8), slice(col, col + 8)
            unknown = states[cell] == UNKNOWN
            if (far[cell] & unknown).sum() > unknown.sum() / 4:
                found[cell][unknown & free[cell]] = FREE
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
    chosen, whole = np.zeros(states.shape, bool), np.zeros(states.shape, bool)
    strong = candidate & (v > max(0.65, limits[1]))
    number = 0
    labels, count = ndimage.label(candidate, EIGHT)
    for k in range(1, count + 1):
        structure = labels == k
        beside = (ndimage.binary_dilation(structure, EIGHT) & kept).any()
        enough = structure.sum() >= 3 or eighths[structure & strong].sum() >= needed
        if not beside and enough:
            whole |= structure
            number += 1
    labels, count = ndimage.label(strong, EIGHT)
    for k in range(1, count + 1):
        part = labels == k
        beside = (ndimage.binary_dilation(part, EIGHT) & kept & (v > max(0.65, limits[1]))).any()
        hidden = part.sum() >= 3 and not beside
        if hidden or eighths[part].sum() >= needed:
            chosen |= part
        number += bool(hidden and not whole[part].any())
    return candidate, chosen | whole, number


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
