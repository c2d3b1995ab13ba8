"""`uavseg plan --dem`: whole commands over drawn and real elevation models."""

import json
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from click.testing import CliRunner, Result
from pymavlink import mavwp
from rasterio.warp import transform

from tests.flight.terrain.dems import HOME, draw, hills
from uavseg.cli.extract import command as extract_command
from uavseg.cli.plan import command
from uavseg.errors import AccessError, MissionError, OutputError, ParameterError, RasterError, RasterReadError
from uavseg.flight.formats import files
from uavseg.flight.mission.items import CAMERA_DISTANCE, FRAME_AMSL, FRAME_RELATIVE, FRAME_TERRAIN, WAYPOINT
from uavseg.flight.safety.check import Clearance
from uavseg.raster.elevation.dem import Dem

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "dem" / "ny_dsm_2m.tif"
HILLS = ("--dem", "{folder}/hills.tif")
BASE = ("--altitude", 60, "--home", f"{HOME[0]},{HOME[1]}")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A field beside home, and hills that cover it."""
    field = shapely.box(HOME[1] + 0.001, HOME[0] - 0.002, HOME[1] + 0.006, HOME[0] + 0.002)
    frame = geopandas.GeoDataFrame({"id": [1]}, geometry=[field], crs=4326)
    frame.to_file(tmp_path / "field.geojson")
    draw(tmp_path / "hills.tif", hills(100), unit="m")
    return tmp_path


def run(folder: Path, *options: object, base: Any = BASE, output: str = "fly.plan") -> Result:
    words = [folder / "field.geojson", "-o", folder / output, "--overwrite", *base, *options]
    return CliRunner().invoke(command, [str(word) for word in words])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "frame"),
    [
        ((), FRAME_AMSL),
        (("--terrain", "absolute", "--autopilot", "px4"), FRAME_AMSL),
        (("--terrain", "frame"), FRAME_TERRAIN),
        (("--terrain", "relative", "--altitude", 110), FRAME_RELATIVE),
    ],
)
@pytest.mark.parametrize("suffix", ["plan", pytest.param("waypoints", marks=pytest.mark.slow)])
def test_the_file_holds_heights_above_the_ground(
    folder: Path, options: tuple[object, ...], frame: int, suffix: str
) -> None:
    done = run(
        folder, "--camera", "phantom 4 rtk", "--dem", folder / "hills.tif", *options, output=f"f.{suffix}"
    )
    assert done.exception is None, done.output
    assert "above the ground" in done.stderr and "over flat ground" not in done.stderr
    mission = files.read_mission(folder / f"f.{suffix}")
    points = [item for item in mission.items if item.command == WAYPOINT]
    assert {item.frame for item in points} == {frame}
    with rasterio.open(folder / "hills.tif") as source:
        x, y = transform(4326, source.crs, [i.lon for i in points], [i.lat for i in points])
        ground = np.array([value[0] for value in source.sample(zip(x, y, strict=True))])
    height = np.array([item.altitude_m for item in points])
    altitude = 110 if "relative" in options else 60
    if frame == FRAME_TERRAIN:
        assert (height == 60).all()
    else:
        zero = mission.home.altitude_m if frame == FRAME_RELATIVE else 0
        assert np.abs(height + zero - ground - altitude).max() < 8  # of the nearest pixel, and slopes up to 1
        assert np.ptp(height) > 15
    assert mission.home.altitude_m == pytest.approx(float(hills(100)(np.zeros(1), np.zeros(1))[0]), abs=0.5)


def test_the_plan_says_that_its_heights_are_mixed(folder: Path) -> None:
    for options, mode in (((), 1), (("--dem", folder / "hills.tif"), 0)):
        assert run(folder, *options).exception is None
        assert json.loads((folder / "fly.plan").read_text())["mission"]["globalPlanAltitudeMode"] == mode


def test_a_ground_station_reads_the_heights(folder: Path) -> None:
    assert run(folder, "--dem", folder / "hills.tif", output="f.waypoints").exception is None
    loader = mavwp.MAVWPLoader()
    loader.load(str(folder / "f.waypoints"))
    mission = files.read_mission(folder / "f.waypoints")
    read = [(w.frame, w.z) for w in map(loader.wp, range(1, loader.count()))]
    assert read == [(item.frame, pytest.approx(item.altitude_m, abs=1e-3)) for item in mission.items]


@pytest.mark.slow
def test_triggers_are_those_without_a_model(folder: Path) -> None:
    def triggers(*options: object) -> list[Any]:
        assert run(folder, "--camera", "phantom 4 rtk", "--angle", 0, *options).exception is None
        items = files.read_mission(folder / "fly.plan").items
        return sorted(item.params for item in items if item.command == CAMERA_DISTANCE)

    # over uneven ground another direction of the same lines may take less time
    assert triggers("--dem", folder / "hills.tif") == triggers() != []


@pytest.mark.slow
def test_a_smaller_tolerance_adds_points(folder: Path) -> None:
    counts = []
    for tolerance in (1, 20):
        done = run(folder, "--spacing", 40, "--dem", folder / "hills.tif", "--terrain-tolerance", tolerance)
        assert done.exception is None
        counts.append(len(files.read_mission(folder / "fly.plan").items))
    assert counts[0] > counts[1] + 20


@pytest.mark.slow
def test_a_mission_that_is_divided_is_above_the_ground_in_each_flight(folder: Path) -> None:
    done = run(folder, "--spacing", 25, "--dem", folder / "hills.tif", "--max-items", 90)
    assert done.exception is None, done.output
    flights = sorted(folder.glob("fly-*.plan"))
    assert len(flights) > 1
    for path in flights:
        items = files.read_mission(path).items
        assert len(items) <= 90
        clearance = Clearance(Dem.open(folder / "hills.tif"), 55)
        assert not list(clearance.problems(files.read_mission(path), 120))


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        (("--dem", "missing.tif"), RasterReadError, "no file missing.tif"),
        (("--dem", "{folder}/field.geojson"), AccessError, "not an image"),
        (
            ("--dem", "{folder}/hills.tif", "--terrain", "frame", "--autopilot", "px4"),
            ParameterError,
            "not to px4",
        ),
        (("--terrain", "absolute"), ParameterError, "give --dem"),
        (("--terrain-tolerance", 3), ParameterError, "give --dem"),
        ((*HILLS, "--terrain-tolerance", "nan"), ParameterError, "half of the height"),
        ((*HILLS, "--climb", 0), ParameterError, "climb rate"),
        (
            ("--dem", "{folder}/hills.tif", "--home", f"{HOME[0]},{HOME[1]},3"),
            MissionError,
            "one of the two is wrong",
        ),
        (("--dem", "{folder}/small.tif"), MissionError, "where the flight leads; it covers lat 47.0"),
        (("--dem", "{folder}/rgb.tif"), RasterError, "3 bands"),
        ((*HILLS, "--altitude", 119), MissionError, "higher than allowed (--max-altitude)"),
    ],
)
def test_what_cannot_be_flown_is_refused_and_nothing_written(
    folder: Path, options: tuple[object, ...], kind: type[Exception], words: str
) -> None:
    draw(folder / "small.tif", hills(100), half_m=200)
    with rasterio.open(folder / "small.tif") as source:
        profile = source.profile | {"count": 3, "dtype": "uint8", "nodata": None}
    with rasterio.open(folder / "rgb.tif", "w", **profile):
        pass
    done = run(folder, *(str(word).format(folder=folder) for word in options))
    assert isinstance(done.exception, kind), done.output
    assert words in str(done.exception) and "\n" not in str(done.exception)
    assert not (folder / "fly.plan").exists()


def test_the_model_is_not_replaced(folder: Path) -> None:
    (folder / "hills.plan").write_bytes((folder / "hills.tif").read_bytes())
    done = run(folder, "--dem", folder / "hills.plan", output="hills.plan")
    assert isinstance(done.exception, OutputError)
    assert (folder / "hills.plan").read_bytes() == (folder / "hills.tif").read_bytes()


def test_a_model_that_is_damaged_where_the_flight_leads_is_an_error(folder: Path) -> None:
    path = draw(folder / "cut.tif", hills(100), compress="deflate")
    content = bytearray(path.read_bytes())
    content[len(content) // 4 : len(content) * 3 // 4] = bytes(len(content) * 3 // 4 - len(content) // 4)
    path.write_bytes(content)
    done = run(folder, "--dem", folder / "cut.tif")
    assert isinstance(done.exception, RasterReadError), done.output
    assert "cannot be read where" in str(done.exception) and "--skip" not in str(done.exception)
    assert not (folder / "fly.plan").exists()


def test_regions_of_an_image_are_flown_above_the_ground(folder: Path) -> None:
    with rasterio.open(folder / "hills.tif") as source:
        profile = source.profile | {"dtype": "uint8", "nodata": None}
    image = np.zeros((300, 300), "u1")
    image[140:170, 160:190] = 200
    with rasterio.open(folder / "image.tif", "w", **profile) as target:
        target.write(image, 1)
    words = [folder / "image.tif", "--range", "0.5,1", "-o", folder / "r.geojson", "--stretch", "dtype"]
    words += ["--mission", folder / "f.plan", *BASE, "--dem", folder / "hills.tif"]
    done = CliRunner().invoke(extract_command, [str(word) for word in words])
    assert done.exception is None, done.output
    frames = [item["frame"] for item in json.loads((folder / "f.plan").read_text())["mission"]["items"]]
    assert FRAME_AMSL in frames


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the shared elevation model is not on this machine")
def test_a_real_surface_model_is_followed(folder: Path) -> None:
    field = shapely.box(-77.0545, 38.8093, -77.0508, 38.8125)
    geopandas.GeoDataFrame({"id": [1]}, geometry=[field], crs=4326).to_file(folder / "field.geojson")
    home = ("--altitude", 40, "--home", "38.8095,-77.0540")
    done = run(folder, "--dem", DATA, "--spacing", 30, "--terrain-tolerance", 4, base=home)
    assert done.exception is None, done.output
    items = files.read_mission(folder / "fly.plan").items
    height = np.array([item.altitude_m for item in items if item.command == WAYPOINT])
    assert height.min() >= 6.9 + 40 - 4 and height.max() <= 39.1 + 40 + 4 and np.ptp(height) > 3
