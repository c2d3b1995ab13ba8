"""Occupancy grids: made empty or from a map, and what they refuse."""

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from uavseg.errors import MapError
from uavseg.occupancy.mapping.grid import OccupancyGrid, grey_picture
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.raster.grid.geobox import GeoBox, local_geobox


def test_cells_outside_of_the_window_of_a_scan_do_not_change() -> None:
    rng = np.random.default_rng(5)
    grid = OccupancyGrid.from_probabilities(rng.uniform(0, 1, (40, 50)), local_geobox((40, 50), 1.0, (0, 0)))
    before = grid.probabilities.copy()
    pose = Pose(25, 20, heading_rad=np.radians(30))
    scan = Scan(pose, np.radians(np.arange(-20, 20, 5.0)), np.full(8, 9.0), 20.0, 0.5)
    window = grid.merge(scan)
    changed = np.zeros((40, 50), bool)
    changed[window.slices] = True
    assert (grid.probabilities[~changed] == before[~changed]).all()
    assert (grid.probabilities != before).any()


def test_a_grid_begins_with_a_given_map() -> None:
    p = np.array([[0.0, 0.1, 0.5], [0.7, 0.99, 1.0]])
    grid = OccupancyGrid.from_probabilities(p, local_geobox((2, 3), 1.0, (0, 0)))
    assert grid.probabilities[0, 2] == 0.5 and grid.log_odds[0, 2] == 0
    np.testing.assert_allclose(grid.probabilities.ravel()[1:5], p.ravel()[1:5], rtol=1e-6)
    assert (grid.log_odds[0, 0], grid.log_odds[1, 2]) == (-6, 6)


@pytest.mark.parametrize("bad", [np.nan, -0.1, 1.1, np.inf])
def test_numbers_that_are_not_probabilities_are_refused(bad: float) -> None:
    with pytest.raises(MapError, match=r"probabilities lie in 0\.\.1"):
        OccupancyGrid.from_probabilities([[0.5, bad]], local_geobox((1, 2), 1.0, (0, 0)))


def test_a_grid_in_degrees_is_refused() -> None:
    from rasterio.crs import CRS

    with pytest.raises(MapError, match="in metres and this one in degrees"):
        OccupancyGrid(GeoBox((2, 2), Affine.scale(1e-5, -1e-5), CRS.from_epsg(4326)))


@given(arrays(np.float64, (5, 7), elements=st.floats(0, 1)))
def test_a_grid_gives_back_the_map_that_it_was_made_from(p: np.ndarray) -> None:
    grid = OccupancyGrid.from_probabilities(p, local_geobox((5, 7), 0.1, (0, 0)))
    low, high = 1 / (1 + np.exp(6)), 1 / (1 + np.exp(-6))
    np.testing.assert_allclose(grid.probabilities, np.clip(p, low, high), atol=1e-6)
    grid.reset()
    assert (grid.probabilities == 0.5).all() and (grid.log_odds == 0).all()


def test_grey_of_a_grid_is_rounded_and_free_is_black() -> None:
    p = np.linspace(0, 1, 1001, dtype=np.float32).reshape(7, 143)
    grey = grey_picture(p)
    assert grey.dtype == np.uint8 and (grey[0, 0], grey[-1, -1]) == (0, 255)
    assert grey_picture(np.full((1, 1), 0.5, np.float32)) == 128
    assert np.abs(grey - 255 * p.astype(float)).max() <= 0.5 + 1e-9
