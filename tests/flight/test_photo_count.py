"""Number of photographs: compared with a walk along the flight in short steps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.mission_items import waypoint
from uavseg.flight.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_MISSION,
    RETURN,
    START_CAPTURE,
    STOP_CAPTURE,
    HomePosition,
    MissionItem,
    distance_m,
)
from uavseg.flight.mission import Mission
from uavseg.flight.photo_count import photo_count

HOME = HomePosition(47.0, 8.0, 400.0)


def order(command: int, *params: float) -> MissionItem:
    first, second, third, fourth = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, FRAME_MISSION, (first, second, third, fourth))


LINE_M = distance_m(47.001, 8.0, 47.002, 8.0)


def test_a_line_begins_with_a_photograph_and_has_one_after_each_distance() -> None:
    on, off = order(CAMERA_DISTANCE, LINE_M / 4, 0, 1), order(CAMERA_DISTANCE, 0)
    items = (waypoint(47.001), on, waypoint(47.002), off, waypoint(47.003), order(RETURN))
    assert photo_count(Mission(HOME, items)) == 5
    assert photo_count(Mission(HOME, (items[0], order(CAMERA_DISTANCE, LINE_M / 4), *items[2:]))) == 4


def test_photographs_in_hover_are_counted_one_by_one() -> None:
    photo = order(START_CAPTURE, 0, 0, 1)
    assert photo_count(Mission(HOME, (waypoint(47.001), photo, waypoint(47.002), photo))) == 2
    assert photo_count(Mission(HOME, (waypoint(47.001),))) == 0


def test_photographs_at_equal_times_follow_the_speed() -> None:
    flown = (
        order(CHANGE_SPEED, 1, 10, -1),
        waypoint(47.001),
        order(START_CAPTURE, 0, LINE_M / 10 / 5, 0),
        waypoint(47.002),
        order(STOP_CAPTURE),
        order(RETURN),
    )
    assert photo_count(Mission(HOME, flown)) == 6


@given(
    step_m=st.floats(5, 60),
    lats=st.lists(st.integers(1, 9), min_size=2, max_size=6, unique=True),
    photographed=st.lists(st.booleans(), min_size=6, max_size=6),
)
@settings(max_examples=80, deadline=None)
def test_counts_are_those_of_a_walk_in_short_steps(
    step_m: float, lats: list[int], photographed: list[bool]
) -> None:
    items: list[MissionItem] = []
    expected = 0
    for number, lat in enumerate(lats):
        items.append(waypoint(47 + lat / 1000))
        if number + 1 < len(lats):
            on = photographed[number]
            items.append(order(CAMERA_DISTANCE, step_m if on else 0.0, 0, float(on)))
            leg = distance_m(items[-2].lat, 8.0, 47 + lats[number + 1] / 1000, 8.0)
            walked = np.arange(0, leg, 0.01)
            taken = len(np.unique(walked // step_m)) if on else 0
            expected += taken
    items.append(order(CAMERA_DISTANCE, 0.0))
    assert photo_count(Mission(HOME, tuple(items))) == pytest.approx(expected, abs=1)
