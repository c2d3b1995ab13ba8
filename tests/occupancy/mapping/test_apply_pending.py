"""Evidence that is counted first and added later: the same maps as beam by beam, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.occupancy import plain_beams
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.log_odds import probabilities_of
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.raster.geobox import local_geobox
from uavseg.raster.intensity.grey import to_grey
from uavseg.raster.tiling import Window


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
    heading = float(rng.choice([0, 45, 90, 30, rng.uniform(0, 360)]))
    sigma = cell_m * float(rng.choice([0.1, 0.6, 2]))
    return Scan(Pose(x, y, heading), angles, ranges, side * rng.uniform(0.1, 1), sigma)


def assert_in_step(grid: OccupancyGrid) -> None:
    p, grey = probabilities_of(grid.log_odds)
    assert (grid.probabilities == p).all()
    assert (grey == to_grey(p[np.newaxis], 0.0, 1.0)).all()
    rows, cols = p.shape
    framed = grid._ground.grey
    assert (framed[1 : rows + 1, 1 : cols + 1] == grey).all()
    assert framed.astype(np.int64).sum() == grey.astype(np.int64).sum()  # nothing beyond the map
    assert not grid._marks.any()


@pytest.mark.parametrize("seed", range(40))
def test_counting_first_is_adding_beam_by_beam(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(1, 150)), int(rng.integers(1, 150)))
    cell_m = float(rng.choice([0.05, 0.3, 1.0]))
    grid = OccupancyGrid.empty(shape, cell_m)
    if seed % 2:
        grid = OccupancyGrid.from_probabilities(rng.random(shape), grid.geobox)
    plain = grid.log_odds.copy()
    for _ in range(3):
        scan = random_scan(rng, shape, cell_m)
        window = grid.merge(scan)
        touched = plain_beams.merge(grid, plain, scan)
        assert (grid.log_odds == plain).all()
        rows, cols = (sorted(index) for index in zip(*touched, strict=True)) if touched else ([], [])
        expected = Window(rows[0], cols[0], rows[-1] - rows[0] + 1, cols[-1] - cols[0] + 1) if rows else None
        assert window == (expected or Window(0, 0, 0, 0))
        assert_in_step(grid)


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 8), st.integers(1, 8), st.integers(-7, 7), st.integers(-7, 7), st.booleans())
def test_beams_through_corners_of_cells(u: int, v: int, right: int, down: int, returns: bool) -> None:
    grid = OccupancyGrid.empty((90, 80), 1.0)
    plain = grid.log_odds.copy()
    ranges = np.array([31.0 if returns else math.inf])
    scan = Scan(Pose(10.0 * u, 10.0 * v), np.array([math.atan2(down, right)]), ranges, 200.0, 0.5)
    grid.merge(scan)
    plain_beams.merge(grid, plain, scan)
    assert (grid.log_odds == plain).all()


def test_a_cell_hears_its_beams_in_their_order() -> None:
    """Free, then a return in the same cells, then free again: adding is not the same in another order."""
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        ranges = np.array([math.inf, 20.3, 25.1])[order]
        grid = OccupancyGrid.from_probabilities(np.full((3, 60), 0.97), local_geobox((3, 60), 1.0, (0, 0)))
        plain = grid.log_odds.copy()
        scan = Scan(Pose(0.0, 1.5), np.full(3, 0.001), ranges, 50.0, 1.0)
        grid.merge(scan)
        plain_beams.merge(grid, plain, scan)
        assert (grid.log_odds == plain).all()


def test_free_said_a_thousand_times_is_as_free_as_can_be() -> None:
    grid = OccupancyGrid.from_probabilities(np.full((1, 70), 1.0), local_geobox((1, 70), 1.0, (0, 0)))
    grid.merge(Scan(Pose(0.0, 0.5), np.full(1000, 1e-4), np.full(1000, math.inf), 50.0, 1.0))
    assert (grid.log_odds[0, :50] == -6).all() and (grid.log_odds[0, 50:] == 6).all()


def test_probabilities_are_those_of_the_log_odds() -> None:
    odds = np.linspace(-6, 6, 100_001).astype(np.float32)
    p, grey = probabilities_of(odds)
    exact = 1 / (1 + np.exp(-odds.astype(np.float64)))
    assert np.abs(p - exact).max() < 4e-8
    assert (p == exact.astype(np.float32)).mean() > 0.9999
    assert (np.diff(p) >= 0).all() and (np.diff(grey.astype(int)) >= 0).all()
    assert probabilities_of(np.zeros(1, np.float32))[0] == 0.5


def test_probabilities_are_the_same_whenever_somebody_looks() -> None:
    rng = np.random.default_rng(3)
    first, last = OccupancyGrid.empty((100, 130), 0.1), OccupancyGrid.empty((100, 130), 0.1)
    seen = first.probabilities
    for _ in range(4):
        scan = random_scan(rng, (100, 130), 0.1)
        first.merge(scan)
        last.merge(scan)
    assert (seen == last.probabilities).all() and (seen != 0.5).any()
    first.reset()
    assert (seen == 0.5).all()
