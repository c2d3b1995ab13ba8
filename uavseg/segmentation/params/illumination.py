"""Flat-field correction: uneven illumination is estimated from sums over squares, and subtracted from grey.

The illumination of a square is the plane fitted to the squares around it, weighted by a triangle along each
axis and by their valid pixels (local linear regression: Cleveland, JASA 74 (1979) 829-836), so a linear
gradient is estimated exactly, also at the edge of the raster. Between the centres of squares it is
interpolated bilinearly, and extrapolated outside of them.
"""

import numpy as np

from uavseg._jit import kernel
from uavseg.arrays import Bools, Floats, Integers, Uint16s
from uavseg.dataclass import dataclass
from uavseg.units import CELL, GREY_MAX

_SQUARES = 8  # at least so many squares across the width, where squares are larger than a cell
_STRIP = 256  # rows of squares that are fitted at once
_TRUSTED, _REFUSED = 6.0, 12.0  # variance of the plane's value over that of the mean
_RIDGE = 1e-9  # makes a plane of squares in one line determined, and changes no other by half a grey

Moments = dict[tuple[int, int], Floats]


@dataclass(frozen=True)
class Illumination:
    """Illumination of a raster in grey, and the mean grey that replaces it."""

    nodes: Uint16s  # (m, n): at centres of squares from the top-left corner
    step: int  # side of a square in pixels, a power of two
    target: int  # mean grey of all valid pixels

    def subtract_from(self, grey: Uint16s, valid: Bools | None, corner: tuple[int, int]) -> None:
        """Replace grey by clip(grey − illumination + target, 0, 65535), in place; invalid pixels stay 0.

        `corner` is the row and column of the first pixel within the raster.
        """
        mask = np.zeros((0, 0), np.uint8) if valid is None else np.ascontiguousarray(valid).view(np.uint8)
        _subtract(grey, mask, self.nodes, *corner, self.step.bit_length() - 1, self.target)


def square_side(width: tuple[int, int]) -> int:
    """Return the side of the squares for a width in rows and columns of pixels: a power of two from 8 on."""
    side = CELL
    while 2 * side * _SQUARES <= min(width):
        side *= 2
    return side


def fit_illumination(sums: Integers, counts: Integers, step: int, width: tuple[int, int]) -> Illumination:
    """Estimate the illumination from the sum of grey and the number of valid pixels of squares, both (m, n).

    Where valid pixels lie so much to one side that the variance of the plane at a square is more than 6 times
    that of the mean, the estimate moves from the plane to the mean. `step` is the side of a square in pixels,
    `width` that of the triangles at half of their height, in rows and columns of pixels.
    """
    total = int(counts.sum())
    target = (2 * int(sums.sum()) + total) // max(2 * total, 1)
    nodes = np.empty(sums.shape, np.uint16)
    reach_rows, reach_cols = (
        min(max(-(-length // step), 2), side) for length, side in zip(width, sums.shape, strict=True)
    )
    shape = max(reach_rows, 1), max(reach_cols, 1)
    for top in range(0, sums.shape[0], _STRIP):
        rows = slice(top, min(top + _STRIP, sums.shape[0]))
        weights, greys = (_moments(array, rows, shape, order) for array, order in ((counts, 2), (sums, 1)))
        nodes[rows] = _plane_values(weights, greys, target)
    return Illumination(nodes, step, target)


def _moments(array: Integers, rows: slice, reach: tuple[int, int], order: int) -> Moments:
    """Compute the triangle-weighted moments around each element of some rows, up to an order."""
    # Key (i, j) is the sum of weight · (row offset)^i · (column offset)^j · element.
    above = min(reach[0] - 1, rows.start)
    below = min(reach[0] - 1, array.shape[0] - rows.stop)
    part = array[rows.start - above : rows.stop + below].astype(np.float64)
    padding = ((reach[0] - 1 - above, reach[0] - 1 - below), (reach[1] - 1, reach[1] - 1))
    part = np.pad(part, padding)
    moments: Moments = {}
    for j in range(order + 1):
        across = _weighted(part, reach[1], j)
        for i in range(order + 1 - j):
            moments[i, j] = _weighted(across.T, reach[0], i).T
    return moments


def _weighted(padded: Floats, reach: int, power: int) -> Floats:
    """Sum along rows with the weights (reach − |t|) · t^power, in the order of t."""
    length = padded.shape[1] - 2 * (reach - 1)
    total = np.zeros((padded.shape[0], length))
    for t in range(1 - reach, reach):
        weight = float((reach - abs(t)) * t**power)
        if weight:
            total += weight * padded[:, reach - 1 + t : reach - 1 + t + length]
    return total


def _plane_values(w: Moments, g: Moments, empty: int) -> Uint16s:
    """Evaluate the fitted planes at their squares by Cramer's rule; `empty` where no valid pixel is near."""
    count = np.where(w[0, 0] > 0, w[0, 0], 1.0)
    rr, cc, rc = w[2, 0] + _RIDGE * count, w[0, 2] + _RIDGE * count, w[1, 1]
    minor = rr * cc - rc * rc
    by_row, by_col = w[0, 1] * rc - w[1, 0] * cc, w[1, 0] * rc - w[0, 1] * rr
    determinant = count * minor + w[1, 0] * by_row + w[0, 1] * by_col
    sound = determinant * _REFUSED > count * minor
    divisor = np.where(sound, determinant, 1.0)
    spread = np.where(sound, count * minor / divisor, _REFUSED)
    mean = g[0, 0] / count
    plane = (g[0, 0] * minor + g[1, 0] * by_row + g[0, 1] * by_col) / divisor
    trust = np.clip((_REFUSED - spread) / (_REFUSED - _TRUSTED), 0.0, 1.0)
    illumination = np.where(w[0, 0] > 0, mean + trust * (np.where(sound, plane, mean) - mean), empty)
    return np.clip(np.floor(illumination + 0.5), 0, GREY_MAX).astype(np.uint16)


@kernel("void(u2[:,::1], u1[:,::1], u2[:,::1], i8, i8, i8, i8)")
def _subtract(grey, valid, nodes, row, col, power, target):  # type: ignore[no-untyped-def]
    side = 1 << power
    shift = power + 1  # places are in half pixels, between centres that are 2 side apart
    half = 1 << (2 * shift - 1)
    last_row, last_col = max(nodes.shape[0] - 2, 0), max(nodes.shape[1] - 2, 0)
    for r in range(grey.shape[0]):
        y = 2 * (row + r) + 1 - side
        above = min(max(y >> shift, 0), last_row)
        below = min(above + 1, nodes.shape[0] - 1)
        down = y - (above << shift)  # outside of the outermost centres, negative or more than 2 side
        for c in range(grey.shape[1]):
            if valid.size > 0 and valid[r, c] == 0:
                continue
            x = 2 * (col + c) + 1 - side
            before = min(max(x >> shift, 0), last_col)
            after = min(before + 1, nodes.shape[1] - 1)
            across = x - (before << shift)
            here = (
                np.int64(nodes[above, before]) * (2 * side - across) + np.int64(nodes[above, after]) * across
            )
            there = np.int64(nodes[below, before]) * (2 * side - across)
            there += np.int64(nodes[below, after]) * across
            illumination = (here * (2 * side - down) + there * down + half) >> (2 * shift)
            flat = np.int64(grey[r, c]) - illumination + target
            grey[r, c] = min(max(flat, 0), 65535)
