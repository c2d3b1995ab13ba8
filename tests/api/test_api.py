"""The words one types in Python."""

import doctest
import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from geopandas.testing import assert_geodataframe_equal
from pyproj import Transformer

import uavseg
from uavseg.errors import IntensityRangeError, ParameterError, RasterReadError
from uavseg.flight.planning import planner

COLUMNS = ["id", "confidence", "area_m2", "perimeter_m", "mean", "std", "pixels", "holes", "lon", "lat"]
COLUMNS += ["range_low", "range_high", "mean_value", "value_low", "value_high", "unit", "source", "geometry"]
RANGE = (0.55, 1)


def scene() -> np.ndarray:
    """Three bright rectangles with noise in a dark field."""
    rng = np.random.default_rng(5)
    image = rng.integers(20, 50, (140, 180))
    for rows, cols in (
        (slice(10, 60), slice(20, 90)),
        (slice(80, 130), slice(8, 40)),
        (slice(90, 101), slice(100, 170)),
    ):
        image[rows, cols] += 160
    image[30:40, 40:60] = 30
    return image.astype(np.uint8)


def write(path: Path, image: np.ndarray, col: int = 0) -> Path:
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5 + 2 * col, 0, -2, 5e6)}
    rows, cols = image.shape
    with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype=image.dtype.name, **place) as file:
        file.write(image, 1)
    return path


@pytest.fixture
def raster(tmp_path: Path) -> Path:
    return write(tmp_path / "tile.tif", scene())


@pytest.fixture
def regions(raster: Path) -> geopandas.GeoDataFrame:
    return uavseg.extract(raster, range=RANGE)


def same(one: geopandas.GeoDataFrame, other: geopandas.GeoDataFrame) -> None:
    assert_geodataframe_equal(one.drop(columns="source"), other.drop(columns="source"))


def test_a_raster_becomes_a_frame(regions: geopandas.GeoDataFrame) -> None:
    assert isinstance(regions, geopandas.GeoDataFrame)
    assert list(regions.columns) == COLUMNS and regions.crs.to_epsg() == 32618
    assert list(regions["id"]) == [1, 2, 3] and regions["id"].dtype == np.int64
    assert list(regions["pixels"]) == [3500 - 200, 50 * 32, 11 * 70] and list(regions["holes"]) == [1, 0, 0]
    assert list(regions.area) == [4.0 * pixels for pixels in regions["pixels"]]
    assert set(regions["source"]) == {"tile.tif"}
    assert set(zip(regions["range_low"], regions["range_high"], strict=True)) == {RANGE}


def test_measures_are_those_of_the_pixels(regions: geopandas.GeoDataFrame) -> None:
    field = scene()[80:130, 8:40] / 255
    row = regions.iloc[1]
    assert row["mean"] == pytest.approx(field.mean(), abs=1e-5) and row["std"] == pytest.approx(
        field.std(), abs=1e-5
    )
    assert row["area_m2"] == pytest.approx(6400, rel=1e-3) and row["perimeter_m"] == pytest.approx(
        328, rel=1e-3
    )
    inside = geopandas.points_from_xy([row["lon"]], [row["lat"]], crs=4326).to_crs(32618)[0]
    assert row.geometry.contains(inside)


def test_a_path_may_be_text_and_many_are_one_mosaic(
    tmp_path: Path, raster: Path, regions: geopandas.GeoDataFrame
) -> None:
    same(uavseg.extract(str(raster), RANGE), regions)
    parts = [write(tmp_path / "west.tif", scene()[:, :70]), write(tmp_path / "east.tif", scene()[:, 70:], 70)]
    found = uavseg.extract(parts, RANGE)
    same(found, regions)
    assert set(found["source"]) == {"west.tif"}
    same(uavseg.extract((str(part) for part in parts), RANGE), regions)


def test_a_dataset_that_is_open_already(raster: Path, regions: geopandas.GeoDataFrame) -> None:
    same(uavseg.extract(uavseg.Dataset.open(raster), RANGE), regions)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_data_array_of_rioxarray(raster: Path, regions: geopandas.GeoDataFrame, dimensions: int) -> None:
    rioxarray = pytest.importorskip("rioxarray")
    with rioxarray.open_rasterio(raster) as opened:
        array = opened.load() if dimensions == 3 else opened.load().squeeze("band", drop=True)
    found = uavseg.extract(array, RANGE)
    same(found, regions)
    assert found.crs == regions.crs


def test_a_data_array_with_nodata_and_numbers_of_its_own() -> None:
    pytest.importorskip("rioxarray")
    xarray = pytest.importorskip("xarray")
    v = np.where(scene() == 30, np.nan, scene() / 255).astype(np.float32)
    axes = {"y": 5e6 - 2 * np.arange(140) - 1, "x": 4e5 + 2 * np.arange(180) + 1}
    array = xarray.DataArray(v, axes, ("y", "x"), name="v").rio.write_crs(32618)
    found = uavseg.extract(array, RANGE, stretch="none", min_area="100px")
    assert len(found) == 3 and found.total_bounds[0] == 4e5 + 16


@pytest.mark.slow
def test_options_are_those_of_the_command_line(raster: Path, regions: geopandas.GeoDataFrame) -> None:
    assert list(uavseg.extract(raster, RANGE, min_area=5000, fill_holes="201px")["pixels"]) == [3500, 1600]
    assert list(uavseg.extract(raster, RANGE, fill_holes=801.0)["holes"]) == [0, 0, 0]
    with pytest.warns(UserWarning, match="no region has a mean v"):
        coarse = uavseg.extract(raster, RANGE, method="paper", refine="none", threshold=2.0)
    assert not np.array_equal(coarse["pixels"], regions["pixels"])
    assert len(uavseg.extract(raster, (0.05, 0.2), stretch="0,510", nodata=30, band=1)) >= 1


@pytest.mark.slow
def test_tile_and_threads_change_nothing(raster: Path, regions: geopandas.GeoDataFrame) -> None:
    for tile, threads in ((64, 1), (128, 2), (4096, 3)):
        same(uavseg.extract(raster, RANGE, tile=tile, threads=threads), regions)


def test_progress_is_reported(raster: Path) -> None:
    told: list[float] = []
    uavseg.extract(raster, RANGE, tile=64, progress=lambda done, total: told.append(done / total))
    assert len(told) >= 9 and told[-1] == 1 and told == sorted(told)


def test_no_region_is_an_empty_frame(raster: Path) -> None:
    with pytest.warns(UserWarning, match="no region has a mean v"):
        none = uavseg.extract(raster, (0.95, 1))
    assert len(none) == 0 and list(none.columns) == COLUMNS and none.crs.to_epsg() == 32618


def test_regions_become_a_mission(regions: geopandas.GeoDataFrame) -> None:
    on_globe = regions.to_crs(4326)
    points = [
        tuple(float(f"{x:.12g}") for x in pair) for pair in zip(regions["lon"], regions["lat"], strict=True)
    ]
    params, home = uavseg.PlanParams(altitude_m=60, pattern="visit"), (45.1, -76.2)
    (mission,) = planner.plan_missions(list(on_globe.geometry), points, params, home)
    assert len(mission.items) >= 3
    with pytest.warns(UserWarning) as caught:
        assert uavseg.plan(regions, altitude=60, home=home).missions == (mission,)
    given = {str(one.message) for one in caught if one.category is UserWarning}
    assert given == set(mission.warnings)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("pattern", ["visit", "corridor", "survey", "perimeter"])
def test_digits_that_formats_cut_off_decide_nothing(pattern: str) -> None:
    """Regions moved by a picometre are planned the same, where several orders are as long."""
    to_degrees = Transformer.from_crs("+proj=aeqd +lat_0=46 +lon_0=15", 4326, always_xy=True).transform
    boxes = [(60, 40, 160, 90), (320, 40, 400, 170), (60, 300, 130, 370), (320, 300, 470, 330)]
    corners = [
        np.column_stack(to_degrees(*np.array(shapely.box(*box).exterior.coords[:-1]).T)) for box in boxes
    ]
    spacing = {"spacing": 15} if pattern in ("corridor", "survey") else {}
    plans = []
    for seed in range(6):
        aside = np.random.default_rng(seed).normal(0, 2e-14 if seed else 0, (4, 4, 2))
        polygons = [shapely.Polygon(box + by) for box, by in zip(corners, aside, strict=True)]
        frame = geopandas.GeoDataFrame(geometry=polygons, crs=4326)
        plans.append(uavseg.plan(frame, altitude=60, home=(46.0, 15.0), pattern=pattern, **spacing).missions)
    assert all(plan == plans[0] for plan in plans)


def test_a_block_map(raster: Path) -> None:
    blocks = uavseg.divide(raster, tile=64, threads=2)
    assert int(blocks.counts.sum()) == 140 * 180
    assert int(blocks.sums.sum()) == 257 * int(scene().sum())
    whole = uavseg.divide(uavseg.Dataset.open(raster))
    assert all(np.array_equal(getattr(blocks, n), getattr(whole, n)) for n in ("sums", "counts", "ratios"))


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"range": (1, 0.5)}, IntensityRangeError),
        ({"range": (0.5, 1), "tile": 100}, ParameterError),
        ({"range": (0.5, 1), "threads": 0}, ParameterError),
        ({"range": (0.5, 1), "min_area": -1}, ParameterError),
        ({"range": (0.5, 1), "fill_holes": "big"}, ParameterError),
        ({"range": (0.5, 1), "method": "best"}, ParameterError),
        ({"range": (0.5, 1), "refine": "twice"}, ParameterError),
        ({"range": (0.5, 1), "stretch": "wide"}, ParameterError),
        ({"range": (0.5, 1), "band": 7}, ParameterError),
    ],
)
def test_what_cannot_be_is_refused(raster: Path, wrong: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error) as caught:
        uavseg.extract(raster, **wrong)
    assert isinstance(caught.value, uavseg.UavsegError) and str(caught.value)


def test_a_raster_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RasterReadError, match=r"missing\.tif"):
        uavseg.extract(tmp_path / "missing.tif", RANGE)
    with pytest.raises(ParameterError, match="give at least one"):
        uavseg.extract([], RANGE)


# The names


def test_every_public_word_is_there() -> None:
    assert {"extract", "divide", "plan", "Dataset", "GeoBox", "trace", "IntensityRange"} <= set(
        uavseg.__all__
    )
    for name in uavseg.__all__:
        assert getattr(uavseg, name) is not None and name in dir(uavseg)
    with pytest.raises(AttributeError, match="has no attribute 'fly'"):
        uavseg.fly  # noqa: B018


@pytest.mark.slow
def test_words_are_loaded_when_they_are_first_used() -> None:
    code = (
        "import sys, uavseg; print('numpy' in sys.modules, 'extract' in vars(uavseg));"
        "uavseg.UavsegError; print('numpy' in sys.modules);"
        "uavseg.extract; print('numpy' in sys.modules, 'extract' in vars(uavseg), 'geopandas' in sys.modules)"
    )
    root = Path(uavseg.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root, check=True)
    assert done.stdout.split() == ["False", "False", "False", "True", "True", "False"]


@pytest.mark.parametrize("module", ["uavseg", "uavseg.api.rasters"])
def test_the_examples_run_where_their_raster_is(
    raster: Path, monkeypatch: pytest.MonkeyPatch, module: str
) -> None:
    monkeypatch.chdir(raster.parent)
    tests = [t for t in doctest.DocTestFinder().find(importlib.import_module(module)) if t.examples]
    assert tests
    for test in tests:
        for example in test.examples:
            example.options.pop(doctest.SKIP, None)
        assert doctest.DocTestRunner().run(test).failed == 0


# Levels and states


def test_a_raster_becomes_levels(raster: Path) -> None:
    segments = uavseg.levels(raster, 0.25)
    assert list(segments.columns) == ["id", "level", *COLUMNS[1:]] and segments.crs.to_epsg() == 32618
    assert segments["pixels"].sum() == scene().size
    assert {0, 3} <= set(segments["level"])
    assert (segments["range_high"] - segments["range_low"] == 0.25).all()
    assert (segments["range_low"] == 0.25 * segments["level"]).all()
    same(uavseg.levels(scene(), 0.25, tile=64), uavseg.levels(scene(), 0.25, threads=1))
    assert uavseg.levels(scene(), 0.25)["pixels"].tolist() == segments["pixels"].tolist()


def occupancy() -> np.ndarray:
    values = np.full((140, 180), 0.5, np.float32)
    values[5:130, 9:170] = 0.2
    values[30:60, 40:90] = 0.9
    values[64:96, 64:128] = 0.8
    return values


def test_a_map_becomes_states_and_objects(tmp_path: Path) -> None:
    found = uavseg.classify(occupancy())
    assert found.states.shape == (140, 180) and found.states.dtype == np.uint8
    wanted = np.searchsorted([0.498, 0.502], occupancy()) + 1
    assert found.states[30:60, 40:90].min() == 3 and (found.states == wanted).mean() > 0.9
    objects = found.frame()
    assert objects["pixels"].tolist() == [2048, 1500] and objects["id"].tolist() == [1, 2]
    assert objects[["x_min", "y_min", "x_max", "y_max"]].iloc[0].tolist() == [64, 64, 128, 96]
    assert sum(found.cells.values()) == occupancy().size and found.cells[3] == 3548
    assert found.geobox.shape == (140, 180)


@pytest.mark.slow
def test_maps_of_every_kind_are_the_same_map(tmp_path: Path) -> None:
    from uavseg.occupancy.map_file import write_states
    from uavseg.occupancy.mapping.grid import OccupancyGrid
    from uavseg.raster.grid.geobox import local_geobox

    grid = OccupancyGrid.from_probabilities(occupancy(), local_geobox((140, 180), 1.0, (0, 0)))
    wanted = uavseg.classify(grid)
    path = write(tmp_path / "map.tif", grid.probabilities)
    for source in (grid.probabilities, path, uavseg.Dataset.open(path), grid.dataset()):
        found = uavseg.classify(source, tile=64)
        assert np.array_equal(found.states, wanted.states)
        assert found.frame()["pixels"].tolist() == wanted.frame()["pixels"].tolist()
    write_states(tmp_path / "out.yaml", wanted.image, wanted.geobox)
    with pytest.warns(UserWarning, match="unknown cells of out.yaml are called free"):
        again = uavseg.classify(tmp_path / "out.yaml", refine="none")
    assert again.cells.keys() == wanted.cells.keys()


def test_what_is_asked_of_a_map_is_answered(tmp_path: Path) -> None:
    assert uavseg.classify(occupancy(), min_area="2000px").frame()["pixels"].tolist() == [2048]
    assert uavseg.classify(occupancy(), free_below=0.05, occupied_above=0.85).cells[1] == 0
    blocky = uavseg.classify(occupancy(), refine="none").states
    assert np.array_equal(blocky[:136, :176], blocky[:136:8, :176:8].repeat(8, 0).repeat(8, 1))


def test_a_map_of_something_else_is_stretched_where_that_is_asked_for(tmp_path: Path) -> None:
    percent = np.rint(occupancy() * 100).astype(np.uint8)
    wanted = uavseg.classify((percent / 100).astype(np.float32))
    for source in (percent, write(tmp_path / "percent.tif", percent)):
        found = uavseg.classify(source, stretch="0,100", tile=64)
        assert np.array_equal(found.states, wanted.states)
        assert found.source.stretch.name == "0,100 -> 0..100"
    assert uavseg.classify(percent).cells[3] == 0  # as parts of 255
    assert uavseg.classify(percent, stretch="minmax").source.stretch.high == percent.max()


def test_a_ros_map_is_never_stretched(tmp_path: Path) -> None:
    from uavseg.occupancy.map_file import write_states
    from uavseg.occupancy.mapping.grid import OccupancyGrid
    from uavseg.raster.grid.geobox import local_geobox

    grid = OccupancyGrid.from_probabilities(occupancy(), local_geobox((140, 180), 1.0, (0, 0)))
    found = uavseg.classify(grid)
    write_states(tmp_path / "map.yaml", found.image, found.geobox)
    wanted = uavseg.classify(tmp_path / "map.yaml")
    for stretch in ("auto", "none"):
        found = uavseg.classify(tmp_path / "map.yaml", stretch=stretch)
        assert found.source.stretch == wanted.source.stretch
    ends = {"range": (0, 0.45), "start": (20.5, 120.5), "goal": (30.5, 120.5)}
    for call in (uavseg.classify, lambda source, stretch: uavseg.path(source, **ends, stretch=stretch)):
        with pytest.raises(ParameterError, match=r"a ROS map holds probabilities, .* leave stretch out"):
            call(tmp_path / "map.yaml", stretch="0,100")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: uavseg.levels(scene(), 0), "width of a level"),
        (lambda: uavseg.levels(scene()[0], 0.1), r"got uint8 of shape \(180,\)"),
        (lambda: uavseg.levels(scene() * 1j, 0.1), "holds complex numbers, got complex128 of shape"),
        (lambda: uavseg.levels(scene(), 0.1, band=2), "there is no band 2"),
        (lambda: uavseg.classify(occupancy(), refine="smooth"), "refine is scan or none, not smooth"),
        (lambda: uavseg.classify(occupancy() * 2), "lies in 0..1 and this one holds 1.8"),
        (lambda: uavseg.classify(occupancy() * np.nan), "no valid cell"),
        (lambda: uavseg.classify(occupancy(), free_below=0.9), "limits of states"),
        (lambda: uavseg.classify(occupancy(), stretch="percent"), "percent"),
        (lambda: uavseg.classify(occupancy(), tile=10), "multiple of 64"),
    ],
)
def test_maps_and_levels_that_cannot_be_are_refused(call: Any, told: str) -> None:
    with pytest.raises(uavseg.UavsegError, match=told):
        call()


def test_objects_that_nobody_asked_for_are_not_there() -> None:
    from uavseg.jobs.maps.classify import ClassifyRequest, classify
    from uavseg.jobs.source.open_source import open_probability_map

    found = classify(open_probability_map(occupancy()), ClassifyRequest(objects=False))
    with pytest.raises(ParameterError, match="no objects were asked for"):
        found.frame()


def test_outlines_are_smoothed_and_small_segments_merged_as_on_the_command_line(raster: Path) -> None:
    stairs, smooth = uavseg.extract(raster, RANGE), uavseg.extract(raster, RANGE, smooth_outline=1)
    assert stairs.drop(columns="geometry").equals(smooth.drop(columns="geometry"))
    assert smooth.is_valid.all() and not stairs.geometry.geom_equals(smooth.geometry).any()
    everything = uavseg.levels(scene(), 0.1)
    merged, dropped = (
        uavseg.levels(scene(), 0.1, min_area="600px", small=small) for small in ("merge", "drop")
    )
    assert merged["pixels"].sum() == everything["pixels"].sum() > dropped["pixels"].sum()
    assert merged["pixels"].min() >= 600
    with pytest.raises(uavseg.errors.ParameterError, match="merge or drop, not 'sieve'"):
        uavseg.levels(scene(), 0.1, small="sieve")  # type: ignore[arg-type]


def test_a_nodata_value_of_numpy_is_a_number(tmp_path: Path) -> None:
    image = np.full((64, 64), 0.5, np.float32)
    image[:20] = 0.25
    path = tmp_path / "a.tif"
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    with rasterio.open(path, "w", "GTiff", 64, 64, 1, dtype="float32", **place) as file:
        file.write(image, 1)
    for nodata in (0.25, np.float64(0.25)):
        found = uavseg.extract(path, range=(0.4, 1), stretch="none", nodata=nodata)
        assert found["pixels"].sum() == 44 * 64
