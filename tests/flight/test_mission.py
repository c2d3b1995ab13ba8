"""Missions: safety checks, length, duration, warnings."""

import math

import pytest

from tests.flight.mission_items import waypoint
from uavseg.errors import MissionError
from uavseg.flight.mission.items import (
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    RETURN,
    TAKEOFF,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import CRUISE_M_S, Mission
from uavseg.flight.mission.vehicle import ARDUCOPTER

HOME = HomePosition(47.0, 8.0, 400.0)


UP = MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), 47.0, 8.0, 50.0)


BACK = MissionItem(RETURN, FRAME_MISSION)


PLACE = MissionItem(94, FRAME_RELATIVE, lat=47.0, lon=8.0, altitude_m=20.0)  # a command that is not known


@pytest.mark.parametrize("items", [(UP,), (UP, BACK), (UP, PLACE, BACK)])
def test_a_mission_may_only_take_off(items: tuple[MissionItem, ...]) -> None:
    mission = Mission(HOME, items)
    assert mission.speed_range_m_s == (CRUISE_M_S, CRUISE_M_S) and mission.duration_s > 20


@pytest.mark.parametrize("items", [(), (BACK,), (PLACE, BACK)])
def test_a_mission_without_a_position_to_fly_to_is_refused(items: tuple[MissionItem, ...]) -> None:
    with pytest.raises(MissionError, match="has none"):
        Mission(HOME, items)


def test_more_items_than_a_link_counts_are_refused_and_many_give_a_warning() -> None:
    assert not Mission(HOME, (waypoint(),) * 650).warnings
    assert "651 items" in Mission(HOME, (waypoint(),) * 651).warnings[0]
    for autopilot in ("px4", "generic"):
        assert "501 items" in Mission(HOME, (waypoint(),) * 501, autopilot).warnings[0]
    with pytest.raises(MissionError, match="65534"):
        Mission(HOME, (waypoint(),) * 65535)


def test_a_home_far_from_the_first_waypoint_is_refused_with_the_distance() -> None:
    Mission(HOME, (UP, waypoint(47.17)))
    with pytest.raises(MissionError, match=r"22 km .* latitude first"):
        Mission(HOME, (UP, waypoint(47.2)))
    with pytest.raises(MissionError, match="look swapped"):
        Mission(HomePosition(8.0, 47.0), (waypoint(),))


def test_a_waypoint_far_from_home_is_refused_wherever_it_comes() -> None:
    with pytest.raises(MissionError, match="111 km from home"):
        Mission(HOME, (UP, waypoint(), waypoint(48.0)))


def test_heights_above_the_sea_are_checked_relative_to_home() -> None:
    Mission(HOME, (waypoint(frame=FRAME_AMSL, altitude_m=1300.0),))
    with pytest.raises(MissionError, match="1100 m above home"):
        Mission(HOME, (waypoint(frame=FRAME_AMSL, altitude_m=1500.0),))


@pytest.mark.parametrize(
    ("item", "autopilot"),
    [
        (waypoint(frame=FRAME_TERRAIN), "px4"),
        (waypoint(command=18), "px4"),
        (MissionItem(RETURN, FRAME_RELATIVE), "px4"),
        (MissionItem(CHANGE_SPEED, FRAME_RELATIVE, (1.0, 5.0, -1.0, 0.0)), "px4"),
        (waypoint(params=(None, 0.0, 0.0, 0.0)), "ardupilot"),
        (MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 5.0, None, 0.0)), "ardupilot"),
        (MissionItem(214, FRAME_MISSION), "ardupilot"),
    ],
)
def test_items_that_one_autopilot_refuses_are_for_the_other_alone(item: MissionItem, autopilot: str) -> None:
    for name in (autopilot, "generic"):
        with pytest.raises(MissionError, match=r"PX4|ArduPilot"):
            Mission(HOME, (waypoint(), item), name)
    Mission(HOME, (waypoint(), item), "px4" if autopilot == "ardupilot" else "ardupilot")


def test_an_unknown_autopilot_is_refused() -> None:
    with pytest.raises(MissionError, match="betaflight"):
        Mission(HOME, (waypoint(),), "betaflight")


def test_distance_and_time_include_the_return() -> None:
    mission = Mission(
        HOME, (UP, MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 10.0, -1.0, 0.0)), waypoint(47.01), BACK)
    )
    twice = math.radians(94.01)  # a degree of latitude after the series of the ellipsoid
    north = (111132.954 - 559.822 * math.cos(twice) + 1.175 * math.cos(2 * twice)) / 100
    assert mission.speed_m_s == 10
    assert mission.distance_m == pytest.approx(2 * north, rel=1e-5)
    at_limits_s = 50 / 2.5 + 2 * north / 10 + 40 / 1.5 + 10 / 0.5 + 5  # the last 10 m slowly, 5 s above home
    at_limits_s += ARDUCOPTER.start_s + ARDUCOPTER.stop_s
    assert at_limits_s < mission.duration_s < at_limits_s + 20


def test_without_return_nothing_is_flown_after_the_last_item() -> None:
    assert Mission(HOME, (UP, waypoint())).distance_m * 2 == pytest.approx(
        Mission(HOME, (UP, waypoint(), BACK)).distance_m
    )


def test_a_takeoff_at_zero_is_where_the_vehicle_is() -> None:
    here = MissionItem(TAKEOFF, FRAME_RELATIVE, altitude_m=50.0)
    assert Mission(HOME, (here, waypoint())).distance_m == Mission(HOME, (UP, waypoint())).distance_m


def test_high_and_long_flights_give_warnings() -> None:
    high = Mission(HOME, (waypoint(altitude_m=121.0),), notes=("mind the wind",))
    assert high.warnings[0] == "mind the wind" and "121 m" in high.warnings[1]
    long = Mission(HOME, (waypoint(47.0), waypoint(47.1), BACK))
    assert "min in the air" in long.warnings[-1]


def test_names_and_notes_do_not_make_missions_differ() -> None:
    assert Mission(HOME, (waypoint(),), name="a", notes=("b",)) == Mission(HOME, (waypoint(),))
