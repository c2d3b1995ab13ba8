"""`uavseg extract`: what it writes, what it says, and what it refuses in one sentence."""

import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result
from rasterio.enums import Compression

import uavseg.jobs.extract
from uavseg.cli import main

UTM = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
NOWHERE: dict[str, Any] = {"crs": None, "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
FIELDS = "........ .###.##. .#.#.##. .###.... ........ .####... ........"
RANGE = ("--range", "0.55,1")


def write(path: Path, image: np.ndarray, **how: Any) -> Path:
    planes = image[None] if image.ndim == 2 else image
    size = {"count": len(planes), "height": planes.shape[1], "width": planes.shape[2]}
    with rasterio.open(path, "w", "GTiff", dtype=planes.dtype.name, **size, **(UTM | how)) as file:
        file.write(planes)
    return path


def picture(text: str) -> np.ndarray:
    """Every letter is 8 x 8 pixels: # bright, . dark."""
    small = np.array([[{"#": 200, ".": 20}[c] for c in row] for row in text.split()], np.uint8)
    return small.repeat(8, 0).repeat(8, 1)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with one raster."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "tile.tif", picture(FIELDS))
    return tmp_path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["extract", *map(str, arguments)])


def extracted(*arguments: object) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result


def files() -> set[str]:
    return {path.name for path in Path().iterdir()}


def table(result: Result) -> dict[str, str]:
    """The rows at the end of what is told."""
    rows = [line.split(maxsplit=1) for line in result.stderr.splitlines() if line.startswith("  ")]
    return {" ".join(row[:1]): row[1] for row in rows}


# What it writes


def test_regions_go_to_the_current_folder_under_the_name_of_the_raster(folder: Path) -> None:
    (folder / "deep").mkdir()
    write(folder / "deep" / "east.field.tif", picture(FIELDS))
    result = extracted("deep/east.field.tif", *RANGE)
    assert files() == {"tile.tif", "deep", "east.field.regions.geojson"}
    assert {p.name for p in Path("deep").iterdir()} == {"east.field.tif"}
    assert result.stdout == ""
    frame = geopandas.read_file("east.field.regions.geojson")
    assert list(frame["pixels"]) == [512, 256, 256]
    assert set(frame["source"]) == {"east.field.tif"}


def test_standard_output_gets_geojson_and_nothing_else() -> None:
    result = extracted("tile.tif", *RANGE, "-o", "-")
    collection = json.loads(result.stdout)
    assert collection["type"] == "FeatureCollection" and len(collection["features"]) == 3
    assert "stdout" in table(result)["regions"]
    extracted("tile.tif", *RANGE)
    assert Path("tile.regions.geojson").read_text() == result.stdout
    assert files() == {"tile.tif", "tile.regions.geojson"}


FORMATS = ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"]


@pytest.mark.parametrize("extension", FORMATS)
def test_every_format_agrees_with_the_labels(extension: str) -> None:
    extracted("tile.tif", *RANGE, "-o", f"out.{extension}", "--labels", "labels.tif")
    with rasterio.open("labels.tif") as file:
        sizes = np.bincount(file.read(1).reshape(-1))[1:]
    read = geopandas.read_parquet if extension == "parquet" else geopandas.read_file
    frame = read(f"out.{extension}")
    ids = frame["Name" if extension == "kml" else "id"].astype(
        int
    )  # GDAL has an id of its own for a placemark
    by_id = dict(zip(ids, frame["pixels"].astype(int), strict=True))
    assert by_id == dict(enumerate(sizes.tolist(), 1))
    assert frame.is_valid.all() and not frame.is_empty.any()
    on_map = frame.to_crs(32618)
    assert list(on_map.area) == pytest.approx([4.0 * by_id[k] for k in ids], rel=1e-3)
    assert frame.crs.to_epsg() == (4326 if extension in ("geojson", "kml") else 32618)


@pytest.mark.parametrize("extension", ["GPKG", "GeoJSON", "json"])
def test_extensions_may_be_written_in_any_way(extension: str) -> None:
    extracted("tile.tif", *RANGE, "-o", f"out.{extension}")
    assert len(geopandas.read_file(f"out.{extension}")) == 3


def test_labels_lie_on_the_grid_of_the_raster_tiled_and_compressed() -> None:
    extracted("tile.tif", *RANGE, "--labels", "labels.tif")
    with rasterio.open("labels.tif") as file, rasterio.open("tile.tif") as raster:
        assert (file.shape, file.transform, file.crs) == (raster.shape, raster.transform, raster.crs)
        assert file.dtypes == ("uint32",) and file.nodata == 0
        assert file.profile["tiled"] and file.compression == Compression.deflate
        labels = file.read(1)[::8, ::8]
        assert ["".join(".123"[k] for k in row) for row in labels] == [
            "........", ".111.22.", ".1.1.22.", ".111....", "........", ".3333...", "........"
        ]  # fmt: skip


def test_a_shapefile_has_its_parts_and_no_more() -> None:
    extracted("tile.tif", *RANGE, "-o", "out.shp")
    assert files() == {"tile.tif", *(f"out.{part}" for part in ("shp", "shx", "dbf", "prj", "cpg"))}


def test_what_is_there_is_replaced_where_it_may_be() -> None:
    Path("out.gpkg").write_text("something else")
    extracted("tile.tif", *RANGE, "-o", "out.gpkg", "--overwrite")
    assert len(geopandas.read_file("out.gpkg")) == 3


def test_a_mosaic_is_one_raster(folder: Path) -> None:
    image = picture(FIELDS)
    write(folder / "west.tif", image[:, :24])
    write(folder / "east.tif", image[:, 24:], transform=Affine(2, 0, 4e5 + 48, 0, -2, 5e6))
    extracted("west.tif", "east.tif", *RANGE, "-o", "parts.gpkg")
    extracted("tile.tif", *RANGE, "-o", "whole.gpkg")
    parts, whole = geopandas.read_file("parts.gpkg"), geopandas.read_file("whole.gpkg")
    assert parts.drop(columns="source").equals(whole.drop(columns="source"))
    assert set(parts["source"]) == {"west.tif"}


def test_bands_and_nodata_are_chosen(folder: Path) -> None:
    dark, bright = picture(FIELDS), picture(FIELDS.replace("#", ".").replace(".", "#"))
    write(folder / "two.tif", np.stack([dark, bright]))
    assert table(extracted("two.tif", *RANGE, "--band", 2, "-o", "-"))["band"] == "band 2"
    result = extracted("tile.tif", *RANGE, "-o", "-", "--nodata", 20, "--refine", "none", "--method", "paper")
    assert sum(f["properties"]["pixels"] for f in json.loads(result.stdout)["features"]) == 16 * 64


def test_small_things_go() -> None:
    some = extracted("tile.tif", *RANGE, "-o", "-", "--fill-holes", "65px", "--min-area", "1100")
    properties = [feature["properties"] for feature in json.loads(some.stdout)["features"]]
    assert [(p["id"], p["pixels"], p["holes"]) for p in properties] == [(1, 576, 0)]


def test_outlines_are_simplified() -> None:
    rng = np.random.default_rng(1)
    image = np.where(np.add.outer(np.arange(90), np.arange(110)) < 100, 200, 30) + rng.integers(
        -9, 9, (90, 110)
    )
    write(Path("slope.tif"), image.astype(np.uint8))
    counts = []
    for options in ((), ("--simplify", 6)):
        features = json.loads(extracted("slope.tif", *RANGE, "-o", "-", *options).stdout)["features"]
        counts.append(sum(len(ring) for f in features for ring in f["geometry"]["coordinates"]))
    assert counts[1] < counts[0] / 3


def test_outlines_are_drawn_without_stairs_around_the_same_pixels() -> None:
    row, col = np.indices((90, 110))
    write(Path("disc.tif"), np.where((row - 41) ** 2 + (col - 57) ** 2 < 900, 200, 30).astype(np.uint8))
    found = {}
    for smooth in ((), ("--smooth-outline", 1), ("--smooth-outline", 1, "--simplify", 3)):
        extracted(
            "disc.tif",
            *RANGE,
            "-o",
            "d.gpkg",
            "--labels",
            "d.tif",
            *smooth,
            "--overwrite",
            "--refine",
            "scan",
        )
        found[len(smooth)] = geopandas.read_file("d.gpkg"), Path("d.tif").read_bytes()
    stairs, smooth, simple = (frame for frame, _ in found.values())
    assert stairs.drop(columns="geometry").equals(smooth.drop(columns="geometry"))
    assert len({labels for _, labels in found.values()}) == 1
    assert smooth.area[0] == pytest.approx(stairs.area[0], rel=1e-3)
    assert smooth.length[0] < 0.82 * stairs.length[0]
    assert simple.get_coordinates().shape[0] < smooth.get_coordinates().shape[0] / 2


def test_regular_outlines_have_right_angles_and_the_same_columns() -> None:
    row, col = np.indices((150, 190)) - np.array([[[75]], [[95]]])
    u, v = 0.8 * col + 0.6 * row, 0.8 * row - 0.6 * col
    roof = (abs(u) < 60) & (abs(v) < 30) & ((u > 0) | (v > 0))
    write(Path("roof.tif"), np.where(roof | (np.hypot(col - 60, row + 50) < 15), 200, 30).astype(np.uint8))
    found, said = {}, {}
    for how in ((), ("--regularize", 3), ("--regularize", 3, "--tile", 64, "--threads", 2)):
        result = extracted("roof.tif", *RANGE, "-o", "r.gpkg", *how, "--refine", "pixels", "--overwrite")
        found[len(how)], said[len(how)] = geopandas.read_file("r.gpkg"), result.stderr
    assert found[0].drop(columns="geometry").equals(found[2].drop(columns="geometry"))
    assert found[2].equals(found[6])
    assert len(found[2].geometry[0].exterior.coords) == 7
    assert found[2].geometry[1].equals(found[0].geometry[1])
    assert "irregular   1 of 2 stay on pixel edges" in said[2] and "irregular" not in said[0]


@pytest.mark.slow
@pytest.mark.parametrize("method, refine", [("paper", "scan"), ("adaptive", "tv")])
def test_what_is_not_said_of_refinement_follows_the_method(method: str, refine: str) -> None:
    image = np.random.default_rng(5).normal(105, 20, (128, 192))
    image[21:77, 13:150] += 70
    write(Path("noisy.tif"), image.clip(1, 255).astype(np.uint8))
    every = {
        way: extracted("noisy.tif", *RANGE, "--method", method, *way, "-o", "-").stdout
        for way in (
            (),
            ("--refine", "tv"),
            ("--refine", "scan"),
            ("--refine", "smooth"),
            ("--refine", "none"),
        )
    }
    assert [way for way, text in every.items() if text == every[()]] == [(), ("--refine", refine)]


@pytest.mark.parametrize("method", ["paper", "adaptive"])
@pytest.mark.parametrize("refine", ["none", "scan", "smooth", "tv", "pixels"])
def test_every_way_to_segment_gives_its_regions(method: str, refine: str) -> None:
    result = extracted("tile.tif", *RANGE, "--method", method, "--refine", refine, "-o", "-", "--tile", 64)
    for feature in json.loads(result.stdout)["features"]:
        assert 0.55 <= feature["properties"]["mean"] <= 1 or refine != "none"
        assert shapely.geometry.shape(feature["geometry"]).is_valid


# What it says


def test_the_table_at_the_end() -> None:
    result = extracted("tile.tif", *RANGE)
    rows = table(result)
    assert rows["regions"] == "3 -> tile.regions.geojson"
    assert rows["total"].startswith("area  4,09") and rows["total"].endswith(" m2")
    assert rows["largest"].startswith("2,04") and rows["largest"].endswith("m2 (512 pixels)")
    assert rows["stretch"] == "dtype -> 0..255" and rows["band"] == "band 1"
    assert float(rows["seconds"]) >= 0
    assert rows["range"] == "v 0.55 to 1: 140.25 to 255"
    assert len(result.stderr.splitlines()) == 7 and result.stdout == ""


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("--range 140,255", "for values in the units of the raster give --values 140,255"),
        ("--range 55,100", "for per cent of its pixels --percentile 55,100"),
        ("--values 300,", "lie outside of what tile.tif can hold: 0 to 255 (uint8)"),
        ("--values 20,40,60", "--values is two numbers with a comma between them"),
        ("--values ,", "a range of values has at least one end"),
        ("--values 3,2", "the low end of a range of values is above its high one: 3,2"),
        ("--percentile 90,101", "percentiles lie in 0..100, not 90,101"),
        ("--values 20,60 --stretch 0,50", "use the stretch auto, or"),
    ],
)
def test_what_is_no_range_of_values_is_refused_in_one_line(words: str, text: str, folder: Path) -> None:
    result = run("tile.tif", *words.split(), "-o", "not.geojson")
    assert result.exit_code == 1 and text in result.stderr, result.output
    assert len(result.stderr.splitlines()) == 1 and not (folder / "not.geojson").exists()


def test_ranges_of_two_kinds_are_wrong_usage() -> None:
    for words in ((), ("--range", "0,1", "--values", "3,")):
        result = run("tile.tif", *words)
        assert result.exit_code == 2 and "--values" in result.stderr


def test_without_a_crs_there_are_no_square_metres_and_one_warning(folder: Path) -> None:
    write(folder / "local.tif", picture(FIELDS), **NOWHERE)
    result = extracted("local.tif", *RANGE, "--min-area", "300px")
    warnings = [line for line in result.stderr.splitlines() if line.startswith("uavseg: warning: ")]
    assert len(warnings) == 1 and "no coordinate reference system" in warnings[0]
    assert table(result)["largest"] == "2,048.0 square units (512 pixels)"


def test_quiet_says_nothing() -> None:
    result = extracted("tile.tif", *RANGE, "-q")
    assert result.output == ""
    assert extracted("tile.tif", "--range", "0.9,1", "-q", "-o", "none.fgb").output == ""


@pytest.mark.parametrize("tile", [64, 4096])
def test_plain_progress_rises_to_100(folder: Path, tile: int) -> None:
    write(folder / "deep.tif", picture(FIELDS).astype(np.uint16))
    for raster in ("tile.tif", "deep.tif"):
        result = extracted(raster, *RANGE, "--progress", "plain", "--tile", tile, "-o", "-")
        lines = [line for line in result.stderr.splitlines() if line.startswith("progress")]
        percents = [int(line.removeprefix("progress ")) for line in lines]
        assert percents == sorted(set(percents)) and percents[-1] == 100
        assert len(percents) > (raster == "deep.tif")  # its stretch takes a pass of its own


def test_plain_progress_is_for_programs_also_where_it_is_quiet() -> None:
    lines = extracted("tile.tif", *RANGE, "--progress", "plain", "-q").stderr.splitlines()
    assert lines[-1] == "progress 100" and all(line.startswith("progress ") for line in lines)


@pytest.mark.parametrize("extension", FORMATS)
def test_no_region_is_a_warning_and_an_empty_file(extension: str) -> None:
    result = extracted("tile.tif", "--range", "0.9,1", "-o", f"out.{extension}", "--labels", "labels.tif")
    [warning] = [line for line in result.stderr.splitlines() if line.startswith("uavseg: warning: ")]
    assert "no region has a mean v in 0.9..1; uavseg info shows which v there are" in warning
    assert table(result)["regions"].startswith("0 -> ") and table(result)["largest"] == "-"
    read = geopandas.read_parquet if extension == "parquet" else geopandas.read_file
    assert len(read(f"out.{extension}")) == 0
    with rasterio.open("labels.tif") as file:
        assert not file.read(1).any()


# Missions


def items(path: str) -> list[dict[str, Any]]:
    return json.loads(Path(path).read_text())["mission"]["items"]


def test_a_mission_in_one_go_starts_outside_of_all_regions() -> None:
    extracted("tile.tif", *RANGE, "--mission", "fly.plan", "--altitude", 60, "--home", "auto")
    regions = shapely.union_all(geopandas.read_file("tile.regions.geojson").geometry)
    plan = json.loads(Path("fly.plan").read_text())
    assert plan["fileType"] == "Plan"
    lat, lon, _ = plan["mission"]["plannedHomePosition"]
    assert 1e-4 < shapely.distance(regions, shapely.Point(lon, lat)) < 1e-3
    commands = [item.get("command") for item in items("fly.plan")]
    assert commands[0] == 22 and commands[-1] == 20  # take off, return to launch


def test_a_mission_starts_where_it_is_said_and_is_reported() -> None:
    said = ("--home", "45.1,-76.2", "--altitude", 50)
    result = extracted("tile.tif", *RANGE, "--mission", "fly.plan", *said)
    plan = json.loads(Path("fly.plan").read_text())
    assert plan["mission"]["plannedHomePosition"][:2] == [45.1, -76.2]
    [line] = [line for line in result.stderr.splitlines() if line.startswith("fly.plan: 3 regions, ")]
    assert " items, " in line and " km, about " in line
    extracted("tile.tif", *RANGE, "--mission", "fly.waypoints", *said, "--overwrite")
    lines = Path("fly.waypoints").read_text().splitlines()
    assert lines[0] == "QGC WPL 110"
    assert [float(number) for number in lines[1].split("\t")[8:10]] == [45.1, -76.2]


def test_the_mission_is_that_of_plan_over_the_same_regions() -> None:
    how = ["--altitude", "40", "--home", "auto", "--spacing", "6", "--angle", "30"]
    extracted("tile.tif", *RANGE, "--mission", "one.plan", *how)
    result = CliRunner().invoke(main, ["plan", "tile.regions.geojson", "-o", "two.plan", *how])
    assert result.exit_code == 0, result.output
    one, two = items("one.plan"), items("two.plan")
    assert len(one) == len(two) > 10
    for a, b in zip(one, two, strict=True):
        assert a["command"] == b["command"]
        assert a["params"] == pytest.approx(b["params"], abs=2e-6, nan_ok=True) or None in a["params"]


# What it refuses

REFUSALS: dict[str, tuple[str, str]] = {
    "there already": (f"tile.tif {' '.join(RANGE)} -o old.gpkg", "old.gpkg exists; give --overwrite"),
    "labels there already": ("tile.tif --range 0.5,1 --labels old.tif", "old.tif exists; give --overwrite"),
    "mission there already": (
        "tile.tif --range 0.5,1 --mission old.plan --altitude 9 --home auto",
        "old.plan exists; give --overwrite",
    ),
    "no such folder": ("tile.tif --range 0.5,1 -o none/out.gpkg", "the folder none does not exist"),
    "a folder": ("tile.tif --range 0.5,1 -o folder.gpkg --overwrite", "folder.gpkg is a folder"),
    "extension": (
        "tile.tif --range 0.5,1 -o out.xyz",
        ".geojson, .json, .gpkg, .fgb, .parquet, .shp or .kml",
    ),
    "no extension": ("tile.tif --range 0.5,1 -o out", "regions are written to"),
    "upside down": ("tile.tif --range 1,0.5", "0 <= low < high <= 1, got 1,0.5"),
    "no number": (
        "tile.tif --range low,high",
        "a comma between them, such as 0.55,1, not 'low,high'",
    ),
    "one number": ("tile.tif --range 0.5", "--range is two numbers"),
    "three numbers": ("tile.tif --range 0,0.5,1", "--range is two numbers"),
    "beyond 1": ("tile.tif --range 0.5,1.2", "0 <= low < high <= 1, got 0.5,1.2"),
    "not a number": ("tile.tif --range nan,1", "0 <= low < high <= 1"),
    "no raster": ("missing.tif --range 0.5,1", "missing.tif"),
    "second raster missing": ("tile.tif missing.tif --range 0.5,1", "missing.tif"),
    "not a raster": ("words.txt --range 0.5,1", "words.txt"),
    "an empty file": ("empty.tif --range 0.5,1", "empty.tif"),
    "no such band": ("tile.tif --range 0.5,1 --band 4", "band 4"),
    "no such rgb": ("tile.tif --range 0.5,1 --rgb 1,2,3", "band"),
    "stretch": ("tile.tif --range 0.5,1 --stretch wide", "a stretch is one of auto, dtype, minmax"),
    "percentiles": ("tile.tif --range 0.5,1 --stretch percentile:98,2", "0 <= P < Q <= 100"),
    "tile": ("tile.tif --range 0.5,1 --tile 100", "positive multiple of 64 pixels, not 100"),
    "no tile": ("tile.tif --range 0.5,1 --tile 0", "positive multiple of 64 pixels, not 0"),
    "threads": ("tile.tif --range 0.5,1 --threads 0", "the number of threads is at least 1, not 0"),
    "negative area": ("tile.tif --range 0.5,1 --min-area -5", "an area is"),
    "strange area": ("tile.tif --range 0.5,1 --fill-holes 5acres", "square metres such as 500, hectares"),
    "square metres": ("local.tif --range 0.5,1 --min-area 5", "no CRS"),
    "square metres of holes": (
        "local.tif --range 0.5,1 --fill-holes 5",
        "give the area in pixels, such as 5px",
    ),
    "regular": (
        "tile.tif --range 0.5,1 --regularize -1",
        "regularized by metres that are not negative, not -1",
    ),
    "smooth and regular": (
        "tile.tif --range 0.5,1 --regularize 1 --smooth-outline 1",
        "smoothed or regularized, not both; leave one of the two out",
    ),
    "smooth": ("tile.tif --range 0.5,1 --smooth-outline nan", "metres that are not negative, not nan"),
    "simplify": ("tile.tif --range 0.5,1 --simplify -2", "metres that are not negative, not -2"),
    "threshold": ("tile.tif --range 0.5,1 --threshold -1", "is at least 0, not -1"),
    "step": ("tile.tif --range 0.5,1 --intensity-step 2", "an intensity step lies in 0..1, not 2"),
    "no altitude": ("tile.tif --range 0.5,1 --mission a.plan --home auto", "a mission needs --altitude"),
    "no home": ("tile.tif --range 0.5,1 --mission a.plan --altitude 60", "a mission needs --home LAT,LON"),
    "strange home": (
        "tile.tif --range 0.5,1 --mission a.plan --altitude 60 --home here",
        "--home is LAT,LON",
    ),
    "mission format": ("tile.tif --range 0.5,1 --mission a.txt --altitude 60 --home auto", ".plan"),
    "mission of nowhere": (
        "local.tif --range 0.5,1 --mission a.plan --altitude 60 --home auto",
        "no CRS, so nobody knows where to fly",
    ),
    "labels": ("tile.tif --range 0.5,1 --labels labels.png", "labels are written as GeoTIFF; name a .tif"),
    "other CRS": ("tile.tif elsewhere.tif --range 0.5,1", "elsewhere.tif"),
    "other resolution": ("tile.tif coarse.tif --range 0.5,1", "coarse.tif"),
    "other bands": ("tile.tif two.tif --range 0.5,1", "two.tif"),
    "bands of a block map": ("blocks.tif --range 0.5,1 --band 1", "a block map has its bands"),
    "stretch of a block map": ("blocks.tif --range 0.5,1 --stretch minmax", "leave these options out"),
    "not on Earth": ("europa.tif --range 0.5,1 --labels labels.tif", "write a .gpkg instead"),
}
EUROPA = (
    'GEOGCS["Europa",DATUM["Europa",SPHEROID["Europa",1560800,0]],PRIMEM["0",0],UNIT["degree",0.0174532925]]'
)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, image = tmp_path_factory.mktemp("drawn"), picture(FIELDS)
    write(folder / "tile.tif", image)
    write(folder / "local.tif", image, **NOWHERE)
    write(folder / "elsewhere.tif", image, crs="EPSG:32619")
    write(folder / "coarse.tif", image, transform=Affine(3, 0, 4e5, 0, -3, 5e6))
    write(folder / "two.tif", np.stack([image, image]))
    write(folder / "europa.tif", image, crs=EUROPA, transform=Affine(0.01, 0, 5, 0, -0.01, 20))
    for name in ("old.gpkg", "old.tif", "old.plan", "words.txt"):
        (folder / name).write_text("words\n")
    (folder / "empty.tif").touch()
    (folder / "folder.gpkg").mkdir()
    (folder / "none.dir").mkdir()
    with chdir(folder):
        result = CliRunner().invoke(main, ["divide", "tile.tif", "-o", "blocks.tif", "-q"])
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture
def odds_and_ends(drawn: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One folder for all refusals, each of which leaves it as it was."""
    monkeypatch.chdir(drawn)
    return drawn


@pytest.mark.parametrize("case", REFUSALS)
def test_what_cannot_be_is_refused_in_one_sentence_and_leaves_nothing(odds_and_ends: Path, case: str) -> None:
    arguments, message = REFUSALS[case]
    before = {path.name: path.stat().st_mtime_ns for path in odds_and_ends.iterdir()}
    result = run(*arguments.split())
    assert result.exit_code == 1, result.output
    assert len(result.stderr.splitlines()) == 1 and result.stdout == "", result.output
    assert result.stderr.startswith("uavseg: error: ") and message in result.stderr
    assert {path.name: path.stat().st_mtime_ns for path in odds_and_ends.iterdir()} == before


def test_there_is_no_mission_over_no_region() -> None:
    result = run("tile.tif", "--range", "0.9,1", "--mission", "a.plan", "--altitude", 60, "--home", "auto")
    assert result.exit_code == 1 and not Path("a.plan").exists()
    assert result.stderr.splitlines()[-1].startswith("uavseg: error: there is no region to fly to")


@pytest.mark.parametrize(
    "arguments",
    [
        "tile.tif",
        "--range 0.5,1",
        "tile.tif --range 0.5,1 --colour red",
        "tile.tif --range 0.5,1 --method best",
        "tile.tif --range 0.5,1 --refine twice",
        "tile.tif --range 0.5,1 --rgb 1,2",
        "tile.tif --range 0.5,1 --band 0",
        "tile.tif --range 0.5,1 --nodata nothing",
        "tile.tif --range 0.5,1 --progress loud",
        "tile.tif --range 0.5,1 --pattern zigzag",
    ],
)
def test_wrong_usage_is_reported_with_exit_code_2(arguments: str) -> None:
    result = run(*arguments.split())
    assert result.exit_code == 2 and "Usage: " in result.stderr and files() == {"tile.tif"}


OUT_OF_MEMORY = "uavseg: error: out of memory; smaller tiles (--tile 1024) or fewer --threads need less\n"


def raises(error: BaseException) -> Callable[..., Any]:
    def fail(*_: Any, **__: Any) -> None:
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "uavseg: interrupted; nothing was written\n"),
        (MemoryError(), 1, OUT_OF_MEMORY),
        (shapely.errors.GEOSException("std::bad_alloc"), 1, OUT_OF_MEMORY),
    ],
)
def test_what_ends_the_work_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, said: str
) -> None:
    for place in ("outline_regions", "measured"):
        monkeypatch.setattr(uavseg.jobs.extract, place, raises(error))
        result = run("tile.tif", *RANGE, "--labels", "labels.tif")
        assert (result.exit_code, result.stderr) == (code, said)
        assert files() == {"tile.tif"}


@pytest.mark.parametrize(
    ("writer", "output"),
    [("pyogrio.raw.write", "out.fgb"), ("uavseg.regions.formats.geopackage._add_metadata", "out.gpkg")],
)
def test_a_writer_that_fails_leaves_no_half_file(
    monkeypatch: pytest.MonkeyPatch, writer: str, output: str
) -> None:
    def half(target: Any, *_: Any, **__: Any) -> None:
        if isinstance(target, Path):
            target.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(writer, half)
    assert run("tile.tif", *RANGE, "-o", output).exit_code == 130
    assert files() == {"tile.tif"}


# As a program


def program(*arguments: object, **how: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "uavseg", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, **how)


@pytest.mark.slow
def test_the_program_writes_regions() -> None:
    done = program("extract", "tile.tif", *RANGE)
    assert (done.returncode, done.stdout) == (0, "")
    assert len(geopandas.read_file("tile.regions.geojson")) == 3
    piped = program("extract", "tile.tif", *RANGE, "-o", "-", "-q")
    assert piped.stdout == Path("tile.regions.geojson").read_text() and piped.stderr == ""


@pytest.mark.slow
def test_the_program_refuses_in_one_sentence() -> None:
    done = program("extract", "missing.tif", *RANGE)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.startswith("uavseg: error: ") and done.stderr.count("\n") == 1


# A folder of GeoParquet files


def test_a_name_that_ends_in_a_slash_is_a_folder_of_files() -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    told = extracted("tile.tif", *RANGE, "-o", "a.parquet/", "--min-confidence", 0).output
    extracted("tile.tif", *RANGE, "-o", "one.parquet", "--min-confidence", 0)
    assert files() == {"tile.tif", "a.parquet", "one.parquet"}
    assert "regions     3 in 1 files -> a.parquet/" in told and "too unsure  0 of 3 left out" in told
    several, one = (geopandas.read_parquet(name).drop(columns="id") for name in ("a.parquet", "one.parquet"))
    assert several.equals(one)
    assert several.crs == one.crs


@pytest.mark.parametrize(
    ("more", "code", "message"),
    [
        (("--fill-holes", "9px"), 1, "a folder of regions is written without filled holes"),
        (("--refine", "none"), 1, "a folder of regions is written without the refinement none"),
        (("--labels", "a.tif"), 2, "--labels does not go with a folder of regions"),
        (("--style", "qml"), 2, "--style does not go with a folder of regions"),
        (("--sequence",), 2, "for standard output"),
        (("--class", "a=0,0.5", "--class", "b=0.5,1"), 1, "a folder of regions is of one range"),
        (("--each",), 1, "a folder is written by uavseg extract of one range"),
    ],
)
def test_what_does_not_go_with_a_folder_is_refused(more: tuple[str, ...], code: int, message: str) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    ranges = () if "--class" in more else RANGE
    result = run("tile.tif", *ranges, "-o", "a.parquet/", *more)
    assert result.exit_code == code and message in result.stderr
    assert files() == {"tile.tif"}


def test_a_folder_is_replaced_by_a_folder_alone() -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    extracted("tile.tif", *RANGE, "-o", "a.parquet/")
    assert "a.parquet exists; give --overwrite" in run("tile.tif", *RANGE, "-o", "a.parquet/").stderr
    assert "a.parquet is a folder" in run("tile.tif", *RANGE, "-o", "a.parquet", "--overwrite").stderr
    extracted("tile.tif", *RANGE, "-o", "a.parquet/", "--overwrite")
    assert len(geopandas.read_parquet("a.parquet")) == 3
