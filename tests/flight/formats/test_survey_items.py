"""Editable surveys of .plan files: the same flight, and every key that QGroundControl requires."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from tests.flight.formats.mission_texts import plan_text
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.camera.camera import Photos, camera_named
from uavseg.flight.formats import files
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.planner import plan_missions

PLANE = Plane(47.0, 8.0)
PHOTOS = Photos(camera_named("phantom 4 pro"))
L_SHAPE = shapely.box(0, 0, 300, 80).union(shapely.box(0, 0, 80, 300))


@cache
def planned(*regions: shapely.Polygon, photos: Photos | None = PHOTOS, **words: Any) -> Mission:
    def degrees(xy: Any) -> Any:
        return np.column_stack(PLANE.lonlat_from_xy(*xy.T))

    polygons = [shapely.transform(region, degrees) for region in regions]
    points = [tuple(shapely.get_coordinates(shapely.point_on_surface(one))[0]) for one in polygons]
    params = PlanParams(60.0, pattern="survey", spacing_m=30.0, photos=photos, **words)
    [mission] = plan_missions(polygons, points, params, (47.0, 8.0, 400.0))
    return mission


def survey_items(mission: Mission) -> list[dict[str, Any]]:
    plan = json.loads(plan_text(mission, editable=True), parse_constant=pytest.fail)
    return [item for item in plan["mission"]["items"] if item["type"] == "ComplexItem"]


def flat(plan: dict[str, Any]) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = []
    for item in plan["mission"]["items"]:
        items += [item] if item["type"] == "SimpleItem" else item["TransectStyleComplexItem"]["Items"]
    return items


@pytest.mark.slow
@given(field=fields(), angle_deg=st.sampled_from([0.0, 30.0, 107.0]))
@settings(max_examples=25)
def test_the_flown_items_are_the_same(
    field: shapely.Polygon, angle_deg: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    mission = planned(field, angle_deg=angle_deg)
    path = tmp_path_factory.getbasetemp() / "edit.plan"
    path.write_text(plan_text(mission, editable=True))
    assert flat(json.loads(path.read_text())) == flat(json.loads(plan_text(mission)))
    assert files.read_mission(path) == mission


def test_a_rectangle_is_one_survey_item() -> None:
    mission = planned(shapely.box(20, 20, 320, 220))
    [item] = survey_items(mission)
    assert (item["complexItemType"], item["version"], item["splitConcavePolygons"]) == ("survey", 5, False)
    turned = (item["angle"] - mission.blocks[0].angle_deg + 90) % 180 - 90
    assert turned == pytest.approx(0, abs=1e-6) and -90 <= item["angle"] <= 90
    x, y = PLANE.xy_from_lonlat(*np.array(item["polygon"]).T[::-1])
    outline = shapely.Polygon(np.column_stack([x, y]))
    assert outline.symmetric_difference(shapely.box(20, 20, 320, 220)).area < 10
    transect = item["TransectStyleComplexItem"]
    assert set(transect) == {
        *("version", "TurnAroundDistance", "CameraTriggerInTurnAround", "HoverAndCapture", "Refly90Degrees"),
        *("CameraShots", "VisualTransectPoints", "Items", "CameraCalc"),
    }
    visited = [one["params"][4:6] for one in transect["Items"] if one["command"] == 16]
    assert transect["VisualTransectPoints"] == visited
    triggers = [one["params"][0] for one in transect["Items"] if one["command"] == 206]
    assert triggers[-1] == 0 and transect["Items"][-1]["command"] == 206
    camera = transect["CameraCalc"]
    assert set(camera) == {
        *("version", "CameraName", "DistanceMode", "DistanceToSurface", "AdjustedFootprintSide"),
        *("AdjustedFootprintFrontal", "ValueSetIsDistance", "ImageDensity", "FrontalOverlap", "SideOverlap"),
        *("SensorWidth", "SensorHeight", "ImageWidth", "ImageHeight", "FocalLength", "Landscape"),
        *("FixedOrientation", "MinTriggerInterval"),
    }
    # the formulas of QGroundControl
    density = camera["DistanceToSurface"] * camera["SensorWidth"] * 100
    density /= camera["ImageWidth"] * camera["FocalLength"]
    assert camera["ImageDensity"] == pytest.approx(density)
    frontal = camera["ImageHeight"] * density / 100 * (100 - camera["FrontalOverlap"]) / 100
    assert camera["AdjustedFootprintFrontal"] == pytest.approx(frontal)
    assert (camera["AdjustedFootprintSide"], camera["DistanceMode"]) == (30, 1)


def test_without_a_camera_the_camera_is_manual() -> None:
    [item] = survey_items(planned(shapely.box(20, 20, 320, 220), photos=None))
    camera = item["TransectStyleComplexItem"]["CameraCalc"]
    assert (camera["CameraName"], camera["AdjustedFootprintFrontal"]) == ("Manual (no camera specs)", 0)


def test_concave_fields_are_divided_and_what_stays_concave_is_single_items(tmp_path: Path) -> None:
    found = survey_items(planned(L_SHAPE, angle_deg=0.0))
    assert found and all(
        shapely.Polygon(item["polygon"]).area >= 0.9 * shapely.Polygon(item["polygon"]).convex_hull.area
        for item in found
    )
    ring = shapely.Point(200, 200).buffer(150) - shapely.Point(200, 200).buffer(60)
    mission = planned(ring, angle_deg=30.0)
    with pytest.warns(UserWarning, match=r"parts? of the survey can be edited .* single items"):
        files.write_mission(mission, tmp_path / "ring.plan", editable=True)
    assert files.read_mission(tmp_path / "ring.plan") == mission


@pytest.mark.slow
def test_what_is_not_a_survey_cannot_be_edited(tmp_path: Path) -> None:
    visited = Mission(planned(L_SHAPE).home, planned(L_SHAPE).items)
    with pytest.warns(UserWarning, match="it has no survey lines"):
        files.write_mission(visited, tmp_path / "fly.plan", editable=True)
    with pytest.raises(ParameterError, match=r"only a \.plan"):
        files.write_mission(visited, tmp_path / "fly.waypoints", editable=True)


@pytest.mark.slow
def test_mavsdk_reads_the_items_of_surveys(mavsdk_reader: Any, tmp_path: Path) -> None:
    mission = planned(shapely.box(20, 20, 320, 220), shapely.box(500, 20, 700, 220))
    assert len(survey_items(mission)) == 2
    path = tmp_path / "edit.plan"
    path.write_text(plan_text(mission, editable=True))
    found = mavsdk_reader.import_qgroundcontrol_mission(str(path)).mission_items
    for item, theirs in zip(mission.items, found, strict=True):
        assert (theirs.command, theirs.frame) == (item.command, item.frame)
        assert abs(theirs.x - item.lat * 1e7) <= 1 and abs(theirs.y - item.lon * 1e7) <= 1
        assert theirs.param1 == pytest.approx(item.params[0], rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": 4}, "a survey item of version 4"),
        ({"complexItemType": "CorridorScan"}, "a CorridorScan item"),
        ({"TransectStyleComplexItem": {"Items": []}}, "without waypoints"),
        ({"TransectStyleComplexItem": {}}, "'Items' is missing"),
        ({"TransectStyleComplexItem": {"Items": [{"type": "ComplexItem"}]}}, "item 4: .*ComplexItem"),
    ],
)
def test_other_complex_items_are_refused(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    plan = json.loads(plan_text(planned(shapely.box(20, 20, 320, 220)), editable=True))
    [at] = [n for n, item in enumerate(plan["mission"]["items"]) if item["type"] == "ComplexItem"]
    plan["mission"]["items"][at].update(changes)
    path = tmp_path / "odd.plan"
    path.write_text(json.dumps(plan))
    with pytest.raises(MissionError, match=words):
        files.read_mission(path)
