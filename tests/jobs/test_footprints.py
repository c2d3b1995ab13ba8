"""Footprints of photographs as regions: where they lie, what they say, and in which files."""

import warnings
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from pyproj import Geod

import uavseg
from tests.photographs.dems import LAT, LON, write_dem
from tests.photographs.make import draw_photograph, ground_lonlat
from uavseg.cli import main
from uavseg.errors import MissionError, ParameterError, PhotographError
from uavseg.photographs.read import Photograph

PHOTO = Photograph(
    path="a.jpg",
    lon=LON,
    lat=LAT,
    relative_m=60,
    altitude_m=560,
    yaw_deg=30,
    image_px=(120, 80),
    focal_px=100.0,
    taken_s=1_700_000_000.25,
)
POSES = {
    "nadir": {},
    "oblique": {"pitch_deg": -50.0, "yaw_deg": -100.0},
    "rolled": {"pitch_deg": -70.0, "roll_deg": 12.0},
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def hills(east: Any, north: Any) -> Any:
    return 500 + 6 * np.sin(east / 30) + 5 * np.cos(north / 22)


def quiet(*sources: Any, **words: Any) -> geopandas.GeoDataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return uavseg.footprints(list(sources), **words)


def warnings_of(*sources: Any, **options: Any) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        uavseg.footprints(list(sources), **options)
    return [str(one.message) for one in caught]


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["footprints", *words])
    return result.exit_code, result.stderr


def border_lonlat(photograph: Photograph, steps: int, dem: Path | None = None) -> Any:
    cols, rows = photograph.image_px
    share = np.arange(steps)[:, None] / steps
    corners = np.array([[0, 0], [cols, 0], [cols, rows], [0, rows], [0, 0]], float)
    sides = [one + share * (two - one) for one, two in pairwise(corners)]
    return shapely.Polygon(np.column_stack(ground_lonlat(photograph, np.concatenate(sides), dem)))


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("maker", ["dji", "parrot", "sensefly"])
def test_footprints_lie_where_the_pixels_were_drawn_from(pose: str, maker: str) -> None:
    photograph = replace(PHOTO, **POSES[pose])
    frame = quiet(draw_photograph("a.jpg", photograph, maker=maker))
    expected = border_lonlat(photograph, 1)
    assert frame.crs == "EPSG:4326"
    difference = frame.geometry[0].symmetric_difference(expected).area
    assert difference < 1e-4 * expected.area
    area = abs(Geod(ellps="WGS84").geometry_area_perimeter(expected)[0])
    assert frame.area_m2[0] == pytest.approx(area, rel=1e-4)
    assert shapely.Point(frame.lon[0], frame.lat[0]).within(frame.geometry[0])


@pytest.mark.slow
@pytest.mark.parametrize("pose", POSES)
def test_footprints_over_hills_lie_where_a_march_along_the_rays_ends(pose: str) -> None:
    dem = write_dem(Path("dem.tif"), hills)
    photograph = replace(PHOTO, **POSES[pose])
    frame = quiet(draw_photograph("a.jpg", photograph), dem=dem)
    expected = border_lonlat(photograph, 16, dem)
    assert frame.geometry[0].symmetric_difference(expected).area < 1e-3 * expected.area
    assert frame.height_m[0] == pytest.approx(560 - hills(0, 0), abs=0.01)
    flat = quiet("a.jpg").geometry[0]
    assert flat.symmetric_difference(expected).area > 1e-2 * expected.area


def test_attributes_are_those_of_the_pose() -> None:
    draw_photograph("a.jpg", replace(PHOTO, yaw_deg=-30, pitch_deg=-60))
    [row] = quiet("a.jpg").to_dict("records")
    assert list(row)[:2] == ["id", "area_m2"] and row["id"] == 1
    assert (row["photo"], row["taken"]) == ("a.jpg", "2023-11-14T22:13:20.250")
    assert (row["camera_lon"], row["camera_lat"]) == (LON, LAT)
    assert (row["yaw"], row["pitch"], row["height_m"]) == (330, -60, 60)
    assert row["gsd_cm"] == pytest.approx(100 * 60 / np.sin(np.radians(60)) / 100)
    draw_photograph("b.jpg", replace(PHOTO, taken_s=None))
    assert quiet("b.jpg").taken[0] == ""


def test_the_camera_of_the_call_takes_the_place_of_the_tags() -> None:
    draw_photograph("a.jpg", PHOTO)
    given = quiet("a.jpg", camera="DJI Phantom 4 Pro")  # 8.8 mm on 13.2 mm: 80 pixels of 120
    assert given.gsd_cm[0] == pytest.approx(75)
    assert given.area_m2[0] == pytest.approx(quiet("a.jpg").area_m2[0] / 0.64, rel=1e-4)


@pytest.mark.parametrize("lon", [180.0, -180.0, 179.9997, -179.9997])
def test_footprints_over_the_antimeridian_are_cut_there(lon: float) -> None:
    here = quiet(draw_photograph("here.jpg", PHOTO))
    there = quiet(draw_photograph("there.jpg", replace(PHOTO, lon=lon)))
    [outline] = there.geometry
    west, _, east, _ = outline.bounds
    assert (west, east) == (-180, 180) and outline.geom_type == "MultiPolygon"
    assert all(part.bounds[2] - part.bounds[0] < 0.01 for part in outline.geoms)
    assert there.area_m2[0] == pytest.approx(here.area_m2[0], rel=1e-6)
    for name in ("out.gpkg", "out.geojson"):
        assert run("there.jpg", "-o", name)[0] == 0
        [read] = geopandas.read_file(name, layer=None).geometry
        assert read.symmetric_difference(outline).area < 1e-3 * outline.area


@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "fgb", "shp", "kml"])
def test_all_formats_hold_the_footprints(suffix: str) -> None:
    for number in range(3):
        draw_photograph(f"{number}.jpg", replace(PHOTO, lat=LAT + number * 1e-4, taken_s=1.7e9 + number))
    expected = quiet(".")
    assert run(".", "-o", f"../out.{suffix}")[0] == 0
    read = geopandas.read_file(f"../out.{suffix}")
    assert len(read) == 3
    read = read.sort_values("photo")  # a .fgb has them in another order
    for one, other in zip(read.geometry, expected.geometry, strict=True):
        assert one.symmetric_difference(other).area < 1e-3 * other.area  # a centimetre of 70 m, in GeoJSON
    assert read.photo.tolist() == ["0.jpg", "1.jpg", "2.jpg"]


def test_those_that_show_no_ground_are_named() -> None:
    draw_photograph("good.jpg", PHOTO)
    for number in range(5):
        draw_photograph(f"{number}.jpg", replace(PHOTO, pitch_deg=-5.0))
    draw_photograph("low.jpg", replace(PHOTO, relative_m=-3.0))
    draw_photograph("lower.jpg", replace(PHOTO, relative_m=-4.0))
    notes = warnings_of(".")
    assert notes[0] == "0.jpg, 1.jpg, 2.jpg and 2 more: left out, as a part of it looks to the horizon"
    assert notes[1].startswith("low.jpg, lower.jpg: left out, as its height is 3.0 m below the ground")
    assert len(notes) == 2
    assert quiet(".").photo.tolist() == ["good.jpg"]


def test_heights_that_differ_are_a_warning() -> None:
    dem = write_dem(Path("dem.tif"), lambda east, north: 500)
    draw_photograph("a.jpg", replace(PHOTO, relative_m=40))
    notes = warnings_of("a.jpg", dem=dem)
    assert notes[0].startswith("a.jpg: 60 m above the ground by altitude, but 40 m above takeoff")
    assert "does not say what its heights are above" in notes[1]
    notes = warnings_of("a.jpg", dem=dem, home=(LAT, LON))
    assert notes[0] == "a.jpg: 40 m above the ground by takeoff, but 60 m by altitude"


def test_none_that_can_be_drawn_is_an_error() -> None:
    draw_photograph("a.jpg", replace(PHOTO, pitch_deg=0.0))
    with pytest.raises(PhotographError, match="no photograph shows ground that is known; a\\.jpg: left out"):
        uavseg.footprints("a.jpg")
    code, said = run("a.jpg", "-o", "out.gpkg")
    assert code == 1 and said.count("\n") == 1 and not Path("out.gpkg").exists()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"home": (91.0, 0.0)}, MissionError),
        ({"home": (1.0,)}, ParameterError),
        ({"camera": "nothing of the kind"}, ParameterError),
    ],
)
def test_parameters_that_are_wrong_are_refused(words: dict[str, Any], error: type[Exception]) -> None:
    draw_photograph("a.jpg", PHOTO)
    with pytest.raises(error):
        uavseg.footprints("a.jpg", **words)


def test_nothing_is_overwritten_or_left_behind() -> None:
    draw_photograph("a.jpg", PHOTO)
    assert run("a.jpg", "-o", "out.geojson")[0] == 0
    before = Path("out.geojson").read_bytes()
    code, said = run("a.jpg", "-o", "out.geojson")
    assert code == 1 and "--overwrite" in said
    assert run("a.jpg", "-o", "out.geojson", "--overwrite")[0] == 0
    assert Path("out.geojson").read_bytes() == before
    assert run("a.jpg", "-o", "out.txt")[0] == 1
    assert run("a.jpg")[0] == 2
    assert sorted(path.name for path in Path().iterdir()) == ["a.jpg", "out.geojson"]


def test_the_command_tells_what_it_wrote() -> None:
    for number in range(2):
        draw_photograph(f"{number}.jpg", replace(PHOTO, relative_m=60 + 60 * number, taken_s=1.7e9 + number))
    code, said = run("0.jpg", "1.jpg", "-o", "out.gpkg", "--progress", "plain")
    lines = said.splitlines()
    assert code == 0 and [line for line in lines if line.startswith("progress")][-1] == "progress 100"
    assert "  footprints  2 -> out.gpkg" in lines
    assert "  areas       3,456.0 to 13,824.0 m2" in lines


def test_progress_runs_to_its_end() -> None:
    for number in range(3):
        draw_photograph(f"{number}.jpg", PHOTO)
    seen: list[tuple[int, int]] = []
    quiet(".", progress=lambda done, total: seen.append((done, total)))
    assert seen == [(n, 6) for n in range(1, 7)]


@pytest.mark.slow
def test_a_thousand_photographs_have_footprints() -> None:
    for number in range(1000):
        place = {"lat": LAT + (number % 50) * 1e-5, "lon": LON + number // 50 * 1e-5}
        draw_photograph(f"{number:04d}.jpg", replace(PHOTO, **place, taken_s=1.7e9 + number))
    frame = quiet(".")
    assert frame.photo.tolist() == [f"{number:04d}.jpg" for number in range(1000)]
    assert frame.geometry.is_valid.all()
