"""Rays in a scene of cells, beside those in the same scene of polygons."""

import math

import numpy as np
import pytest
from affine import Affine

from uavseg.occupancy.simulation.simulate import CellScene, Scene
from uavseg.raster.grid.geobox import GeoBox, local_geobox


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("turned", [0.0, 30.0])
def test_rays_end_where_those_of_polygons_do(seed: int, turned: float) -> None:
    random = np.random.default_rng(seed)
    solid = random.random((12, 16)) < 0.15
    upright = local_geobox(solid.shape, 0.5, (1.0, -2.0))
    geobox = GeoBox(solid.shape, Affine.rotation(turned) @ upright.transform, None)
    corners = [
        np.stack(geobox.xy_from_pixel(r + np.array([0, 0, 1, 1]), c + np.array([0, 1, 1, 0])), axis=1)
        for r, c in np.argwhere(solid)
    ]
    cells, polygons = CellScene(solid, geobox), Scene(polygons=corners)
    row, col = np.argwhere(~solid)[random.integers(len(corners))] + random.uniform(0.1, 0.9, 2)
    x, y = geobox.xy_from_pixel(row, col)
    angles = random.uniform(0, math.tau, 400)
    expected = polygons.cast(float(x), float(y), angles)
    assert np.allclose(cells.cast(float(x), float(y), angles), expected, atol=1e-9)
    xs, ys = random.uniform(-4, 10, (2, 300))
    assert np.array_equal(cells.contains(xs, ys), polygons.contains(xs, ys))
