"""Mission files: round trips, independent readers, one line for each fault."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pymavlink import mavwp

from tests.flight.fences import FENCE, RALLY, fences, rally_points
from tests.flight.formats.mission_texts import plan_text, waypoints_text
from uavseg.errors import MissionError, OutputExistsError
from uavseg.flight.formats import files
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.items import (
    AUTOPILOTS,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    RETURN,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
    RallyPoint,
)
from uavseg.flight.mission.mission import Mission

HOME = HomePosition(-33.856784123, 151.215296987, 12.5)
WAYPOINT = MissionItem(16, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), -33.8561234567, 151.2151234567, 40.25)
MISSION = Mission(
    HOME,
    (
        MissionItem(22, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), HOME.lat, HOME.lon, 60.0),
        MissionItem(178, FRAME_MISSION, (1.0, 7.5, -1.0, 0.0)),
        WAYPOINT,
        MissionItem(16, FRAME_TERRAIN, (3.0, 0.0, 0.0, 90.0), -33.8, 151.2, 55.0),
        MissionItem(19, FRAME_AMSL, (20.0, 0.0, 0.0, 0.0), -33.80000001, 151.20000001, 99.125),
        MissionItem(RETURN, FRAME_MISSION),
    ),
)

numbers = st.floats(-1e4, 1e4)
steps = numbers.filter(lambda value: not 0 < value < 0.01)  # between photographs, and speeds
headings = st.none() | st.floats(-360, 360).filter(bool)
places = st.builds(
    MissionItem,
    st.sampled_from([16, 17, 21]),
    st.sampled_from([FRAME_RELATIVE, FRAME_TERRAIN]),
    st.tuples(numbers, numbers, numbers, headings),
    st.floats(-33.9, -33.8),
    st.floats(151.1, 151.3),
    st.floats(0.01, 1000),
)
orders = st.builds(
    MissionItem,
    st.sampled_from([20, 178, 206]),
    st.just(FRAME_MISSION),
    st.tuples(steps, steps, numbers, numbers),
)
missions = st.builds(
    Mission, st.just(HOME), st.tuples(places, orders, places), st.just("ardupilot")
) | st.lists(st.one_of(places, orders), max_size=9).map(lambda items: Mission(HOME, (WAYPOINT, *items)))


FENCED = replace(MISSION, fence=FENCE, rally=RALLY)


def written(mission: Mission, folder: Path, suffix: str) -> Path:
    path = folder / f"flight{suffix}"
    files.write_mission(mission, path, overwrite=True)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
@given(mission=missions)
@settings(max_examples=40)
def test_a_mission_written_is_read_equal(
    mission: Mission, suffix: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    assert files.read_mission(written(mission, tmp_path_factory.getbasetemp(), suffix)) == mission


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_plan_holds_the_autopilot(tmp_path: Path, autopilot: str) -> None:
    mission = Mission(HOME, (WAYPOINT, MissionItem(RETURN, FRAME_MISSION)), autopilot)
    assert files.read_mission(written(mission, tmp_path, ".plan")) == mission


@pytest.mark.parametrize(("suffix", "homes"), [(".plan", 0), (".waypoints", 1)])
def test_mavsdk_reads_every_item(mavsdk_reader: Any, tmp_path: Path, suffix: str, homes: int) -> None:
    path = str(written(MISSION, tmp_path, suffix))
    reader = mavsdk_reader
    load = reader.import_qgroundcontrol_mission if homes == 0 else reader.import_mission_planner_mission
    found = load(path).mission_items
    assert len(found) == len(MISSION.items) + homes
    if homes:
        assert (found[0].command, found[0].frame, found[0].z) == (16, 0, 12.5)
        assert found[0].x == pytest.approx(HOME.lat * 1e7, abs=1)
    for item, theirs in zip(MISSION.items, found[homes:], strict=True):
        assert (theirs.command, theirs.frame, theirs.autocontinue) == (item.command, item.frame, 1)
        assert theirs.x == pytest.approx(item.lat * 1e7, abs=1)
        assert theirs.y == pytest.approx(item.lon * 1e7, abs=1)
        assert theirs.z == pytest.approx(item.altitude_m, abs=1e-5)
        for mine, param in zip(
            item.params, (theirs.param1, theirs.param2, theirs.param3, theirs.param4), strict=True
        ):
            unset = 0.0 if homes else math.nan
            assert param == pytest.approx(unset if mine is None else mine, nan_ok=True)


def test_mavwp_reads_every_row(tmp_path: Path) -> None:
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(written(MISSION, tmp_path, ".waypoints"))) == len(MISSION.items) + 1
    home = loader.wp(0)
    assert (home.seq, home.current, home.frame, home.command, home.z) == (0, 1, 0, 16, 12.5)
    assert (home.x, home.y) == (HOME.lat, HOME.lon)
    for number, item in enumerate(MISSION.items, start=1):
        row = loader.wp(number)
        assert (row.seq, row.current, row.frame, row.command) == (number, 0, item.frame, item.command)
        assert (row.param1, row.param2, row.param3, row.param4) == tuple(p or 0.0 for p in item.params)
        assert (row.x, row.y, row.z) == (item.lat, item.lon, item.altitude_m)


def test_a_plan_has_every_key_that_any_reader_requires() -> None:
    plan = json.loads(plan_text(MISSION), parse_constant=pytest.fail)
    assert set(plan) == {"fileType", "groundStation", "version", "mission", "geoFence", "rallyPoints"}
    assert (plan["fileType"], plan["version"], plan["mission"]["version"]) == ("Plan", 1, 2)
    assert plan["geoFence"] == {"version": 2, "circles": [], "polygons": []}
    assert plan["rallyPoints"] == {"version": 2, "points": []}
    mission = plan["mission"]
    assert mission["plannedHomePosition"] == [HOME.lat, HOME.lon, 12.5]
    assert (mission["firmwareType"], mission["vehicleType"], mission["globalPlanAltitudeMode"]) == (3, 2, 0)
    for number in (plan["version"], mission["version"], mission["cruiseSpeed"], mission["hoverSpeed"]):
        assert type(number) is int
    for number, item in enumerate(mission["items"], start=1):
        assert {"type", "command", "frame", "params", "autoContinue", "doJumpId"} <= set(item)
        assert (item["doJumpId"], len(item["params"]), item["autoContinue"]) == (number, 7, True)
        assert ("AltitudeMode" in item) == ("Altitude" in item) == ("AMSLAltAboveTerrain" in item)
    assert [item.get("AltitudeMode") for item in mission["items"]] == [1, None, 1, 4, 2, None]


def test_waypoints_are_tabs_and_line_feeds_with_home_first(tmp_path: Path) -> None:
    text = written(MISSION, tmp_path, ".waypoints").read_bytes().decode("ascii")
    assert text.startswith("QGC WPL 110\n0\t1\t0\t16\t0.00000000\t") and text.endswith("\t1\n")
    assert "\r" not in text and "\n\n" not in text
    for line in text.splitlines()[1:]:
        fields = line.split("\t")
        assert len(fields) == 12
        assert all(len(field.split(".")[1]) >= 8 for field in fields[4:10])


def test_the_extension_chooses_and_another_is_refused(tmp_path: Path) -> None:
    files.write_mission(MISSION, tmp_path / "UPPER.PLAN")
    for name in ("mission.txt", "mission", "mission.json"):
        with pytest.raises(MissionError, match=r"\.plan, .* or \.csv"):
            files.write_mission(MISSION, tmp_path / name)
        with pytest.raises(MissionError, match=r"\.plan, .* or \.csv"):
            files.read_mission(tmp_path / name)


def test_a_mission_is_not_replaced_without_overwrite(tmp_path: Path) -> None:
    path = written(MISSION, tmp_path, ".plan")
    before = path.read_bytes()
    with pytest.raises(OutputExistsError):
        files.write_mission(Mission(HOME, (WAYPOINT,)), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["flight.plan"]


def changed(**changes: Any) -> str:
    plan = json.loads(plan_text(MISSION))
    return json.dumps({**plan, **changes})


def changed_item(**changes: Any) -> str:
    plan = json.loads(plan_text(MISSION))
    plan["mission"]["items"][2].update(changes)
    return json.dumps(plan)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "cannot|not a mission"),
        ("[]", "not a plan"),
        ("{}", "not a plan"),
        (changed(fileType="Fence"), "not a plan"),
        (changed(version=3), "version 1"),
        (changed(mission={"version": 2}), "firmwareType' is missing"),
        (changed_item(type="ComplexItem", complexItemType="survey"), "holds a survey item of version None"),
        (changed_item(params=[0, 0, 0]), "item 3: a list in it is of a wrong length"),
        (changed_item(params=[0, 0, 0, None, 91, 151, 40]), "-90..90"),
        (changed_item(params=[0, 0, 0, None, -33.8, 151.2, math.nan]), "finite"),
        (changed_item(autoContinue=0), "item 3: autoContinue is 0; expected true or false"),
        (changed_item(command="fly"), "item 3: expected a whole number"),
    ],
)
def test_an_invalid_plan_is_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "odd.plan"
    path.write_text(text)
    with pytest.raises(MissionError, match=words) as refused:
        files.read_mission(path)
    assert "odd.plan" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("110", "120", "first line"),
        ("\n1\t", "\n2\t", "line 3"),
        ("\t", ";", "line 2"),
        ("\t-33", "\tminus", "not a mission"),
        ("-33.8561", "nan", "item 3: expected a number|finite"),
        ("151.21512", "351.21512", "-180..180"),
        ("\t1\n", "\tnan\n", "item 1: autocontinue is 'nan'; expected 0 or 1"),
    ],
)
def test_invalid_waypoints_are_refused_by_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "odd.waypoints"
    path.write_text(waypoints_text(MISSION).replace(old, new))
    with pytest.raises(MissionError, match=words):
        files.read_mission(path)


@pytest.mark.parametrize(
    ("autopilot", "words"),
    [("ardupilot", "does not wait there"), ("px4", "waits there until it is sent on"), ("generic", "waits")],
)
def test_a_mission_that_waits_says_where(autopilot: str, words: str) -> None:
    mission = Mission(HOME, (WAYPOINT, replace(WAYPOINT, autocontinue=False)), autopilot)
    [told] = [text for text in mission.warnings if "autocontinue" in text]
    assert told.startswith("item 2 has autocontinue 0: ") and words in told


@pytest.mark.parametrize("suffix", [".kmz", ".csv"])
def test_a_format_that_cannot_hold_where_a_mission_waits_says_so(suffix: str) -> None:
    waiting = Mission(HOME, (WAYPOINT, replace(WAYPOINT, autocontinue=False, lat=WAYPOINT.lat + 0.001)))
    told = files.FORMATS[suffix].losses(waiting, FileOptions())
    assert any("cannot hold where a mission waits" in text for text in told)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match=r"there is no file .*none\.plan"):
        files.read_mission(tmp_path / "none.plan")


@pytest.mark.slow
@given(fence=fences, rally=rally_points)
@settings(max_examples=40)
def test_a_fence_and_rally_points_written_are_read_equal(
    fence: list[FencePolygon | FenceCircle],
    rally: list[RallyPoint],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    mission = replace(MISSION, fence=tuple(fence), rally=tuple(rally))
    found = files.read_mission(written(mission, tmp_path_factory.getbasetemp(), ".plan"))
    assert found == mission and found.fence == mission.fence and found.rally == mission.rally


def test_a_fence_has_every_key_that_qgroundcontrol_requires() -> None:
    plan = json.loads(plan_text(FENCED), parse_constant=pytest.fail)
    assert plan["geoFence"]["version"] == plan["rallyPoints"]["version"] == 2
    shapes = plan["geoFence"]["polygons"] + plan["geoFence"]["circles"]
    assert [shape["inclusion"] for shape in shapes] == [True, False, False]
    assert all(shape["version"] == 1 for shape in shapes)
    for shape in plan["geoFence"]["polygons"]:
        lat, lon = np.array(shape["polygon"]).T
        assert np.sum((np.roll(lon, -1) - lon) * (np.roll(lat, -1) + lat)) > 0  # clockwise
    assert plan["geoFence"]["circles"][0]["circle"] == {"center": [-33.85, 151.21], "radius": 40.5}
    assert plan["rallyPoints"]["points"] == [[-33.855, 151.214, 30.0], [-33.85, 151.22, 45.5]]


def test_mavsdk_reads_the_fence_and_rally_points(mavsdk_reader: Any, tmp_path: Path) -> None:
    found = mavsdk_reader.import_qgroundcontrol_mission(str(written(FENCED, tmp_path, ".plan")))
    assert len(found.mission_items) == len(MISSION.items)
    box, keep_out, _ = FENCED.fence
    assert isinstance(box, FencePolygon) and isinstance(keep_out, FencePolygon)
    expected = [(5001, 4, *vertex) for vertex in box.vertices]
    expected += [(5002, 3, *vertex) for vertex in keep_out.vertices] + [(5004, 40.5, -33.85, 151.21)]
    items = found.geofence_items
    assert [(one.command, one.param1) for one in items] == [one[:2] for one in expected]
    assert {(one.frame, one.mission_type) for one in items} == {(0, 1)}
    for one, (_, _, lat, lon) in zip(items, expected, strict=True):
        assert (one.x, one.y) == (pytest.approx(lat * 1e7, abs=1), pytest.approx(lon * 1e7, abs=1))
    for one, point in zip(found.rally_items, RALLY, strict=True):
        assert (one.command, one.frame, one.mission_type, one.z) == (5100, 3, 2, point.altitude_m)
        assert (one.x, one.y) == (
            pytest.approx(point.lat * 1e7, abs=1),
            pytest.approx(point.lon * 1e7, abs=1),
        )


@pytest.mark.parametrize(("fence", "rally"), [(FENCE, ()), ((), RALLY)])
def test_waypoints_cannot_hold_a_fence_and_say_so(tmp_path: Path, fence: Any, rally: Any) -> None:
    path = tmp_path / "fenced.waypoints"
    with pytest.warns(UserWarning, match=r"cannot hold a fence or rally points.*\.plan"):
        files.write_mission(replace(MISSION, fence=fence, rally=rally), path)
    assert path.read_text() == waypoints_text(MISSION)


def changed_fence(polygon: Any = None, circle: Any = None, rally: Any = None) -> str:
    fence = {"version": 2, "polygons": [polygon] if polygon else [], "circles": [circle] if circle else []}
    return changed(geoFence=fence, rallyPoints={"version": 2, "points": [rally] if rally else []})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            changed_fence({"polygon": [[-33.8, 151.2], [-33.9, 151.2], [-33.9, 151.1]]}),
            "inclusion' is missing",
        ),
        (changed_fence({"polygon": [[-33.8, 151.2]], "inclusion": True}), "three vertices"),
        (changed_fence({"polygon": [[151.2, -33.8]] * 3, "inclusion": True}), "swapped"),
        (changed_fence({"polygon": [[1, 2, 3]], "inclusion": True}), "not a mission that can be read"),
        (changed_fence({"polygon": 5, "inclusion": True}), "not a mission that can be read"),
        (
            changed_fence(circle={"circle": {"center": [-33.8, 151.2]}, "inclusion": True}),
            "radius' is missing",
        ),
        (
            changed_fence(circle={"circle": {"center": [-33.8, 151.2], "radius": 5}, "inclusion": 1}),
            "inclusion",
        ),
        (
            changed_fence(circle={"circle": {"center": [47, 8], "radius": 5}, "inclusion": True}),
            "km from home",
        ),
        (changed_fence(rally=[-33.8, 151.2]), "not a mission that can be read"),
        (changed_fence(rally=[-33.8, 151.2, -5]), "rally point"),
        (changed_fence(rally=[47, 8, 50]), "a rally point lies .* km from home"),
        (changed(geoFence=[1]), "not a mission that can be read"),
        (changed(rallyPoints="none"), "not a mission that can be read"),
    ],
)
def test_an_invalid_fence_is_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "odd.plan"
    path.write_text(text)
    with pytest.raises(MissionError, match=words) as refused:
        files.read_mission(path)
    assert "odd.plan" in str(refused.value) and "\n" not in str(refused.value)


def test_a_plan_without_a_fence_has_none(tmp_path: Path) -> None:
    path = tmp_path / "open.plan"
    plan = json.loads(plan_text(MISSION))
    path.write_text(json.dumps({**plan, "geoFence": None, "rallyPoints": None}))
    assert files.read_mission(path) == MISSION


def test_a_breach_return_point_that_is_not_read_gives_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "breach.plan"
    path.write_text(changed(geoFence={"version": 2, "breachReturn": [-33.85, 151.21, 30]}))
    assert "breach return" in files.read_mission(path).warnings[0]
