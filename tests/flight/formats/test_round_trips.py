"""Hundreds of random missions, written in every format and read back."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from pymavlink import mavwp

from tests.flight.formats.random_missions import missions, routes
from uavseg.flight.formats import files
from uavseg.flight.formats.wayline import Wayline, wayline_of
from uavseg.flight.mission.items import HEADING_COMMANDS, MissionItem
from uavseg.flight.mission.mission import CRUISE_M_S, Mission

DEGREES = 1e-7
pytestmark = pytest.mark.slow


def read_back(mission: Mission, folder: Path, suffix: str) -> Mission:
    path = folder / f"flight{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        files.write_mission(mission, path, overwrite=True)
    return files.read_mission(path)


@pytest.mark.parametrize("suffix", [".plan", ".kml", ".geojson"])
@given(mission=missions())
@settings(max_examples=150)
def test_formats_that_hold_everything_are_read_back_equal(
    mission: Mission, suffix: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    assert read_back(mission, tmp_path_factory.getbasetemp(), suffix) == mission


@given(mission=missions())
@settings(max_examples=150)
def test_waypoints_are_read_back_equal_but_for_what_they_cannot_hold(
    mission: Mission, tmp_path_factory: pytest.TempPathFactory
) -> None:
    def unset_zero_headings(item: MissionItem) -> MissionItem:
        heading = None if item.command in HEADING_COMMANDS and not item.params[3] else item.params[3]
        return replace(item, params=(*item.params[:3], heading))

    items = tuple(map(unset_zero_headings, mission.items))
    held = replace(mission, items=items, autopilot="ardupilot", fence=(), rally=())
    assert read_back(mission, tmp_path_factory.getbasetemp(), ".waypoints") == held


def same_points(found: Wayline, expected: Wayline) -> None:
    """Equal points; a speed that is not set is the usual one, and headings are compared modulo 360.

    A place to look at decides heading and pitch, which are not held beside it.
    """
    assert len(found.points) == len(expected.points)
    for mine, theirs in zip(expected.points, found.points, strict=True):
        assert abs(mine.lat - theirs.lat) <= DEGREES and abs(mine.lon - theirs.lon) <= DEGREES
        assert theirs.altitude_m == pytest.approx(mine.altitude_m, abs=1e-6)
        assert theirs.frame == mine.frame and theirs.photo == mine.photo
        assert theirs.speed_m_s == pytest.approx(mine.speed_m_s or CRUISE_M_S)
        names = ("hold_s", "trigger_m", "interval_s")
        if mine.looks_at is not None:
            assert theirs.looks_at == pytest.approx(mine.looks_at, rel=0, abs=DEGREES)
            mine = replace(mine, heading_deg=theirs.heading_deg)
        else:
            assert theirs.looks_at is None
            names = (*names, "pitch_deg")
        assert (theirs.heading_deg is None) == (mine.heading_deg is None)
        if mine.heading_deg is not None and theirs.heading_deg is not None:
            assert abs((mine.heading_deg - theirs.heading_deg + 180) % 360 - 180) <= 0.5
        for name in names:
            assert getattr(theirs, name) == pytest.approx(getattr(mine, name)), name


@given(mission=routes())
@settings(max_examples=200)
def test_a_kmz_makes_an_aircraft_fly_the_same(
    mission: Mission, tmp_path_factory: pytest.TempPathFactory
) -> None:
    route = wayline_of(mission, "it")
    # a series that begins at the last waypoint photographs nothing
    last = replace(route.points[-1], trigger_m=0.0, interval_s=0.0)
    route = replace(route, points=(*route.points[:-1], last))
    found = read_back(mission, tmp_path_factory.getbasetemp(), ".kmz")
    same_points(wayline_of(found, "it"), route)
    again = wayline_of(found, "it")
    assert (again.finish, again.approach_m_s) == (route.finish, pytest.approx(route.approach_m_s))
    assert again.takeoff_m == pytest.approx(route.takeoff_m)
    assert (found.home.lat, found.home.lon) == pytest.approx((route.points[0].lat, route.points[0].lon))
    assert any("does not hold home" in note for note in found.notes)


@given(mission=routes())
@settings(max_examples=200)
def test_a_csv_makes_litchi_fly_the_same(mission: Mission, tmp_path_factory: pytest.TempPathFactory) -> None:
    found = read_back(mission, tmp_path_factory.getbasetemp(), ".csv")
    route = wayline_of(mission, "it")
    pairs = zip((None, *route.points), route.points, strict=False)
    looking = [replace(b, looks_at=b.looks_at or (a and a.looks_at)) for a, b in pairs]  # from and to it
    same_points(wayline_of(found, "it"), replace(route, points=tuple(looking)))
    assert any("does not hold home" in note for note in found.notes)


@given(mission=missions())
@settings(max_examples=100)
def test_mavwp_reads_every_row(mission: Mission, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.getbasetemp()
    read_back(mission, folder, ".waypoints")
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(folder / "flight.waypoints")) == len(mission.items) + 1
    home = loader.wp(0)
    assert (home.x, home.y, home.z) == (mission.home.lat, mission.home.lon, mission.home.altitude_m)
    for number, item in enumerate(mission.items, start=1):
        row = loader.wp(number)
        assert (row.seq, row.current, row.frame, row.command) == (number, 0, item.frame, item.command)
        assert (row.param1, row.param2, row.param3, row.param4) == tuple(p or 0.0 for p in item.params)
        assert (row.x, row.y, row.z) == (item.lat, item.lon, item.altitude_m)
        assert row.autocontinue == item.autocontinue


@given(mission=missions())
@settings(max_examples=100)
def test_mavsdk_reads_every_item(
    mission: Mission, mavsdk_reader: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.getbasetemp()
    for suffix, load in (
        (".plan", mavsdk_reader.import_qgroundcontrol_mission),
        (".waypoints", mavsdk_reader.import_mission_planner_mission),
    ):
        read_back(mission, folder, suffix)
        found = load(str(folder / f"flight{suffix}")).mission_items
        found = found[len(found) - len(mission.items) :]
        for item, theirs in zip(mission.items, found, strict=True):
            assert (theirs.command, theirs.frame) == (item.command, item.frame)
            assert theirs.autocontinue == item.autocontinue
            assert abs(theirs.x - item.lat * 1e7) <= 1 and abs(theirs.y - item.lon * 1e7) <= 1
            assert theirs.z == pytest.approx(item.altitude_m, rel=1e-6)
            params = (theirs.param1, theirs.param2, theirs.param3, theirs.param4)
            for mine, param in zip(item.params, params, strict=True):
                unset = 0.0 if suffix == ".waypoints" else float("nan")
                assert param == pytest.approx(unset if mine is None else mine, nan_ok=True, rel=1e-6)
