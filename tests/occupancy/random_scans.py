"""Random scans, with beams that leave from corners of cells, run along edges or pass through corners."""

import math

import numpy as np

from uavseg.occupancy.mapping.scan import Pose, Scan


def random_scan(rng: np.random.Generator, shape: tuple[int, int], cell_m: float) -> Scan:
    """Beams of all kinds: some leave from the corner of a cell, some run along edges or through corners."""
    side = max(shape) * cell_m
    x, y = rng.uniform(-0.2 * side, 1.2 * side, 2)
    if rng.random() < 0.5:
        x, y = (math.floor(2 * number / cell_m) / 2 * cell_m for number in (x, y))
    count = int(rng.integers(1, 60))
    angles = rng.uniform(-math.pi, math.pi, count)
    if rng.random() < 0.5:
        angles = np.arctan2(*rng.integers(-6, 7, (2, count)))
    ranges = np.where(rng.random(count) < 0.4, math.inf, rng.uniform(0, side, count))
    ranges[rng.random(count) < 0.05] = math.nan
    heading = math.radians(float(rng.choice([0, 45, 90, 30, rng.uniform(0, 360)])))
    sigma = cell_m * float(rng.choice([0.1, 0.6, 2]))
    return Scan(Pose(x, y, heading_rad=heading), angles, ranges, side * rng.uniform(0.1, 1), sigma)
