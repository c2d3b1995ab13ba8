"""Estimates of missions: length, times, photographs, ground they show, energy."""

import math
from dataclasses import replace

import pytest

from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.mission.estimate import estimate, flown_path, landing_seconds
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CAMERA_INTERVAL,
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    LAND,
    LOITER,
    LOITER_TIME,
    LOITER_TURNS,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Ground, Mission
from uavseg.flight.mission.vehicle import ARDUCOPTER, PX4

HOME = HomePosition(47.0, 8.0, 400.0)
METRE = 1 / 111_177.5  # degrees of latitude at 47 degrees
UP = MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), 47.0, 8.0, 40.0)
BACK = MissionItem(RETURN, FRAME_MISSION)
PHOTOS = Photos(Camera("test", (13.2, 8.8), (5472, 3648), 8.8), Overlap(50, 50))


def north(metres: float, hold_s: float = 0.0, command: int = WAYPOINT, height_m: float = 40.0) -> MissionItem:
    place = (47.0 + metres * METRE, 8.0, height_m)
    heading = None if command in {WAYPOINT, LOITER, LAND} else 0.0
    return MissionItem(command, FRAME_RELATIVE, (hold_s, 0.0, 0.0, heading), *place)


def every(metres: float, at_once: bool = False) -> MissionItem:
    return MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (metres, 0.0, float(at_once), 0.0))


def fly(*items: MissionItem, autopilot: str = "ardupilot") -> Mission:
    return Mission(HOME, (UP, *items), autopilot)


def test_the_parts_add_up_and_the_length_is_that_of_the_mission() -> None:
    mission = fly(north(300), north(900, 7.0), BACK)
    found = estimate(mission)
    parts = (found.climb_s, found.flight_s, found.hold_s, found.return_s, found.landing_s)
    assert found.duration_s == pytest.approx(sum(parts)) and min(parts) > 0
    assert found.distance_m == pytest.approx(mission.distance_m, rel=1e-5) == pytest.approx(1800, rel=1e-4)
    assert found.climb_s > 40 / 2.5 and found.flight_s > 900 / 5 and found.hold_s == 7
    assert found.return_s > 900 / 10 + 5
    assert mission.duration_s == found.duration_s == mission.estimate.duration_s


def test_px4_returns_higher_and_slower() -> None:
    path = flown_path(fly(north(300), BACK, autopilot="px4"), PX4)
    assert path.xyz_m[:, 2].tolist() == [0, 40, 40, 60, 60]
    assert path.landing_s - PX4.stop_s == landing_seconds(60, PX4) == 53 / 1.5 + 7 / 0.7
    near = flown_path(fly(north(45), BACK, autopilot="px4"), PX4)
    assert near.xyz_m[-1, 2] == pytest.approx(45, rel=1e-3)  # within the cone
    assert flown_path(fly(north(300), BACK), ARDUCOPTER).xyz_m[:, 2].tolist() == [0, 40, 40, 40]


def test_holds_turns_and_landings() -> None:
    held = estimate(fly(north(100, 30.0, LOITER_TIME), north(100, 2.0), BACK))
    assert held.hold_s == 32
    turns = estimate(fly(replace(north(100, command=LOITER_TURNS), params=(3.0, 0.0, -20.0, 0.0)), BACK))
    assert turns.hold_s == pytest.approx(3 * 2 * math.pi * 20 / 5)
    landed = estimate(fly(north(100), north(150, command=LAND, height_m=0.0)))
    assert landed.return_s == 0 and landed.landing_s == 30 / 1.5 + 10 / 0.5 + ARDUCOPTER.stop_s
    assert landed.distance_m == pytest.approx(150, rel=1e-3)
    there = estimate(fly(north(100), north(150)))
    assert there.landing_s == there.return_s == 0
    assert estimate(fly(north(100), north(100, command=LOITER), north(9000), BACK)).distance_m < 101


def test_each_leg_has_the_speed_that_was_set_before_it() -> None:
    faster = MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 10.0, -1.0, 0.0))
    climb = MissionItem(CHANGE_SPEED, FRAME_MISSION, (2.0, 1.0, -1.0, 0.0))
    slow, fast = estimate(fly(north(2000), BACK)), estimate(fly(faster, climb, north(2000), BACK))
    assert fast.flight_s < 0.53 * slow.flight_s and fast.return_s == slow.return_s
    both = estimate(fly(north(1000), faster, north(2000), BACK))
    assert both.flight_s == pytest.approx((slow.flight_s + fast.flight_s) / 2, rel=0.02)


def test_heights_above_the_sea_are_above_home() -> None:
    item = replace(north(100), frame=FRAME_AMSL, altitude_m=460.0)
    assert flown_path(fly(item), ARDUCOPTER).xyz_m[-1, 2] == 60


def test_photographs_are_counted_from_line_to_line() -> None:
    line = (north(0.001), every(20, True), north(100.01), every(0), north(300))
    path = flown_path(fly(*line, BACK), ARDUCOPTER)
    assert path.photographs.sum() == 6 and path.photographs[2] == 6  # at 0, 20, ... 100 m of the third leg
    assert estimate(fly(*line, BACK)).photographs == 6
    bent = estimate(fly(north(0.001), every(30), north(50), north(100.01), every(0), BACK))
    assert bent.photographs == 3  # at 30, 60 and 90 m
    assert estimate(fly(north(500), BACK)).photographs == 0


def test_photographs_by_time_include_holds() -> None:
    timed = MissionItem(CAMERA_INTERVAL, FRAME_MISSION, (2000.0, 0.0, 0.0, 0.0))
    still = estimate(fly(north(100), timed, north(200), BACK, autopilot="px4")).photographs
    held = estimate(fly(north(100), timed, north(200, 60.0), BACK, autopilot="px4")).photographs
    assert still == pytest.approx(100 / 5 / 2, abs=3) and held == pytest.approx(still + 30, abs=2)


def test_ground_is_that_of_the_footprints() -> None:
    line = (north(0.001), every(20, True), north(100), every(0))
    found = estimate(fly(*line, BACK), photos=PHOTOS)
    across, along = 60.0, 40.0  # 40 m times 13.2 / 8.8, and 8.8 / 8.8
    assert found.photographed_m2 == pytest.approx(across * (100 + along), rel=1e-3)
    assert found.gsd_m == pytest.approx(60 / 5472)
    assert found.footprint_m == pytest.approx((across, along))
    assert found.as_dict()["footprint_m"] == [across, along]
    again = (*line, north(0.002), every(20, True), north(100), every(0))
    assert estimate(fly(*again, BACK), photos=PHOTOS).photographed_m2 == pytest.approx(
        found.photographed_m2, rel=1e-3
    )
    assert estimate(fly(*line, BACK)).gsd_m is None and estimate(fly(*line, BACK)).footprint_m is None
    assert estimate(fly(north(100), BACK), photos=PHOTOS).photographed_m2 is None
    carried = replace(fly(*line, BACK), photos=PHOTOS)
    assert carried.estimate == found and carried == fly(*line, BACK)


def test_energy_is_power_times_time() -> None:
    strong = replace(ARDUCOPTER, hover_w=200.0, cruise_w=100.0, battery_wh=50.0)
    mission = fly(north(300), BACK)
    found = estimate(mission, strong)
    moving = found.flight_s + found.return_s - ARDUCOPTER.return_hold_s
    expected = (100 * moving + 200 * (found.duration_s - moving)) / 3600
    assert found.energy_wh == pytest.approx(expected) and found.battery == pytest.approx(expected / 50)
    assert estimate(mission).energy_wh is None and estimate(mission).battery is None
    weak = replace(strong, battery_wh=found.energy_wh)
    assert "100 % of a battery" in replace(mission, vehicle=weak).warnings[-1]
    assert not replace(mission, vehicle=strong).warnings


def test_as_json_what_is_not_known_is_null() -> None:
    written = estimate(fly(north(300), BACK)).as_dict()
    assert written["battery"] is None and written["photographs"] == 0
    assert written["distance_m"] == pytest.approx(600, abs=0.1)


def test_heights_are_above_the_ground_where_it_is_known() -> None:
    line = (north(0.001), every(20, True), north(100), every(0))
    flat = fly(*line, BACK)
    below = {(HOME.lat, HOME.lon): 400.0} | {
        (item.lat, item.lon): 410.0 for item in line if item.command == WAYPOINT
    }
    hill = replace(flat, ground=Ground(below, 30.0, 30.0))
    known = [estimate(mission, photos=PHOTOS).gsd_m for mission in (flat, hill)]
    assert known == pytest.approx([60 / 5472, 45 / 5472])  # 40 and 30 m above the ground
