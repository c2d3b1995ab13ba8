"""What beams say about cells: the beam model, along every cell that a beam crosses once.

The beam model is Elfes-shaped: a cell at distance d along a beam that returned range r, with standard
deviation σ, has P(d) = clip(0.5 Φ((d - r)/σ) + (p_peak - 0.25) exp(-(d - r)²/2σ²), p_min, p_max) for d <= r +
3σ and is left as it was beyond. A beam without a return says p_min as far as the sensor sees. The cells that
a beam crosses are found by Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing",
Eurographics 1987.
"""

from math import erf, exp, floor, inf, log, sqrt

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.raster.tiling import Window

P_PEAK, P_MIN, P_MAX = 0.9, 0.1, 0.95
REACH_SIGMAS = 3.0  # how far behind a return a beam still says something
MAX_LOG_ODDS = 6.0
FREE_SIGMAS = -2.5  # nearer than this, the model is p_min: the clip is already reached at -2σ
LOG_P_MIN = log(P_MIN / (1 - P_MIN))

_NOTHING = 1e-100  # one divided by less than this may be infinite

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


def merge_beams(
    log_odds: Singles,
    probabilities: Singles,
    origin: tuple[float, float],
    beams: Floats,
    sigma: float,
) -> Window:
    """Merge what beams from one place say into the log-odds of cells, in place and beam by beam.

    Parameters
    ----------
    log_odds, probabilities : (rows, cols) float32 arrays
        Kept in step with each other; |log-odds| never leaves 6.
    origin : (float, float)
        Column and row of the sensor, in cells from the grid's outer corner.
    beams : (n, 4) float64 array
        Steps in columns and in rows of one metre along the beam, the range returned (infinite for none), and
        how far the beam says something, in metres.
    sigma : float
        Standard deviation of ranges in metres.

    Returns
    -------
    Window
        The smallest one with all cells that were touched; it may be empty.
    """
    rows, cols = log_odds.shape
    box = np.array([rows, cols, -1, -1], np.int64)
    beams = np.where(np.abs(beams) < _NOTHING, 0.0, beams)
    _merge(log_odds, probabilities, origin[0], origin[1], beams, sigma, box)
    top, left, bottom, right = (int(edge) for edge in box)
    return Window(top, left, bottom - top + 1, right - left + 1) if bottom >= 0 else Window(0, 0, 0, 0)


@inlined
def _model(x):  # type: ignore[no-untyped-def]
    """P(d) of the beam model, x = (d - r) / sigma."""
    p = 0.25 * (1.0 + erf(x / sqrt(2.0))) + (P_PEAK - 0.25) * exp(-0.5 * x * x)
    return min(max(p, P_MIN), P_MAX)


@inlined
def _crossing(place, step, length):  # type: ignore[no-untyped-def]
    """Where along a beam one axis of it enters and leaves a grid; nowhere is (inf, -inf)."""
    if step == 0.0:
        return (-inf, inf) if 0.0 <= place < length else (inf, -inf)
    first, last = -place / step, (length - place) / step
    return min(first, last), max(first, last)


@inlined
def _says(d, measured, sigma):  # type: ignore[no-untyped-def]
    """Log-odds of what a beam says about a cell at distance d; no logarithm where the model is p_min."""
    if d <= measured + FREE_SIGMAS * sigma:  # always, where nothing returned
        return LOG_P_MIN
    p = _model((d - measured) / sigma)
    return log(p / (1.0 - p))


@kernel("void(f4[:,::1], f4[:,::1], f8, f8, f8[:,::1], f8, i8[::1])")
def _merge(log_odds, probabilities, u0, v0, beams, sigma, box):  # type: ignore[no-untyped-def]
    rows, cols = log_odds.shape
    known, known_p = np.float32(0.0), np.float32(0.5)  # the cell before: neighbours are mostly alike
    for i in range(beams.shape[0]):
        du, dv, measured, reach = beams[i, 0], beams[i, 1], beams[i, 2], beams[i, 3]
        in_col, out_col = _crossing(u0, du, cols)
        in_row, out_row = _crossing(v0, dv, rows)
        t_in = max(0.0, in_col, in_row)
        t_end = min(reach, out_col, out_row)
        if not t_in < t_end:
            continue
        col = min(max(np.int64(floor(u0 + t_in * du)), 0), cols - 1)
        row = min(max(np.int64(floor(v0 + t_in * dv)), 0), rows - 1)
        first_col, first_row, last_col, last_row = col, row, np.int64(-1), np.int64(-1)
        # The next edges as doubles, so that no integer is converted on the way. Along an axis on which the
        # beam does not move, the next edge is infinitely far.
        step_u, step_v = -1.0 if du < 0.0 else 1.0, -1.0 if dv < 0.0 else 1.0
        per_col, per_row = 1.0 / du if du != 0.0 else inf, 1.0 / dv if dv != 0.0 else inf
        edge_u, edge_v = np.float64(col + (du >= 0.0)), np.float64(row + (dv >= 0.0))
        t_col, t_row = (edge_u - u0) * per_col, (edge_v - v0) * per_row
        while True:
            t_out = min(t_col, t_row)
            if t_out > t_in:  # not a cell that is only touched at a corner or an edge
                d = 0.5 * (t_in + t_out)
                if d > reach:
                    break
                before = log_odds[row, col]
                total = before + _says(d, measured, sigma)
                after = np.float32(min(max(total, -MAX_LOG_ODDS), MAX_LOG_ODDS))
                if after != before:
                    if after != known:
                        known, known_p = after, np.float32(1.0 / (1.0 + exp(-np.float64(after))))
                    log_odds[row, col] = after
                    probabilities[row, col] = known_p
                if last_col < 0:
                    first_col, first_row = col, row
                last_col, last_row = col, row
                t_in = t_out
            if t_out >= t_end:
                break
            if t_col < t_row:
                col += np.int64(step_u)
                edge_u += step_u
                t_col = (edge_u - u0) * per_col
            else:
                row += np.int64(step_v)
                edge_v += step_v
                t_row = (edge_v - v0) * per_row
            if not (0 <= row < rows and 0 <= col < cols):
                break
        if last_col >= 0:  # a beam is straight: its first and last cells bound it
            box[0], box[1] = min(box[0], first_row, last_row), min(box[1], first_col, last_col)
            box[2], box[3] = max(box[2], first_row, last_row), max(box[3], first_col, last_col)
