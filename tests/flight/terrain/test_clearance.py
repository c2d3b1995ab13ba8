"""The heights of a complete mission above the ground of a DEM."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from tests.flight.terrain.dems import HOME, cone, draw, hills, plane
from tests.flight.terrain.flights import PLANE, flown, follow, track
from uavseg.errors import MissionError
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    RETURN,
    HomePosition,
    MissionItem,
    RallyPoint,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.params.plan import PlanParams, TerrainParams
from uavseg.flight.planning.along import items_along
from uavseg.flight.safety.check import Clearance, clearance_of
from uavseg.flight.terrain.follow import GroundPath, WaypointHeights
from uavseg.raster.elevation.dem import Dem


def mission(path: Any, frame: int, heights: Any, takeoff_m: float = 60.0) -> Mission:
    lon, lat = PLANE.lonlat_from_xy(*np.array(path, float).T)
    none = np.zeros(len(lon), bool)
    flight = WaypointHeights(frame, np.array(heights, float), takeoff_m, none, np.full(len(lon), 5.0))
    home = HomePosition(*HOME, 400.0)
    return Mission(home, items_along(track(lon, lat), home, PlanParams(60), flight))


def check(clearance: Clearance, flight: Mission, maximum_m: float) -> None:
    """Raise MissionError with the first of the problems, if there is one."""
    for problem in clearance.problems(flight, maximum_m):
        raise MissionError(problem)


@pytest.mark.slow
@given(st.integers(0, 99), st.floats(10, 100), st.floats(-8, 8))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_planned_flight_passes_and_a_lowered_or_raised_one_does_not(
    tmp_path: Path, seed: int, relief_m: float, moved_m: float
) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", hills(relief_m, seed)))
    found = follow(dem, [(-300, 200), (500, 100)], tolerance_m=4.0)
    above = flown(dem, found)
    height_m = float(dem.heights_m([HOME[1]], [HOME[0]])[0])
    home = HomePosition(*HOME, height_m)

    def moved(path: GroundPath, by_m: float) -> Mission:
        heights = path.heights
        flight = WaypointHeights(
            heights.frame, heights.height_m + by_m, heights.takeoff_m + by_m, heights.added, heights.speed_m_s
        )
        items = items_along(path.track, home, PlanParams(60), flight)
        return Mission(home, items)

    assert found.ground is not None
    lowest, highest = found.ground.lowest_m, found.ground.highest_m
    check(Clearance(dem, lowest), moved(found, 0.0), highest + 0.5)
    checked = Clearance(dem, 56)
    if above.min() + moved_m < 55.5:
        with pytest.raises(MissionError, match=r"above the ground of a\.tif, and at least 56\.0 m"):
            check(checked, moved(found, moved_m), 200)
    elif above.min() + moved_m > 56.5:
        check(checked, moved(found, moved_m), 200)
    with pytest.raises(MissionError, match="--max-altitude"):
        check(Clearance(dem, 0), moved(found, moved_m), above.max() + moved_m - 1)


def test_a_hill_between_two_waypoints_or_on_the_way_back_is_seen(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(50, 120, 500, 0)))
    over, back = [(300, 0), (700, 0)], [(300, 400), (900, 0)]
    for path in (over, back):
        for frame, zero in ((FRAME_AMSL, 400), (FRAME_RELATIVE, 0)):
            with pytest.raises(MissionError, match=r"is 1\d\.\d m above the ground"):
                check(Clearance(dem, 55), mission(path, frame, [zero + 60] * 2), 120)
    check(Clearance(dem, 55), mission([(300, 0), (300, 300)], FRAME_AMSL, [460] * 2), 120)


def test_rally_points_keep_above_their_own_ground(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(50, 120, 500, 0)))
    lon, lat = (float(v) for v in PLANE.lonlat_from_xy(500, 0))
    flight = mission([(300, 0), (300, 300)], FRAME_AMSL, [460] * 2)
    for height_m, words in ((40, ["and at least 5.0 m"]), (70, []), (190, ["--max-altitude"])):
        found = list(
            Clearance(dem, 55).problems(replace(flight, rally=(RallyPoint(lat, lon, height_m),)), 120)
        )
        assert [word in text for word, text in zip(words, found, strict=True)] == [True] * len(words)
        assert all("rally point 1" in text for text in found)


def test_a_mission_without_takeoff_starts_at_the_ground_of_home(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", plane(0, 0)))
    whole = mission([(300, 0)], FRAME_AMSL, [460])
    without = Mission(whole.home, (*whole.items[1:-1], MissionItem(RETURN, 2)))
    with pytest.raises(MissionError, match=r"is 0\.0 m above the ground"):
        check(Clearance(dem, 55), without, 120)


def test_heights_above_the_terrain_of_the_vehicle_are_taken_for_what_they_say(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(150, 300, 500, 0)))
    check(Clearance(dem, 55), mission([(300, 0), (700, 0)], FRAME_TERRAIN, [60, 60]), 120)
    with pytest.raises(MissionError, match="higher than allowed"):
        check(Clearance(dem, 55), mission([(300, 0), (700, 0)], FRAME_TERRAIN, [60, 121]), 120)


def test_without_a_model_nothing_is_checked_here(tmp_path: Path) -> None:
    assert clearance_of(PlanParams(60)) is None
    assert clearance_of(PlanParams(60, terrain=TerrainParams(None, "frame"))) is None
    dem = Dem.open(draw(tmp_path / "a.tif", plane(0, 0)))
    found = clearance_of(PlanParams(60, terrain=TerrainParams(dem, tolerance_m=7)))
    assert found is not None and found.minimum_m == 53


@pytest.mark.parametrize(("rise_m", "words"), [(-40.0, "at least 55"), (40.0, "--max-altitude")])
def test_a_vehicle_that_changes_its_height_early_is_checked_where_it_flies(
    tmp_path: Path, rise_m: float, words: str
) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", plane(rise_m / 400, 0)))
    start = 400 + rise_m / 2 + 60  # the ground and the straight line rise alike over 400 m
    flight = mission([(200, 0), (600, 0)], FRAME_AMSL, [start, start + rise_m], takeoff_m=start - 400)
    straight = replace(flight, items=flight.items[:-1])
    check(Clearance(dem, 35), straight, 85)
    with pytest.raises(MissionError, match=words):
        check(Clearance(dem, 55, (3.0, 1.5)), straight, 70 if rise_m > 0 else 120)


@pytest.mark.parametrize("autopilot", ["px4", "generic", "ardupilot"])
def test_the_rates_that_are_planned_with_are_those_that_are_checked(tmp_path: Path, autopilot: str) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", plane(0, 0)))
    found = clearance_of(PlanParams(60, autopilot=autopilot, terrain=TerrainParams(dem, climb_m_s=2.0)))
    assert found is not None
    assert found.early == (None if autopilot == "ardupilot" else (2.0, 1.5))
