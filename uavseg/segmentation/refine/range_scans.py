"""Boundaries to the pixel: four scans over the image, or a local mean (beyond the paper).

The scans are Abou Merhy, Payeur and Petriu's compaction (2008, section II C) with "in the range" in the
place of the states: first pixels outside the range leave their region, then pixels in the range join one. A
run of such changes ends after 8 pixels, so that what happens to a pixel depends on its neighbourhood alone.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

REACH = 80  # pixels: an image cut with this much around it is refined as the whole would be
_RUN = 8  # pixels: where a run of changes stops
# The weights of the local mean, 16 over k for k = 0..8: nearly a Gaussian with sigma = 2 pixels.
_WEIGHTS = np.array([1, 16, 120, 560, 1820, 4368, 8008, 11440, 12870], np.int64)


def scan(
    inside: NDArray[np.uint8], valid: NDArray[np.uint8], matching: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Shrink regions by pixels that do not match, then grow them by pixels that do.

    Parameters
    ----------
    inside : (M, N) uint8 array
        1 where a pixel belongs to a region; it is refined in place.
    valid : (M, N) uint8 array
        1 where a pixel is valid.
    matching : (M, N) uint8 array
        1 where a valid pixel's own v lies in the range.

    Returns
    -------
    inside : (M, N) uint8 array, the same array
    """
    cols = inside.shape[1]
    lines = np.zeros((4, cols + 2 * _RUN), np.uint8)
    for grow in (0, 1):
        for before in (1, -1):  # right to left, left to right
            _scan_rows(inside, valid, matching, grow, before, *lines)
        for before in (1, -1):  # bottom to top, top to bottom
            _scan_columns(inside, valid, matching, grow, before, lines[0, :cols])
    return inside


def smooth(
    inside: NDArray[np.uint8], valid: NDArray[np.uint8], grey: NDArray[np.uint16], low: float, high: float
) -> NDArray[np.uint8]:
    """Decide the pixels near a boundary again, by the mean of v around them.

    A pixel is near where both a pixel inside and a valid one outside lie within 8 pixels of it (in a
    square). The mean runs over the valid pixels of the 17 x 17 around it with binomial weights (sigma 2
    pixels).

    Parameters
    ----------
    inside : (M, N) uint8 array
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    low, high : float
        The range of v.

    Returns
    -------
    inside : (M, N) uint8 array, a new one
    """
    near = _spread(inside) & _spread(valid & (1 - inside)) & valid
    refined = inside.copy()
    sums = np.empty(inside.shape, np.int64)
    weights = np.empty(inside.shape, np.int64)
    _weigh_rows(grey, valid, near, _WEIGHTS, sums, weights)
    _decide(sums, weights, near, _WEIGHTS, low, high, refined)
    return refined


def _spread(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The largest value within 8 pixels, along rows and then along columns."""
    spread = image
    for axis in (0, 1):
        padded = np.pad(spread, [(_RUN, _RUN) if k == axis else (0, 0) for k in (0, 1)])
        for step in (1, 2, 4, 8, 1):  # windows of 2, 4, 8, 16 and 17
            length = padded.shape[axis] - step
            padded = np.maximum(
                padded.take(range(length), axis), padded.take(range(step, length + step), axis)
            )
        spread = padded
    return spread


@inlined
def eligible(own, fits, grow):  # type: ignore[no-untyped-def]
    """1 where a pixel would change its side if the one before it asked: it does not fit, or (grow) it
    does.
    """
    return (own ^ grow) & (fits ^ grow ^ np.uint8(1))


@inlined
def asks(own, valid, grow):  # type: ignore[no-untyped-def]
    """1 where a pixel asks the next one over: it is valid and outside, or (grow) inside."""
    return (own ^ grow ^ np.uint8(1)) & (valid | grow)


@inlined
def joined(first, second, ahead, result):  # type: ignore[no-untyped-def]
    """first & second, the latter `ahead` pixels on. (Unsigned indices and one result a loop keep it
    vectorised.)
    """
    margin = np.uintp(_RUN)
    moved = np.uintp(_RUN + ahead)
    for c in range(np.uintp(result.shape[0] - 2 * _RUN)):
        result[c + margin] = first[c + margin] & second[c + moved]


@inlined
def extended(change, fits, ahead, result):  # type: ignore[no-untyped-def]
    """change | fits & change, the last `ahead` pixels on."""
    margin = np.uintp(_RUN)
    moved = np.uintp(_RUN + ahead)
    for c in range(np.uintp(result.shape[0] - 2 * _RUN)):
        result[c + margin] = change[c + margin] | (fits[c + margin] & change[c + moved])


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1, i8, u1[::1], u1[::1], u1[::1], u1[::1])")
def _scan_rows(inside, valid, matching, grow, before, fits, change, fits_2, change_2):  # type: ignore[no-untyped-def]
    # A pixel changes where it and all between it and one that asks are eligible, and the one that asks is at
    # most 8 pixels before it. Three doublings make runs of 8; lines have 8 zeros at both ends, so nothing
    # runs over.
    cols = inside.shape[1]
    for r in range(inside.shape[0]):
        for c in range(cols):
            fits[c + _RUN] = eligible(inside[r, c], matching[r, c], grow)
        for c in range(cols):
            change_2[c + _RUN] = asks(inside[r, c], valid[r, c], grow)
        joined(fits, change_2, before, change)
        extended(change, fits, before, change_2)
        joined(fits, fits, before, fits_2)
        extended(change_2, fits_2, 2 * before, change)
        joined(fits_2, fits_2, 2 * before, fits)
        extended(change, fits, 4 * before, change_2)
        for c in range(cols):
            inside[r, c] ^= change_2[c + _RUN]


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1, i8, u1[::1])")
def _scan_columns(inside, valid, matching, grow, before, run):  # type: ignore[no-untyped-def]
    rows, cols = inside.shape
    for c in range(cols):
        run[c] = 0
    for k in range(1, rows):
        r = rows - 1 - k if before > 0 else k
        for c in range(cols):
            change = eligible(inside[r, c], matching[r, c], grow)
            change &= asks(inside[r + before, c], valid[r + before, c], grow)
            change &= np.uint8(run[c] < _RUN)
            inside[r, c] ^= change
            run[c] = (run[c] + np.uint8(1)) * change


@kernel("void(u2[:,::1], u1[:,::1], u1[:,::1], i8[::1], i8[:,::1], i8[:,::1])")
def _weigh_rows(grey, valid, near, weights, sums, totals):  # type: ignore[no-untyped-def]
    rows, cols = grey.shape
    for r in range(rows):
        wanted = False
        for up in range(max(r - 8, 0), min(r + 9, rows)):
            for c in range(cols):
                wanted |= near[up, c] != 0
        if not wanted:
            continue
        for c in range(cols):
            total = np.int64(0)
            weight = np.int64(0)
            for at in range(max(c - 8, 0), min(c + 9, cols)):
                w = weights[8 - abs(at - c)] * np.int64(valid[r, at])
                total += w * np.int64(grey[r, at])
                weight += w
            sums[r, c] = total
            totals[r, c] = weight


@kernel("void(i8[:,::1], i8[:,::1], u1[:,::1], i8[::1], f8, f8, u1[:,::1])")
def _decide(sums, totals, near, weights, low, high, inside):  # type: ignore[no-untyped-def]
    rows, cols = near.shape
    for r in range(rows):
        for c in range(cols):
            if near[r, c]:
                total = np.int64(0)
                weight = np.int64(0)
                for at in range(max(r - 8, 0), min(r + 9, rows)):
                    total += weights[8 - abs(at - r)] * sums[at, c]
                    weight += weights[8 - abs(at - r)] * totals[at, c]
                mean = total / (65535.0 * weight)
                inside[r, c] = low <= mean and mean <= high
