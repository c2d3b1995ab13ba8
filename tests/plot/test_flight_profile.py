"""Profiles of flights: heights above the ground below, and lines with photographs where they are flown."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from affine import Affine

from tests.plot.pictures import UTM, write
from uavseg.errors import MissionError
from uavseg.flight.camera.camera import Photos, camera_named
from uavseg.flight.mission.mission import Mission
from uavseg.flight.params.plan import PlanParams, terrain_params
from uavseg.flight.planning.planner import plan_missions
from uavseg.plot.preview_missions import flight_profile
from uavseg.raster.elevation.dem import Dem

HOME = (44.2005, -76.5005)
FIELD = shapely.box(-76.5, 44.2, -76.498, 44.2015)
ALTITUDE_M = 50.0


@pytest.fixture(scope="module")
def hills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Hills of 30 m around the field."""
    rows, cols = np.mgrid[:120, :120]
    heights = (200 + 15 * np.sin(rows / 9) + 15 * np.cos(cols / 11)).astype(np.float32)
    place = Affine(5, 0, 379_900, 0, -5, 4_895_500)
    return write(tmp_path_factory.mktemp("dem") / "hills.tif", heights, place, UTM)


def flown(hills: Path | None = None, mode: str | None = None, **more: object) -> Mission:
    terrain = None if hills is None else terrain_params(hills, mode)
    params = PlanParams(altitude_m=ALTITUDE_M, pattern="survey", spacing_m=30.0, terrain=terrain, **more)  # type: ignore[arg-type]
    [mission] = plan_missions([FIELD], [(-76.499, 44.2007)], params, HOME)
    return mission


def test_a_level_flight_is_level_between_its_ends() -> None:
    mission = flown()
    profile = flight_profile(mission)
    assert profile.zero == "home" and not len(profile.ground_m) and np.isnan(profile.lowest_m)
    assert profile.height_m[0] == 0 and profile.height_m[-1] == 0
    assert np.allclose(profile.height_m[1:-1], ALTITUDE_M)
    assert profile.along_m[-1] == pytest.approx(mission.estimate.distance_m)


@pytest.mark.slow
def test_lines_with_photographs_are_as_long_as_the_survey_lines() -> None:
    profile = flight_profile(flown(photos=Photos(camera_named("phantom 4 rtk"))))
    legs = np.diff(profile.along_m)
    assert not profile.is_line[0] and not profile.is_line[-1]
    # the field is 160 m wide and 167 m high: its lines, 30 m apart, cover it
    assert 0.9 * 160 * 167 / 30 < legs[profile.is_line].sum() < 1.25 * 160 * 167 / 30
    assert not flight_profile(flown()).is_line.any()


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["absolute", "relative", "frame"])
def test_the_height_above_the_ground_is_what_was_planned(hills: Path, mode: str) -> None:
    mission, dem = flown(hills, mode), Dem.open(hills)
    profile = flight_profile(mission, dem)
    tolerance = 5.0 if mode != "frame" else 0.5
    assert profile.zero == "the sea"
    assert ALTITUDE_M - tolerance - 1.5 < profile.lowest_m < ALTITUDE_M + 0.5
    assert np.ptp(profile.ground_m) > 20
    above = np.interp(profile.ground_along_m, profile.along_m, profile.height_m) - profile.ground_m
    between = (profile.ground_along_m > 0) & (profile.ground_along_m < profile.along_m[-1])
    assert np.abs(above[between] - ALTITUDE_M).max() < tolerance + 1.5
    assert profile.height_m[[0, -1]] == pytest.approx(profile.ground_m[[0, -1]], abs=0.2)


def test_a_level_flight_over_hills_is_as_near_to_them_as_the_highest(hills: Path) -> None:
    profile = flight_profile(flown(), Dem.open(hills))
    assert profile.lowest_m == pytest.approx(profile.ground_m[0] + ALTITUDE_M - profile.ground_m.max())


def test_ground_that_is_not_known_is_refused(tmp_path: Path, hills: Path) -> None:
    far = write(
        tmp_path / "far.tif", np.ones((9, 9), np.float32), Affine(5, 0, 379_900, 0, -5, 4_999_000), UTM
    )
    with pytest.raises(MissionError, match=r"far\.tif has no height of the ground at lat 44\.2"):
        flight_profile(flown(), Dem.open(far))
