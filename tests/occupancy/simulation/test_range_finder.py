"""Range finders: angles of beams, noise, maximum range."""

import math

import numpy as np
import pytest

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene


def test_noise_has_its_standard_deviation_and_a_seed() -> None:
    sensor = RangeFinder(sigma_m=0.05, max_range_m=5, fov_deg=360, step_deg=0.01)
    ring = Scene(circles=[(0, 0, 3)])
    scans = [sensor.scan(ring, Pose(0, 0), np.random.default_rng(seed)) for seed in (7, 7, 8)]
    assert len(scans[0].ranges) == 36000
    assert scans[0].ranges.mean() == pytest.approx(3, abs=0.002)
    assert scans[0].ranges.std() == pytest.approx(0.05, rel=0.02)
    assert (scans[0].ranges == scans[1].ranges).all() and (scans[0].ranges != scans[2].ranges).any()


def test_beams_are_spread_evenly_around_the_heading() -> None:
    half = np.degrees(RangeFinder(fov_deg=180, step_deg=0.5).angles)
    assert len(half) == 361 and half[0] == pytest.approx(-90) and half[-1] == pytest.approx(90)
    whole = np.degrees(RangeFinder(fov_deg=360, step_deg=0.5).angles)
    assert len(whole) == 720 and np.diff(whole) == pytest.approx(0.5)
    assert (whole[0] + 360) - whole[-1] == pytest.approx(0.5)  # no beam twice
    rest = np.degrees(RangeFinder(fov_deg=10, step_deg=3).angles)
    assert rest == pytest.approx([-4.5, -1.5, 1.5, 4.5])


def test_surfaces_beyond_the_range_return_nothing() -> None:
    sensor = RangeFinder(sigma_m=0.01, max_range_m=2, fov_deg=1, step_deg=1)
    random = np.random.default_rng(0)
    assert np.isinf(sensor.scan(Scene(circles=[(5, 0, 2.9)]), Pose(0, 0), random).ranges).all()
    assert np.isfinite(sensor.scan(Scene(circles=[(5, 0, 3.1)]), Pose(0, 0), random).ranges).all()


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"sigma_m": -1.0}, "deviation of ranges is a number above 0, not -1"),
        ({"sigma_m": 0.0}, "deviation of ranges is a number above 0, not 0"),
        ({"max_range_m": math.nan}, "maximum range is a number above 0, not nan"),
        ({"step_deg": 0.0}, "angular step"),
        ({"fov_deg": 361.0}, "field of view is more than 0 and at most 360"),
        ({"fov_deg": math.nan}, "field of view"),
        ({"step_deg": 1e-9}, "beams; at most"),
    ],
)
def test_a_range_finder_checks_itself(how: dict[str, float], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        RangeFinder(**how)
