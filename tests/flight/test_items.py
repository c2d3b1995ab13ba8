"""Mission items and home: positions on Earth, heights, frames, parameters."""

import math
from typing import Any

import pytest

from tests.flight.mission_items import waypoint
from uavseg.errors import MissionError
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CAMERA_INTERVAL,
    CHANGE_SPEED,
    FRAME_MISSION,
    FRAME_RELATIVE,
    IMAGE_START,
    LAND,
    HomePosition,
    MissionItem,
)


@pytest.mark.parametrize(
    ("lat", "lon", "words"),
    [
        (math.nan, 8, "finite"),
        (47, math.inf, "finite"),
        (90.001, 8, "-90..90"),
        (-91, 8, "-90..90"),
        (47, 180.5, "-180..180"),
        (122.3, 49.4, "swapped"),
    ],
)
def test_a_position_that_is_not_on_earth_is_refused(lat: float, lon: float, words: str) -> None:
    with pytest.raises(MissionError, match=words):
        HomePosition(lat, lon)
    with pytest.raises(MissionError, match=words):
        waypoint(lat, lon)


@pytest.mark.parametrize("altitude_m", [-1.0, 0.0, 1000.5, math.nan, math.inf])
def test_an_altitude_at_the_ground_or_absurd_is_refused(altitude_m: float) -> None:
    with pytest.raises(MissionError, match="altitude"):
        waypoint(altitude_m=altitude_m)


def test_a_landing_may_be_at_the_ground() -> None:
    assert MissionItem(LAND, FRAME_RELATIVE, lat=47.0, lon=8.0).altitude_m == 0


@pytest.mark.parametrize("altitude_m", [-501.0, 9001.0, math.nan])
def test_home_is_on_the_ground_of_the_earth(altitude_m: float) -> None:
    with pytest.raises(MissionError, match="above the sea"):
        HomePosition(47, 8, altitude_m)


def test_a_position_needs_a_frame_of_positions() -> None:
    with pytest.raises(MissionError, match="frame 3"):
        waypoint(frame=FRAME_MISSION)


@pytest.mark.parametrize("params", [(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0), (0.0, math.inf, 0.0, 0.0)])
def test_parameters_are_four_finite_numbers(params: Any) -> None:
    with pytest.raises(MissionError, match="four parameters"):
        waypoint(params=params)


@pytest.mark.parametrize(
    ("command", "params"),
    [
        (CAMERA_DISTANCE, (1e-320, 0.0, 1.0, 0.0)),
        (CAMERA_DISTANCE, (0.009, 0.0, 0.0, 0.0)),
        (CAMERA_INTERVAL, (9.0, 0.0, 0.0, 0.0)),  # milliseconds
        (IMAGE_START, (0.0, 1e-300, 0.0, 0.0)),
    ],
)
def test_photographs_nearer_to_one_another_than_any_camera_takes_are_refused(
    command: int, params: tuple[float, float, float, float]
) -> None:
    with pytest.raises(MissionError, match=r"takes a photograph every .*; expected 0.01 (m|s) at least"):
        MissionItem(command, FRAME_MISSION, params)


def test_no_photographs_and_one_photograph_have_no_step() -> None:
    for command in (CAMERA_DISTANCE, CAMERA_INTERVAL, IMAGE_START):
        MissionItem(command, FRAME_MISSION)
        MissionItem(command, FRAME_MISSION, (-1.0, 0.0, 0.0, 0.0))
    MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 1e-9, 1.0, 0.0))
    MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (0.01, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("speed", [1e-320, 0.0099])
def test_a_speed_at_which_nothing_arrives_is_refused(speed: float) -> None:
    with pytest.raises(MissionError, match=r"sets a speed of .* m/s; expected 0.01 m/s at least"):
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, speed, -1.0, 0.0))


@pytest.mark.parametrize("speed", [-2.0, -1.0, 0.0, 0.01, 12.0])
def test_a_speed_that_stays_and_a_slow_one_are_taken(speed: float) -> None:
    MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, speed, -1.0, 0.0))
