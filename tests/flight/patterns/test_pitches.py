"""Several gimbal pitches in one flight: straight down, and tilted from four sides."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from tests.flight.patterns.photographed import Photograph, photographs
from tests.flight.small_regions import HOME, box, degrees, flights, inside, planned
from tests.flight.terrain.dems import HOME as DEM_HOME, draw, hills
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.formats.files import read_mission, write_mission
from uavseg.flight.formats.wayline import wayline_of
from uavseg.flight.mission.estimate import estimate, flown_path, footprints
from uavseg.flight.mission.items import CAMERA_DISTANCE, IMAGE_START, IMAGE_STOP, MOUNT_CONTROL, WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane, Track
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import LimitParams, PlanParams, SurveyParams, terrain_params
from uavseg.flight.planning.planner import plan_missions
from uavseg.flight.planning.split import with_pitch_points
from uavseg.jobs.flights.request import flight_params
from uavseg.options.flights import MissionOptions
from uavseg.options.option import build

CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 0.5)
PLANE = Plane(47.0, 8.0)
FIELD = box(100, 100, 200, 150)


def survey(pitches: tuple[float, ...] = (-90, -60), height: float = 60, **more: Any) -> dict[str, Any]:
    photos = Photos(CAMERA, more.pop("overlap", Overlap(70, 60)), pitches[0], flatter_deg=pitches[1:])
    photos = replace(photos, trigger=more.pop("trigger", "distance"))
    spacing = photos.spacing_m(height)
    return {"pattern": "survey", "altitude_m": height, "spacing_m": spacing, "photos": photos} | {
        "limits": LimitParams(max_items=65_000),
        **more,
    }


def side(one: Photograph, angle_deg: float) -> int:
    """Which of four directions, clockwise from the azimuth of lines, a photograph looks in; within 50 deg."""
    turn = (math.degrees(math.atan2(*one.ahead)) - angle_deg) % 360
    nearest = round(turn / 90)
    assert abs(turn - 90 * nearest) < 50
    return nearest % 4


def points_in(field: shapely.Polygon, step: float = 7.0) -> Any:
    west, south, east, north = field.bounds
    x, y = np.meshgrid(np.arange(west, east, step), np.arange(south, north, step))
    points = shapely.points(x.ravel(), y.ravel())
    corners = shapely.points(shapely.get_coordinates(field.buffer(-0.05)))
    return np.concatenate([points[shapely.contains(field, points)], corners])


@pytest.mark.slow
@given(
    fields(),
    st.sampled_from([(-90.0, -60.0), (-90.0, -75.0, -45.0), (-70.0, -50.0), (-88.0, -80.0)]),
    st.sampled_from(["distance", "interval"]),
    st.sampled_from([(75, 70), (20, 10)]),
    st.sampled_from([25.0, 60.0]),
    st.sampled_from([0.0, 30.0, 107.0]),
    st.sampled_from([0.0, 15.0]),
)
@settings(max_examples=10)
def test_every_place_is_seen_from_four_sides(
    field: shapely.Polygon,
    pitches: tuple[float, ...],
    trigger: str,
    overlap: tuple[int, int],
    height: float,
    angle: float,
    turnaround: float,
) -> None:
    more: dict[str, Any] = {"angle_deg": angle, "how": SurveyParams(turnaround_m=turnaround)}
    params = survey(pitches, height, trigger=trigger, overlap=Overlap(*overlap), **more)
    assert_seen_from_all_sides([field], [planned([degrees(field)], **params)], params)


def assert_seen_from_all_sides(
    fields: list[shapely.Polygon], missions: Sequence[Mission], params: dict[str, Any]
) -> None:
    taken = [one for mission in missions for one in photographs(mission, PLANE)]
    places = np.concatenate([points_in(field) for field in fields])
    passes = PlanParams(**params).passes
    assert {one.pitch_deg for one in taken} == {one.photos.pitch_deg for one in passes if one.photos}
    for one_pass in passes:
        photos = one_pass.photos
        assert photos is not None
        shown: dict[int, list[Any]] = {}
        for one in taken:
            if one.pitch_deg == photos.pitch_deg:
                which = 0 if photos.pitch_deg == -90 else side(one, params["angle_deg"])
                shown.setdefault(which, []).append(one.footprint(photos, params["altitude_m"]))
        assert sorted(shown) == ([0] if photos.pitch_deg == -90 else [0, 1, 2, 3])
        for footprint in shown.values():
            missed = ~shapely.intersects(shapely.union_all(footprint).buffer(1e-3), places)
            assert not missed.any()


@pytest.mark.slow
@pytest.mark.parametrize(
    "limits", [LimitParams(max_items=65_000), LimitParams(max_items=80), LimitParams(15, 10)]
)
def test_several_regions_and_flights_are_seen_from_all_sides(limits: LimitParams) -> None:
    both = [shapely.box(100, 100, 200, 160), shapely.Point(-80, 150).buffer(40)]
    params = survey((-90, -50), 40, angle_deg=20.0, limits=limits)
    found = flights([degrees(one) for one in both], **params)
    assert (len(found) > 1) == (limits.max_items != 65_000)
    assert_seen_from_all_sides(both, found, params)


def turns(mission: Mission) -> list[tuple[int, float]]:
    """Positions and pitches of the items that turn the gimbal."""
    return [
        (k, float(item.params[0] or 0))
        for k, item in enumerate(mission.items)
        if item.command == MOUNT_CONTROL
    ]


@pytest.mark.parametrize("trigger", ["distance", "interval", "hover", "none"])
def test_the_gimbal_turns_past_the_lines(trigger: str) -> None:
    mission = planned([FIELD], **survey((-90, -60, -45), trigger=trigger))
    (first, _), *later = found = turns(mission)
    assert mission.items[first + 1].command == WAYPOINT
    pitches = [pitch for _, pitch in found]
    assert pitches in ([-90, -60, -45], [-45, -60, -90])  # the flight may be faster from its end
    for k, _ in later:  # at a corner between the lines, where no photographs are taken
        assert mission.items[k - 1].command == mission.items[k + 1].command == WAYPOINT
        cameras = [
            item for item in mission.items[:k] if item.command in {CAMERA_DISTANCE, IMAGE_START, IMAGE_STOP}
        ]
        if trigger in {"distance", "interval"}:
            assert cameras[-1].command == IMAGE_STOP or cameras[-1].params[0] == 0


def test_lines_that_meet_leave_the_gimbal_no_time() -> None:
    line = replace(Track.of_path(np.array([[0, 0], [9.0, 0]])), pitch_deg=np.array([-90.0]))
    other = replace(Track.of_path(np.array([[9, 0], [9.0, 9]])), pitch_deg=np.array([-60.0]))
    with pytest.raises(MissionError, match="meet"):
        with_pitch_points(Track.joined([line, other]))
    short = Track.transit(np.array([[9, 0], [9.0, 1]]))
    with pytest.raises(MissionError, match="meet"):
        with_pitch_points(Track.joined([line, short, replace(other, xy=other.xy + np.array([0, 1]))]))
    same = Track.joined([line, replace(other, pitch_deg=line.pitch_deg)])
    assert with_pitch_points(same) is same


@pytest.mark.slow
def test_one_pitch_is_one_pass_as_a_number_or_alone() -> None:
    given = {"altitude": 60.0, "pattern": "survey", "camera": "phantom 4 rtk"}
    for pitch in (-90.0, -60.0):
        params = [
            flight_params(build(MissionOptions, given | {"gimbal_pitch": one})) for one in (pitch, (pitch,))
        ]
        assert params[0] == params[1] and params[0].passes == (params[0],)
        (one,) = plan_missions([FIELD], inside([FIELD]), params[0], HOME)
        assert [there for _, there in turns(one)] == [pitch]
    both = build(MissionOptions, given | {"altitude": None, "gsd": 2.0, "gimbal_pitch": (-60, -90)})
    found = flight_params(both)
    assert found.photos and (found.photos.pitch_deg, found.photos.flatter_deg) == (-90, (-60,))
    assert found.photos.camera.gsd_m(found.altitude_m, -60) == pytest.approx(0.02)
    for one in found.passes:
        assert one.photos and one.spacing_m == pytest.approx(one.photos.spacing_m(found.altitude_m))


def test_each_flight_begins_with_its_pitch() -> None:
    params = survey((-90, -60, -45), limits=LimitParams(max_items=70))
    found = flights([FIELD], **params)
    assert len(found) > 2
    whole = photographs(planned([FIELD], **survey((-90, -60, -45))), PLANE)
    taken = [one for mission in found for one in photographs(mission, PLANE)]
    for mission in found:
        first = next(k for k, item in enumerate(mission.items) if item.command == WAYPOINT)
        assert turns(mission)[0][0] < first
    for pitch in (-90, -60, -45):
        for which in range(4 if pitch > -90 else 1):
            counts = [
                sum(
                    one.pitch_deg == pitch
                    and (pitch == -90 or side(one, found[0].blocks[0].angle_deg) == which)
                    for one in some
                )
                for some in (whole, taken)
            ]
            assert counts[0] <= counts[1] <= counts[0] + 2 * len(found)


def test_estimates_follow_the_items() -> None:
    params = survey((-90, -60))
    mission = planned([FIELD], **params)
    taken = photographs(mission, PLANE)
    found = estimate(mission)
    assert found.photographs == len(taken) == len(footprints(mission).lonlat)
    assert found.gsd_m == pytest.approx(CAMERA.gsd_m(60, -60))
    assert found.footprint_m == pytest.approx(CAMERA.footprint_m(60, -60))
    x, y = PLANE.xy_from_lonlat(*np.moveaxis(footprints(mission).lonlat, -1, 0))
    shown = np.stack([x, y], axis=-1)
    for one, corners in zip(taken, shown, strict=True):
        photos = replace(params["photos"], pitch_deg=one.pitch_deg, flatter_deg=())
        expected = shapely.get_coordinates(one.footprint(photos, 60))[:-1]
        np.testing.assert_allclose(corners, expected, atol=0.05)
    path = flown_path(mission, default_vehicle(mission.autopilot))
    assert {path.pitch_deg[run.leg] for run in path.shots} == {-90, -60}


@pytest.mark.parametrize("suffix", [".plan", ".waypoints", ".kmz", ".csv"])
@pytest.mark.parametrize("trigger", ["distance", "hover"])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_formats_hold_the_pitches(suffix: str, trigger: str, tmp_path: Path) -> None:
    params = survey((-90, -60), 25, trigger=trigger, overlap=Overlap(20, 10), speed_m_s=4.0)
    mission = planned([box(100, 100, 30, 20)], **params)
    path = tmp_path / f"a{suffix}"
    write_mission(mission, path)
    found = read_mission(path)
    if suffix == ".plan":
        assert found == mission
        write_mission(mission, path, overwrite=True, editable=True)
        assert read_mission(path) == mission
    elif suffix == ".waypoints":
        assert found.items == mission.items
    else:
        mine, theirs = (wayline_of(one, suffix) for one in (mission, found))
        assert [one.pitch_deg for one in mine.points] == [one.pitch_deg for one in theirs.points]
        assert [pitch for _, pitch in turns(found)] == [pitch for _, pitch in turns(mission)]
        kinds = [
            [one.command for one in m.items if one.command in {WAYPOINT, MOUNT_CONTROL}]
            for m in (mission, found)
        ]
        assert kinds[0] == kinds[1]


def test_editable_survey_items_are_straight_down_or_none(tmp_path: Path) -> None:
    for pitches in ((-90, -60), (-70, -50)):
        mission = planned([FIELD], **survey(pitches))
        with pytest.warns(UserWarning, match="edited"):
            write_mission(mission, tmp_path / "a.plan", overwrite=True, editable=True)
        items = json.loads((tmp_path / "a.plan").read_text())["mission"]["items"]
        assert {block.photos and block.photos.pitch_deg for block in mission.blocks} <= {-90}
        complex_items = [item for item in items if item["type"] == "ComplexItem"]
        assert len(complex_items) == (pitches[0] == -90)


@pytest.mark.parametrize(
    ("pitches", "words"),
    [((-60, -60), "once"), ((-60, -90), "steepest first"), ((-90, -20), "-30"), ((-95, -60), "-90")],
)
def test_pitches_twice_or_out_of_bounds_are_refused(pitches: tuple[float, ...], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        survey(pitches)


@pytest.mark.parametrize("pattern", ["visit", "perimeter", "corridor"])
def test_several_pitches_are_for_surveys(pattern: str) -> None:
    photos = Photos(CAMERA, trigger="hover", flatter_deg=(-60.0,))
    with pytest.raises(ParameterError, match="for the pattern survey"):
        PlanParams(60.0, pattern, 20.0 if pattern == "corridor" else None, photos=photos)


def test_zones_beside_the_region_are_kept_out_of_and_named() -> None:
    zone = box(110, 158, 30, 20)  # on the lines from outside
    mission = planned([FIELD], zones=[zone], **survey())
    flown = [(item.lon, item.lat) for item in mission.items if item.command == WAYPOINT]
    assert not shapely.intersects(shapely.LineString(flown), zone)
    assert any("from all sides" in note for note in mission.notes)
    assert not any("from all sides" in note for note in planned([FIELD], **survey()).notes)


@pytest.mark.slow
def test_terrain_is_followed_with_the_same_pitches(tmp_path: Path) -> None:
    dem = terrain_params(draw(tmp_path / "hills.tif", hills(15, 3)), "absolute", 2.0)
    field = degrees(shapely.box(100, 100, 300, 250), Plane(*DEM_HOME))
    mission = planned([field], DEM_HOME, **survey(terrain=dem))
    assert len({item.altitude_m for item in mission.items if item.command == WAYPOINT}) > 9
    assert [pitch for _, pitch in turns(mission)] == [-90, -60]
    for k, _ in turns(mission)[1:]:
        assert mission.items[k - 1].command == mission.items[k + 1].command == WAYPOINT
