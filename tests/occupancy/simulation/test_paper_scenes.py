"""The two scenes of the paper."""

import numpy as np
import pytest
import shapely
from shapely.affinity import scale, translate

from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES, lens_outline
from uavseg.units import FREE, OCCUPIED, UNKNOWN


@pytest.mark.parametrize(("name", "views", "sigma"), [("lens", 5, 0.05), ("circles", 8, 0.03)])
def test_the_scenes_of_the_paper_have_its_parameters(name: str, views: int, sigma: float) -> None:
    simulation = BUILT_IN_SCENES[name]()
    assert simulation.geobox.shape == (320, 320)
    assert len(simulation.poses) == views
    sensor = simulation.sensor
    assert sensor.sigma_m == sigma and sensor.max_range_m == 2 and sensor.step_deg == 0.5
    p = simulation.run(0).probabilities
    assert p.dtype == np.float32 and p.min() > 0 and p.max() < 1
    truth = simulation.truth()
    inner = truth.solid & ~truth.visible
    assert inner.any() and (p[inner] == 0.5).mean() > 0.5  # what is inside objects is never seen
    assert (p[truth.states == FREE] < 0.5).mean() > 0.9
    assert (p[truth.states == OCCUPIED] > 0.5).mean() > 0.6
    assert (p[truth.states == UNKNOWN] == 0.5).mean() > 0.9


@pytest.mark.parametrize(("height", "edge", "waist"), [(1.1, 1.0, 0.5), (2.0, 0.8, 0.1)])
def test_a_lens_is_symmetric_and_thinnest_in_the_middle(height: float, edge: float, waist: float) -> None:
    corners = lens_outline(0, 0, height, edge, waist)
    lens = shapely.Polygon(corners)
    assert lens.is_valid and lens.exterior.is_ccw
    assert lens.bounds == pytest.approx((-edge / 2, -height / 2, edge / 2, height / 2))
    widths = [
        lens.intersection(shapely.LineString([(-9, y), (9, y)])).length
        for y in np.linspace(0, 0.99, 9) * height / 2
    ]
    assert widths[0] == pytest.approx(waist, rel=1e-3) and (np.diff(widths) > 0).all()
    moved = shapely.Polygon(lens_outline(3, -2, height, edge, waist))
    assert moved.symmetric_difference(translate(lens, 3, -2)).area < 1e-9
    assert lens.symmetric_difference(scale(lens, -1, -1, origin=(0, 0))).area < 1e-9
