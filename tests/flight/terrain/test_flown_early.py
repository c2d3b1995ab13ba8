"""PX4 approaches the height of the next waypoint at once: the height above the ground holds all the same."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.flight.terrain.dems import HOME, draw, hills
from tests.flight.terrain.flights import PLANE, ZIGZAG
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.track import Track
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import PlanParams, TerrainParams
from uavseg.flight.terrain.altitude_profile import Rates, points_climbed_early
from uavseg.flight.terrain.follow import follow_ground
from uavseg.raster.elevation.dem import Dem

SPEED = 5.0
RATES = Rates(3.0, 1.5, SPEED)


def early(at: np.ndarray, x: np.ndarray, z: np.ndarray, speed: np.ndarray, rates: Rates) -> np.ndarray:
    """Heights at places along a path of a vehicle that climbs and descends at the start of each leg."""
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    rise = z[k + 1] - z[k]
    slope = np.where(rise > 0, rates.climb_m_s, rates.descent_m_s) / speed[k]
    return z[k] + np.sign(rise) * np.minimum(slope * (at - x[k]), np.abs(rise))


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=60), st.floats(3, 10))
def test_both_ways_to_fly_a_leg_are_within_the_tolerance(steps: list[float], tolerance_m: float) -> None:
    x, z = 10.0 * np.arange(len(steps)), np.cumsum(steps)
    points = points_climbed_early(x, z, tolerance_m, RATES)
    assert points[0] == 0 and points[-1] == len(x) - 1 and points == sorted(set(points))
    speed = RATES.speeds(np.diff(x[points]), np.diff(z[points]))
    for flown in (early(x, x[points], z[points], speed, RATES), np.interp(x, x[points], z[points])):
        assert np.abs(flown - z).max() <= tolerance_m + 1e-9


@pytest.mark.parametrize("autopilot", ["px4", "generic"])
@pytest.mark.parametrize("relief_m", [20.0, 60.0])
def test_a_vehicle_that_descends_early_keeps_its_height(
    tmp_path: Path, autopilot: str, relief_m: float
) -> None:
    dem = Dem.open(draw(tmp_path / "hills.tif", hills(relief_m)))
    lon, lat = PLANE.lonlat_from_xy(*np.array(ZIGZAG, float).T)
    params = PlanParams(60.0, speed_m_s=SPEED, autopilot=autopilot, terrain=TerrainParams(dem))
    home = HomePosition(*HOME, float(dem.heights_m([HOME[1]], [HOME[0]])[0]))
    path = follow_ground(Track.of_path(np.column_stack([lon, lat])), home, params)
    place = np.column_stack(PLANE.xy_from_lonlat(*path.track.xy.T))
    x = np.r_[0.0, np.cumsum(np.hypot(*np.diff(place, axis=0).T))]
    at = np.arange(0.0, x[-1], 0.5)
    on_ground = dem.heights_m(*(np.interp(at, x, path.track.xy[:, k]) for k in (0, 1)))
    vehicle = default_vehicle(autopilot)
    rates = Rates(vehicle.climb_m_s, vehicle.descent_m_s, SPEED)
    flown = early(at, x, path.heights.height_m, path.heights.speed_m_s[1:], rates)
    assert np.abs(flown - on_ground - 60).max() <= 5.1
