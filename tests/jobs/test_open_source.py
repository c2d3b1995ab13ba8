"""Every kind of source is recognised, and carries where it lies, its name and its warnings."""

from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine

import uavseg
from uavseg.errors import ParameterError, RasterReadError
from uavseg.jobs.divide import divide
from uavseg.jobs.source.open_source import open_probability_map, open_raster, open_source, raster_of
from uavseg.jobs.source.source import Blocks, ProbabilityMap, Raster
from uavseg.jobs.source.work import Work
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.blocks.block_file import write_block_map
from uavseg.segmentation.params.segment import SegmentParams

SHAPE = (80, 100)
SCENE = np.add.outer(np.arange(80), np.arange(100)).astype(np.uint8)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with chdir(path := tmp_path_factory.mktemp("sources")):
        place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
        for name, how in (("tile.tif", place), ("local.tif", {"transform": place["transform"]})):
            with rasterio.open(name, "w", "GTiff", 100, 80, 1, dtype="uint8", **how) as file:
                file.write(SCENE, 1)
        saved = divide(open_raster("tile.tif", ReadOptions(stretch="0,200"))).saved
        write_block_map("blocks.tif", saved, SegmentParams().division)
        write_ros_map("ros.yaml", np.full(SHAPE, 1), local_geobox(SHAPE, 0.1, (0, 0)))
        yield path


def grid() -> uavseg.OccupancyGrid:
    return uavseg.OccupancyGrid.empty(SHAPE, 0.1)


def data_array() -> Any:
    pytest.importorskip("rioxarray")
    return pytest.importorskip("xarray").DataArray(SCENE, dims=("y", "x"), name="v").rio.write_crs(32618)


@pytest.mark.parametrize(
    ("source", "kind", "name"),
    [
        (lambda: "tile.tif", Raster, "tile.tif"),
        (lambda: Path("tile.tif"), Raster, "tile.tif"),
        (lambda: ["tile.tif"], Raster, "tile.tif"),
        (lambda: ("tile.tif", "tile.tif"), Raster, "tile.tif"),
        (lambda: (name for name in ("tile.tif", "tile.tif")), Raster, "tile.tif"),
        (lambda: SCENE, Raster, "array"),
        (data_array, Raster, "v"),
        (lambda: Dataset.open("tile.tif"), Raster, "tile.tif"),
        (lambda: "blocks.tif", Blocks, "tile.tif"),
        (lambda: [Path("blocks.tif")], Blocks, "tile.tif"),
        (lambda: "ros.yaml", ProbabilityMap, "ros.yaml"),
        (lambda: ["ros.yaml"], ProbabilityMap, "ros.yaml"),
        (grid, ProbabilityMap, "occupancy grid"),
    ],
)
def test_every_kind_of_source_is_recognised(source: Any, kind: type, name: str) -> None:
    opened = open_source(source())
    assert isinstance(opened, kind)
    assert (opened.geobox.shape, opened.name) == (SHAPE, name)


def test_a_source_carries_its_warnings() -> None:
    assert open_source("tile.tif").warnings == ()
    [warning] = open_source("local.tif").warnings
    assert "coordinates are local" in warning


def test_a_raster_is_opened_as_a_map_of_probabilities() -> None:
    opened = open_probability_map("tile.tif")
    assert isinstance(opened, ProbabilityMap) and not opened.ros_map and opened.in_metres
    assert opened.stretch.name == "dtype -> 0..255"  # type: ignore[union-attr]
    chosen = open_probability_map(SCENE, ReadOptions(stretch="0,180"))
    assert isinstance(chosen, ProbabilityMap) and not chosen.in_metres and str(chosen.stretch) == "0,180"
    assert isinstance(open_probability_map("blocks.tif"), Blocks)
    ros = open_probability_map("ros.yaml")
    assert isinstance(ros, ProbabilityMap) and ros.ros_map == "ros.yaml" and ros.in_metres


def test_a_block_map_opens_its_raster_with_its_own_stretch() -> None:
    opened = open_source("blocks.tif", ReadOptions(skip_bad_tiles=True))
    assert isinstance(opened, Blocks) and opened.raster is not None
    assert opened.raster.stretch == opened.saved.stretch and opened.saved.stretch.high == 200
    assert opened.raster.dataset.skip_bad_tiles


def test_the_file_of_a_block_map_is_a_raster_where_that_is_asked_for() -> None:
    assert open_raster("blocks.tif").geobox.shape == (10, 13)


@pytest.mark.parametrize(
    ("source", "options", "refusal"),
    [
        ("blocks.tif", {"band": 1}, "a block map has its bands, nodata and stretch already"),
        ("blocks.tif", {"nodata": 0}, "leave these options out"),
        ("blocks.tif", {"stretch": "none"}, "leave these options out"),
        (["blocks.tif", "tile.tif"], {}, "blocks.tif is a block map, which is no part of a mosaic"),
        (["tile.tif", "ros.yaml"], {}, "a ROS map is no part of a mosaic; name it alone"),
        ("ros.yaml", {"rgb": (1, 2, 3)}, "a ROS map has neither bands nor nodata"),
        ("ros.yaml", {"stretch": "0,1"}, "a ROS map holds probabilities, which are not stretched"),
        (grid(), {"nodata": 0}, "a map has one band and no nodata"),
        (SCENE.astype(str), {}, "holds no numbers of a raster: .* got <U"),
        (SCENE[None, None], {}, r"expected an array of \(rows, cols\) or"),
        ([SCENE, SCENE], {}, "does not say where it lies, so it is no part of a mosaic"),
        ([], {}, "give at least one"),
    ],
)
def test_options_that_do_not_apply_are_refused(source: Any, options: dict[str, Any], refusal: str) -> None:
    with pytest.raises(ParameterError, match=refusal):
        open_source(source, ReadOptions(**options))


@pytest.mark.parametrize("stretch", ["auto", "none"])
def test_a_ros_map_may_be_said_not_to_be_stretched(stretch: str) -> None:
    assert isinstance(open_source("ros.yaml", ReadOptions(stretch=stretch)), ProbabilityMap)


def test_what_has_to_be_a_raster_is_refused_otherwise() -> None:
    assert raster_of(open_source("tile.tif")).name == "tile.tif"
    with pytest.raises(ParameterError, match="name the raster"):
        raster_of(open_source("blocks.tif"), "name the raster")
    for source in ("ros.yaml", grid()):
        with pytest.raises(RasterReadError, match="it is a map of probabilities"):
            raster_of(open_source(source))


def test_a_ros_map_cannot_be_resumed(tmp_path: Path) -> None:
    opened = open_source("ros.yaml")
    assert isinstance(opened, ProbabilityMap)
    assert Work(64).over(opened).windows
    with pytest.raises(ParameterError, match="nothing to resume"):
        Work(64, checkpoint=tmp_path / "kept").over(opened)
    assert not (tmp_path / "kept").exists()


def test_a_grid_is_not_stretched_by_what_it_contains() -> None:
    values = np.full(SHAPE, 0.5)
    values[20:60, 30:70] = 0.3
    grid = uavseg.OccupancyGrid.from_probabilities(values, local_geobox(SHAPE, 0.1, (0, 0)))
    found = uavseg.levels(grid, 0.4)
    assert sorted(found["mean"].round(3)) == [0.3, 0.5]
    assert np.isclose(uavseg.divide(grid).sums.sum() / 65535, values.sum(), rtol=1e-4)
