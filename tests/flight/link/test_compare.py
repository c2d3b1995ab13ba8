"""What a vehicle holds against what was sent: what is an error, what is rounded, what does not matter."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from tests.flight.link.link_missions import FENCE, RALLY, survey
from uavseg.flight.link.messages import (
    LinkItem,
    MissionType,
    items_of_fence,
    items_of_mission,
    items_of_rally,
)
from uavseg.flight.link.missions import differences, rounded

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
        (3, {"params": (99.0, 0.0, 0.0, None)}, "parameter 1 is 99 instead of 0"),
        (3, {"params": (0.0, 0.0, 0.0, 77.0)}, "parameter 4 is 77 instead of nan"),
        (3, {"autocontinue": 0}, "item 3: autocontinue is 0 instead of 1"),
    ],
)
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
def test_what_would_fly_otherwise_is_an_error(
    number: int, changes: dict[str, Any], words: str, autopilot: str
) -> None:
    [found] = differences(SENT, kept(number, **changes), MissionType.MISSION, autopilot)
    assert re.search(words, found)


@pytest.mark.parametrize(
    ("number", "changes"),
    [
        (0, {"x": 1, "y": 2, "z": 3.0}),  # home
        (3, {"x": SENT[3].x + 1, "z": SENT[3].z - 0.015}),
        (3, {"params": (0.0, 0.0, 0.0, 0.0)}),
        (2, {"frame": 0, "params": (1.0, 7.1000001, 0.0, 0.0)}),
    ],
)
def test_what_ardupilot_replaces_or_rounds_is_none(number: int, changes: dict[str, Any]) -> None:
    assert not differences(SENT, kept(number, **changes), MissionType.MISSION, "ardupilot")


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
def test_only_ardupilot_may_go_on_where_it_was_to_wait(autopilot: str) -> None:
    waiting = [*SENT[:3], replace(SENT[3], autocontinue=0), *SENT[4:]]
    assert not differences(waiting, waiting, MissionType.MISSION, autopilot)
    found = differences(waiting, SENT, MissionType.MISSION, autopilot)
    assert found == ([] if autopilot == "ardupilot" else ["item 3: autocontinue is 1 instead of 0"])


def test_a_generic_vehicle_keeps_all_parameters() -> None:
    assert differences(SENT, kept(3, params=(0.0, 0.0, 1.0, None)), MissionType.MISSION, "generic")


def test_the_number_of_items_is_compared_first() -> None:
    assert differences(SENT, SENT[:-1], MissionType.MISSION, "px4") == ["it holds 12 items instead of 13"]


NAN, INF = math.nan, math.inf
STATED = LinkItem(16, 3, (5.0, 1.0, 0.0, 90.0), 470000000, 80000000, 50.0)
COUNTED = LinkItem(178, 2, (1.0, 5.0, -1.0, 0.0))
LISTS = {
    MissionType.MISSION: [STATED, STATED, COUNTED],
    MissionType.FENCE: items_of_fence(FENCE),
    MissionType.RALLY: items_of_rally(RALLY),
}


@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize("field", ["param1", "param2", "param3", "param4", "z"])
@pytest.mark.parametrize("kind", list(MissionType))
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
def test_a_number_that_is_not_finite_is_a_difference(
    value: float, field: str, kind: MissionType, autopilot: str
) -> None:
    for number in range(1, len(LISTS[kind])):
        message = SimpleNamespace(
            **{f"param{n}": p for n, p in enumerate(LISTS[kind][number].params, start=1)},
            **{name: getattr(LISTS[kind][number], name) for name in ("command", "frame", "x", "y", "z")},
            autocontinue=1,
        )
        setattr(message, field, value)
        held = [*LISTS[kind][:number], LinkItem.of_message(message), *LISTS[kind][number + 1 :]]
        [found] = differences(LISTS[kind], held, kind, autopilot)
        assert found.startswith(f"item {number}: ") and f"{value:g}" in found


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
def test_infinity_and_nan_equal_nothing_but_nan(autopilot: str) -> None:
    unset = replace(STATED, params=(0.0, 0.0, 0.0, None))
    for value in (INF, -INF):
        held = [unset, replace(unset, params=(0.0, 0.0, 0.0, value))]
        assert differences([unset, unset], held, MissionType.MISSION, autopilot)
    assert not differences([unset, unset], [unset, unset], MissionType.MISSION, autopilot)


MADE = [  # autopilot, command, parameter, sent, kept, whether that is known of the autopilot
    ("ardupilot", 16, 1, 2.7, 2.0, True),
    ("ardupilot", 16, 1, 2.7, 3.0, False),
    ("ardupilot", 16, 1, 5.0, 0.0, True),  # ArduPlane stores no hold
    ("ardupilot", 16, 4, 90.0, 0.0, True),
    ("ardupilot", 16, 4, None, 0.0, True),
    ("ardupilot", 16, 4, 0.0, None, False),
    ("ardupilot", 18, 1, 0.4, 0.3984375, True),
    ("ardupilot", 18, 1, 3.0, 0.0, False),
    ("ardupilot", 18, 1, 300.0, 255.0, True),
    ("ardupilot", 18, 3, 307.5, 300.0, True),
    ("ardupilot", 18, 3, -307.5, -300.0, True),
    ("ardupilot", 18, 3, -307.5, 300.0, False),
    ("ardupilot", 18, 3, 20.0, 30.0, False),
    ("ardupilot", 19, 3, -25.0, -1.0, True),
    ("ardupilot", 19, 1, 12.0, 0.0, False),
    ("ardupilot", 19, 4, 90.0, 1.0, True),
    ("ardupilot", 21, 4, None, 1.0, True),
    ("ardupilot", 16, 4, None, 1.0, False),
    ("px4", 16, 1, 2.7, 2.0, False),
    ("px4", 16, 1, 5.0, 0.0, False),
    ("px4", 16, 3, 5.0, 0.0, True),
    ("px4", 16, 4, -90.0, 270.0, True),
    ("px4", 16, 4, 90.0, 0.0, False),
    ("px4", 16, 4, None, 0.0, False),
    ("px4", 19, 4, 90.0, 1.0, True),
    ("px4", 21, 2, 1.5, 1.0, True),
    ("generic", 16, 4, None, 0.0, True),
    ("generic", 16, 1, 2.7, 2.0, False),
    ("generic", 16, 4, 0.0, None, False),
]


@pytest.mark.parametrize(("autopilot", "command", "n", "value", "known", "is_known"), MADE)
def test_only_what_an_autopilot_is_known_to_make_of_a_parameter_is_no_difference(
    autopilot: str, command: int, n: int, value: float | None, known: float | None, is_known: bool
) -> None:
    def item(number: float | None) -> LinkItem:
        params = [0.0] * 4
        params[n - 1] = number  # type: ignore[call-overload]
        return replace(STATED, command=command, params=tuple(params))

    sent, held = [STATED, item(value)], [STATED, item(known)]
    assert (not differences(sent, held, MissionType.MISSION, autopilot)) == is_known
    if is_known and (value is not None or autopilot == "generic"):
        [told] = rounded(sent, held, MissionType.MISSION, autopilot)
        assert told.startswith(f"the vehicle keeps parameter {n} of command {command} as ")


def test_the_height_of_what_is_looked_at_is_compared() -> None:
    point = LinkItem(195, 3, x=470000000, y=80000000, z=12.0)
    assert differences([STATED, point], [STATED, replace(point, z=40.0)], MissionType.MISSION, "ardupilot")
    assert differences([STATED, point], [STATED, replace(point, frame=0)], MissionType.MISSION, "ardupilot")


def test_a_fence_is_compared_by_position_and_size() -> None:
    sent = items_of_fence(FENCE)
    assert not differences(sent, [replace(one, frame=3, z=5.0) for one in sent], MissionType.FENCE, "px4")
    for changes in ({"params": (5.0, 0.0, 0.0, 0.0)}, {"x": 1}, {"command": 5002}):
        assert differences(sent, [replace(sent[0], **changes), *sent[1:]], MissionType.FENCE, "ardupilot")


def test_rally_points_may_lose_the_decimals_of_their_altitude() -> None:
    sent = items_of_rally(RALLY)
    assert not differences(
        sent, [replace(sent[0], z=sent[0].z - 0.9), sent[1]], MissionType.RALLY, "ardupilot"
    )
    assert differences(sent, [replace(sent[0], z=sent[0].z - 1.1), sent[1]], MissionType.RALLY, "ardupilot")
