"""What a vehicle holds against what was sent: what is an error, what is rounded, what does not matter."""

import re
from dataclasses import replace
from typing import Any

import pytest

from tests.flight.link.link_missions import FENCE, RALLY, survey
from uavseg.flight.link.compare import differences, rounded
from uavseg.flight.link.link_items import LinkItem, items_of_fence, items_of_mission, items_of_rally
from uavseg.flight.link.results import Kind

SENT = items_of_mission(survey(), True)  # home, takeoff, speed, waypoint, ...


def kept(number: int, **changes: Any) -> list[LinkItem]:
    return [*SENT[:number], replace(SENT[number], **changes), *SENT[number + 1 :]]


@pytest.mark.parametrize(
    ("number", "changes", "words"),
    [
        (3, {"command": 17}, "item 3: command 17 instead of 16"),
        (3, {"x": SENT[3].x + 2}, r"item 3: position 47\.0000002,8\.0000000 instead of 47\.0000000"),
        (3, {"y": SENT[3].y - 2}, "position"),
        (3, {"z": 40.03}, r"altitude 40\.03 m instead of 40 m"),
        (3, {"frame": 0}, "frame 0 instead of 3"),
        (2, {"params": (1.0, 7.2, -1.0, 0.0)}, r"parameter 2 is 7\.2 instead of 7\.1"),
        (7, {"params": (0.0, 0.0, 1.0, 0.0)}, r"parameter 1 is 0 instead of 12\.5"),
    ],
)
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
def test_what_would_fly_otherwise_is_an_error(
    number: int, changes: dict[str, Any], words: str, autopilot: str
) -> None:
    [found] = differences(SENT, kept(number, **changes), Kind.MISSION, autopilot)
    assert re.search(words, found)


@pytest.mark.parametrize(
    ("number", "changes"),
    [
        (0, {"x": 1, "y": 2, "z": 3.0}),  # home
        (3, {"x": SENT[3].x + 1, "z": SENT[3].z - 0.015}),
        (3, {"params": (2.0, 0.0, 0.0, 0.0)}),
        (2, {"frame": 0, "params": (1.0, 7.1000001, 0.0, 9.0)}),
    ],
)
def test_what_ardupilot_replaces_or_rounds_is_none(number: int, changes: dict[str, Any]) -> None:
    assert not differences(SENT, kept(number, **changes), Kind.MISSION, "ardupilot")


def test_a_generic_vehicle_keeps_all_parameters() -> None:
    assert differences(SENT, kept(3, params=(0.0, 0.0, 1.0, None)), Kind.MISSION, "generic")
    assert not rounded(SENT, kept(3, params=(0.0, 0.0, 1.0, None)), Kind.MISSION, "generic")


def test_the_number_of_items_is_compared_first() -> None:
    assert differences(SENT, SENT[:-1], Kind.MISSION, "px4") == ["it holds 12 items instead of 13"]


def test_a_parameter_that_is_not_set_may_come_back_as_anything() -> None:
    assert not rounded(SENT, kept(3, params=(0.0, 0.0, 0.0, 77.0)), Kind.MISSION, "ardupilot")
    assert rounded(SENT, kept(3, params=(1.0, 0.0, 0.0, None)), Kind.MISSION, "ardupilot") == [
        "the vehicle keeps parameter 1 of command 16 as 1 instead of 0"
    ]


def test_a_fence_is_compared_by_position_and_size() -> None:
    sent = items_of_fence(FENCE)
    assert not differences(sent, [replace(one, frame=3, z=5.0) for one in sent], Kind.FENCE, "px4")
    for changes in ({"params": (5.0, 0.0, 0.0, 0.0)}, {"x": 1}, {"command": 5002}):
        assert differences(sent, [replace(sent[0], **changes), *sent[1:]], Kind.FENCE, "ardupilot")


def test_rally_points_may_lose_the_decimals_of_their_altitude() -> None:
    sent = items_of_rally(RALLY)
    assert not differences(sent, [replace(sent[0], z=sent[0].z - 0.9), sent[1]], Kind.RALLY, "ardupilot")
    assert differences(sent, [replace(sent[0], z=sent[0].z - 1.1), sent[1]], Kind.RALLY, "ardupilot")
