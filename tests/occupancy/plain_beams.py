"""Reference for beams: merged cell by cell in plain Python, without pending updates."""

from math import erf, exp, floor, inf, log, sqrt

import numpy as np
from numpy.typing import NDArray

from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Scan

P_PEAK, P_MIN, P_MAX = 0.9, 0.1, 0.95


def log_odds_of(d: float, measured: float, sigma: float) -> float:
    if d <= measured - 2.5 * sigma:
        return log(P_MIN / (1 - P_MIN))
    x = (d - measured) / sigma
    p = min(max(0.25 * (1 + erf(x / sqrt(2))) + (P_PEAK - 0.25) * exp(-0.5 * x * x), P_MIN), P_MAX)
    return log(p / (1 - p))


def crossing(place: float, step: float, length: int) -> tuple[float, float]:
    if step == 0:
        return (-inf, inf) if 0 <= place < length else (inf, -inf)
    first, last = -place / step, (length - place) / step
    return min(first, last), max(first, last)


def merge(grid: OccupancyGrid, log_odds: NDArray[np.float32], scan: Scan) -> set[tuple[int, int]]:
    """Merge a scan into log-odds on the cells of a grid; returns the updated cells."""
    a, b, c, d, e, f = tuple(~grid.geobox.transform)[:6]
    x, y = scan.pose.x, scan.pose.y
    touched = set()
    known = ~np.isnan(scan.ranges)
    angles = scan.pose.heading_rad + scan.angles[known]
    for cos, sin, measured in zip(np.cos(angles), np.sin(angles), scan.ranges[known], strict=True):
        step = [
            0.0 if abs(number) < 1e-100 else float(number)
            for number in (a * cos + b * sin, d * cos + e * sin)
        ]
        reach = scan.max_range_m if measured == inf else float(measured) + 3 * scan.sigma_m
        place = (a * x + b * y + c, d * x + e * y + f)
        for row, col, distance in walk(place, (step[0], step[1]), reach, log_odds.shape):
            said = float(log_odds[row, col]) + log_odds_of(distance, float(measured), scan.sigma_m)
            log_odds[row, col] = min(max(said, -6.0), 6.0)
            touched.add((row, col))
    return touched


def walk(
    place: tuple[float, float], step: tuple[float, float], reach: float, shape: tuple[int, ...]
) -> list[tuple[int, int, float]]:
    """Row, column and distance of each cell that a beam crosses."""
    (u, v), (du, dv), (rows, cols) = place, step, shape
    (in_col, out_col), (in_row, out_row) = crossing(u, du, cols), crossing(v, dv, rows)
    t, t_end = max(0.0, in_col, in_row), min(reach, out_col, out_row)
    cells: list[tuple[int, int, float]] = []
    if not t < t_end:
        return cells
    col, row = min(max(floor(u + t * du), 0), cols - 1), min(max(floor(v + t * dv), 0), rows - 1)
    while 0 <= row < rows and 0 <= col < cols:
        t_col = (col + (du >= 0) - u) * (1 / du) if du else inf
        t_row = (row + (dv >= 0) - v) * (1 / dv) if dv else inf
        t_out = min(t_col, t_row)
        if t_out > t:
            if 0.5 * (t + t_out) > reach:
                break
            cells.append((row, col, 0.5 * (t + t_out)))
            t = t_out
        if t_out >= t_end:
            break
        if t_col < t_row:
            col += 1 if du >= 0 else -1
        else:
            row += 1 if dv >= 0 else -1
    return cells
