"""Python and the command line give the same files, the same warnings and the same errors."""

import json
import shutil
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir
from dataclasses import asdict, replace
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import click
import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner

import uavseg
from tests.flight.link.link_missions import fenced, survey
from tests.flight.link.served import udp_vehicle
from tests.flight.link.vehicles import ArduPilot, FakeVehicle, Generic, Px4
from tests.jobs.test_next_sample import fields
from tests.occupancy.bags.write_bags import POINT_CLOUD, Drive, Recorded, write_ros1, write_ros2
from tests.photographs.make import draw_photograph
from tests.photographs.test_read import PHOTO
from uavseg.cli import main
from uavseg.flight.formats import files
from uavseg.flight.link import link
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.divide import divide as divide_job
from uavseg.jobs.maps.build_map import simulate as simulate_job
from uavseg.jobs.original import original as original_job
from uavseg.jobs.source.open_source import open_source
from uavseg.occupancy.map_file import write_states
from uavseg.occupancy.paths.path_text import path_to_geojson
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.options.maps import SimulateOptions
from uavseg.options.option import build
from uavseg.options.reading import ReadOptions
from uavseg.options.regions import DivideOptions
from uavseg.photographs.coverage import planned_photographs
from uavseg.raster.formats.geotiff import write_geotiff, write_label_geotiff
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.grid.tiling import Window
from uavseg.regions.formats import export
from uavseg.regions.table import Regions
from uavseg.segmentation.blocks.block_file import read_block_map, write_block_map
from uavseg.segmentation.lbpc import LbpcParams
from uavseg.segmentation.params.segment import SegmentParams

UTM = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
SHAPE = (140, 170)
Words = dict[str, Any]


def some_fast(cases: list[Any], step: int = 3) -> list[Any]:
    """Cases, one of `step` of which is part of the fast suite."""
    return [pytest.param(*case, marks=[pytest.mark.slow] if n % step else []) for n, case in enumerate(cases)]


class Answer(NamedTuple):
    """What one face gives: the content of a file or the kind and text of an error, and warnings."""

    content: bytes | tuple[str, str]
    warnings: set[str]


# The sources


def patches(seed: int, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """Patches with noise and some nodata (0)."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(30, 230, (shape[0] // 24 + 1, shape[1] // 24 + 1))
    image = np.kron(coarse, np.ones((24, 24)))[: shape[0], : shape[1]] + rng.normal(0, 8, shape)
    image = np.clip(image, 1, 255).astype(np.uint8)
    image[rng.random(shape) < 0.01] = 0
    return image


def write(name: str, image: np.ndarray, **how: Any) -> None:
    planes = image[None] if image.ndim == 2 else image
    size = dict(zip(("count", "height", "width"), planes.shape, strict=True)) | {"dtype": image.dtype.name}
    with rasterio.open(name, "w", "GTiff", **size, **how) as file:
        file.write(planes)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a source of every kind."""
    with chdir(tmp_path_factory.mktemp("faces")) as _, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write("tile.tif", patches(1), nodata=0, **UTM)
        write("deep.tif", patches(2).astype(np.uint16) * 200, nodata=0)
        framed = np.pad(patches(7, (90, 110)), ((20, 30), (24, 36)))
        write("collar.tif", framed, **UTM)
        write("fields.tif", fields((140, 198))[0], **UTM)
        write("west.tif", patches(3)[:, :90], nodata=0, **UTM)
        east = {"crs": UTM["crs"], "transform": UTM["transform"] @ Affine.translation(90, 0)}
        write("east.tif", patches(3)[:, 90:], nodata=0, **east)
        other = {"crs": "EPSG:32617", "transform": Affine(-1.9, 0.1, 872_080, 0.1, 1.9, 5_009_830)}
        write("other.tif", patches(3)[:, 90:], nodata=0, **other)
        Path("halves").mkdir()
        for name in ("west.tif", "east.tif"):
            shutil.copy(name, "halves")
        Path("halves.txt").write_text("west.tif\neast.tif\n")
        write("bands.tif", np.stack([patches(seed) for seed in (11, 12, 13, 14, 15)]), nodata=0, **UTM)
        with rasterio.open("bands.tif", "r+") as file:
            file.descriptions = ("blue", "green", "red", "Red Edge", "NIR")
        line = ["divide", "bands.tif", "--index", "ndvi", "-o", "ndvi.blocks.tif"]
        assert CliRunner().invoke(main, line).exit_code == 0
        write("two.tif", patches(9)[:100], **(UTM | {"transform": Affine(3, 0, 4e5, 0, -3, 5e6)}))
        write("black.tif", np.zeros(SHAPE, np.uint8), nodata=0, **UTM)
        blocks = {"tiled": True, "blockxsize": 64, "blockysize": 64, "compress": "deflate"}
        write("cut.tif", patches(4), **UTM, **blocks)
        content = Path("cut.tif").read_bytes()
        Path("cut.tif").write_bytes(content[: len(content) * 7 // 10])
        beliefs = np.full(SHAPE, 0.2, np.float32)
        beliefs[40:70, 40:110], beliefs[100:, :60] = 0.9, 0.5
        write("map.tif", beliefs, transform=Affine(0.1, 0, 0, 0, -0.1, 14))
        write("utm_map.tif", beliefs, **UTM)
        # A flight turns outside of its regions.
        around = {"transform": UTM["transform"] @ Affine.translation(-20, -20)}
        write("ground.tif", np.pad((400 + 90 * beliefs).astype(np.float32), 20, "edge"), **(UTM | around))
        write("percent.tif", np.rint(beliefs * 100).astype(np.uint8), **UTM)
        states = np.searchsorted([0.498, 0.502], beliefs) + 1
        write_ros_map("ros.yaml", states, local_geobox(SHAPE, 0.1, (0, 0)))
        states[10, 20:90] = states[20:90, 130] = 3
        write_ros_map("thin.yaml", states, local_geobox(SHAPE, 0.1, (0, 0)))
        done = CliRunner().invoke
        assert done(main, ["divide", "tile.tif", "-o", "blocks.tif"]).exit_code == 0
        write("gone.tif", patches(5), nodata=0, **UTM)
        assert done(main, ["divide", "gone.tif", "-o", "lost.tif"]).exit_code == 0
        Path("gone.tif").unlink()
        bright = ["extract", "tile.tif", "--range", "0.5,1"]
        few = ["--bounds", "400120,4999720,400340,4999850", "--fill-holes", "20px"]  # a survey soon ends
        assert done(main, [*bright, *few, "-o", "regions.geojson"]).exit_code == 0
        assert done(main, [*bright, "-o", "regions.gpkg"]).exit_code == 0
        wall = [[[0, 0], [0.9, 0], [0.9, 0.1], [0, 0.1]], [[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]]]
        room = {"map": {"rows": 50, "cols": 50, "cell": 0.02}, "polygons": wall, "sensor": {"sigma": 0.03}}
        Path("room.json").write_text(json.dumps(room | {"poses": [{"at": [0.2, 0.8]}]}))
        Path("weak.json").write_text('{"hover_w": 900, "cruise_w": 800, "battery_wh": 9}')
        geopandas.read_file("regions.gpkg").head(2).to_file("two.gpkg", layer="a")
        geopandas.read_file("regions.gpkg").tail(2).to_file("two.gpkg", layer="b")
        far = shapely.Point(-76.2708, 45.1511).buffer(8e-5)
        geopandas.GeoDataFrame({"id": [1]}, geometry=[far], crs=4326).to_file("zone.geojson")
        mast, wire = far.centroid, shapely.LineString(far.exterior.coords[:2])
        geopandas.GeoDataFrame({"id": [1, 2]}, geometry=[mast, wire], crs=4326).to_file("masts.geojson")
        discs = [shapely.Point(4e5 + x, 5e6 - y).buffer(20) for x, y in ((170, 140), (60, 60), (60, 200))]
        classes = {"class": ["a", "b", "b"]}
        geopandas.GeoDataFrame(classes, geometry=discs, crs=UTM["crs"]).to_file("samples.gpkg")
        yield Path()


# The two faces


def options(words: Words) -> list[str]:
    """The words of Python as options of the command line."""
    found = []
    for word, value in words.items():
        option = f"--{word.replace('_', '-')}"
        if value is True or (word == "free_is_white" and value is False):
            found.append(option if value else "--free-is-black")
        elif isinstance(value, list) and value and isinstance(value[0], tuple):
            found += [part for one in value for part in (option, ",".join(map(repr, one)))]
        elif isinstance(value, tuple | list):
            found += [
                option,
                ",".join("" if one is None else one if isinstance(one, str) else repr(one) for one in value),
            ]
        else:
            found += [option, str(value)]
    return found


def told(lines: str) -> set[str]:
    """Warnings of a command, and the notes of a mission."""
    starts = ("uavseg: warning: ", "note: ")
    return {
        line.removeprefix(start) for line in lines.splitlines() for start in starts if line.startswith(start)
    }


def on_the_command_line(job: str, arguments: list[str], output: str, answers: str = "") -> Answer:
    if output:
        Path(output).unlink(missing_ok=True)
    command = main.get_command(click.Context(main), job)
    result = CliRunner().invoke(command, arguments, input=answers)  # type: ignore[arg-type]
    if isinstance(result.exception, uavseg.UavsegError):
        assert not output or not Path(output).exists()
        return Answer((type(result.exception).__name__, str(result.exception)), set())
    assert result.exit_code == 0, result.output
    content = Path(output).read_bytes() if output else result.stdout_bytes
    return Answer(content, told(result.stderr))


def in_python(call: Callable[[], bytes]) -> Answer:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            content = call()
        except uavseg.UavsegError as error:
            return Answer((type(error).__name__, str(error)), set())
    return Answer(content, {str(one.message) for one in caught if one.category is UserWarning})


def regions_of(frame: geopandas.GeoDataFrame) -> Regions:
    columns = {name: frame[name].to_numpy() for name in frame.columns if name != "geometry"}
    return Regions(
        columns, np.array(frame.geometry, object), frame.crs and frame.crs.to_wkt(), frame.attrs["uavseg"]
    )


def written(write_to: Callable[[str], object], name: str) -> bytes:
    Path(name).unlink(missing_ok=True)
    write_to(name)
    return Path(name).read_bytes()


def geojson_of(frame: geopandas.GeoDataFrame) -> bytes:
    stream = BytesIO()
    export.write_regions(regions_of(frame), stream)
    return stream.getvalue()


def assert_equal(one: Answer, other: Answer) -> None:
    assert one.warnings == other.warnings
    assert one.content == other.content


EXTRACT: list[tuple[Any, Words]] = [
    ("tile.tif", {"range": (0.55, 1)}),
    ("tile.tif", {"range": (0.2, 0.6), "refine": "scan", "min_area": "64px", "tile": 64, "threads": 2}),
    ("tile.tif", {"range": (0.2, 0.6), "refine": "none", "fill_holes": 900.0, "method": "paper"}),
    ("tile.tif", {"range": (0.5, 1), "smooth_outline": 1.0, "simplify": 3.0, "refine": "smooth"}),
    ("tile.tif", {"range": (0.5, 1), "regularize": 3.0, "tile": 64}),
    ("tile.tif", {"range": (0.5, 1), "refine": "pixels", "connectivity": 8, "min_area": "9px"}),
    ("tile.tif", {"range": (0.5, 1), "refine": "pixels", "min_area": "20px"}),
    ("tile.tif", {"range": (0.5, 1), "stats": "bands", "simplify": 3.0, "tile": 64}),
    (["west.tif", "east.tif"], {"range": (0.2, 0.6), "stats": "bands", "threads": 2}),
    ("blocks.tif", {"range": (0.2, 0.6), "stats": "bands"}),
    ("tile.tif", {"range": (0.5, 1), "stretch": "percentile:5,95", "nodata": 5, "threshold": 1.5}),
    ("tile.tif", {"range": (0.2, 0.6), "detail": "7px", "tile": 64}),
    ("tile.tif", {"range": (0.2, 0.6), "detail": 900.0}),
    ("tile.tif", {"range": (0.2, 0.6), "flatten": "40px", "tile": 64}),
    ("tile.tif", {"range": (0.2, 0.6), "flatten": 4.0}),
    ("blocks.tif", {"range": (0.2, 0.6), "flatten": 100}),
    ("tile.tif", {"range": (0.2, 0.6), "thin_lines": True, "tile": 64}),
    ("tile.tif", {"range": (0.2, 0.6), "thin_lines": True, "detail": "7px"}),
    ("tile.tif", {"range": (0.2, 0.6), "min_confidence": 0.5, "tile": 64}),
    ("tile.tif", {"range": (0.2, 0.6), "min_confidence": 1.0}),
    ("tile.tif", {"range": (0.2, 0.6), "min_confidence": 2.0}),
    ("tile.tif", {"range": (0.2, 0.6), "min_confidence": 0.5, "refine": "none"}),
    ("blocks.tif", {"range": (0.2, 0.6), "min_confidence": 0.5}),
    ("tile.tif", {"range": (0.9999, 1)}),
    ("tile.tif", {"range": "0.55,1"}),
    ("tile.tif", {"values": (100, None)}),
    ("tile.tif", {"values": "60,120", "stretch": "percentile:5,95", "refine": "none"}),
    ("tile.tif", {"values": (60, 120), "stretch": "80,100"}),
    ("tile.tif", {"values": (300, None)}),
    ("tile.tif", {"values": (9, 3)}),
    ("tile.tif", {"percentile": (80, 100), "tile": 64, "threads": 2}),
    ("deep.tif", {"values": (None, 9000)}),
    ("deep.tif", {"values": (45000, 1e9)}),
    ("deep.tif", {"percentile": "10,"}),
    ("blocks.tif", {"values": (100, 200)}),
    ("blocks.tif", {"percentile": (90, 100)}),
    ("lost.tif", {"values": (100, None)}),
    ("deep.tif", {"range": (0.4, 0.8), "band": 1, "intensity_step": 0.2}),
    ("deep.tif", {"range": (0.4, 0.8), "min_area": 50.0}),
    (["west.tif", "east.tif"], {"range": (0.3, 0.7)}),
    (["west.tif", "two.tif"], {"range": (0.3, 0.7)}),
    (["west.tif", "other.tif"], {"range": (0.3, 0.7), "warp": True}),
    (["west.tif", "other.tif"], {"range": (0.3, 0.7)}),
    (["west.tif", "two.tif"], {"range": (0.3, 0.7), "warp": True}),
    ("ros.yaml", {"range": (0.4, 1), "warp": True}),
    ("halves", {"range": (0.3, 0.7)}),
    ("[ew]*st.tif", {"range": (0.3, 0.7)}),
    ("@halves.txt", {"range": (0.3, 0.7)}),
    ("none*.tif", {"range": (0.3, 0.7)}),
    ("black.tif", {"range": (0, 1), "stretch": "minmax"}),
    ("cut.tif", {"range": (0.3, 0.7), "skip_bad_tiles": True}),
    ("cut.tif", {"range": (0.3, 0.7)}),
    ("collar.tif", {"range": (0, 0.4)}),
    ("collar.tif", {"range": (0, 0.4), "collar": "keep"}),
    ("tile.tif", {"range": (0.3, 0.7), "bounds": (4e5 + 15, 5e6 - 180, 4e5 + 200, 5e6)}),
    ("tile.tif", {"range": (0.3, 0.7), "bounds": (0.0, 0.0, 1.0, 1.0)}),
    ("tile.tif", {"range": (0.3, 0.7), "aoi": "missing.gpkg"}),
    ("blocks.tif", {"range": (0.55, 1)}),
    ("blocks.tif", {"range": (0.55, 1), "refine": "none", "fill_holes": "70px", "min_area": 400.0}),
    ("blocks.tif", {"range": (0.55, 1), "band": 1}),
    ("blocks.tif", {"range": (0.55, 1), "stretch": "minmax"}),
    (["blocks.tif", "tile.tif"], {"range": (0.55, 1)}),
    ("lost.tif", {"range": (0.4, 1)}),
    ("lost.tif", {"range": (0.4, 1), "refine": "none"}),
    ("ros.yaml", {"range": (0.4, 1)}),
    ("missing.tif", {"range": (0.4, 1)}),
    ("tile.tif", {"range": (1, 0)}),
    ("tile.tif", {"range": (0, 1), "tile": 100}),
    ("tile.tif", {"range": (0, 1), "threads": 0}),
    ("tile.tif", {"range": (0, 1), "stretch": "wide"}),
    ("tile.tif", {"range": (0, 1), "min_area": "much"}),
    ("tile.tif", {"range": (0, 1), "simplify": -1.0}),
    ("tile.tif", {"range": (0, 1), "smooth_outline": 1.0, "regularize": 1.0}),
    ("tile.tif", {"range": (0, 1), "band": 3}),
    ("bands.tif", {"range": (0.5, 1), "index": "ndvi"}),
    (
        "bands.tif",
        {"range": (0.5, 1), "index": "NDWI", "stretch": "percentile:2,98", "tile": 64, "threads": 2},
    ),
    ("bands.tif", {"range": (0.5, 1), "expr": "(nir - red) / (nir + red)"}),
    ("bands.tif", {"range": (0.4, 1), "expr": "2 * b2 - a - b", "band_names": "b=1,a=3"}),
    ("bands.tif", {"range": (0.4, 1), "band": "NIR"}),
    ("bands.tif", {"range": (0.4, 1)}),
    ("bands.tif", {"range": (0.4, 1), "band": "swir"}),
    ("bands.tif", {"range": (0.4, 1), "index": "nvdi"}),
    ("bands.tif", {"range": (0.4, 1), "index": "ndbi"}),
    ("bands.tif", {"range": (0.4, 1), "index": "evi"}),
    ("bands.tif", {"range": (0.4, 1), "expr": "(nir - ret) / 2"}),
    ("bands.tif", {"range": (0.4, 1), "expr": "nir", "index": "ndvi"}),
    ("bands.tif", {"range": (0.4, 1), "expr": "nir", "band": 1}),
    ("bands.tif", {"range": (0.4, 1), "band": 1, "band_names": "a,b"}),
    ("ndvi.blocks.tif", {"range": (0.5, 1)}),
    ("ndvi.blocks.tif", {"range": (0.5, 1), "index": "ndvi"}),
    ("ros.yaml", {"range": (0.4, 1), "expr": "b1"}),
]
LEVELS: list[tuple[Any, Words]] = [
    ("tile.tif", {"width": 0.25}),
    ("tile.tif", {"width": 0.1, "min_area": "200px"}),
    ("tile.tif", {"width": 0.1, "min_area": 800.0, "small": "drop", "tile": 64}),
    ("tile.tif", {"width": 0.1, "detail": "9px", "tile": 64}),
    ("tile.tif", {"width": 0.1, "flatten": "40px", "tile": 64}),
    ("ros.yaml", {"width": 0.5, "flatten": "40px"}),
    ("tile.tif", {"width": 0.2, "min_confidence": 0.4, "tile": 64}),
    ("tile.tif", {"width": 0.3, "smooth_outline": 0.5, "simplify": 2.0, "method": "paper"}),
    ("tile.tif", {"width": 0.3, "regularize": 3.0, "simplify": 2.0, "threads": 2}),
    ("tile.tif", {"width": 0.3, "refine": "pixels", "connectivity": 8, "min_area": "9px", "tile": 64}),
    ("deep.tif", {"width": 0.5, "stretch": "0,50000"}),
    ("deep.tif", {"width": 0.5, "stretch": "0,50000", "stats": "bands"}),
    ("ros.yaml", {"width": 0.5, "stats": "bands"}),
    (["west.tif", "east.tif"], {"width": 0.2, "threads": 2}),
    ("map.tif", {"width": 0.25, "stretch": "none"}),
    ("ros.yaml", {"width": 0.5}),
    ("ros.yaml", {"width": 0.5, "band": 1}),
    ("ros.yaml", {"width": 0.5, "stretch": "minmax"}),
    ("ros.yaml", {"width": 0.5, "resume": "kept"}),
    (["tile.tif", "ros.yaml"], {"width": 0.5}),
    ("blocks.tif", {"width": 0.2, "min_area": "100px"}),
    ("blocks.tif", {"width": 0.2, "nodata": 3}),
    ("lost.tif", {"width": 0.4}),
    ("black.tif", {"width": 0.4}),
    ("tile.tif", {"width": 0.4, "min_area": "1e9px", "small": "drop"}),
    ("cut.tif", {"width": 0.3, "skip_bad_tiles": True}),
    ("collar.tif", {"width": 0.3}),
    ("collar.tif", {"width": 0.3, "collar": "keep"}),
    ("tile.tif", {"width": 0}),
    ("bands.tif", {"width": 0.1, "index": "ndvi"}),
]
PLAN_LINE = ["plan", "regions.geojson", "--altitude", "40", "--home", "auto", "--largest", "2"]
DISC = (4e5 + 170, 5e6 - 140, 66)
MATCH: list[tuple[Any, Words]] = [
    ("bands.tif", {"like": DISC, "flatten": "80px", "bands": (1, 2)}),
    ("tile.tif", {"like": DISC}),
    ("tile.tif", {"like": DISC, "window": 16, "similarity": 0.5, "intensity": 2.0}),
    ("tile.tif", {"like": DISC, "refine": "none", "fill_holes": "99px", "min_area": 60.0, "simplify": 2.0}),
    ("tile.tif", {"like": DISC, "tile": 64, "threads": 2, "stretch": "minmax", "intensity": 1e9}),
    ("tile.tif", {"like": DISC, "similarity": 1.0, "intensity": 0.0}),
    ("tile.tif", {"like": DISC, "min_area": 1e9}),
    ("tile.tif", {"like": DISC, "by": "color", "refine": "none"}),
    ("tile.tif", {"like": DISC, "by": "texture", "tile": 64, "detail": "12px"}),
    ("tile.tif", {"like": [DISC, (4e5 + 60, 5e6 - 60, 30)], "unlike": [(4e5 + 60, 5e6 - 200, 30)]}),
    ("tile.tif", {"like": DISC, "unlike": [DISC]}),
    ("tile.tif", {"classes": "samples.gpkg", "min_area": 60.0, "fill_holes": "99px"}),
    ("tile.tif", {"classes": "samples.gpkg", "tile": 64, "detail": "9px", "min_confidence": 0.3}),
    ("tile.tif", {"classes": "samples.gpkg", "refine": "none", "min_confidence": 0.3}),
    ("tile.tif", {"classes": "regions.gpkg"}),
    ("tile.tif", {"like": DISC, "by": "color", "tile": 64, "detail": "9px"}),
    ("tile.tif", {"like": DISC, "by": "color", "min_confidence": 0.3}),
    ("tile.tif", {"like": DISC, "by": "texture", "min_confidence": 0.3}),
    ("tile.tif", {"like": DISC, "by": "color", "window": 16}),
    ("fields.tif", {"like": (4e5 + 60, 5e6 - 140, 20), "answer": 2}),
    ("tile.tif", {"like": DISC, "answer": 3, "tile": 64}),
    ("tile.tif", {"like": DISC, "answer": 2, "by": "texture"}),
    ("tile.tif", {"like": DISC, "answer": 4}),
    ("bands.tif", {"like": DISC, "by": "color", "bands": (1, 2, 3), "min_area": 60.0, "fill_holes": "9px"}),
    ("fields.tif", {"like": (4e5 + 60, 5e6 - 140, 20), "by": "color", "min_confidence": 0.3}),
    ("fields.tif", {"like": [(4e5 + 60, 5e6 - 140, 20), (4e5 + 70, 5e6 - 60, 9)], "tile": 64}),
    (["west.tif", "east.tif"], {"like": DISC, "window": 24}),
    ("deep.tif", {"like": (85, -70, 33)}),
    ("deep.tif", {"like": (85, 70, 33)}),
    ("cut.tif", {"like": (4e5 + 100, 5e6 - 100, 70), "skip_bad_tiles": True}),
    ("collar.tif", {"like": (4e5 + 180, 5e6 - 140, 60), "collar": "auto"}),
    ("tile.tif", {"like": "regions.gpkg"}),
    ("tile.tif", {"like": "missing.gpkg"}),
    ("tile.tif", {"like": (4e5, 5e6, 4)}),
    ("tile.tif", {"like": DISC, "window": 20}),
    ("tile.tif", {"like": DISC, "similarity": 2.0}),
    ("blocks.tif", {"like": DISC}),
    ("ros.yaml", {"like": DISC}),
    ("bands.tif", {"like": DISC, "index": "ndvi"}),
    (
        "bands.tif",
        {"like": DISC, "band": "nir", "bands": (3, 2), "intensity": 3.0, "similarity": 0.5, "tile": 64},
    ),
    ("bands.tif", {"like": DISC, "band": "nir", "bands": (9,)}),
    ("bands.tif", {"like": DISC, "bands": (3,)}),
    ("bands.tif", {"like": DISC, "band": 1, "bands": (3,), "intensity": float("inf")}),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "source", "words"),
    some_fast(
        [
            *(("extract", *case) for case in EXTRACT),
            *(("levels", *case) for case in LEVELS),
            *(("match", *case) for case in MATCH),
        ],
        step=6,
    ),
)
def test_regions(job: str, source: Any, words: Words) -> None:
    rasters = source if isinstance(source, list) else [source]
    arguments = [*rasters, *options(words), "-o", "out.geojson"]
    call = getattr(uavseg, job)
    expected = on_the_command_line(job, arguments, "out.geojson")
    assert_equal(in_python(lambda: geojson_of(call(source, **words))), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "words"),
    some_fast(
        [
            ("fields.tif", {"like": (4e5 + 60, 5e6 - 140, 20), "by": "color"}),
            ("tile.tif", {"like": DISC, "unlike": [(4e5 + 60, 5e6 - 200, 30)], "tile": 64, "detail": "9px"}),
            ("bands.tif", {"like": DISC, "bands": (1, 2, 3), "min_confidence": 0.3}),
            ("tile.tif", {"like": DISC, "by": "texture"}),
            ("tile.tif", {"like": "missing.gpkg"}),
            ("blocks.tif", {"like": DISC}),
            ("tile.tif", {"classes": "missing.gpkg"}),
        ],
        step=4,
    ),
)
def test_answers_to_questions(source: str, words: Words) -> None:
    given = [False, True, "skip", None]
    lines = "".join({False: "n\n", True: "y\n", "skip": "s\n", None: "q\n"}[one] for one in given)
    arguments = [source, *options(words), "--ask", "--overwrite", "-o", "out.geojson"]
    answers = iter(given)

    def call() -> bytes:
        return geojson_of(uavseg.match(source, **words, ask=lambda disc: next(answers)))

    if "classes" in words:
        assert CliRunner().invoke(main, ["match", *arguments]).exit_code == 2
        assert in_python(call).content[0] == "ParameterError"
    else:
        assert_equal(in_python(call), on_the_command_line("match", arguments, "out.geojson", lines))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "sources", "words"),
    some_fast(
        [
            ("extract", "lot", {"range": (0.55, 1)}),
            ("extract", "lot", {"range": (0.9999, 1), "report": "out/report.csv", "threads": 2}),
            ("extract", "lot/*.tif", {"range": (0.3, 0.7), "labels": "out/{stem}.tif", "tile": 64}),
            (
                "extract",
                ["tile.tif", "missing.tif", "cut.tif", "deep.tif"],
                {"range": (0.3, 0.7), "min_area": "9px"},
            ),
            (
                "extract",
                ["blocks.tif", "lost.tif", "ros.yaml"],
                {"range": (0.4, 1), "report": "out/report.csv"},
            ),
            ("levels", "@list.txt", {"width": 0.3, "threads": 1, "min_area": 60.0, "small": "drop"}),
            ("levels", "lot", {"width": 0.3, "band": 2, "overwrite": True}),
            ("match", ["tile.tif", "west.tif"], {"like": DISC, "similarity": 0.5}),
            ("extract", "empty", {"range": (0.55, 1)}),
            ("extract", "none*.tif", {"range": (0.55, 1)}),
            ("extract", "@none.txt", {"range": (0.55, 1)}),
            ("extract", "lot", {"range": (1, 0)}),
            ("extract", "lot", {"range": (0, 1), "threads": 0}),
            ("extract", "lot", {"range": (0, 1), "report": "out/report.txt"}),
            ("extract", ["tile.tif", "lot/tile.tif"], {"range": (0, 1)}),
        ]
    ),
)
def test_each_of_many(job: str, sources: Any, words: Words) -> None:
    for name in ("lot", "empty", "out"):
        shutil.rmtree(name, ignore_errors=True)
        Path(name).mkdir()
    for name in ("tile.tif", "deep.tif", "black.tif"):
        shutil.copy(name, "lot")
    Path("list.txt").write_text("west.tif\neast.tif\n")
    rasters = sources if isinstance(sources, list) else [sources]
    line = [job, *rasters, "--each", *options(words), "-o", "out/{stem}.gpkg"]
    result = CliRunner().invoke(main, line)
    errors = [
        text.removeprefix("uavseg: error: ") for text in result.stderr.splitlines() if ": error: " in text
    ]
    expected = {path.name: path.read_bytes() for path in Path("out").iterdir()}
    shutil.rmtree("out")
    Path("out").mkdir()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = uavseg.each(getattr(uavseg, job), sources, "out/{stem}.gpkg", **words)
            failures = [one.failure for one in found if one.error is not None]
            assert errors == failures
        except uavseg.UavsegError as error:
            failures = []
            assert errors == [str(error)]
    assert result.exit_code == bool(errors)
    assert {path.name: path.read_bytes() for path in Path("out").iterdir()} == expected
    said = {str(one.message) for one in caught if one.category is UserWarning}
    assert said == told(result.stderr) | set(failures)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("tile.tif", {"range": (0.3, 0.7), "min_area": "9px", "threads": 2}),
        ("deep.tif", {"range": (0.9999, 1)}),
        ("missing.tif", {"range": (0, 1)}),
        ("blocks.tif", {"range": (0, 1)}),
        ("tile.tif", {"range": (0, 1), "fill_holes": "9px"}),
        ("tile.tif", {"range": (0, 1), "threads": 0}),
    ],
)
def test_a_folder_of_regions(source: str, words: Words) -> None:
    shutil.rmtree("out.parquet", ignore_errors=True)
    result = CliRunner().invoke(main, ["extract", source, *options(words), "-o", "out.parquet/"])
    errors = [
        text.removeprefix("uavseg: error: ") for text in result.stderr.splitlines() if ": error: " in text
    ]
    expected = {path.name: path.read_bytes() for path in Path().glob("out.parquet/*")}
    shutil.rmtree("out.parquet", ignore_errors=True)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            written = uavseg.extract_to("out.parquet", source, **words)
            assert not errors and written.files == sum(
                len(geopandas.read_parquet(f"out.parquet/{n}")) > 0 for n in expected
            )
        except uavseg.UavsegError as error:
            assert errors == [str(error)]
    assert {path.name: path.read_bytes() for path in Path().glob("out.parquet/*")} == expected
    said = {str(one.message) for one in caught if one.category is UserWarning}
    assert said == told(result.stderr)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ({"rang": (0, 1)}, "uavseg.extract has no argument rang"),
        ({}, "a range is one of range"),
        ({"range": (0, 1), "source": "tile.tif"}, "has no argument source"),
        ({"range": (0, 1), "resume": "kept"}, "resume is for one source"),
        ({"range": "wide"}, "range is"),
    ],
)
def test_words_of_each_are_those_of_the_job(words: Words, text: str) -> None:
    with pytest.raises(uavseg.errors.ParameterError, match=text):
        uavseg.each(uavseg.extract, "tile.tif", "{stem}.gpkg", **words)
    with pytest.raises(uavseg.errors.ParameterError, match=r"job is uavseg\.extract"):
        uavseg.each(uavseg.divide, "tile.tif", "{stem}.gpkg")
    assert not Path("tile.gpkg").exists()


@pytest.mark.parametrize(
    "words",
    [
        {},
        {"size": 64, "band": 1, "stretch": "minmax", "threshold": 1.5, "method": "paper"},
        {"mission": "fly.plan", "collar": "keep", "tile": 64},
        {"mission": "fly.plan", "camera": "DJI Mavic 3"},
        {"camera": "DJI Mavic 3"},
        {"mission": "fly.plan", "camera": "Box Brownie"},
        {"regions": "missing.gpkg"},
        {"mission": "missing.plan"},
        {"size": 5},
        {"band": 9},
    ],
)
def test_web_maps(words: Words) -> None:
    assert CliRunner().invoke(main, [*PLAN_LINE, "-o", "fly.plan", "--overwrite"]).exit_code == 0
    expected = on_the_command_line("map", ["tile.tif", *options(words), "-o", "out.html"], "out.html")
    call = in_python(lambda: written(lambda name: uavseg.map_page("tile.tif", name, **words), "out.html"))
    assert_equal(call, expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("tile.tif", {"leaves": "blocks.tif", "labels": "labels.tif", "width": 300}),
        ("ros.yaml", {"labels": "labels.tif", "width": 300}),
        ("tile.tif", {"labels": "map.tif"}),
    ],
)
def test_pictures_of_rasters(source: str, words: Words) -> None:
    line = ["original", source, "-o", "labels.tif", "--overwrite", "--sweeps", "1"]
    assert CliRunner().invoke(main, line).exit_code == 0
    expected = on_the_command_line("preview", [source, *options(words), "-o", "out.png"], "out.png")
    call = in_python(lambda: written(lambda name: uavseg.preview(source, name, **words), "out.png"))
    assert_equal(call, expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("missions", "words"),
    [
        (["fly.plan"], {}),
        (["fly.plan", "fly.kmz"], {"width_px": 300}),
        (["fly.plan"], {"dem": "ground.tif"}),
        (["fly.plan"], {"dem": "tile.tif"}),
        (["fly.plan"], {"width_px": 9}),
        (["missing.plan"], {}),
    ],
)
def test_pictures_of_missions(missions: list[str], words: Words) -> None:
    assert CliRunner().invoke(main, [*PLAN_LINE, "-o", "fly.plan", "--overwrite"]).exit_code == 0
    assert CliRunner().invoke(main, [*PLAN_LINE, "-o", "fly.kmz", "--overwrite"]).exit_code == 0
    named = {word.removesuffix("_px"): value for word, value in words.items()}
    expected = on_the_command_line("preview", [*missions, *options(named), "-o", "out.png"], "out.png")
    call = in_python(
        lambda: written(
            lambda name: uavseg.preview(
                mission=missions,
                output=name,
                **{"width" if k == "width_px" else k: v for k, v in words.items()},
            ),
            "out.png",
        )
    )
    assert_equal(call, expected)


@pytest.mark.parametrize(
    ("source", "words"),
    some_fast(
        [
            ("tile.tif", {}),
            ("tile.tif", {"classes": 3}),
            ("tile.tif", {"classes": 2, "method": "paper", "threshold": 1.4, "tile": 64}),
            ("tile.tif", {"stretch": "minmax", "nodata": 9, "intensity_step": 0.1, "threads": 2}),
            ("deep.tif", {"classes": 8}),
            (["west.tif", "east.tif"], {"classes": 4}),
            ("blocks.tif", {"classes": 3}),
            ("blocks.tif", {"stretch": "none"}),
            ("lost.tif", {}),
            ("black.tif", {}),
            ("cut.tif", {"skip_bad_tiles": True}),
            ("tile.tif", {"classes": 12}),
            ("missing.tif", {}),
            ("ros.yaml", {}),
            ("bands.tif", {"classes": 3, "index": "ndvi"}),
            ("bands.tif", {"classes": 3}),
            ("tile.tif", {"classes": 2, "flatten": "40px", "tile": 64}),
            ("tile.tif", {"flatten": "9px"}),
        ]
    ),
)
def test_suggestions(source: Any, words: Words) -> None:
    rasters = source if isinstance(source, list) else [source]
    expected = on_the_command_line("suggest", [*rasters, *options(words), "--json"], "")
    if isinstance(expected.content, bytes):
        found = json.loads(expected.content)
        assert set(found["warnings"]) == expected.warnings
        ranges = [{word: one[word] for word in one if word != "command"} for one in found["ranges"]]
        expected = Answer(json.dumps(ranges).encode(), expected.warnings)
    call = in_python(lambda: json.dumps([asdict(one) for one in uavseg.suggest(source, **words)]).encode())
    assert_equal(call, expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("tile.tif", {"like": (400100, 4999860, 30)}),
        ("bands.tif", {"like": (400100, 4999860, 30), "unlike": [(400280, 4999780, 20)]}),
        ("bands.tif", {"like": (400100, 4999860, 30), "bands": ["red", "NIR"]}),
        ("bands.tif", {"like": (400100, 4999860, 30), "index": "ndvi", "threads": 1}),
        ("bands.tif", {"like": (400100, 4999860, 30), "rgb": (3, 2, 1), "nodata": 3}),
        (["west.tif", "east.tif"], {"like": (400100, 4999860, 30)}),
        ("deep.tif", {"like": (50, 60, 20), "stretch": "minmax", "tile": 64}),
        ("tile.tif", {"like": (400100, 4999860, 30), "flatten": "40px"}),
        ("tile.tif", {"like": (1, 2, 3)}),
        ("tile.tif", {"unlike": [(400100, 4999860, 30)]}),
        ("blocks.tif", {"like": (400100, 4999860, 30)}),
        ("ros.yaml", {"like": (1, 2, 3)}),
        ("missing.tif", {"like": (1, 2, 3)}),
    ],
)
def test_ranges_of_samples(source: Any, words: Words) -> None:
    rasters = source if isinstance(source, list) else [source]
    expected = on_the_command_line("suggest", [*rasters, *options(words), "--json"], "")
    if isinstance(expected.content, bytes):
        found = json.loads(expected.content)
        assert set(found["warnings"]) == expected.warnings
        ranges = [{word: one[word] for word in one if word != "command"} for one in found["ranges"]]
        expected = Answer(json.dumps(ranges).encode(), expected.warnings)
    call = in_python(lambda: json.dumps([asdict(one) for one in uavseg.suggest(source, **words)]).encode())
    assert_equal(call, expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "words"),
    some_fast(
        [
            ("tile.tif", {}),
            ("tile.tif", {"stretch": "percentile:5,90", "tile": 64}),
            ("tile.tif", {"stretch": "minmax", "threads": 2}),
            ("deep.tif", {}),
            ("deep.tif", {"stretch": "0,60000"}),
            (["west.tif", "east.tif"], {}),
            (["other.tif", "east.tif"], {"warp": True}),
            (["west.tif", "two.tif"], {}),
            ("black.tif", {"stretch": "minmax"}),
            ("cut.tif", {"skip_bad_tiles": True}),
            ("cut.tif", {}),
            ("blocks.tif", {}),
            ("ros.yaml", {}),
            ("tile.tif", {"stretch": "narrow"}),
            ("missing.tif", {}),
            ("bands.tif", {"index": "ndvi"}),
            ("bands.tif", {"expr": "nir / b1", "band_names": "b=1"}),
            ("bands.tif", {"band": "nir"}),
            ("bands.tif", {}),
        ]
    ),
)
def test_block_maps(source: Any, words: Words) -> None:
    rasters = source if isinstance(source, list) else [source]
    expected = on_the_command_line("divide", [*rasters, *options(words), "-o", "out.tif"], "out.tif")

    def saved() -> bytes:
        blocks = uavseg.divide(source, **words)
        known = read_block_map("out.tif").blocks
        assert all(
            np.array_equal(getattr(blocks, n), getattr(known, n)) for n in ("sums", "counts", "ratios")
        )
        read = build(DivideOptions, words).read
        found = divide_job(open_source(source, read))
        return written(
            lambda path: write_block_map(path, found.saved, SegmentParams().division), "python.tif"
        )

    assert_equal(in_python(saved), expected)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("map.tif", {}),
        ("map.tif", {"min_area": "60px", "simplify": 0.2, "tile": 64}),
        ("map.tif", {"free_below": 0.1, "occupied_above": 0.95, "threads": 2}),
        ("utm_map.tif", {"refine": "none", "min_area": 50.0}),
        ("utm_map.tif", {"method": "adaptive", "threshold": 1.1, "intensity_step": 0.2, "stretch": "none"}),
        ("percent.tif", {"stretch": "0,100"}),
        ("percent.tif", {"nodata": 90, "band": 1}),
        ("ros.yaml", {}),
        ("thin.yaml", {}),
        ("thin.yaml", {"method": "paper"}),
        ("thin.yaml", {"method": "paper", "allow_lost_obstacles": True}),
        ("thin.yaml", {"refine": "none", "min_area": 2.0}),
        ("thin.pgm", {}),
        ("thin.pgm", {"free_is_white": True}),
        ("thin.pgm", {"free_is_white": False, "allow_lost_obstacles": True}),
        ("thin.pgm", {"free_is_white": True, "band": 1}),
        ("map.tif", {"free_is_white": False}),
        ("ros.yaml", {"stretch": "auto"}),
        ("ros.yaml", {"stretch": "minmax"}),
        ("ros.yaml", {"nodata": 0}),
        ("ros.yaml", {"resume": "kept"}),
        ("black.tif", {}),
        ("blocks.tif", {}),
        ("map.tif", {"free_below": 0.9}),
        ("map.tif", {"min_area": 5.0}),
        ("missing.yaml", {}),
        ("cut.tif", {}),
        ("percent.tif", {"expr": "b1 / 100"}),
        ("percent.tif", {"band_names": "belief", "band": "belief", "stretch": "0,100"}),
        ("ros.yaml", {"expr": "b1"}),
    ],
)
def test_states(source: str, words: Words) -> None:
    Path("objects.geojson").unlink(missing_ok=True)
    arguments = [source, *options(words), "-o", "out.tif", "--objects", "objects.geojson"]
    expected = on_the_command_line("classify", arguments, "out.tif")

    def classify_states() -> bytes:
        found = uavseg.classify(source, **words)
        assert geojson_of(found.frame()) == Path("objects.geojson").read_bytes()
        return written(lambda path: write_states(path, found.image, found.geobox), "python.tif")

    assert_equal(in_python(classify_states), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("map.tif", {}),
        ("map.tif", {"gap": 1.0, "min_area": "4px", "threads": 2}),
        ("ros.yaml", {}),
        ("found.gpkg", {}),
        ("found.gpkg", {"raster": "utm_map.tif", "band": 1}),
        ("found.gpkg", {"gap": 1.0}),
        ("ros.yaml", {"raster": "map.tif"}),
        ("missing.gpkg", {}),
    ],
)
def test_descriptions_and_names(source: str, words: Words) -> None:
    _, words = Path("library.gpkg").unlink(missing_ok=True), dict(words)
    if source == "found.gpkg":
        export.write_regions(regions_of(uavseg.extract("utm_map.tif", range=(0.6, 1))), source, True)
    arguments = [source, *options(words), "-o", "out.gpkg"]
    expected = on_the_command_line("describe", arguments, "out.gpkg")

    def describe() -> bytes:
        found = uavseg.describe(source, **words)
        return written(lambda path: export.write_regions(found.regions, path), "python.gpkg")

    assert_equal(in_python(describe), expected)
    if isinstance(expected.content, bytes):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            uavseg.recognise(source, "library.gpkg", learn="one", ids=[1], **words)
        expected = on_the_command_line("recognise", [*arguments, "--library", "library.gpkg"], "out.gpkg")

        def recognise() -> bytes:
            found = uavseg.recognise(source, "library.gpkg", **words)
            return written(lambda path: export.write_regions(found.regions, path), "python.gpkg")

        assert_equal(in_python(recognise), expected)


PLACE = {"lat": 45.14516, "lon": -76.26984, "altitude_m": 530.0}  # over ground.tif


@pytest.mark.parametrize(
    ("sources", "words"),
    [
        (["photos"], {}),
        (["photos/a.jpg", "photos/b.jpg"], {"camera": "DJI Phantom 4 Pro"}),
        (["photos"], {"home": (45.1452, -76.2698, 350.0)}),
        (["photos"], {"dem": "ground.tif"}),
        (["photos"], {"dem": "ground.tif", "home": (45.1450, -76.2698)}),
        (["photos"], {"home": (95.0, 8.0)}),
        (["photos"], {"camera": "no such camera"}),
        (["photos/nothing.jpg"], {}),
        (["tile.tif"], {}),
    ],
)
def test_footprints_of_photographs(sources: list[str], words: Words) -> None:
    Path("photos").mkdir(exist_ok=True)
    for number, (name, maker) in enumerate((("a.jpg", "dji"), ("b.jpg", "geotag"), ("c.tif", "parrot"))):
        place = PLACE | {"lat": PLACE["lat"] + number * 1e-4, "taken_s": 1e9 + number}
        draw_photograph(Path("photos", name), replace(PHOTO, **place), maker=maker)
    Path("photos/notes.txt").touch()
    arguments = [*sources, *options(words), "-o", "out.gpkg"]
    expected = on_the_command_line("footprints", arguments, "out.gpkg")

    def footprints() -> bytes:
        frame = uavseg.footprints(sources, **words)
        return written(lambda path: export.write_regions(regions_of(frame), path), "python.gpkg")

    assert_equal(in_python(footprints), expected)


@pytest.mark.parametrize(
    ("sources", "words"),
    [
        (["views"], {}),
        (["views/b.jpg", "views/a.jpg"], {"resolution": 80.0}),
        (["views"], {"dem": "ground.tif"}),
        (["views/a.jpg"], {"home": (45.15, -76.27, 350.0)}),
        (["views"], {"resolution": -1.0}),
        (["views"], {"camera": "no such camera"}),
        (["views/nothing.jpg"], {}),
        (["tile.tif"], {}),
    ],
)
def test_maps_of_photographs(sources: list[str], words: Words) -> None:
    Path("views").mkdir(exist_ok=True)
    for number, name in enumerate(("a.jpg", "b.jpg")):
        place = {
            "lat": 45.1505 + number * 2e-4,
            "lon": -76.2705,
            "altitude_m": 480.0,
            "taken_s": 1e9 + number,
        }
        draw_photograph(Path("views", name), replace(PHOTO, **place))
    expected = on_the_command_line("georeference", [*sources, *options(words), "-o", "out.tif"], "out.tif")

    def mapped() -> bytes:
        Path("python.tif").unlink(missing_ok=True)
        found = uavseg.georeference(sources, "python.tif", **words)
        return found.path.read_bytes()

    assert_equal(in_python(mapped), expected)


ENDS = {"range": (0, 0.45), "start": (1.05, 12.05), "goal": (15.05, 1.05)}
ON_UTM = {"range": (0, 0.45), "start": (4e5 + 21, 5e6 - 21), "goal": (4e5 + 301, 5e6 - 251)}


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("map.tif", ENDS),
        ("map.tif", ENDS | {"smooth": True, "tile": 64}),
        ("map.tif", ENDS | {"clearance": 0.35, "threads": 2, "method": "paper"}),
        ("utm_map.tif", ON_UTM | {"smooth": True, "threshold": 1.3, "intensity_step": 0.1}),
        ("percent.tif", ON_UTM | {"stretch": "0,100"}),
        ("ros.yaml", ENDS),
        ("ros.yaml", ENDS | {"clearance": 0.2}),
        ("ros.pgm", ENDS),
        ("ros.pgm", ENDS | {"free_is_white": True}),
        ("ros.yaml", ENDS | {"stretch": "minmax"}),
        ("ros.yaml", ENDS | {"resume": "kept"}),
        ("map.tif", ENDS | {"goal": (99.0, 1.0)}),
        ("map.tif", ENDS | {"goal": (5.05, 9.05)}),
        ("map.tif", ENDS | {"clearance": 30.0}),
        ("map.tif", ENDS | {"clearance": -1.0}),
        ("map.tif", ENDS | {"range": (0.5, 0.4)}),
        ("blocks.tif", ON_UTM),
        ("missing.tif", ENDS),
        ("percent.tif", ON_UTM | {"expr": "b1 / 100"}),
        ("percent.tif", ON_UTM | {"band": 2}),
    ],
)
def test_paths(source: str, words: Words) -> None:
    arguments = [source, *options(words), "-o", "out.geojson"]
    expected = on_the_command_line("path", arguments, "out.geojson")
    assert_equal(in_python(lambda: path_to_geojson(uavseg.path(source, **words)).encode()), expected)


VIEW: Words = {"pose": (1.05, 12.05), "range": 3.0}


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("map.tif", VIEW),
        ("map.tif", VIEW | {"pose": (1.05, 12.05, 90.0), "fov": 75.0, "count": 2, "clearance": 0.2}),
        ("map.tif", VIEW | {"free_below": 0.3, "occupied_above": 0.7, "tile": 64, "threads": 2}),
        ("ros.yaml", VIEW),
        ("percent.tif", {"pose": (4e5 + 21, 5e6 - 21), "range": 30.0, "stretch": "0,100"}),
        ("map.tif", VIEW | {"pose": (99.0, 1.0)}),
        ("map.tif", VIEW | {"pose": (1.0,)}),
        ("map.tif", VIEW | {"range": -1.0}),
        ("map.tif", VIEW | {"fov": 400.0}),
        ("blocks.tif", VIEW),
        ("missing.tif", VIEW),
    ],
)
def test_next_views(source: str, words: Words) -> None:
    arguments = [source, *options(words), "-o", "out.geojson"]
    expected = on_the_command_line("next-view", arguments, "out.geojson")
    assert_equal(in_python(lambda: uavseg.next_views(source, **words).to_geojson().encode()), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("room.json", {"range": 0.5, "step": 2.0}),
        (
            "room.json",
            {"range": 0.5, "step": 2.0, "fov": 60.0, "seed": 3, "clearance": 0.05, "start": (0.2, 0.2, 45.0)},
        ),
        ("ros.yaml", {"range": 3.0, "step": 2.0, "start": (1.05, 12.05)}),
        ("ros.yaml", {"start": (1.05, 12.05)}),
        ("ros.yaml", {"range": 3.0}),
        ("lens", {"start": (1.6, 1.6)}),
        ("lens", {"start": (99.0, 1.6)}),
        ("lens", {"sigma": -1.0}),
        ("missing.json", {}),
    ],
)
def test_drives(scene: str, words: Words) -> None:
    expected = on_the_command_line("explore", [scene, *options(words), "-o", "out.geojson"], "out.geojson")
    assert_equal(in_python(lambda: uavseg.explore(scene, **words).to_geojson().encode()), expected)


FLIGHT: Words = {"altitude": 60, "home": "auto"}


PLANNED: list[tuple[str, Words]] = [
    ("regions.geojson", FLIGHT),
    ("regions.gpkg", FLIGHT | {"pattern": "perimeter", "tolerance": 2.0}),
    ("regions.geojson", FLIGHT | {"spacing": 15}),
    ("regions.gpkg", FLIGHT | {"pattern": "survey", "spacing": 15, "angle": 30.5, "speed": 8.0}),
    ("regions.geojson", FLIGHT | {"home": (45.151, -76.271)}),
    ("regions.geojson", FLIGHT | {"home": (45.151, -76.271, 120.5), "autopilot": "px4"}),
    ("regions.geojson", FLIGHT | {"ids": [2, 1]}),
    ("regions.geojson", FLIGHT | {"largest": 1, "where": "mean > 0.5 and area_m2 > 100"}),
    ("two.gpkg", FLIGHT | {"layer": "b"}),
    ("two.gpkg", FLIGHT),
    ("regions.geojson", FLIGHT | {"ids": [99]}),
    ("regions.geojson", FLIGHT | {"where": "brightness > 1"}),
    ("regions.geojson", FLIGHT | {"home": (10.0, 10.0)}),
    ("regions.geojson", FLIGHT | {"altitude": 0}),
    ("regions.geojson", FLIGHT | {"spacing": 15, "pattern": "visit"}),
    ("regions.geojson", FLIGHT | {"camera": "phantom 4 rtk", "angle": 20.0}),
    (
        "regions.geojson",
        FLIGHT | {"camera": "rx1r ii", "overlap": (80.0, 60.0), "gimbal_pitch": -80.0, "angle": 0.0},
    ),
    (
        "regions.geojson",
        {"camera": "mavic 3 enterprise", "gsd": 1.5, "home": "auto", "speed": 12.0, "angle": 90.0},
    ),
    (
        "regions.geojson",
        {"camera": "rx1r ii", "gsd": 2.0, "home": "auto", "gimbal_pitch": (-90.0, -60.0), "angle": 0.0},
    ),
    ("regions.geojson", FLIGHT | {"camera": "rx1r ii", "pattern": "orbit", "gimbal_pitch": (-90.0, -60.0)}),
    ("regions.geojson", FLIGHT | {"camera": "phantom"}),
    ("regions.geojson", FLIGHT | {"vehicle": "weak.json"}),
    ("regions.geojson", FLIGHT | {"vehicle": "missing.json"}),
    (
        "regions.geojson",
        FLIGHT | {"camera": "phantom 4 rtk", "trigger": "hover", "overlap": (30.0, 9.0), "angle": 0.0},
    ),
    (
        "regions.geojson",
        FLIGHT | {"camera": "phantom 4 rtk", "trigger": "interval", "turnaround": 20.0, "angle": 45.0},
    ),
    ("regions.geojson", FLIGHT | {"spacing": 15, "angle": 10.0, "crosshatch": True}),
    ("regions.geojson", FLIGHT | {"spacing": 15, "pattern": "corridor", "margin": 5.0}),
    ("regions.gpkg", FLIGHT | {"pattern": "perimeter", "offset": 4.0, "min_leg": 8.0, "holes": "fly"}),
    ("regions.geojson", FLIGHT | {"pattern": "orbit", "margin": 10.0, "camera": "phantom 4 rtk"}),
    ("regions.geojson", FLIGHT | {"pattern": "visit", "hold": 5.0}),
    ("regions.geojson", FLIGHT | {"pattern": "visit", "margin": 5.0}),
    ("regions.geojson", FLIGHT | {"spacing": 15, "angle": 0.0, "trigger": "hover"}),
    ("regions.geojson", {"home": "auto"}),
    ("regions.geojson", FLIGHT | {"dem": "ground.tif", "spacing": 15, "angle": 0.0}),
    ("regions.geojson", FLIGHT | {"dem": "ground.tif", "terrain": "relative", "terrain_tolerance": 1.5}),
    ("regions.gpkg", FLIGHT | {"dem": "ground.tif", "terrain": "frame", "climb": 1.0, "descent": 0.5}),
    ("regions.gpkg", FLIGHT | {"terrain": "frame"}),
    ("regions.gpkg", FLIGHT | {"terrain": "absolute"}),
    ("regions.gpkg", FLIGHT | {"dem": "ground.tif", "terrain_tolerance": 99.0}),
    ("regions.gpkg", FLIGHT | {"dem": "missing.tif"}),
    ("regions.gpkg", FLIGHT | {"dem": "tile.tif"}),
    ("regions.geojson", FLIGHT | {"spacing": 15, "angle": 0.0, "avoid": "zone.geojson", "avoid_margin": 4.0}),
    ("regions.geojson", FLIGHT | {"spacing": 15, "angle": 0.0, "avoid": (0.0, 0.2), "raster": "tile.tif"}),
    ("regions.geojson", FLIGHT | {"spacing": 15, "angle": 0.0, "avoid": "masts.geojson", "zone_width": 4.0}),
    ("regions.geojson", FLIGHT | {"avoid": "masts.geojson", "zone_height": 20.0}),
    ("regions.geojson", FLIGHT | {"avoid": "masts.geojson", "zone_height": 20.0, "dem": "ground.tif"}),
    ("regions.geojson", FLIGHT | {"avoid": "masts.geojson", "zone_width": 0.0}),
    ("regions.geojson", FLIGHT | {"zone_height": 20.0}),
    ("masts.geojson", FLIGHT | {"pattern": "visit"}),
    ("masts.geojson", FLIGHT | {"pattern": "corridor", "spacing": 15}),
    ("masts.geojson", FLIGHT | {"pattern": "corridor", "spacing": 15.0, "width": 40.0}),
    ("masts.geojson", FLIGHT | {"pattern": "orbit"}),
    ("regions.geojson", FLIGHT | {"width": 40.0}),
    ("regions.geojson", FLIGHT | {"raster": "tile.tif"}),
    ("regions.geojson", FLIGHT | {"raster": "tile.tif", "allow_edge": True}),
    ("regions.geojson", FLIGHT | {"raster": "blocks.tif", "largest": 2}),
    ("regions.geojson", FLIGHT | {"avoid": (0.0, 0.2)}),
    ("regions.geojson", FLIGHT | {"avoid": (0.0, 0.001), "raster": "tile.tif"}),
    ("regions.geojson", FLIGHT | {"avoid": "missing.geojson"}),
    ("regions.geojson", FLIGHT | {"avoid_margin": -1.0}),
    ("regions.geojson", FLIGHT | {"endurance": 99.0, "reserve": 10.0}),
    ("regions.geojson", FLIGHT | {"endurance": 1.0}),
    ("regions.geojson", FLIGHT | {"max_items": 5}),
    ("regions.geojson", FLIGHT | {"fence": "none"}),
    ("regions.geojson", FLIGHT | {"fence": 20.0}),
    ("regions.geojson", FLIGHT | {"rally": [(45.1447, -76.2697, 30.0)]}),
    ("regions.geojson", FLIGHT | {"rally": [(45.3, -76.2715, 30.0)]}),
    ("regions.geojson", FLIGHT | {"max_distance": 5.0}),
    ("regions.geojson", FLIGHT | {"max_distance": 5000.0}),
    ("regions.geojson", FLIGHT | {"altitude": 150, "max_altitude": 160.0}),
    ("regions.geojson", FLIGHT | {"altitude": 150}),
    ("regions.geojson", FLIGHT | {"altitude": 12, "max_altitude": 12.0, "autopilot": "px4"}),
    ("missing.geojson", FLIGHT),
    ("tile.tif", FLIGHT),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "words", "suffix"),
    [
        pytest.param(source, words, suffix, marks=pytest.mark.thorough if n % 5 and suffix != ".plan" else [])
        for n, (source, words) in enumerate(PLANNED)
        for suffix in (".plan", ".waypoints")
    ],
)
def test_missions(source: str, words: Words, suffix: str) -> None:
    output = f"out{suffix}"
    expected = on_the_command_line("plan", [source, *options(words), "-o", output], output)
    north = {one for one in expected.warnings if "PX4 will face north" in one}  # of the format alone
    assert bool(north) == (words.get("autopilot") == "px4" and suffix == ".waypoints")
    expected = Answer(expected.content, expected.warnings - north)

    def planned() -> bytes:
        planned = uavseg.plan(source, **(words | {"fence": None} if words.get("fence") == "none" else words))
        return written(planned.write, f"python{suffix}")

    assert_equal(in_python(planned), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "suffix"),
    [
        pytest.param(words, suffix, marks=pytest.mark.thorough if (n + k) % 2 else [])
        for n, words in enumerate(
            [
                {"max_items": 12},
                {"endurance": 6.0, "camera": "mavic 3 enterprise", "autopilot": "px4"},
                {"max_items": 10, "dem": "ground.tif", "raster": "tile.tif"},
                {"max_items": 14, "avoid": "zone.geojson", "rally": [(45.1447, -76.2697, 30.0)]},
            ]
        )
        for k, suffix in enumerate([".plan", ".kmz"])
    ],
)
def test_several_flights(words: Words, suffix: str) -> None:
    words = FLIGHT | {"spacing": 15, "angle": 0.0} | words
    for old in Path().glob(f"*several*{suffix}"):
        old.unlink()
    line = ["regions.geojson", *options(words), "-o", f"several{suffix}"]
    command = main.get_command(click.Context(main), "plan")
    result = CliRunner().invoke(command, [*line, "--json"])  # type: ignore[arg-type]
    assert result.exit_code == 0, result.output
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        plan = uavseg.plan("regions.geojson", **words)
        paths = plan.write(f"in-python-several{suffix}")
    assert len(paths) > 1
    theirs = sorted(Path().glob(f"several*{suffix}"))
    assert [path.read_bytes() for path in theirs] == [path.read_bytes() for path in sorted(paths)]
    said = {str(one.message) for one in caught if one.category is UserWarning}
    assert said == told(result.stderr) == set(json.loads(result.stdout)["warnings"])
    assert {one["items"] for one in json.loads(result.stdout)["flights"]} == {
        len(mission.items) for mission in plan.missions
    }


@pytest.mark.parametrize("words", [{}, {"allow_edge": True}, {"avoid": (0.0, 0.2)}])
def test_missions_over_what_is_extracted(words: Words) -> None:
    line = ["tile.tif", "--range", "0.5,1", "-o", "tiles.geojson", "--overwrite", "--mission", "fly.plan"]
    expected = on_the_command_line("extract", [*line, *options(FLIGHT | words)], "fly.plan")

    def planned() -> bytes:
        plan = uavseg.plan("tiles.geojson", raster="tile.tif", **FLIGHT, **words)
        return written(plan.write, "python.plan")

    assert_equal(in_python(planned), expected)


SUFFIXES = (".kmz", ".csv", ".kml", ".geojson", ".plan")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "suffix"),
    [
        pytest.param(words, suffix, marks=[] if suffix in checked else pytest.mark.thorough)
        for words, checked in (
            ({"spacing": 15, "angle": 0.0}, SUFFIXES),
            ({"camera": "matrice 30", "angle": 0.0}, (".kmz", ".csv")),
            ({"camera": "phantom 4 rtk", "angle": 0.0}, (".kmz", ".plan")),
        )
        for suffix in SUFFIXES
    ],
)
def test_files_of_missions(words: Words, suffix: str) -> None:
    editable = ["--editable"] * (suffix == ".plan")
    of_kmz: Words = {"lens": "zoom,ir", "turn": "through"} if suffix == ".kmz" else {}
    line = [
        "regions.geojson",
        *options(FLIGHT | words),
        *editable,
        *options(of_kmz),
        "--dji-model",
        "m30t",
        "-o",
        f"out{suffix}",
    ]
    expected = on_the_command_line("plan", line, f"out{suffix}")

    def planned() -> bytes:
        plan = uavseg.plan("regions.geojson", **FLIGHT, **words)
        how: Words = {"editable": bool(editable), "dji_model": "m30t", **of_kmz}
        return written(lambda path: plan.write(path, **how), f"python{suffix}")

    assert_equal(in_python(planned), expected)


CHECKS: list[Words] = [
    {},
    {"autopilot": "px4"},
    {"autopilot": "generic"},
    {"avoid": "missing.geojson"},
    {"avoid": "masts.geojson", "zone_width": 5.0, "zone_height": 3.0},
    {"zone_height": 3.0},
    {"max_altitude": 500.0, "max_distance": 5000.0, "avoid_margin": 5.0},
    {"dem": "missing.tif"},
]


@pytest.mark.parametrize("words", CHECKS)
@pytest.mark.parametrize("name", ["held.plan", "missing.plan", "held.txt"])
def test_checks(name: str, words: Words) -> None:
    on_the_command_line("plan", ["regions.geojson", *options(FLIGHT), "-o", "held.plan"], "held.plan")
    expected = on_the_command_line("check", [name, "--json", *options(words)], "")

    def checked() -> bytes:
        return (json.dumps(uavseg.check(name, **words).as_dict(), indent=2) + "\n").encode()

    assert_equal(in_python(checked), expected)


RESUMES: list[Any] = [
    12,
    12.4,
    1,
    400,
    (45.1511, -76.2708),
    (45.0, -76.0),
    (91.0, 0.0),
    "tile.tif",
    "missing.bin",
]


@pytest.mark.slow
@pytest.mark.parametrize("start", RESUMES)
@pytest.mark.parametrize("name", ["held.plan", "missing.plan", "held.txt"])
def test_rests_of_flights(name: str, start: Any) -> None:
    on_the_command_line("plan", ["regions.geojson", *options(FLIGHT), "-o", "held.plan"], "held.plan")
    text = ",".join(map(repr, start)) if isinstance(start, tuple) else str(start)
    expected = on_the_command_line("resume", [name, "--from", text, "-o", "rest.plan"], "rest.plan")

    def resumed() -> bytes:
        return written(uavseg.resume(name, start=start).write, "python.plan")

    assert_equal(in_python(resumed), expected)


SEEN: list[Words] = [
    {},
    {"regions": "regions.geojson"},
    {"regions": "missing.geojson"},
    {"camera": "phantom 4 pro", "home": (45.151, -76.271, 100.0)},
    {"camera": "none such"},
    {"home": (145.0, 8.0)},
]


@pytest.mark.slow
@pytest.mark.parametrize("words", SEEN)
@pytest.mark.parametrize("photos", ["photos", "missing", "photos/0.jpg"])
def test_checks_of_photographs(photos: str, words: Words) -> None:
    flown = FLIGHT | {"camera": "phantom 4 pro", "largest": 1}
    on_the_command_line("plan", ["regions.geojson", *options(flown), "-o", "held.plan"], "held.plan")
    if not Path("photos").exists():
        Path("photos").mkdir()
        plan = planned_photographs(files.read_mission("held.plan"), ((120, 80), 80.0))
        for k, one in enumerate(plan.photographs):
            draw_photograph(Path("photos", f"{k}.jpg"), replace(one, altitude_m=100 + one.relative_m))
    words = {"photos": photos, **words}
    command = main.get_command(click.Context(main), "check")
    line = ["held.plan", "--json", *options(words), "--gaps", "gaps.geojson", "--overwrite"]
    result = CliRunner().invoke(command, line)  # type: ignore[arg-type]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = uavseg.check("held.plan", **words)
        except uavseg.UavsegError as error:
            assert (type(result.exception), str(result.exception)) == (type(error), str(error))
            return
    assert json.loads(result.stdout) == found.as_dict()
    assert told(result.stderr) == {str(one.message) for one in caught if one.category is UserWarning}
    assert (result.exception is None) == (not found.problems)
    assert len(geopandas.read_file("gaps.geojson")) == len(found.gaps)


@pytest.mark.slow
def test_regions_in_memory_are_planned_as_from_their_file() -> None:
    frame = geopandas.read_file("regions.gpkg")
    content = Path("regions.geojson").read_bytes()
    with pytest.warns(UserWarning, match="altitude of home|outside of all regions"):
        assert uavseg.plan(frame, **FLIGHT) == uavseg.plan("regions.gpkg", **FLIGHT)
        assert uavseg.plan(frame, ids=frame["id"].tail(2), **FLIGHT) == uavseg.plan(
            "regions.gpkg", ids=frame["id"].tail(2).tolist(), **FLIGHT
        )
        assert uavseg.plan(content, **FLIGHT) == uavseg.plan("regions.geojson", **FLIGHT)


@pytest.mark.parametrize("home", ["here", "45,10", (1.0,), (1.0, 2.0, 3.0, 4.0)])
def test_a_home_that_is_no_position_is_refused(home: Any) -> None:
    with pytest.raises(uavseg.errors.ParameterError, match="home is "):
        uavseg.plan("regions.geojson", altitude=60, home=home)


# Jobs without a word in Python


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("tile.tif", {}),
        ("tile.tif", {"stretch": "minmax"}),
        ("deep.tif", {"stretch": "0,60000"}),
        ("deep.tif", {"band": 1, "nodata": 9.0}),
        ("black.tif", {}),
        ("cut.tif", {"skip_bad_tiles": True}),
        ("cut.tif", {}),
        (["west.tif", "east.tif"], {}),
        (["west.tif", "other.tif"], {"warp": True}),
        (["west.tif", "two.tif"], {}),
        ("blocks.tif", {}),
        ("ros.yaml", {}),
        ("tile.tif", {"band": 3}),
    ],
)
def test_summaries(source: Any, words: Words) -> None:
    rasters = source if isinstance(source, list) else [source]
    expected = on_the_command_line("info", [*rasters, *options(words), "--json"], "")

    def summary() -> bytes:
        found = uavseg.info(source, **words)
        return (json.dumps(found.as_dict(), indent=2) + "\n").encode()

    assert_equal(in_python(summary), expected)


@pytest.mark.parametrize(
    ("source", "words", "params"),
    [
        ("tile.tif", {}, {"sweeps": 2}),
        ("tile.tif", {"stretch": "minmax"}, {"sweeps": 1, "radius": 5}),
        ("tile.tif", {}, {"sweeps": 0, "threshold": 1.5, "untested": 0.2}),
        ("deep.tif", {}, {"sweeps": 1}),
        ("cut.tif", {"skip_bad_tiles": True}, {"sweeps": 1}),
        ("blocks.tif", {}, {}),
        ("ros.yaml", {}, {}),
        ("tile.tif", {}, {"radius": 300}),
    ],
)
def test_segments_of_the_original(source: str, words: Words, params: Words) -> None:
    arguments = [source, *options(words), *options(params), "-o", "out.tif"]
    expected = on_the_command_line("original", arguments, "out.tif")

    def segments() -> bytes:
        found = original_job(open_source(source, ReadOptions(**words)), LbpcParams(**params))
        for text in found.warnings:
            warnings.warn(text, stacklevel=1)
        box = found.source.geobox
        return written(
            lambda path: write_label_geotiff(path, [(Window(0, 0, *box.shape), found.labels)], box),
            "python.tif",
        )

    assert_equal(in_python(segments), expected)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("lens", {"poses": 1}),
        ("circles", {"poses": 1, "seed": 4}),
        ("lens", {"poses": 1, "sigma": 0.1, "max_range": 1.5, "fov": 40.0, "step": 2.0}),
        ("lens", {"poses": 9}),
        ("square", {}),
        ("lens", {"sigma": -1.0}),
    ],
)
def test_simulations(scene: str, words: Words) -> None:
    expected = on_the_command_line("simulate", [scene, *options(words), "-o", "out.tif"], "out.tif")

    def simulated() -> bytes:
        asked = SimulateOptions(scene=scene, **words)
        grid = simulate_job(asked).grid
        tags = {"scene": scene, "seed": str(asked.seed)}
        bands = [grid.probabilities]
        return written(
            lambda path: write_geotiff(path, bands, grid.geobox, ["occupancy"], tags), "python.tif"
        )

    assert_equal(in_python(simulated), expected)


def clouds_of(drive: Drive) -> list[Recorded]:
    """Points on the walls of its scans, at a height of one metre."""
    found = []
    for time, scan in zip(drive.scan_times(), drive.scans(), strict=True):
        seen = np.isfinite(scan.ranges)
        x, y = (scan.ranges[seen] * along(scan.angles[seen]) for along in (np.cos, np.sin))
        points = np.column_stack([x, y, np.ones(len(x))])
        found.append(Recorded("/scan", POINT_CLOUD, time, drive.point_cloud(points, time, "base_link")))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bag", "output", "words"),
    [
        ("drive.bag", "out.yaml", {}),
        ("drive", "out.tif", {"scan": "/scan", "odom": "/odom", "resolution": 0.1, "sigma": 0.05}),
        ("drive", "out.yaml", {"tf": True, "max_range": 1.5}),
        ("late", "out.tif", {}),
        ("drive", "out.tif", {"co": {"COMPRESS": "ZSTD", "PREDICTOR": 3}}),
        ("drive", "out.tif", {"co": {"COMPRESS": "JPEG"}}),
        ("drive", "out.yaml", {"co": {"COMPRESS": "ZSTD"}}),
        ("drive", "out.yaml", {"scan": "/front"}),
        ("drive", "out.yaml", {"odom": "/tf"}),
        ("drive", "out.yaml", {"tf": True, "odom": "/odom"}),
        ("drive", "out.yaml", {"resolution": -1.0}),
        ("drive", "out.yaml", {"sigma": float("nan")}),
        ("drive", "out.tif", {"no_return": "range_max", "beam_order": "angles"}),
        ("drive", "out.tif", {"heights": (0.1, 1.8)}),
        ("clouds", "out.tif", {"heights": (0.1, 1.8)}),
        ("clouds", "out.tif", {"heights": (1.8, 0.1)}),
        ("clouds", "out.tif", {}),
        ("missing.bag", "out.yaml", {}),
        ("tile.tif", "out.yaml", {}),
    ],
)
def test_maps_of_bags(bag: str, output: str, words: Words) -> None:
    if not Path("drive").exists():
        write_ros1(Path("drive.bag"), Drive(1, 3).everything())
        write_ros2(Path("drive"), Drive(2, 3).everything())
        write_ros2(Path("clouds"), clouds_of(Drive(2, 3)) + Drive(2, 3).recorded_odometry())
        write_ros2(Path("late"), Drive(2, 3).recorded_scans() + Drive(2, 3).recorded_odometry()[1:])
    for name in ("out.pgm", "python.pgm", "python.yaml"):
        Path(name).unlink(missing_ok=True)
    words = dict(words)
    creation = words.pop("co", {})
    named = [part for name, value in creation.items() for part in ("--co", f"{name}={value}")]
    expected = on_the_command_line("build-map", [bag, *options(words), *named, "-o", output], output)

    def built() -> bytes:
        found = uavseg.build_map(bag, **words)
        name = f"python{Path(output).suffix}"
        content = written(lambda path: found.write(path, creation_options=creation), name)
        if output == "out.yaml":
            assert Path("python.pgm").read_bytes() == Path("out.pgm").read_bytes()
        return content.replace(b"python.pgm", b"out.pgm")

    assert_equal(in_python(built), expected)


@pytest.mark.parametrize(
    ("maps", "output", "words"),
    [
        (["ros.yaml"], "out.yaml", {}),
        (["ros.yaml", "thin.yaml"], "out.tif", {"crop": True, "resolution": 0.07}),
        ("ros.yaml", "out.yaml", {}),
        (["ros.yaml"], "out.yaml", {"unrotate": True, "mode": "raw"}),
        (["ros.yaml"], "out.tif", {"mode": "raw"}),
        (["ros.yaml"], "out.yaml", {"resolution": -1.0}),
        (["ros.yaml", "missing.yaml"], "out.yaml", {}),
        (["ros.yaml", "tile.tif"], "out.yaml", {}),
    ],
)
def test_merged_maps(maps: str | list[str], output: str, words: Words) -> None:
    for name in ("out.pgm", "python.pgm", "python.yaml"):
        Path(name).unlink(missing_ok=True)
    expected = on_the_command_line(
        "merge-maps", [*([maps] if isinstance(maps, str) else maps), *options(words), "-o", output], output
    )

    def merged() -> bytes:
        merging = {name: value for name, value in words.items() if name != "mode"}
        found = uavseg.merge_maps(maps, **merging)
        name = f"python{Path(output).suffix}"
        content = written(lambda path: found.write(path, mode=words.get("mode")), name)
        return content.replace(b"python.pgm", b"out.pgm")

    assert_equal(in_python(merged), expected)


COMPARE: list[tuple[str, str, Words]] = [
    ("tile.tif", "tile.tif", {"range": (0.55, 1)}),
    ("tile.tif", "deep.tif", {"range": (0.55, 1)}),
    ("tile.tif", "two.tif", {"values": (100, None), "refine": "pixels", "min_area": "30px"}),
    ("tile.tif", "west.tif", {"percentile": (60, 100), "stretch": "minmax", "tile": 64}),
    ("bands.tif", "bands.tif", {"range": (0.55, 1), "index": "ndvi"}),
    ("tile.tif", "collar.tif", {"range": ["0,0.4", "0.6,1"], "refine": "none"}),
    ("tile.tif", "missing.tif", {"range": (0.55, 1)}),
    ("tile.tif", "tile.tif", {"range": (0.55, 1), "values": (1, 2)}),
    ("tile.tif", "tile.tif", {"refine": "pixels"}),
    ("ros.yaml", "ros.yaml", {}),
    ("ros.yaml", "thin.yaml", {}),
    ("map.tif", "map.tif", {"min_area": 1.0}),
    ("map.tif", "utm_map.tif", {}),
    ("ros.yaml", "ros.yaml", {"resume": "done"}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("before", "after", "words"), COMPARE)
def test_comparisons(before: str, after: str, words: Words) -> None:
    ranges = words["range"] if isinstance(words.get("range"), list) else []
    others = {name: value for name, value in words.items() if not ranges or name != "range"}
    named = [part for one in ranges for part in ("--range", one)]
    line = [before, after, *options(others), *named, "-o", "out.gpkg"]
    expected = on_the_command_line("compare", line, "out.gpkg")

    def compared() -> bytes:
        found = uavseg.compare(before, after, **words)
        return written(lambda path: export.write_regions(found.regions, path), "python.gpkg")

    assert_equal(in_python(compared), expected)


# Vehicles


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do not wait for a second vehicle."""
    monkeypatch.setattr(link, "LISTEN_S", 0.05)


def vehicle_lists(vehicle: FakeVehicle) -> bytes:
    return repr([vehicle.stored[kind] for kind in range(3)]).encode()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "mission", "words"),
    [
        (ArduPilot, fenced(survey()), {}),
        (Px4, survey(autopilot="px4"), {"timeout": 4.0}),
        (Px4, survey(), {}),
        (lambda: ArduPilot(capacity=5), survey(), {"timeout": 0.4}),
        (lambda: ArduPilot(armed=True), survey(), {}),
        (lambda: ArduPilot(armed=True), survey(), {"while_armed": True}),
        (ArduPilot, survey(), {"timeout": -1.0}),
    ],
)
def test_uploads(make: Callable[[], FakeVehicle], mission: Mission, words: Words) -> None:
    files.write_mission(mission, "fly.plan", overwrite=True)
    vehicle, other = make(), make()
    with udp_vehicle(vehicle) as address:
        expected = on_the_command_line("upload", ["fly.plan", "--connect", address, *options(words)], "")
    if isinstance(expected.content, bytes):
        expected = Answer(vehicle_lists(vehicle), expected.warnings)

    def upload() -> bytes:
        with udp_vehicle(other) as address:
            uavseg.upload("fly.plan", connect=address, **words)
        return vehicle_lists(other)

    assert_equal(in_python(upload), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "mission"),
    [
        (ArduPilot, fenced(survey())),
        (lambda: Px4(home=(47.0, 8.0, 412.5)), fenced(survey(autopilot="px4"))),
        (Generic, survey()),
        (Px4, None),
    ],
)
@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_downloads(make: Callable[[], FakeVehicle], mission: Mission | None, suffix: str) -> None:
    with udp_vehicle(make()) as address:
        if mission is not None:
            uavseg.upload(mission, connect=address)
        output = f"out{suffix}"
        expected = on_the_command_line("download", ["--connect", address, "-o", output], output)

        def held() -> bytes:
            found = uavseg.download(connect=address)
            return written(lambda path: files.write_mission(found, path), f"python{suffix}")

        assert_equal(in_python(held), expected)
