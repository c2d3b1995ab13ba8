"""Missions along a line."""

import numpy as np
from hypothesis import given, strategies as st

from tests.flight.small_regions import box, planned
from uavseg.flight.mission.items import CHANGE_SPEED, RETURN, TAKEOFF, WAYPOINT
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.along import fly_along


def test_an_unknown_altitude_of_home_gives_a_warning() -> None:
    assert "written as 0" in planned([box(0, 0, 50, 50)], home=(47.0, 8.0)).warnings[0]


@given(st.lists(st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)), min_size=1, max_size=9))
def test_a_line_is_flown_from_waypoint_to_waypoint(offsets: list[tuple[float, float]]) -> None:
    lon, lat = np.array(offsets).T + np.array([[8.0], [47.0]])
    mission = fly_along(lon, lat, PlanParams(30, speed_m_s=4), (47.0, 8.0, 400.0))
    first, speed, *waypoints, last = mission.items
    assert (first.command, speed.command, last.command) == (TAKEOFF, CHANGE_SPEED, RETURN)
    assert {item.command for item in waypoints} == {WAYPOINT} and mission.speed_m_s == 4
    assert np.allclose([(item.lon, item.lat) for item in waypoints], np.stack([lon, lat], 1), atol=1e-8)
    assert {item.altitude_m for item in (first, *waypoints)} == {30} and mission.notes == ()
