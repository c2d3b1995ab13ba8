"""The ground that photographs show: planes against geometry, hills against a march along rays."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings, strategies as st

from tests.photographs.dems import LAT, LON, write_dem
from tests.photographs.make import ground_lonlat
from uavseg.errors import MissionError, ParameterError, PhotographError
from uavseg.flight.mission.track import Plane
from uavseg.photographs.ground import Ground
from uavseg.photographs.read import Photograph
from uavseg.raster.elevation.dem import Dem

PHOTO = Photograph(
    path="a.jpg",
    lon=LON,
    lat=LAT,
    relative_m=60,
    altitude_m=560,
    yaw_deg=20,
    image_px=(120, 80),
    focal_px=110.0,
)
POSES = [
    replace(PHOTO, yaw_deg=0),
    replace(PHOTO, yaw_deg=-130, pitch_deg=-60),
    replace(PHOTO, yaw_deg=77, pitch_deg=-50, roll_deg=12),
    replace(PHOTO, yaw_deg=200, pitch_deg=-85, roll_deg=-170),
]


def hills(east: Any, north: Any) -> Any:
    return 500 + 9 * np.sin(east / 25) + 7 * np.cos(north / 18) + 0.03 * east


def ridge(east: Any, north: Any) -> Any:
    """500 m, with a ridge of 40 m from west to east, 40.5 to 60.5 m to the north."""
    return 500 + np.clip(40 - 4 * np.abs(north - 50.5), 0, 40)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ground")


@pytest.fixture(scope="module")
def level(folder: Path) -> Dem:
    return Dem.open(write_dem(folder / "level.tif", lambda east, north: 500))


@pytest.mark.parametrize("photograph", POSES)
def test_a_level_elevation_model_is_flat_ground(photograph: Photograph, level: Dem) -> None:
    flat, over_dem = Ground().footprint(photograph), Ground(level).footprint(photograph)
    assert flat.hausdorff_distance(over_dem) < 1e-8  # a millimetre
    pixels = photograph.border(7)
    expected = Ground().seen(photograph, pixels) + np.array([0, 0, 500])
    np.testing.assert_allclose(Ground(level).seen(photograph, pixels), expected, atol=1e-4)


@pytest.mark.slow
@given(
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.floats(-180, 180),
    st.floats(-90, -55),
    st.floats(-20, 20),
)
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_rays_meet_a_slope_where_geometry_says(
    folder: Path, east: float, north: float, yaw: float, pitch: float, roll: float
) -> None:
    slope = write_dem(folder / "slope.tif", lambda x, y: 500 + east * x + north * y)
    photograph = replace(PHOTO, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    rays = photograph.rays(photograph.border(3))
    # 560 + t up = 500 + t (east, north) . (x, y)
    length = 60 / (rays[:, :2] @ [east, north] - rays[:, 2])
    expected = rays * length[:, None] + [0, 0, 560]
    inside = (np.abs(expected[:, :2]) < 390).all(axis=1) & (length > 0)
    found = Ground(Dem.open(slope)).seen(photograph, photograph.border(3))
    seen = inside & np.isfinite(found[:, 0])
    assert seen.sum() >= 4
    np.testing.assert_allclose(found[seen], expected[seen], atol=1e-3)


@pytest.mark.parametrize("photograph", POSES)
def test_hills_are_met_where_a_march_along_the_rays_meets_them(photograph: Photograph, folder: Path) -> None:
    path = write_dem(folder / "hills.tif", hills)
    pixels = photograph.border(6)
    east, north, _ = Ground(Dem.open(path)).seen(photograph, pixels).T
    lon, lat = ground_lonlat(photograph, pixels, path)
    x, y = Plane(LAT, LON).xy_from_lonlat(lon, lat)
    np.testing.assert_allclose(np.column_stack([east, north]), np.column_stack([x, y]), atol=0.02)


def test_ground_behind_a_ridge_is_hidden(folder: Path) -> None:
    dem = Dem.open(write_dem(folder / "ridge.tif", ridge, pixel_m=1))
    photograph = replace(PHOTO, yaw_deg=0, pitch_deg=-45, altitude_m=545)
    rows = np.linspace(1, 80, 60)
    seen = Ground(dem).seen(photograph, np.column_stack([np.full(60, 60.0), rows]))
    north, height = seen[:, 1], seen[:, 2]
    np.testing.assert_allclose(height, ridge(0, north), atol=0.01)  # all of it on the ground
    # The ray over the crest (50.5 m to the north, 540 m high) falls by 5 m in 50.5 m.
    hidden = (north > 51) & (north < 50.5 + 40 / 5 * 50.5 - 1)
    assert (north < 50.5).any() and not hidden.any()


def test_the_height_is_that_above_takeoff_where_its_place_is_known(folder: Path, level: Dem) -> None:
    slope = Dem.open(write_dem(folder / "rising.tif", lambda east, north: 500 + 0.1 * north))
    assert Ground(slope).camera_height_m(PHOTO) == 560
    north_m = 111_195.0
    assert Ground(slope, (LAT + 100 / north_m, LON)).camera_height_m(PHOTO) == pytest.approx(570, abs=0.05)
    assert Ground(slope, (LAT, LON, 520.0)).camera_height_m(PHOTO) == 580
    assert Ground(None, (LAT, LON, 520.0)).camera_height_m(replace(PHOTO, relative_m=None)) == 40
    assert Ground().camera_height_m(PHOTO) == 60


def test_heights_above_the_ellipsoid_are_brought_to_the_sea(level: Dem) -> None:
    photograph = replace(PHOTO, altitude_m=610, is_ellipsoidal=True)
    ground = Ground(level, to_sea=lambda lon, lat, height: height - 48)
    assert ground.camera_height_m(photograph) == 562
    with pytest.raises(PhotographError, match="no geoid"):
        Ground(level, to_sea=None).camera_height_m(photograph)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"relative_m": None, "altitude_m": None}, "no height above the sea"),
        ({"altitude_m": 490}, "10.0 m below the ground"),
        ({"altitude_m": 500}, "0.0 m below the ground"),
        ({"altitude_m": 500 + 1e-12}, "has no area"),
        ({"lat": LAT + 1}, "does not cover the place where"),
        ({"pitch_deg": -10}, "looks to the horizon"),
        ({"pitch_deg": 20}, "looks to the horizon"),
        ({"pitch_deg": -35, "altitude_m": 900}, "beyond the elevation model"),
    ],
)
def test_what_cannot_be_seen_is_refused(changes: dict[str, Any], says: str, level: Dem) -> None:
    with pytest.raises(PhotographError, match=says):
        Ground(level).footprint(replace(PHOTO, **changes))


def test_flat_ground_needs_a_height() -> None:
    with pytest.raises(PhotographError, match="--home LAT,LON,M"):
        Ground().camera_height_m(replace(PHOTO, relative_m=None))
    with pytest.raises(PhotographError, match="no height above the sea, nor one above takeoff"):
        Ground(None, (LAT, LON, 5.0)).camera_height_m(replace(PHOTO, relative_m=None, altitude_m=None))
    with pytest.raises(PhotographError, match="place of takeoff"):
        Ground(None, (LAT, LON, 700.0)).camera_height_m(replace(PHOTO, relative_m=None))


@pytest.mark.parametrize("home", [(1.0,), (47.0, 8.0, 1.0, 2.0)])
def test_a_place_of_takeoff_is_two_or_three_numbers(home: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError, match="home is"):
        Ground(home=home)


@pytest.mark.parametrize("home", [(91.0, 0.0), (0.0, 200.0), (float("nan"), 0.0), (47.0, 8.0, 1e5)])
def test_a_place_of_takeoff_is_on_earth(home: tuple[float, ...]) -> None:
    with pytest.raises(MissionError):
        Ground(home=home)


def test_heights_that_differ_are_told(level: Dem) -> None:
    assert Ground(level).notes(PHOTO) == ()
    assert Ground().notes(replace(PHOTO, relative_m=10)) == ()
    assert Ground(level).notes(replace(PHOTO, relative_m=None)) == ()
    [note] = Ground(level).notes(replace(PHOTO, relative_m=45))
    assert note.startswith("60 m above the ground by altitude, but 45 m above takeoff")
    assert Ground(level).notes(replace(PHOTO, relative_m=50)) == ()
    [note] = Ground(level, (LAT, LON)).notes(replace(PHOTO, altitude_m=590))
    assert note == "60 m above the ground by takeoff, but 90 m by altitude"


def test_heights_that_cannot_be_compared_are_not(level: Dem) -> None:
    photograph = replace(PHOTO, altitude_m=900, is_ellipsoidal=True)
    ground = Ground(level, (LAT, LON), to_sea=None)
    assert ground.camera_height_m(photograph) == pytest.approx(560)
    assert ground.notes(photograph) == ()


@pytest.mark.parametrize("lon", [180.0, -180.0, 179.9999, -179.9999])
def test_outlines_go_on_over_the_antimeridian(lon: float) -> None:
    here, there = Ground().footprint(PHOTO), Ground().footprint(replace(PHOTO, lon=lon))
    moved = shapely.transform(here, lambda xy: xy + np.array([lon - LON, 0]))
    assert moved.hausdorff_distance(there) < 1e-9
