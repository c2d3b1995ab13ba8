"""Planned missions, not random items: MAVSDK and mavwp read them, and the check refuses nothing."""

import math
from pathlib import Path
from typing import Any

import pytest
import shapely
from pymavlink import mavwp

from tests.flight.small_regions import degrees, inside
from tests.flight.terrain.dems import HOME, draw, hills
from uavseg.flight.formats import files
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_RELATIVE, FRAME_TERRAIN
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.planning.planner import plan_missions
from uavseg.flight.safety.check import SafetyCheck
from uavseg.jobs.flights.check import CheckRequest, check
from uavseg.jobs.flights.request import flight_params
from uavseg.options.flights import MissionOptions
from uavseg.options.option import build

PLANE = Plane(*HOME)
REGIONS = [degrees(shapely.box(*sides), PLANE) for sides in ((100, 50, 180, 110), (220, 60, 270, 150))]
PATTERNS = {
    "visit": ["hover", "none"],
    "perimeter": ["distance", "interval", "hover", "none"],
    "survey": ["distance", "interval", "hover", "none"],
    "corridor": ["distance", "interval", "hover", "none"],
    "orbit": ["distance", "interval", "none"],
}
CASES = [
    (pattern, trigger, autopilot, terrain)
    for pattern, triggers in PATTERNS.items()
    for trigger in triggers
    for autopilot in ("ardupilot", "px4", "generic")
    for terrain in (None, "absolute", "relative", "frame")
    if terrain != "frame" or autopilot == "ardupilot"
]
FRAMES = {None: FRAME_RELATIVE, "absolute": FRAME_AMSL, "relative": FRAME_RELATIVE, "frame": FRAME_TERRAIN}


def planned(pattern: str, trigger: str, autopilot: str, terrain: str | None, dem: Path) -> Mission:
    given = {
        "altitude": 60.0,
        "pattern": pattern,
        "autopilot": autopilot,
        "camera": "phantom 4 rtk",
        "trigger": trigger,
        "hold": 3.0 if pattern == "visit" else None,
        "dem": None if terrain is None else dem,
        "terrain": terrain,
    }
    params = flight_params(build(MissionOptions, given))
    (mission,) = plan_missions(REGIONS, inside(REGIONS), params, HOME)
    return mission


@pytest.fixture(scope="module")
def dem(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return draw(tmp_path_factory.mktemp("dem") / "hills.tif", hills(15, 3))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pattern", "trigger", "autopilot", "terrain"),
    [pytest.param(*case, marks=[pytest.mark.thorough] if n % 3 else []) for n, case in enumerate(CASES)],
)
def test_independent_readers_find_every_item_and_the_check_refuses_nothing(
    mavsdk_reader: Any,
    dem: Path,
    tmp_path: Path,
    pattern: str,
    trigger: str,
    autopilot: str,
    terrain: str | None,
) -> None:
    mission = planned(pattern, trigger, autopilot, terrain, dem)
    frames = {item.frame for item in mission.items if item.has_position}
    assert FRAMES[terrain] in frames
    plan, rows = tmp_path / "fly.plan", tmp_path / "fly.waypoints"
    with pytest.warns(UserWarning, match="fence"):
        files.write_mission(mission, rows)
    files.write_mission(mission, plan)
    found = mavsdk_reader.import_qgroundcontrol_mission(str(plan)).mission_items
    assert len(found) == len(mission.items)
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(rows)) == len(mission.items) + 1
    for number, (item, theirs) in enumerate(zip(mission.items, found, strict=True), start=1):
        row = loader.wp(number)
        assert (theirs.command, theirs.frame) == (row.command, row.frame) == (item.command, item.frame)
        assert abs(theirs.x / 1e7 - item.lat) <= 1e-7 and abs(theirs.y / 1e7 - item.lon) <= 1e-7
        assert (row.x, row.y) == pytest.approx((item.lat, item.lon), abs=1e-8)
        assert theirs.z == pytest.approx(item.altitude_m, abs=1e-4) and row.z == pytest.approx(
            item.altitude_m
        )
        params = theirs.param1, theirs.param2, theirs.param3, theirs.param4
        for mine, param in zip(item.params, params, strict=True):
            assert param == pytest.approx(math.nan if mine is None else mine, nan_ok=True, rel=1e-6)
        assert (row.param1, row.param2, row.param3, row.param4) == pytest.approx(
            [p or 0 for p in item.params]
        )
    checked = check(plan, CheckRequest(autopilot))
    assert checked.problems == () and checked.mission == mission
    assert not list(SafetyCheck().problems(files.read_mission(rows))) or terrain is not None
