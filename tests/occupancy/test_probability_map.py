"""Maps of probabilities, as the segmentation reads them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from affine import Affine

from uavseg.errors import MapError, RasterReadError
from uavseg.occupancy.map_file import open_map, stretch_of
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.occupancy.simulation.scenes import lens
from uavseg.raster.formats.geotiff import Page, write_geotiff_pages
from uavseg.raster.formats.png import write_png
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.pipeline import GreySource, fill_ratios, measure_cells

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def writing(values: np.ndarray, nodata: float | None = None) -> Path:
        path = tmp_path / "map.tif"
        page = Page([values], local_geobox(values.shape, 0.05, (0, 0)), [""], nodata)
        write_geotiff_pages(path, [page], overwrite=True)
        return path

    return writing


def grey_of(path: Path, nodata: float | None = None) -> np.ndarray:
    dataset, stretch = open_map(path, nodata=nodata)
    rows, cols = dataset.geobox.shape
    return GreySource(dataset, stretch).read(Window(0, 0, rows, cols), 0).grey[:rows, :cols]


def greys(v: object) -> np.ndarray:
    return np.floor(65535 * np.asarray(v, np.float64) + 0.5)


def test_floats_are_not_stretched(write: Write) -> None:
    values = np.array([[0.2, 0.5, 0.3]], np.float32)
    assert (grey_of(write(values)) == greys(values)).all()


@pytest.mark.parametrize(("dtype", "top"), [(np.uint8, 255), (np.uint16, 65535)])
def test_integers_are_divided_by_the_largest_of_their_type(write: Write, dtype: type, top: int) -> None:
    values = np.array([[0, 7, 100]], dtype)
    assert (grey_of(write(values)) == greys(values / top)).all()


@pytest.mark.parametrize("bad", [1.5, -0.25])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_float_outside_of_0_to_1_is_refused(write: Write, bad: float, dtype: type) -> None:
    path = write(np.array([[0.5, bad, np.nan]], dtype))
    with pytest.raises(MapError, match=rf"lies in 0\.\.1 and this one holds {bad:g}"):
        grey_of(path)


def test_invalid_cells_may_hold_any_number(write: Write) -> None:
    path = write(np.array([[0.5, -9999.0, np.nan, np.inf]], np.float32), nodata=-9999.0)
    assert grey_of(path).tolist() == [[32768, 0, 0, 0]]
    bare = write(np.array([[0.5, 7.0]], np.float32))
    assert grey_of(bare, nodata=7.0).tolist() == [[32768, 0]]


@pytest.mark.parametrize("bad", [-0.1, 1.1])
def test_one_wrong_number_is_found_among_many_invalid(write: Write, bad: float) -> None:
    values = np.full((70, 90), np.nan, np.float32)
    values[69, 89] = bad
    with pytest.raises(MapError):
        grey_of(write(values))


def test_a_ros_map_is_read_by_window(tmp_path: Path) -> None:
    states = np.random.default_rng(0).integers(1, 4, (70, 90))
    write_ros_map(tmp_path / "map.yaml", states, local_geobox((70, 90), 0.05, (-1, -2)))
    dataset, stretch = open_map(tmp_path / "map.yaml")
    assert dataset.geobox.transform[:6] == Affine(0.05, 0, -1, 0, -0.05, 1.5)[:6]
    tile = GreySource(dataset, stretch).read(Window(64, 64, 6, 26), 1)
    assert tile.grey[0, 0] == np.array([0, 0, 32768, 65535])[states[63, 63]]
    assert (tile.grey[1:7, 1:27] == np.array([0, 0, 32768, 65535])[states[64:, 64:]]).all()
    assert not tile.valid[7:].any()


def test_a_ros_map_divides_like_the_same_raster(tmp_path: Path, write: Write) -> None:
    states = np.repeat(np.repeat(np.random.default_rng(1).integers(1, 4, (12, 13)), 11, 0), 9, 1)
    write_ros_map(tmp_path / "map.yaml", states, local_geobox(states.shape, 0.05, (0, 0)))
    probabilities = np.array([0, 0, 0.5, 1], np.float32)[states]
    maps = [open_map(path) for path in (tmp_path / "map.yaml", write(probabilities))]
    blocks = []
    for (dataset, stretch), side in zip(maps, (64, 128), strict=True):
        source, tile_pass = GreySource(dataset, stretch), TilePass(tiles(states.shape, side))
        measured = measure_cells(source, tile_pass)
        fill_ratios(source, measured, np.ones(measured.blocks.blocks, bool), tile_pass)
        blocks.append(measured.blocks)
    assert (blocks[0].sums == blocks[1].sums).all()
    np.testing.assert_array_equal(blocks[0].ratios, blocks[1].ratios)


def test_a_grid_is_a_dataset_and_later_scans_show_in_it() -> None:
    simulation = lens()
    grid = OccupancyGrid(simulation.geobox)
    dataset = grid.dataset()
    assert (dataset.read(Window(0, 0, 320, 320))[0] == 0.5).all()
    scan = simulation.sensor.scan(simulation.scene, simulation.poses[0], np.random.default_rng(0))
    window = grid.merge(scan)
    values, valid = dataset.read(window)
    assert valid is None and (values[0] == grid.probabilities[window.slices]).all() and (values != 0.5).any()
    assert stretch_of(dataset).apply(values).shape == (window.rows, window.cols)
    assert dataset.read_coarse(100)[0].shape == (1, 100, 100)


def test_an_image_without_yaml_is_a_raster(tmp_path: Path) -> None:
    grey = np.array([[0, 128, 255]], np.uint8)
    write_png(tmp_path / "map.png", grey)
    assert (grey_of(tmp_path / "map.png") == greys(grey / 255)).all()


def test_values_in_memory_are_not_copied() -> None:
    values = np.zeros((4, 5), np.float32)
    dataset = Dataset.of_values(values, local_geobox((4, 5), 1.0, (0, 0)), "mine")
    values[2, 3] = 0.75
    assert dataset.read(Window(2, 3, 1, 1))[0] == 0.75 and dataset.source == "mine"


def test_a_missing_map_is_refused(tmp_path: Path) -> None:
    for name in ("none.tif", "none.yaml"):
        with pytest.raises(RasterReadError, match="there is no file"):
            open_map(tmp_path / name)


@pytest.mark.parametrize("name", ["depot.yaml", "tb3_sandbox.yaml", "willow-full.pgm"])
def test_real_maps_are_read_by_window(shared_data: Path, name: str) -> None:
    dataset, stretch = open_map(shared_data / "maps" / name)
    source = GreySource(dataset, stretch)
    windows = tiles(dataset.geobox.shape, 64)
    whole = source.read(Window(0, 0, *dataset.geobox.shape), 0).grey
    for window in windows:
        tile = source.read(window, 0).grey
        assert (tile[: window.rows, : window.cols] == whole[window.slices]).all()
