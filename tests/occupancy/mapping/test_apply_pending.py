"""Counting free observations first gives the same maps as adding beam by beam, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.occupancy import plain_beams
from tests.occupancy.random_scans import random_scan
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.log_odds import probabilities_and_grey
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.grey import to_grey


def assert_in_step(grid: OccupancyGrid) -> None:
    p, grey = probabilities_and_grey(grid.log_odds)
    assert (grid.probabilities == p).all()
    assert (grey == to_grey(p[np.newaxis], 0.0, 1.0)).all()
    rows, cols = p.shape
    framed = grid._grey_map.grey
    assert (framed[1 : rows + 1, 1 : cols + 1] == grey).all()
    assert framed.astype(np.int64).sum() == grey.astype(np.int64).sum()  # nothing beyond the map
    assert not grid._pending.any()


@pytest.mark.parametrize("seed", range(40))
def test_counting_free_observations_equals_adding_beam_by_beam(seed: int) -> None:
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


@settings(max_examples=30)
@given(st.integers(1, 8), st.integers(1, 8), st.integers(-7, 7), st.integers(-7, 7), st.booleans())
def test_beams_through_corners_of_cells(u: int, v: int, right: int, down: int, returns: bool) -> None:
    grid = OccupancyGrid.empty((90, 80), 1.0)
    plain = grid.log_odds.copy()
    ranges = np.array([31.0 if returns else math.inf])
    scan = Scan(Pose(10.0 * u, 10.0 * v), np.array([math.atan2(down, right)]), ranges, 200.0, 0.5)
    grid.merge(scan)
    plain_beams.merge(grid, plain, scan)
    assert (grid.log_odds == plain).all()


def test_updates_of_a_cell_are_applied_in_beam_order() -> None:
    """Free, then a return in the same cells, then free again: adding is not the same in another order."""
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        ranges = np.array([math.inf, 20.3, 25.1])[order]
        grid = OccupancyGrid.from_probabilities(np.full((3, 60), 0.97), local_geobox((3, 60), 1.0, (0, 0)))
        plain = grid.log_odds.copy()
        scan = Scan(Pose(0.0, 1.5), np.full(3, 0.001), ranges, 50.0, 1.0)
        grid.merge(scan)
        plain_beams.merge(grid, plain, scan)
        assert (grid.log_odds == plain).all()


def test_a_thousand_free_observations_lead_to_the_minimum() -> None:
    grid = OccupancyGrid.from_probabilities(np.full((1, 70), 1.0), local_geobox((1, 70), 1.0, (0, 0)))
    grid.merge(Scan(Pose(0.0, 0.5), np.full(1000, 1e-4), np.full(1000, math.inf), 50.0, 1.0))
    assert (grid.log_odds[0, :50] == -6).all() and (grid.log_odds[0, 50:] == 6).all()


def test_probabilities_do_not_depend_on_when_they_are_read() -> None:
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
