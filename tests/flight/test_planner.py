"""The planner: complete missions over regions, on the ground and near the antimeridian."""

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from pyproj import Geod

from tests.flight.small_regions import HOME, box, degrees, inside, plan_mission, planned, waypoints
from uavseg.errors import MissionError, ParameterError, UavsegError
from uavseg.flight.cover.lines import LEEWAY
from uavseg.flight.mission.items import CHANGE_SPEED, FRAME_MISSION, FRAME_RELATIVE, RETURN, TAKEOFF, WAYPOINT
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PARAMS_OF, PlanParams

GEOD = Geod(ellps="WGS84")


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
@pytest.mark.parametrize("params", [{}, {"pattern": "perimeter"}, {"pattern": "survey", "spacing_m": 20}])
def test_a_mission_takes_off_at_home_sets_its_speed_and_returns(
    params: dict[str, Any], autopilot: str
) -> None:
    mission = planned([box(100, 100, 80, 60)], autopilot=autopilot, speed_m_s=7.5, **params)
    start, speed, *flight, end = mission.items
    assert (start.command, start.frame, start.lat, start.lon, start.altitude_m) == (
        TAKEOFF,
        FRAME_RELATIVE,
        47,
        8,
        60,
    )
    assert (speed.command, speed.frame, speed.params) == (CHANGE_SPEED, FRAME_MISSION, (1, 7.5, -1, 0))
    assert (end.command, end.frame) == (RETURN, FRAME_MISSION)
    assert {(i.command, i.frame, i.altitude_m, i.params) for i in flight} == {
        (WAYPOINT, FRAME_RELATIVE, 60, (0, 0, 0, None))
    }
    assert mission.autopilot == autopilot
    assert (mission.home.lat, mission.home.lon, mission.home.altitude_m) == HOME


@pytest.mark.slow
@given(st.floats(-80, 80), st.floats(-180, 180), st.floats(0, 180), st.floats(8, 60))
@settings(max_examples=25)
def test_survey_lines_are_evenly_apart_on_the_ground_by_a_spacing_at_most(
    lat: float, lon: float, angle_deg: float, spacing_m: float
) -> None:
    plane = Plane(lat, lon)
    polygon = degrees(shapely.Point(0, 0).buffer(150), plane)
    if polygon.bounds[2] - polygon.bounds[0] > 180:
        return  # cut at the antimeridian first: see below
    params = PlanParams(60, "survey", spacing_m, angle_deg)
    found = np.array(waypoints(plan_mission([polygon], [(lon, lat)], params, (lat, lon, 0.0))))
    x, y = plane.xy_from_lonlat(*found.T)
    azimuth = math.radians(angle_deg)
    across = (x * math.cos(azimuth) - y * math.sin(azimuth)).reshape(-1, 2)
    assert np.allclose(across[:, 0], across[:, 1], atol=0.02)
    steps = np.abs(np.diff(across[:, 0]))
    assert np.allclose(steps, steps[0], atol=0.02)
    assert spacing_m * len(steps) / (len(steps) + 1) - 0.02 <= steps[0] <= 1.01 * spacing_m + 0.02
    assert (np.hypot(x, y) < 150.1 + LEEWAY * spacing_m).all()


def test_a_region_cut_at_the_antimeridian_is_one_region() -> None:
    west, east = shapely.box(179.999, 10, 180, 10.002), shapely.box(-180, 10, -179.999, 10.002)
    params = PlanParams(60, "perimeter")
    mission = plan_mission([shapely.MultiPolygon([west, east])], [(179.9995, 10.001)], params, (10.0, 180.0))
    assert len(waypoints(mission)) == 5
    assert mission.distance_m < 2500


def test_each_part_of_a_region_is_flown() -> None:
    parts = [box(0, 0, 40, 40), box(100, 0, 40, 40)]
    region = shapely.MultiPolygon(parts)
    found = waypoints(plan_mission([region], inside(parts)[:1], PlanParams(60), HOME))
    assert [shapely.covers(part, shapely.points(found)).sum() for part in parts] == [1, 1]
    assert np.isclose(found, inside(parts)[0], atol=1e-8, rtol=0).all(axis=1).any()


def test_two_surveys_are_joined_at_near_ends() -> None:
    mission = planned(
        [box(500, 0, 200, 100), box(0, 0, 200, 100)], pattern="survey", spacing_m=20, angle_deg=90
    )
    xy = np.array(waypoints(mission))
    metres = np.abs(GEOD.inv(*xy[:-1].T, *xy[1:].T)[2])
    assert len(xy) == 20
    assert np.sort(metres)[-1] == pytest.approx(300, abs=25)


@pytest.mark.parametrize(
    ("polygons", "home", "words"),
    [
        ([], HOME, "no region"),
        ([box(0, 0, 50, 50)], (8.0, 47.0), "look swapped"),
        ([box(0, 0, 50, 50)], (46.0, 8.0), "111 km"),
        ([box(0, 0, 50, 50)], (math.nan, 8.0), "finite"),
        ([box(0, 0, 50, 50)], (47.0, 200.0), "-180..180"),
        ([box(0, 0, 50, 50), shapely.box(10, 47, 10.01, 47.01)], HOME, "153 km from home"),
        ([shapely.box(7, 46, 9, 48)], HOME, "from home"),
        ([shapely.box(500000, 5200000, 500100, 5200100)], HOME, "-90..90"),
    ],
)
def test_regions_that_are_not_near_home_are_refused(polygons: Any, home: Any, words: str) -> None:
    with pytest.raises(MissionError, match=words):
        planned(polygons, home)


def test_a_survey_with_too_many_items_is_refused() -> None:
    with pytest.raises(MissionError, match="wider spacing"):
        planned([box(0, 0, 9000, 9000)], pattern="survey", spacing_m=0.2)


@pytest.mark.slow
def test_a_region_that_touches_itself_is_flown() -> None:
    pinched = shapely.Polygon([(0, 0), (60, 0), (30, 30), (60, 60), (0, 60), (30, 30)])
    assert not pinched.is_valid
    mission = plan_mission([degrees(pinched)], [(8.0, 47.0)], PlanParams(60, "survey", 5), HOME)
    assert len(waypoints(mission)) > 10


def test_errors_descend_from_those_of_users() -> None:
    assert issubclass(MissionError, UavsegError) and issubclass(ParameterError, ValueError)


@pytest.mark.parametrize("pattern", ["survey", "corridor", "perimeter"])
def test_a_margin_of_next_to_nothing_is_none(pattern: str) -> None:
    spacing = {} if pattern == "perimeter" else {"spacing_m": 20.0}
    tiny, none = (
        planned([box(0, 0, 200, 100)], pattern=pattern, how=PARAMS_OF[pattern](metres), **spacing)
        for metres in (1e-320, 0.0)
    )
    assert tiny == none
