"""`uavseg plan` with what an operator gets wrong: one clear line, exit 1, no file; or it is understood."""

import re
import shutil
import warnings
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result

import uavseg
from uavseg.cli import main
from uavseg.cli.command import joined_home
from uavseg.flight.formats import files

BOW = shapely.Polygon([(8, 47), (8.002, 47.002), (8.002, 47), (8, 47.002)])
TOUCHING = shapely.Polygon(
    [(8, 47), (8.002, 47), (8.001, 47.001), (8.002, 47.002), (8, 47.002), (8.001, 47.001)]
)
BOXES = [shapely.box(8, 47, 8.004, 47.00135), shapely.box(8.006, 47, 8.007, 47.001)]
SHAPES = {
    "r": BOXES,
    "bow": [BOW],
    "touching": [TOUCHING],
    "tiny": [shapely.box(8, 47, 8.00005, 47.00005), BOXES[1]],
    "zone": [shapely.box(8.0005, 47.0003, 8.0008, 47.0006)],
}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Regions, a keep-out zone in the first of them, regions without a CRS, and a DEM with a hole."""
    folder = tmp_path_factory.mktemp("drawn")
    for name, shapes in SHAPES.items():
        frame = geopandas.GeoDataFrame({"id": range(1, len(shapes) + 1)}, geometry=shapes, crs=4326)
        frame.to_file(folder / f"{name}.geojson")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        geopandas.GeoDataFrame({"id": [1]}, geometry=[shapely.box(0, 0, 9, 9)]).to_file(
            folder / "nowhere.gpkg"
        )
    ground = np.full((200, 200), 100, np.float32)
    ground[90:110, 90:110] = -9999
    how = {"height": 200, "width": 200, "count": 1, "dtype": "float32", "nodata": -9999}
    place = Affine(1e-4, 0, 7.995, 0, -1e-4, 47.01)
    with rasterio.open(folder / "holes.tif", "w", "GTiff", crs="EPSG:4326", transform=place, **how) as file:
        file.write(ground, 1)
    return folder


@pytest.fixture
def folder(drawn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of them to work in."""
    shutil.copytree(drawn, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plan(*words: object) -> Result:
    return CliRunner().invoke(main, ["plan", *map(str, words), "-o", "out.plan"])


AT_60 = ["--altitude", "60"]
FLIGHT = [*AT_60, "--home", "47,8"]
SURVEY = ["r.geojson", *FLIGHT, "--spacing", "20", "--angle", "0"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["r.geojson", *AT_60], "needs --home LAT,LON"),
        (["r.geojson", *AT_60, "--home", "-33.9,18.4"], r"\(-33\.900000,18\.400000\) is 9020 km"),
        (["r.geojson", *AT_60, "--home=-33.9,18.4"], r"\(-33\.900000,18\.400000\) is 9020 km"),
        (["r.geojson", *AT_60, "--home", "47", "-8.1"], r"\(47\.000000,-8\.100000\) is 12\d\d km"),
        (["r.geojson", *AT_60, "--home", "8,47"], "look swapped"),
        (["r.geojson", *AT_60, "--home", "47"], "LAT,LON or LAT,LON,M"),
        (["r.geojson", *AT_60, "--home", "47,5 8"], "LAT,LON or LAT,LON,M"),
        (["r.geojson", "--home", "47,8"], "needs --altitude"),
        (["r.geojson", "--home", "47,8", "--altitude", "0"], r"0\.001 to 1000 m above home, not 0"),
        (["r.geojson", "--home", "47,8", "--altitude", "-5"], r"0\.001 to 1000 m above home, not -5"),
        (
            ["r.geojson", "--home", "47,8", "--altitude", "121"],
            "121 m is higher than 120 m .* --max-altitude",
        ),
        (["nowhere.gpkg", *FLIGHT], "no coordinate system"),
        (["r.geojson", *FLIGHT, "--ids", "9"], "no region 9; there are 1, 2"),
        (["r.geojson", *FLIGHT, "--where", "id > 9"], "none of the 2 regions is selected"),
        (["bow.geojson", *FLIGHT], "not a valid polygon"),
        pytest.param(
            ["r.geojson", *FLIGHT, "--spacing", "0.06", "--crosshatch"],
            r"2\d,\d+ waypoints; at most 20,000",
            marks=pytest.mark.slow,
        ),
        (["r.geojson", *FLIGHT, "--spacing", "0.001"], "149932 lines, .* wider spacing"),
        ([*SURVEY, "--endurance", "3"], r"more than 2\.\d min, .* a flight has 2\.4 min"),
        ([*SURVEY, "--dem", "holes.tif"], "with a hole there"),
        (
            ["r.geojson", *AT_60, "--home", "47.0005,8.0006", "--avoid", "zone.geojson"],
            "home lies in a keep-out",
        ),
        ([*SURVEY, "--avoid", "none.geojson"], "none.geojson does not exist"),
        ([*SURVEY, "--avoid", "0,0.2"], r"0,0\.2 are a range of intensity; .* \(--raster\)"),
        ([*SURVEY, "--avoid", "0,0.1", "--raster", "holes.tif"], "no region of holes.tif .* 0,0.1"),
        ([*SURVEY, "--camera", "mavik 3 enterprise"], "nearest names are DJI Mavic 3 Enterprise"),
        ([*SURVEY, "--rally", "47.1,8,40"], "rally point 1 .* outside of the fence"),
        (
            [*SURVEY, "--rally", "47.0005,8.0006,40", "--avoid", "zone.geojson"],
            "rally point 1 .* keep-out zone",
        ),
        ([*SURVEY, "--rally", "47.0005,8.001,130"], r"rally point 1 .* 130\.0 m high, .*--max-altitude"),
        ([*SURVEY, "--rally", "47.0005,8.001"], "--rally is LAT,LON,M"),
    ],
)
def test_what_is_wrong_is_one_line_and_leaves_no_file(folder: Path, words: list[str], said: str) -> None:
    result = plan(*words)
    lines = result.stderr.splitlines()
    assert (result.exit_code, len(lines)) == (1, 1), result.output
    assert re.search(said, lines[0]), lines[0]
    assert not list(folder.glob("out*"))


CAMERA = ["--camera", "phantom 4 rtk"]
SENSOR = ["--sensor", "13.2x8.8", "--image", "5472x3648"]
NUMBERS: dict[str, list[str]] = {
    "--altitude": ["--home", "47,8"],
    "--gsd": ["--home", "47,8", *CAMERA],
    **{name: [*FLIGHT, *CAMERA] for name in ["--overlap", "--gimbal-pitch", "--shutter"]},
    **dict.fromkeys(["--spacing", "--speed", "--tolerance", "--fence", "--rally", "--home"], FLIGHT),
    **dict.fromkeys(["--avoid-margin", "--endurance", "--reserve", "--max-altitude"], FLIGHT),
    **dict.fromkeys(["--max-distance"], FLIGHT),
    **{name: [*FLIGHT, "--spacing", "20"] for name in ["--angle", "--margin", "--turnaround"]},
    **{name: [*FLIGHT, "--pattern", "perimeter"] for name in ["--offset", "--min-leg"]},
    "--hold": FLIGHT,
    "--focal": [*FLIGHT, *SENSOR],
    "--min-interval": [*FLIGHT, *SENSOR, "--focal", "8.8"],
    **{name: [*FLIGHT, "--dem", "holes.tif"] for name in ["--terrain-tolerance", "--climb", "--descent"]},
}
LISTS = {"--overlap": "{},70", "--rally": "47,8,{}", "--home": "47,{}"}


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize("option", NUMBERS)
def test_numbers_that_are_not_finite_are_refused(folder: Path, option: str, value: str) -> None:
    result = plan("r.geojson", *NUMBERS[option], f"{option}={LISTS.get(option, '{}').format(value)}")
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1), result.output
    assert "Traceback" not in result.output and not list(folder.glob("out*"))


@pytest.mark.parametrize(
    "home",
    [["--home", "47", "8"], ["--home", "47.0,", "8.0,", "400"], ["--home=47", "8"], ["--home", "47 8 400"]],
)
def test_a_home_with_spaces_is_understood(folder: Path, home: list[str]) -> None:
    result = plan(*home, "r.geojson", *AT_60)
    assert result.exit_code == 0, result.output
    found = files.read_mission("out.plan").home
    assert (found.lat, found.lon, found.altitude_m) == (47, 8, 400.0 if "400" in home[-1] else 0.0)


def test_only_numbers_after_home_are_joined() -> None:
    assert joined_home(["--home", "auto", "8"]) == ["--home", "auto", "8"]
    assert joined_home(["--home", "47,8", "9"]) == ["--home", "47,8", "9"]
    assert joined_home(["--home", "47", "r.geojson"]) == ["--home", "47", "r.geojson"]
    assert joined_home(["--", "--home", "47", "8"]) == ["--", "--home", "47", "8"]
    assert joined_home(["--home"]) == ["--home"]


@pytest.mark.slow
def test_a_region_smaller_than_the_spacing_is_flown_over_and_photographed(folder: Path) -> None:
    for how in (["--spacing", "40"], CAMERA):
        assert plan("tiny.geojson", *FLIGHT, *how, "--overwrite").exit_code == 0
        lat, lon, _ = files.read_mission("out.plan").path
        assert shapely.LineString(np.column_stack([lon, lat])).distance(SHAPES["tiny"][0]) == 0
    with pytest.warns(UserWarning):
        (mission,) = uavseg.plan(
            "tiny.geojson", altitude=60, home=(47, 8), ids=[1], camera=CAMERA[1]
        ).missions
    assert mission.estimate.photographs >= 1
    assert plan("touching.geojson", *FLIGHT, "--spacing", "20", "--overwrite").exit_code == 0
