"""Numbers of MAVLink in the code are those of pymavlink's enums."""

from types import ModuleType

import pytest
from pymavlink.dialects.v20 import common

from uavseg.flight.link import link, messages
from uavseg.flight.link.messages import MissionType, Result, result_text
from uavseg.flight.link.transfer import command_name
from uavseg.flight.mission import items

NAMES = {
    items: {
        "WAYPOINT": "MAV_CMD_NAV_WAYPOINT",
        "LOITER": "MAV_CMD_NAV_LOITER_UNLIM",
        "LOITER_TURNS": "MAV_CMD_NAV_LOITER_TURNS",
        "LOITER_TIME": "MAV_CMD_NAV_LOITER_TIME",
        "RETURN": "MAV_CMD_NAV_RETURN_TO_LAUNCH",
        "LAND": "MAV_CMD_NAV_LAND",
        "TAKEOFF": "MAV_CMD_NAV_TAKEOFF",
        "LOITER_TO_ALTITUDE": "MAV_CMD_NAV_LOITER_TO_ALT",
        "SPLINE_WAYPOINT": "MAV_CMD_NAV_SPLINE_WAYPOINT",
        "VTOL_TAKEOFF": "MAV_CMD_NAV_VTOL_TAKEOFF",
        "VTOL_LAND": "MAV_CMD_NAV_VTOL_LAND",
        "JUMP": "MAV_CMD_DO_JUMP",
        "CHANGE_SPEED": "MAV_CMD_DO_CHANGE_SPEED",
        "CAMERA_DISTANCE": "MAV_CMD_DO_SET_CAM_TRIGG_DIST",
        "MOUNT_CONTROL": "MAV_CMD_DO_MOUNT_CONTROL",
        "CAMERA_INTERVAL": "MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL",
        "ROI_LOCATION": "MAV_CMD_DO_SET_ROI_LOCATION",
        "ROI_NONE": "MAV_CMD_DO_SET_ROI_NONE",
        "IMAGE_START": "MAV_CMD_IMAGE_START_CAPTURE",
        "IMAGE_STOP": "MAV_CMD_IMAGE_STOP_CAPTURE",
        "CONDITION_GATE": "MAV_CMD_CONDITION_GATE",
        "LAST_NAV": "MAV_CMD_NAV_LAST",
        "FRAME_AMSL": "MAV_FRAME_GLOBAL",
        "FRAME_MISSION": "MAV_FRAME_MISSION",
        "FRAME_RELATIVE": "MAV_FRAME_GLOBAL_RELATIVE_ALT",
        "FRAME_TERRAIN": "MAV_FRAME_GLOBAL_TERRAIN_ALT",
    },
    messages: {
        "FENCE_RETURN": "MAV_CMD_NAV_FENCE_RETURN_POINT",
        "POLYGON_INCLUSION": "MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION",
        "POLYGON_EXCLUSION": "MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION",
        "CIRCLE_INCLUSION": "MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION",
        "CIRCLE_EXCLUSION": "MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION",
        "RALLY_POINT": "MAV_CMD_NAV_RALLY_POINT",
        "SET_HOME": "MAV_CMD_DO_SET_HOME",
        "LAND_START": "MAV_CMD_DO_LAND_START",
        "ROI_LOCATION": "MAV_CMD_DO_SET_ROI_LOCATION",
        "ROI": "MAV_CMD_DO_SET_ROI",
        "FRAME_AMSL_INT": "MAV_FRAME_GLOBAL_INT",
        "FRAME_RELATIVE_INT": "MAV_FRAME_GLOBAL_RELATIVE_ALT_INT",
        "FRAME_TERRAIN_INT": "MAV_FRAME_GLOBAL_TERRAIN_ALT_INT",
    },
    link: {
        "INVALID_AUTOPILOT": "MAV_AUTOPILOT_INVALID",
        "ARMED": "MAV_MODE_FLAG_SAFETY_ARMED",
        "TRACKER": "MAV_TYPE_ANTENNA_TRACKER",
        "GROUND_STATION": "MAV_TYPE_GCS",
        "COMPANION": "MAV_TYPE_ONBOARD_CONTROLLER",
        "GIMBAL": "MAV_TYPE_GIMBAL",
        "ADSB": "MAV_TYPE_ADSB",
        "CAMERA": "MAV_TYPE_CAMERA",
        "FIRST_COMPONENT": "MAV_COMP_ID_USER1",
    },
}
NEWER = {"MAV_CMD_CONDITION_GATE"}  # than the oldest pymavlink that works
OTHERS = {"MAX_ITEMS", "SYSTEM", "COMPONENTS", "QUICK_REPEATS", "DEGREE_DECIMALS"}  # of no enum


@pytest.mark.parametrize("module", NAMES, ids=lambda module: module.__name__)
def test_numbers_are_those_of_mavlink(module: ModuleType) -> None:
    known = {word: name for word, name in NAMES[module].items() if name not in NEWER or hasattr(common, name)}
    assert {word: getattr(module, word) for word in known} == {
        word: getattr(common, name) for word, name in known.items()
    }


@pytest.mark.parametrize("module", NAMES, ids=lambda module: module.__name__)
def test_every_number_is_compared(module: ModuleType) -> None:
    imported = {word for other in (items, messages) if other is not module for word in vars(other)}
    numbers = {word for word, value in vars(module).items() if word.isupper() and type(value) is int}
    assert numbers - imported - OTHERS <= set(NAMES[module])


def test_autopilots_list_types_and_results_are_those_of_mavlink() -> None:
    for name, number in items.AUTOPILOTS.items():
        enum = {"ardupilot": "ARDUPILOTMEGA"}.get(name, name.upper())
        assert number == getattr(common, f"MAV_AUTOPILOT_{enum}")
    assert {kind.name: int(kind) for kind in MissionType} == {
        kind.name: getattr(common, f"MAV_MISSION_TYPE_{kind.name}") for kind in MissionType
    }
    theirs = {
        number: entry.name.removeprefix("MAV_MISSION_")
        for number, entry in common.enums["MAV_MISSION_RESULT"].items()
        if not entry.name.endswith("ENUM_END")
    }
    assert {int(result): result.name for result in Result} == theirs


def test_every_result_has_words() -> None:
    said = {result_text(result) for result in Result}
    assert len(said) == len(Result) and all("(MAV_MISSION_" in words for words in said)
    assert result_text(99) == "result 99"


def test_commands_have_their_names() -> None:
    assert command_name(18) == "NAV_LOITER_TURNS (18)" and command_name(64999) == "command 64999"
