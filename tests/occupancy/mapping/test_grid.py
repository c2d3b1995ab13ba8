"""Occupancy grids: begun empty or from a map, and what they refuse."""

import numpy as np
import pytest
from affine import Affine

from uavseg.errors import MapError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.raster.geobox import GeoBox, upright


def test_what_a_scan_did_not_touch_stays_as_it_was() -> None:
    rng = np.random.default_rng(5)
    grid = OccupancyGrid.from_probabilities(rng.uniform(0, 1, (40, 50)), upright((40, 50), 1.0, (0, 0)))
    before = grid.probabilities.copy()
    scan = Scan(Pose(25, 20, 30), np.radians(np.arange(-20, 20, 5.0)), np.full(8, 9.0), 20.0, 0.5)
    window = grid.merge(scan)
    changed = np.zeros((40, 50), bool)
    changed[window.slices] = True
    assert (grid.probabilities[~changed] == before[~changed]).all()
    assert (grid.probabilities != before).any()


def test_a_grid_believes_a_map() -> None:
    p = np.array([[0.0, 0.1, 0.5], [0.7, 0.99, 1.0]])
    grid = OccupancyGrid.from_probabilities(p, upright((2, 3), 1.0, (0, 0)))
    assert grid.probabilities[0, 2] == 0.5 and grid.log_odds[0, 2] == 0
    np.testing.assert_allclose(grid.probabilities.ravel()[1:5], p.ravel()[1:5], rtol=1e-6)
    assert (grid.log_odds[0, 0], grid.log_odds[1, 2]) == (-6, 6)


@pytest.mark.parametrize("bad", [np.nan, -0.1, 1.1, np.inf])
def test_a_grid_of_what_is_no_probability_is_refused(bad: float) -> None:
    with pytest.raises(MapError, match=r"probabilities lie in 0\.\.1"):
        OccupancyGrid.from_probabilities([[0.5, bad]], upright((1, 2), 1.0, (0, 0)))


def test_a_grid_in_degrees_is_refused() -> None:
    from rasterio.crs import CRS

    with pytest.raises(MapError, match="in metres and this one in degrees"):
        OccupancyGrid(GeoBox((2, 2), Affine.scale(1e-5, -1e-5), CRS.from_epsg(4326)))
