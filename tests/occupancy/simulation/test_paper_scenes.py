"""The two scenes of the paper."""

import numpy as np
import pytest

from uavseg.occupancy.simulation.paper_scenes import BUILT_IN_SCENES
from uavseg.units import FREE, OCCUPIED, UNKNOWN


@pytest.mark.parametrize(("name", "views", "sigma"), [("lens", 5, 0.05), ("circles", 8, 0.03)])
def test_the_scenes_of_the_paper_are_as_it_tells(name: str, views: int, sigma: float) -> None:
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
