"""Boundary refinement by directional scans, or by a local mean (beyond the paper).

The scans are Abou Merhy, Payeur and Petriu's compaction (2008, section II C) with "in the range" in the
place of the states: first, pixels outside the range leave their region; then, pixels in the range join one. A
run of changes stops after 8 pixels, so that the result depends on a bounded neighbourhood only.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Uint8s, Uint16s
from uavseg.segmentation.blocks.dilation import dilate

REFINE_HALO = 80  # pixels: a tile with this halo is refined exactly as the whole image
_MAX_RUN = 8  # pixels: a run of changes stops here
# Weights of the local mean, C(16, k) for k = 0..8: nearly a Gaussian with sigma = 2 pixels.
_WEIGHTS = np.array([1, 16, 120, 560, 1820, 4368, 8008, 11440, 12870], np.int64)


def refine_by_scans(inside: Uint8s, valid: Uint8s, in_range: Uint8s) -> Uint8s:
    """Shrink regions by boundary pixels out of range, then grow them by adjacent pixels in range.

    All arrays are (M, N). `inside`, 1 where a pixel belongs to a region, is refined in place and returned;
    `in_range` is 1 where a pixel is valid and its own v lies in the range.
    """
    cols = inside.shape[1]
    lines = np.zeros((4, cols + 2 * _MAX_RUN), np.uint8)
    for grow in (0, 1):
        for offset in (1, -1):  # right to left, left to right
            _scan_rows(inside, valid, in_range, grow, offset, *lines)
        for offset in (1, -1):  # bottom to top, top to bottom
            _scan_columns(inside, valid, in_range, grow, offset, lines[0, :cols])
    return inside


def refine_by_local_mean(inside: Uint8s, valid: Uint8s, grey: Uint16s, low: float, high: float) -> Uint8s:
    """Reclassify the pixels near a boundary by whether a local mean of v lies in low..high; in a new array.

    A pixel is near a boundary where a pixel inside and a valid one outside both lie within 8 pixels (in a
    square). The mean is over the valid pixels of a window of 17 x 17 with binomial weights (sigma 2 pixels).
    All arrays are (M, N), and `grey` is 0 where not valid.
    """
    near = dilate(inside, _MAX_RUN) & dilate(valid & (1 - inside), _MAX_RUN) & valid
    refined = inside.copy()
    sums, weights = np.empty(inside.shape, np.int64), np.empty(inside.shape, np.int64)
    _weigh_rows(grey, valid, near, _WEIGHTS, sums, weights)
    _decide(sums, weights, near, _WEIGHTS, low, high, refined)
    return refined


@inlined
def can_change(inside, in_range, grow):  # type: ignore[no-untyped-def]
    """Return 1 where a pixel may change side: inside and out of range, or (grow) outside and in range."""
    return (inside ^ grow) & (in_range ^ grow ^ np.uint8(1))


@inlined
def is_source(inside, valid, grow):  # type: ignore[no-untyped-def]
    """Return 1 where the next pixel may take the side of this one: valid and outside, or (grow) inside."""
    return (inside ^ grow ^ np.uint8(1)) & (valid | grow)


@inlined
def and_shifted(first, second, ahead, result):  # type: ignore[no-untyped-def]
    """Store first & second, the latter shifted by `ahead`."""
    # Unsigned indices and one result a loop vectorise.
    margin = np.uintp(_MAX_RUN)
    moved = np.uintp(_MAX_RUN + ahead)
    for c in range(np.uintp(result.shape[0] - 2 * _MAX_RUN)):
        result[c + margin] = first[c + margin] & second[c + moved]


@inlined
def or_and_shifted(change, eligible, ahead, result):  # type: ignore[no-untyped-def]
    """Store change | eligible & change, the last shifted by `ahead`."""
    margin = np.uintp(_MAX_RUN)
    moved = np.uintp(_MAX_RUN + ahead)
    for c in range(np.uintp(result.shape[0] - 2 * _MAX_RUN)):
        result[c + margin] = change[c + margin] | (eligible[c + margin] & change[c + moved])


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1, i8, u1[::1], u1[::1], u1[::1], u1[::1])")
def _scan_rows(inside, valid, in_range, grow, offset, eligible, change, eligible_2, change_2):  # type: ignore[no-untyped-def]
    # A pixel changes where a source lies at most 8 pixels before it, and it and all pixels between are
    # eligible. Three doublings make runs of 8; lines are padded by 8 zeros at both ends.
    cols = inside.shape[1]
    for r in range(inside.shape[0]):
        for c in range(cols):
            eligible[c + _MAX_RUN] = can_change(inside[r, c], in_range[r, c], grow)
        for c in range(cols):
            change_2[c + _MAX_RUN] = is_source(inside[r, c], valid[r, c], grow)
        and_shifted(eligible, change_2, offset, change)
        or_and_shifted(change, eligible, offset, change_2)
        and_shifted(eligible, eligible, offset, eligible_2)
        or_and_shifted(change_2, eligible_2, 2 * offset, change)
        and_shifted(eligible_2, eligible_2, 2 * offset, eligible)
        or_and_shifted(change, eligible, 4 * offset, change_2)
        for c in range(cols):
            inside[r, c] ^= change_2[c + _MAX_RUN]


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1, i8, u1[::1])")
def _scan_columns(inside, valid, in_range, grow, offset, run):  # type: ignore[no-untyped-def]
    rows, cols = inside.shape
    for c in range(cols):
        run[c] = 0
    for k in range(1, rows):
        r = rows - 1 - k if offset > 0 else k
        for c in range(cols):
            change = can_change(inside[r, c], in_range[r, c], grow)
            change &= is_source(inside[r + offset, c], valid[r + offset, c], grow)
            change &= np.uint8(run[c] < _MAX_RUN)
            inside[r, c] ^= change
            run[c] = (run[c] + np.uint8(1)) * change


@kernel("void(u2[:,::1], u1[:,::1], u1[:,::1], i8[::1], i8[:,::1], i8[:,::1])")
def _weigh_rows(grey, valid, near, weights, sums, totals):  # type: ignore[no-untyped-def]
    rows, cols = grey.shape
    for r in range(rows):
        needed = False
        for up in range(max(r - 8, 0), min(r + 9, rows)):
            for c in range(cols):
                needed |= near[up, c] != 0
        if not needed:
            continue
        for c in range(cols):
            total, weight = np.int64(0), np.int64(0)
            for k in range(max(c - 8, 0), min(c + 9, cols)):
                w = weights[8 - abs(k - c)] * np.int64(valid[r, k])
                total += w * np.int64(grey[r, k])
                weight += w
            sums[r, c], totals[r, c] = total, weight


@kernel("void(i8[:,::1], i8[:,::1], u1[:,::1], i8[::1], f8, f8, u1[:,::1])")
def _decide(sums, totals, near, weights, low, high, inside):  # type: ignore[no-untyped-def]
    rows, cols = near.shape
    for r in range(rows):
        for c in range(cols):
            if near[r, c]:
                total, weight = np.int64(0), np.int64(0)
                for k in range(max(r - 8, 0), min(r + 9, rows)):
                    total += weights[8 - abs(k - r)] * sums[k, c]
                    weight += weights[8 - abs(k - r)] * totals[k, c]
                mean = total / (65535.0 * weight)
                inside[r, c] = low <= mean and mean <= high
