"""`uavseg path`: where it leads, what it says, and what it refuses in one sentence."""

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import yaml
from affine import Affine
from click.testing import CliRunner, Result
from pyproj import Geod, Transformer

from tests.occupancy.paths.sight import is_visible
from uavseg.cli import main
from uavseg.flight.formats import files as missions
from uavseg.occupancy.paths.clearance import clearance
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.grid.geobox import GeoBox

CELL = 0.5
UTM = {"crs": "EPSG:32618", "transform": Affine(CELL, 0, 4e5, 0, -CELL, 5e6)}
LOCAL: dict[str, Any] = {"crs": None, "transform": Affine(CELL, 0, 0, 0, -CELL, 64)}
RANGE = ("--range", "0,0.45")


def rooms() -> np.ndarray:
    """128 x 192 cells: two rooms with a door at the top, a third one apart, a thin wall in the left."""
    image = np.full((128, 192), 20, np.uint8)
    image[:, 128:144] = 230
    image[16:, 64:72] = 230
    image[40, 8:64] = 230
    return image


def write(path: Path, image: np.ndarray, **how: Any) -> Path:
    size = {"count": 1, "height": image.shape[0], "width": image.shape[1], "dtype": image.dtype.name}
    with rasterio.open(path, "w", "GTiff", **size, **(UTM | how)) as file:
        file.write(image, 1)
    return path


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with two maps."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "rooms.tif", rooms())
    write(tmp_path / "local.tif", rooms(), **LOCAL)
    return tmp_path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["path", *map(str, arguments)])


def found(*arguments: object) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result


def at(row: float, col: float, local: bool = False) -> str:
    """The centre of a cell on the map."""
    t = (LOCAL if local else UTM)["transform"]
    x, y = t.a * (col + 0.5) + t.c, t.e * (row + 0.5) + t.f
    return f"{x},{y}"


def cells_of(path: str) -> list[tuple[int, int]]:
    """The cells in which a path in local coordinates has its corners."""
    line = json.loads(Path(path).read_text())["features"][0]["geometry"]["coordinates"]
    return [(round((64 - y) / CELL - 0.5), round(x / CELL - 0.5)) for x, y in line]


ENDS = ("--start", at(100, 20), "--goal", at(100, 100))
LOCAL_ENDS = ("--start", at(100, 20, True), "--goal", at(100, 100, True))


def test_a_path_goes_through_the_door_and_round_the_thin_wall() -> None:
    result = found("local.tif", *RANGE, *LOCAL_ENDS, "-o", "path.geojson")
    corners = cells_of("path.geojson")
    assert corners[0] == (100, 20) and corners[-1] == (100, 100)
    free = rooms() < 100
    for leg in pairwise(corners):
        assert is_visible(free, *leg)
        assert leg[0][0] == leg[1][0] or leg[0][1] == leg[1][1] or np.ptp(np.abs(np.subtract(*leg))) == 0
    assert min(row for row, _ in corners) <= 15
    assert "coordinates are local" in result.stderr and "kept out" not in result.stderr


def test_regions_of_blocks_hold_cells_that_a_path_keeps_out_of() -> None:
    result = found("local.tif", *RANGE, *LOCAL_ENDS, "--refine", "scan", "-o", "path.geojson")
    assert re.search(r"kept out of +48 cells of region 1", result.stderr)


def test_its_length_is_that_of_the_line_and_reported_with_the_rest() -> None:
    result = found("local.tif", *RANGE, *LOCAL_ENDS, "-o", "path.geojson")
    told = json.loads(Path("path.geojson").read_text())["features"][0]["properties"]
    legs = np.diff(np.array(cells_of("path.geojson")), axis=0)
    assert told["length_m"] == pytest.approx(CELL * np.hypot(*legs.T).sum())
    assert told["cells"] == np.abs(legs).max(axis=1).sum() + 1
    assert told["clearance"] == 0 and told["region"] == 1 and told["expanded"] > 0
    assert f"{told['length_m']:,.3f}" in result.stderr and f"{told['expanded']} cells in" in result.stderr


def test_degrees_and_metres_are_true_on_the_globe() -> None:
    found("rooms.tif", *RANGE, *ENDS, "-o", "path.geojson")
    feature = json.loads(Path("path.geojson").read_text())["features"][0]
    lon, lat = np.array(feature["geometry"]["coordinates"]).T
    length = Geod(ellps="WGS84").line_length(lon, lat)
    assert feature["properties"]["length_m"] == pytest.approx(length, rel=1e-3)
    x, y = Transformer.from_crs(4326, 32618, always_xy=True).transform(lon, lat)
    assert at(100, 20) == f"{x[0]:.2f},{y[0]:.2f}" and at(100, 100) == f"{x[-1]:.2f},{y[-1]:.2f}"


def test_smooth_is_shorter_and_as_safe() -> None:
    found("local.tif", *RANGE, *LOCAL_ENDS, "-o", "path.geojson")
    found("local.tif", *RANGE, *LOCAL_ENDS, "--smooth", "-o", "tight.geojson")
    plain, tight = (
        json.loads(Path(name).read_text())["features"][0]["properties"]["length_m"]
        for name in ("path.geojson", "tight.geojson")
    )
    assert tight < plain
    corners = cells_of("tight.geojson")
    assert corners[0] == (100, 20) and corners[-1] == (100, 100)
    assert all(is_visible(rooms() < 100, *leg) for leg in pairwise(corners))


@pytest.mark.parametrize("extra", [(), ("--smooth",)])
def test_clearance_is_kept_from_walls_and_the_edge_of_the_map(extra: tuple[str, ...]) -> None:
    found("local.tif", *RANGE, *LOCAL_ENDS, "--clearance", "1.75", *extra, "-o", "path.geojson")
    distance = clearance(rooms() < 100, CELL, CELL)
    assert all(is_visible(distance >= 1.75, *leg) for leg in pairwise(cells_of("path.geojson")))
    result = run("local.tif", *RANGE, *LOCAL_ENDS, "--clearance", "4.5", *extra, "-o", "narrow.geojson")
    assert result.exit_code == 1 and "no path leads" in result.stderr and "4.5 m" in result.stderr


def test_a_mission_flies_along_the_path() -> None:
    line = found("rooms.tif", *RANGE, *ENDS, "--smooth", "-o", "-").stdout
    lonlat = json.loads(line)["features"][0]["geometry"]["coordinates"]
    fly = ("--altitude", "12", "--home", "auto", "--speed", "3")
    for name in ("path.waypoints", "path.plan"):
        found("rooms.tif", *RANGE, *ENDS, "--smooth", *fly, "-o", name)
        mission = missions.read_mission(name)
        places = [(item.lon, item.lat) for item in mission.items if item.command == 16]
        assert np.array(places) == pytest.approx(np.array(lonlat), abs=1e-7)
        assert {item.altitude_m for item in mission.items if item.command == 16} == {12}
        assert mission.speed_m_s == 3 and (mission.home.lon, mission.home.lat) == pytest.approx(lonlat[0])


@pytest.mark.slow
def test_floats_are_probabilities_as_they_are_and_tiles_and_threads_change_nothing(folder: Path) -> None:
    write(folder / "floats.tif", (rooms() / 255).astype(np.float32))
    texts = set()
    for name in ("rooms.tif", "floats.tif"):
        for how in ((), ("--tile", "64"), ("--threads", "1"), ("--tile", "128", "--threads", "2")):
            texts.add(found(name, *RANGE, *ENDS, *how, "-o", "-").stdout)
    assert len(texts) == 1


def test_the_antimeridian_cuts_the_line(folder: Path) -> None:
    there = {"crs": "EPSG:4326", "transform": Affine(0.001, 0, 179.9, 0, -0.001, 10)}
    write(folder / "date.tif", np.full((64, 256), 20, np.uint8), **there)
    found("date.tif", *RANGE, "--start", "179.9205,9.9805", "--goal", "180.1005,9.9605", "-o", "path.geojson")
    shape = json.loads(Path("path.geojson").read_text())["features"][0]["geometry"]
    assert shape["type"] == "MultiLineString"
    west, east = shape["coordinates"]
    assert west[0] == pytest.approx([179.9205, 9.9805]) and east[-1] == pytest.approx([-179.8995, 9.9605])
    assert west[-1] == [180.0, east[0][1]] and east[0][0] == -180.0


def test_oblong_cells_are_reported(folder: Path) -> None:
    north = {"crs": "EPSG:4326", "transform": Affine(0.001, 0, 20, 0, -0.001, 60)}
    write(folder / "north.tif", np.full((64, 64), 20, np.uint8), **north)
    result = found("north.tif", *RANGE, "--start", "20.01,59.99", "--goal", "20.03,59.95", "-o", "p.geojson")
    assert "wide" in result.stderr and "high" in result.stderr


BAD = {
    ("--start", "1,2"): "outside of the map",
    ("--start", "nan,2"): "finite",
    ("--start", "inf,2"): "finite",
    ("--start", "7"): "--start is X,Y",
    ("--goal", at(100, 170)): "region 2",
    ("--goal", at(100, 135)): "no region",
    ("--goal", at(40, 20)): "no region (its cell has v = 0.902)",
    ("--range", "0.45,0"): "low < high",
    ("--clearance", "-1"): "not negative",
    ("--clearance", "nan"): "not negative",
    ("--clearance", "50"): "no room at the start",
    ("-o", "path.tif"): "written to .geojson",
    ("-o", "path.waypoints"): "--altitude",
    ("-o", "nowhere/path.geojson"): "does not exist",
    ("-o", "rooms.geojson"): "--overwrite",
    ("--stretch", "sideways"): "a stretch is one of",
}


@pytest.mark.parametrize("option", BAD, ids=" ".join)
def test_what_cannot_be_is_reported_in_one_line_and_nothing_is_written(option: tuple[str, str]) -> None:
    Path("rooms.geojson").write_text("mine")
    before = {path.name for path in Path().iterdir()}
    options = {"--range": "0,0.45", "--start": at(100, 20), "--goal": at(100, 100), "-o": "path.geojson"}
    options[option[0]] = option[1]
    result = run("rooms.tif", *(word for pair in options.items() for word in pair))
    assert result.exit_code == 1 and result.stdout == ""
    assert BAD[option] in result.stderr
    assert result.stderr.startswith("uavseg: error: ") and result.stderr.count("\n") == 1
    assert {path.name for path in Path().iterdir()} == before
    assert Path("rooms.geojson").read_text() == "mine"


def test_the_nearest_free_cell_is_reported_in_metres() -> None:
    result = run("rooms.tif", *RANGE, "--start", at(100, 20), "--goal", at(100, 69), "-o", "p.geojson")
    assert "nearest free cell of region 1 is 1.5 m from the goal" in result.stderr
    assert f"at {float(at(100, 72).split(',')[0]):.12g}" in result.stderr
    result = run("rooms.tif", *RANGE, "--start", at(40, 20), "--goal", at(100, 138), "-o", "p.geojson")
    assert "nearest free cell is 0.500" in result.stderr and "is 3.001 m from the goal" in result.stderr


def test_floats_that_are_no_probabilities_are_refused_unless_a_stretch_is_named(folder: Path) -> None:
    write(folder / "image.tif", rooms().astype(np.float32))
    result = run("image.tif", *RANGE, *ENDS, "-o", "p.geojson")
    assert result.exit_code == 1 and "holds 20" in result.stderr and "--stretch" in result.stderr
    found("image.tif", *RANGE, *ENDS, "--stretch", "0,255", "-o", "p.geojson")


def test_without_a_place_on_the_earth_there_is_no_mission(folder: Path) -> None:
    fly = ("--altitude", "12", "--home", "auto", "-o", "p.waypoints")
    result = run("local.tif", *RANGE, *LOCAL_ENDS, *fly)
    assert result.exit_code == 1 and "no CRS" in result.stderr
    write(folder / "moon.tif", rooms(), crs="+proj=eqc +R=1737400 +units=m +no_defs")
    result = run("moon.tif", *RANGE, *ENDS, "-o", "p.geojson")
    assert (
        result.exit_code == 1 and "no place on the Earth" in result.stderr and not Path("p.geojson").exists()
    )


def test_a_map_without_free_cells_says_so(folder: Path) -> None:
    write(folder / "full.tif", np.full((64, 64), 250, np.uint8))
    result = run("full.tif", *RANGE, "--start", at(3, 3), "--goal", at(5, 5), "-o", "p.geojson")
    assert result.exit_code == 1 and "no cell of the map is free" in result.stderr


@pytest.mark.parametrize(
    "options, told",
    [
        (("--nodata", 3), "neither bands nor nodata"),
        (("--stretch", "0,100"), "not stretched"),
        (("--resume", "kept"), "nothing to resume"),
    ],
)
def test_a_ros_map_has_nothing_that_only_rasters_have(options: tuple[Any, ...], told: str) -> None:
    box = GeoBox((64, 64), Affine(0.05, 0, 0, 0, -0.05, 3.2), None)
    write_ros_map("map.yaml", np.ones(box.shape, np.uint8), box)
    result = run("map.yaml", *RANGE, "--start", "1,1", "--goal", "2,2", "-o", "path.geojson", *options)
    assert result.exit_code == 1 and told in result.stderr, result.output
    assert len(result.stderr.splitlines()) == 1 and not Path("path.geojson").exists()


def test_a_ros_map_is_not_stretched_by_auto_either() -> None:
    box = GeoBox((64, 128), Affine(0.05, 0, 0, 0, -0.05, 3.2), None)
    states = np.repeat(np.array([[1, 2]], np.uint8), 64, 1).repeat(64, 0)
    write_ros_map("map.yaml", states, box)
    unknown = ("--range", "0.4,0.6", "--start", "4,1", "--goal", "5,2")  # v = 0.5, which would be 1
    found("map.yaml", *unknown, "-o", "own.geojson")
    found("map.yaml", *unknown, "-o", "auto.geojson", "--stretch", "auto")
    assert Path("own.geojson").read_bytes() == Path("auto.geojson").read_bytes()


def test_what_a_kml_cannot_show_is_a_note() -> None:
    said = found(
        *("rooms.tif", *RANGE, "--start", at(8, 30), "--goal", at(8, 100), "-o", "p.kml"),
        *("--altitude", "30", "--home", "auto"),
    ).output
    assert "note: the altitude of home is not given, so that the .kml draws heights above the ground" in said
    assert "a library warns" not in said


def test_waypoints_are_the_corners_of_the_line(folder: Path) -> None:
    ways = (*RANGE, "--start", "5,60", "--goal", "60,4", "--smooth")
    found("local.tif", *ways, "-o", "path.geojson")
    found("local.tif", *ways, "-o", "path.yaml")
    line = json.loads(Path("path.geojson").read_text())["features"][0]["geometry"]["coordinates"]
    poses = yaml.safe_load(Path("path.yaml").read_text())["waypoints"].values()
    assert len(line) > 2 and [pose["pose"][:2] for pose in poses] == line


def test_waypoints_are_those_of_a_map_without_a_crs(folder: Path) -> None:
    ways = (*RANGE, "--start", "400005,4999996", "--goal", "400010,4999990")
    found("rooms.tif", *ways, "-o", "path.geojson")
    result = run("rooms.tif", *ways, "-o", "path.yaml")
    assert result.exit_code == 1 and "without a CRS" in result.stderr and result.stderr.count("\n") == 1
    assert not Path("path.yaml").exists()
