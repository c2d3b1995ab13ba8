"""Rules of ground stations: MAVSDK itself agrees, and the others are those of their loaders."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.flight.formats.mission_texts import plan_text, waypoints_text
from tests.flight.formats.test_kmz import SURVEY
from tests.flight.formats.test_survey_items import planned, shapely
from uavseg.errors import MissionError
from uavseg.flight.formats.files import MAVSDK, MISSION_PLANNER, QGC, read_mission, station_refusals

SIMPLE = plan_text(SURVEY)
EDITABLE = plan_text(planned(shapely.box(20, 20, 320, 220)), editable=True)


def changed(change: Callable[[dict[str, Any]], object], text: str = SIMPLE) -> str:
    plan = json.loads(text)
    change(plan)
    return json.dumps(plan)


@pytest.mark.parametrize(
    ("text", "refusing"),
    [
        (SIMPLE, set()),
        (EDITABLE, {MISSION_PLANNER}),
        (changed(lambda plan: plan.pop("geoFence")), {QGC, MAVSDK}),
        (changed(lambda plan: plan.pop("rallyPoints")), {QGC, MAVSDK}),
        (changed(lambda plan: plan.pop("groundStation")), {QGC}),
        (changed(lambda plan: plan.update(version=1.0)), {MAVSDK}),
        (changed(lambda plan: plan["geoFence"].update(version=1)), {MAVSDK}),
        (changed(lambda plan: plan["mission"].update(hoverSpeed=7.5)), {MISSION_PLANNER}),
        (changed(lambda plan: plan["mission"]["plannedHomePosition"].pop()), {QGC, MAVSDK}),
        (changed(lambda plan: plan["mission"]["items"][0].pop("autoContinue")), {QGC, MAVSDK}),
        (changed(lambda plan: plan["mission"]["items"][0]["params"].append(0)), {QGC}),
    ],
)
def test_who_refuses_a_plan(text: str, refusing: set[str], mavsdk_reader: Any, tmp_path: Path) -> None:
    found = station_refusals(text.encode(), ".plan")
    assert {who for who, reason in found.items() if reason} == refusing
    path = tmp_path / "odd.plan"
    path.write_text(text)
    if len(json.loads(text)["mission"]["plannedHomePosition"]) != 3:
        return  # MAVSDK reads home for ArduPilot alone, and this reader is connected to another
    if MAVSDK in refusing:
        with pytest.raises(Exception, match=r"."):
            mavsdk_reader.import_qgroundcontrol_mission(str(path))
    else:
        assert mavsdk_reader.import_qgroundcontrol_mission(str(path)).mission_items


@pytest.mark.parametrize("value", ["a", [1], 3])
@pytest.mark.parametrize("key", ["TransectStyleComplexItem", "CameraCalc"])
def test_a_member_of_a_wrong_type_is_a_refusal(key: str, value: object) -> None:
    def change(plan: dict[str, Any]) -> None:
        survey = next(item for item in plan["mission"]["items"] if item["type"] != "SimpleItem")
        holder = survey if key in survey else survey["TransectStyleComplexItem"]
        holder[key] = value
        survey["angle"] = 0

    found = station_refusals(changed(change, EDITABLE).encode(), ".plan")
    assert found[MISSION_PLANNER] == "a value in it is of a wrong kind"


ROWS = waypoints_text(SURVEY)


@pytest.mark.parametrize(
    ("text", "refusing"),
    [
        (ROWS, set()),
        (ROWS.replace("\n", "\r\n"), {MAVSDK}),
        (ROWS + "\n", {QGC}),
        (ROWS + "# end\n", {QGC}),
        (ROWS.replace("\t1\n", " 1\n"), {QGC, MAVSDK}),
    ],
)
def test_who_refuses_waypoints(text: str, refusing: set[str], mavsdk_reader: Any, tmp_path: Path) -> None:
    found = station_refusals(text.encode(), ".waypoints")
    assert {who for who, reason in found.items() if reason} == refusing
    path = tmp_path / "odd.waypoints"
    path.write_bytes(text.encode())
    if MAVSDK in refusing:
        with pytest.raises(Exception, match=r"."):
            mavsdk_reader.import_mission_planner_mission(str(path))
    else:
        assert mavsdk_reader.import_mission_planner_mission(str(path)).mission_items


def test_other_formats_are_not_loaded_by_these_programs() -> None:
    assert station_refusals(b"", ".kmz") == {}


@pytest.mark.parametrize("value", [0.0, [], "", False])
def test_a_fence_that_is_no_object_is_not_read(value: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.plan"
    path.write_text(changed(lambda plan: plan.update(geoFence=value)))
    with pytest.raises(MissionError):
        read_mission(path)
