"""The height of home, from the DEM or compared with it; parameters of a flight above the ground."""

from pathlib import Path
from typing import Any

import pytest
import shapely

from tests.flight.small_regions import degrees, planned as over_regions
from tests.flight.terrain.dems import HOME, draw, plane, write
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams, SafetyParams, TerrainParams, terrain_params
from uavseg.flight.terrain.follow import home_on_ground
from uavseg.raster.elevation.dem import Dem


@pytest.fixture
def level(tmp_path: Path) -> Dem:
    """Flat ground at 400 m."""
    return Dem.open(draw(tmp_path / "level.tif", plane(0, 0), unit="m"))


def on_ground(dem: Dem | None, home: tuple[float, ...], altitude_m: float = 60) -> Any:
    terrain = None if dem is None else TerrainParams(dem)
    return home_on_ground(home, PlanParams(altitude_m, terrain=terrain))


def test_without_a_model_home_stays_as_it_is() -> None:
    assert on_ground(None, HOME) == (HOME, [])


def test_a_missing_height_is_that_of_the_ground(level: Dem) -> None:
    home, [note] = on_ground(level, HOME)
    assert home == (*HOME, 400.0) and "ground in level.tif: 400.0 m" in note


@pytest.mark.parametrize(
    ("given_m", "altitude_m", "reported"),
    [
        (400, 60, False),
        (409.9, 60, False),
        (410.1, 60, True),
        (429.9, 60, True),
        (371, 60, True),
        (449, 120, True),
    ],
)
def test_a_given_height_that_differs_is_reported(
    level: Dem, given_m: float, altitude_m: float, reported: int
) -> None:
    home, notes = on_ground(level, (*HOME, given_m), altitude_m)
    assert home == (*HOME, given_m) and len(notes) == reported


@pytest.mark.parametrize(
    ("given_m", "altitude_m"), [(430.1, 60), (0.0, 60), (451, 120), (411, 15), (1312, 60)]
)
def test_a_height_that_cannot_be_right_is_refused(level: Dem, given_m: float, altitude_m: float) -> None:
    with pytest.raises(MissionError, match="one of the two is wrong"):
        on_ground(level, (*HOME, given_m), altitude_m)


def test_home_outside_of_the_model_is_refused(level: Dem) -> None:
    with pytest.raises(MissionError, match=r"has no height of the ground at lat 48\.000000, lon 9.000000"):
        on_ground(level, (48.0, 9.0))


def test_heights_above_the_ellipsoid_are_flown_above_home_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import numpy as np
    from affine import Affine

    monkeypatch.setattr("uavseg.raster.elevation.dem.sea_from_ellipsoid", lambda: None)
    path = write(
        tmp_path / "a.tif", np.full((90, 90), 448.0), Affine(1e-3, 0, 8.95, 0, -1e-3, 47.05), 4979,
        GEOTIFF_VERSION="1.1",
    )  # fmt: skip
    dem = Dem.open(path)
    with pytest.raises(ParameterError, match="--terrain relative"):
        TerrainParams(dem)
    params = PlanParams(60, terrain=TerrainParams(dem, "relative"))
    assert home_on_ground(HOME, params) == (HOME, [])
    assert home_on_ground((*HOME, 400.0), params) == ((*HOME, 400.0), [])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"mode": "absolute"}, "give --dem"),
        ({"mode": "relative"}, "give --dem"),
        ({"mode": ""}, "one of frame, absolute, relative"),
        ({"mode": "agl"}, "one of frame, absolute, relative"),
        ({"tolerance_m": 5.0}, "give --dem"),
        ({"mode": "frame", "climb_m_s": 0.0}, "climb rate"),
        ({"mode": "frame", "descent_m_s": float("nan")}, "descent rate"),
    ],
)
def test_parameters_that_do_not_go_together_are_refused(words: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        terrain_params(None, **words)


def test_nothing_is_asked_for_without_a_model() -> None:
    assert terrain_params(None) is None
    with pytest.raises(ParameterError, match="give at least one"):
        terrain_params([])  # an empty list is a mistake of a program, not flat ground


@pytest.mark.parametrize(
    ("tolerance_m", "altitude_m", "fits"),
    [(0.05, 60, False), (30.5, 60, False), (30, 60, True), (0.1, 60, True)],
)
def test_a_tolerance_is_at_most_half_of_the_height(
    level: Dem, tolerance_m: float, altitude_m: float, fits: bool
) -> None:
    terrain = TerrainParams(level, tolerance_m=tolerance_m)
    if fits:
        assert PlanParams(altitude_m, terrain=terrain).terrain is terrain
        return
    with pytest.raises(ParameterError, match="tolerance of the height"):
        PlanParams(altitude_m, terrain=terrain)


def test_the_default_tolerance_fits_every_height(level: Dem) -> None:
    found = [TerrainParams(level).tolerance_for(altitude) for altitude in (0.1, 8, 20, 120)]
    assert found == [0.1, 2, 5, 5]


def test_only_ardupilot_knows_the_terrain_frame() -> None:
    terrain = TerrainParams(None, "frame")
    assert PlanParams(60, terrain=terrain).terrain is terrain
    with pytest.raises(ParameterError, match="not to px4"):
        PlanParams(60, autopilot="px4", terrain=terrain)


@pytest.mark.slow
def test_the_path_of_a_mission_knows_the_ground(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "slope.tif", plane(0.1, 0), half_m=2500.0, crs=32632))
    home = (HOME[0], HOME[1] + 0.001)
    region = [degrees(shapely.box(100, 400, 400, 500), Plane(*HOME))]
    heights = {}
    for mode in ("absolute", "frame"):
        mission = over_regions(region, home, pattern="survey", spacing_m=40, terrain=TerrainParams(dem, mode))
        heights[mode] = mission.path[2]
        assert mission.ground is not None
        assert mission.ground.lowest_m == pytest.approx(60, abs=0.01)
        assert 60 <= mission.ground.highest_m <= 65  # the return is level, within the tolerance
        assert mission.home.altitude_m == pytest.approx(400 + 0.1 * 76, abs=0.1)
    assert heights["absolute"] == pytest.approx(heights["frame"], abs=0.02)
    assert heights["absolute"].max() > 65
    tall = over_regions(region, home, altitude_m=115, terrain=TerrainParams(dem))
    assert tall.path[2].max() > 120 and not [one for one in tall.warnings if "permit" in one]
    permitted = SafetyParams(max_altitude_m=200)
    high = over_regions(region, home, altitude_m=125, safety=permitted, terrain=TerrainParams(dem))
    [warning] = [one for one in high.warnings if "permit" in one]
    assert warning == "125 m above the ground is more than most countries allow without a permit (120 m)"
