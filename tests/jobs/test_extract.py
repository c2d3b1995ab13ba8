"""The main job, whole: a raster, or its block map, becomes regions."""

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from hypothesis import example, given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import serial, threads
from uavseg.jobs.divide import divide
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.result.result import Drawing, Extraction
from uavseg.jobs.source.source import Blocks, Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import tiles
from uavseg.raster.intensity.stretch import parse_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.edit.small import Area
from uavseg.regions.formats.export import label_strips
from uavseg.segmentation.blocks.block_file import Origin
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

Image = NDArray[Any]
Opened = Callable[..., Dataset]
BRIGHT = IntensityRange(0.55, 1)
NONE, SCAN, SMOOTH = (SegmentParams(refine=how) for how in ("none", "scan", "smooth"))
WAYS = [SegmentParams(method, refine=how) for method in ("paper", "adaptive") for how in ("none", "scan")]  # type: ignore[arg-type]


def pixels(value: float) -> Area:
    return Area(value, in_pixels=True)


@pytest.fixture(scope="session")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Opened:
    """A dataset of an image, with a nodata value or without."""
    folder, numbers = tmp_path_factory.mktemp("extract"), count()

    def write(image: Image, nodata: float | None = None, crs: str | None = "EPSG:32618") -> Dataset:
        path = folder / f"{next(numbers)}.tif"
        rows, cols = image.shape
        place = {"crs": crs, "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": nodata}
        with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype=image.dtype.name, **place) as file:
            file.write(image, 1)
        return Dataset.open(path)

    return write


def scene(seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Patches of some brightness, smooth or noisy, with nodata (0) in patches and specks."""
    rng = np.random.default_rng(seed)
    grain = int(rng.choice([5, 11, 30]))
    coarse = rng.integers(60, 240, (shape[0] // grain + 1, shape[1] // grain + 1))
    image = np.kron(coarse, np.ones((grain, grain), int))[: shape[0], : shape[1]]
    image = np.clip(image + rng.normal(0, rng.choice([1, 25]), shape), 1, 255).astype(np.uint8)
    gone = np.kron(rng.random(coarse.shape) < 0.1, np.ones((grain, grain), bool))[: shape[0], : shape[1]]
    image[gone | (rng.random(shape) < 0.01)] = 0
    return image


def picture(text: str, side: int = 8) -> NDArray[np.uint8]:
    """A drawing in which every letter is a cell of 8 x 8 pixels, or more: # bright, . dark, x nodata (0)."""
    small = np.array([[{"#": 200, ".": 20, "x": 0}[c] for c in row] for row in text.split()], np.uint8)
    return small.repeat(side, 0).repeat(side, 1)


def labels_of(found: Extraction) -> NDArray[np.uint32]:
    labels = np.zeros(found.geobox.shape, np.uint32)
    for window, part in label_strips(found.rings, found.geobox.shape):
        labels[window.slices] = part
    return labels


def cells_of(found: Extraction) -> list[str]:
    return ["".join(".123456789"[label] for label in row) for row in labels_of(found)[::8, ::8]]


def extracted(
    source: Dataset | Blocks,
    segment: SegmentParams = SegmentParams(),
    stretch: str = "auto",
    work: Work = SERIAL,
    **more: Any,
) -> Extraction:
    opened = Raster(source, parse_stretch(stretch)) if isinstance(source, Dataset) else source
    return extract(opened, ExtractRequest(BRIGHT, segment, **more), work)


def saved(dataset: Dataset, raster: Dataset | None = None) -> Blocks:
    """The block map of a raster that is not where it was, or has become another."""
    path = "there.tif" if raster is None else raster.paths[0]
    blocks = divide(Raster(dataset)).saved
    return Blocks(
        replace(blocks, origin=Origin((path,), "/nowhere")), str(Path(path).with_name("blocks.tif"))
    )


def equal(one: Extraction, other: Extraction) -> bool:
    """All attributes, and all outlines."""
    names = one.regions.columns
    columns = all(str(names[k].tolist()) == str(other.regions.columns[k].tolist()) for k in names)
    same_shapes = [
        a.equals_exact(b) for a, b in zip(one.regions.polygons, other.regions.polygons, strict=True)
    ]
    return columns and all(same_shapes) and np.array_equal(labels_of(one), labels_of(other))


def assert_measured(found: Extraction, grey: NDArray[np.uint16], valid: NDArray[np.bool_]) -> None:
    """The attributes are those of the painted labels, by force."""
    labels, columns = labels_of(found).reshape(-1), found.regions.columns
    n = len(found.regions)
    assert columns["id"].tolist() == list(range(1, n + 1)) and labels.max() == n
    assert columns["pixels"].tolist() == np.bincount(labels)[1:].tolist()
    assert (np.diff(columns["pixels"]) <= 0).all()
    v, known = grey.reshape(-1) / 65535, valid.reshape(-1)
    for name in range(1, n + 1):
        own = v[(labels == name) & known]
        assert columns["mean"][name - 1] == pytest.approx(own.mean(), rel=1e-12)
        assert columns["std"][name - 1] == pytest.approx(own.std(), abs=1e-7)
    areas = 4.0 * columns["pixels"]  # pixels of 2 m
    assert shapely.area(found.regions.polygons).tolist() == pytest.approx(areas.tolist())
    assert np.abs(columns["area_m2"] / areas - 1).max(initial=0) < 0.002  # the scale of UTM
    assert shapely.is_valid(found.regions.polygons).all()


# A raster


@pytest.mark.parametrize("how", WAYS, ids=lambda how: f"{how.method}-{how.refine}")
@pytest.mark.parametrize(("seed", "shape"), [(1, (100, 140)), (2, (64, 64)), (3, (33, 150)), (5, (129, 90))])
def test_labels_are_those_of_the_reference(
    reference: ModuleType, opened: Opened, seed: int, shape: tuple[int, int], how: SegmentParams
) -> None:
    image = scene(seed, shape)
    tau = how.intensity_step if how.method == "adaptive" else None
    wanted = reference.extract(image, image > 0, 0, 255, 0.55, 1, how.threshold, tau, how.refine)
    found = extracted(opened(image, 0), how, work=Work(64))
    assert np.array_equal(labels_of(found), wanted)
    assert_measured(found, reference.grey(image, image > 0, 0, 255), image > 0)


def test_floats_with_nan_and_sixteen_bits_too(reference: ModuleType, opened: Opened) -> None:
    image = scene(9, (90, 120))
    floats = np.where(image == 0, np.nan, image / 255).astype(np.float32)
    wanted = reference.extract(floats, image > 0, 0, 1, 0.55, 1, 1.2, 0.05)
    assert np.array_equal(labels_of(extracted(opened(floats), SCAN, "none")), wanted)
    deep = image.astype(np.uint16) * 200
    wanted = reference.extract(deep, image > 0, 2000, 50_000, 0.55, 1, 1.2, 0.05)
    found = extracted(opened(deep, 0), SCAN, "2000,50000")
    assert np.array_equal(labels_of(found), wanted)


def test_a_bright_field_is_one_region_with_its_attributes(opened: Opened) -> None:
    found = extracted(opened(picture("...... .####. .#..#. .####. ......")))
    assert cells_of(found) == ["......", ".1111.", ".1..1.", ".1111.", "......"]
    columns = {name: column.tolist() for name, column in found.regions.columns.items()}
    assert columns["pixels"] == [640] and columns["holes"] == [1]
    assert columns["mean"] == pytest.approx([200 / 255], abs=1e-5) and columns["std"] == pytest.approx(
        [0], abs=1e-5
    )
    assert columns["area_m2"] == pytest.approx([2560], rel=1e-3)
    assert columns["perimeter_m"] == pytest.approx([2 * (14 + 6) * 8], rel=1e-3)
    assert (columns["range_low"], columns["range_high"]) == ([0.55], [1])
    assert columns["source"][0].endswith(".tif")
    assert found.regions.polygons[0].bounds == (4e5 + 16, 5e6 - 64, 4e5 + 80, 5e6 - 16)


def test_nothing_in_range_is_no_region(opened: Opened) -> None:
    for image in (picture("... ..."), np.zeros((20, 30), np.uint8)):
        found = extracted(opened(image, 0))
        assert len(found.regions) == 0 and not labels_of(found).any()


@pytest.mark.slow
@settings(max_examples=15)
@given(
    st.integers(0, 10**6),
    st.tuples(st.integers(1, 260), st.integers(1, 260)),
    st.sampled_from([NONE, SCAN, SMOOTH, *WAYS]),
    st.sampled_from(["auto", "percentile:5,95"]),
    st.booleans(),
)
@example(0, (200, 200), SMOOTH, "auto", True)
def test_tiles_and_threads_change_nothing(
    opened: Opened, seed: int, shape: tuple[int, int], how: SegmentParams, stretch: str, clean: bool
) -> None:
    dataset = opened(scene(seed, shape), 0)
    small = {"fill_holes": pixels(40), "min_area": pixels(10)} if clean else {}
    wanted = extracted(dataset, how, stretch, Work(4096), **small)
    for tile, run in ((64, threads(2)), (128, serial), (192, threads(3)), (None, serial)):
        assert equal(wanted, extracted(dataset, how, stretch, Work(tile, run), **small))


def test_progress_rises_to_the_end(opened: Opened) -> None:
    told: list[float] = []
    dataset = opened(scene(4, (200, 200)).astype(np.uint16))
    extracted(dataset, work=Work(64, threads(2), progress=lambda done, total: told.append(done / total)))
    assert told == sorted(told) and told[-1] == 1 and len(told) > 16


@pytest.mark.parametrize("tile", [100, -64, 63])
def test_a_tile_that_is_no_multiple_of_64_is_refused(opened: Opened, tile: int) -> None:
    with pytest.raises(ParameterError, match=f"multiple of 64 pixels, not {tile}"):
        extracted(opened(picture("#")), work=Work(tile))


@pytest.mark.parametrize("metres", [-1.0, float("nan"), float("inf")])
def test_outlines_are_not_simplified_by_less_than_nothing(metres: float) -> None:
    with pytest.raises(ParameterError, match="simplified by metres that are not negative"):
        Drawing(simplify_m=metres)


def test_simplified_outlines_keep_ids_and_measures_of_the_pixels(opened: Opened) -> None:
    dataset = opened(scene(12, (200, 200)), 0)
    exact = extracted(dataset)
    simple = extracted(dataset, drawing=Drawing(simplify_m=5))
    for name in ("id", "pixels", "mean", "std", "holes"):
        if name != "holes":
            assert simple.regions.columns[name].tolist() == exact.regions.columns[name].tolist()
    corners = [int(shapely.get_num_coordinates(f.regions.polygons).sum()) for f in (simple, exact)]
    assert corners[0] < 0.8 * corners[1]
    assert np.array_equal(labels_of(simple), labels_of(exact))


# Holes and small regions

LAKE = ".......... .#####.... .#...#.##. .#.#.#.##. .#...#.##. .#####.##. .......##. .........."


def test_small_regions_are_dropped_after_holes_are_filled(opened: Opened) -> None:
    dataset = opened(picture("....... .###... .#.#... .###... ......."))
    kept = extracted(dataset, NONE, fill_holes=pixels(65), min_area=pixels(576))
    assert kept.regions.columns["pixels"].tolist() == [576]
    assert len(extracted(dataset, NONE, min_area=pixels(576)).regions) == 0
    assert len(extracted(dataset, NONE, fill_holes=pixels(64), min_area=pixels(576)).regions) == 0


def test_what_was_in_a_filled_hole_is_measured_anew(reference: ModuleType, opened: Opened) -> None:
    image = picture(LAKE)
    dataset = opened(image)
    grey, everywhere = reference.grey(image, image > 0, 0, 255), image > 0
    before = extracted(dataset, NONE)
    assert before.regions.columns["pixels"].tolist() == [64 * 16, 64 * 10, 64]
    found = extracted(dataset, NONE, fill_holes=pixels(1000))
    assert found.regions.columns["pixels"].tolist() == [64 * 25, 64 * 10]
    assert found.regions.columns["holes"].tolist() == [0, 0]
    assert_measured(found, grey, everywhere)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.integers(0, 10**6), st.integers(0, 300), st.integers(0, 100), st.sampled_from([SCAN, SMOOTH]))
def test_cleaned_regions_are_measured_over_their_valid_pixels(
    reference: ModuleType, opened: Opened, seed: int, holes: int, small: int, how: SegmentParams
) -> None:
    image = scene(seed, (120, 130))
    valid = image > 0
    area = {"fill_holes": pixels(holes), "min_area": pixels(small)}
    found = extracted(opened(image, 0), how, work=Work(64), **area)
    if len(found.regions):
        assert_measured(found, reference.grey(image, valid, 0, 255), valid)
        assert found.regions.columns["pixels"].min() >= small


def test_dropping_nothing_changes_nothing(opened: Opened) -> None:
    image = picture("........ .###.##. .#x#.##. .###.##. .....##. .....#.. ........")
    dataset = opened(image, 0)  # eight cells and a hole of nodata, against nine cells
    image[40:44, 40:48] = 20
    one = extracted(dataset, NONE, fill_holes=pixels(100))
    assert equal(one, extracted(dataset, NONE, fill_holes=pixels(100), min_area=pixels(1)))


def test_a_filled_hole_of_nodata_counts_as_pixels_but_not_for_the_mean(opened: Opened) -> None:
    image = picture("......... .###.###. .#x#.#.#. .###.###. .........")
    image[28:32, 60:64] = 20  # the second region is smaller by this, and its hole is not
    found = extracted(opened(image, 0), SCAN, fill_holes=pixels(100), min_area=pixels(1))
    columns = found.regions.columns
    assert columns["pixels"].tolist() == sorted(columns["pixels"].tolist(), reverse=True)
    assert columns["mean"][0] == pytest.approx(200 / 255, abs=1e-5)


def test_a_part_of_a_region_in_its_own_hole_survives_filling(opened: Opened) -> None:
    image = np.full((64, 64), 200, np.uint8)
    image[20:40, 20:40] = 0
    image[24:36, 24:36] = 200  # one leaf, in two parts
    found = extracted(opened(image, 0), NONE, fill_holes=pixels(1000))
    assert found.regions.columns["pixels"].tolist() == [64 * 64]


def test_square_metres_want_a_crs(opened: Opened) -> None:
    dataset = opened(picture("### #.# ###"), crs=None)
    assert len(extracted(dataset, min_area=pixels(4)).regions) == 1
    for what in ("min_area", "fill_holes"):
        with pytest.raises(ParameterError, match="give the area in pixels, such as 4px"):
            extracted(dataset, **{what: Area(4)})


# A block map


@pytest.mark.slow
@settings(max_examples=10)
@given(
    st.integers(0, 10**6),
    st.tuples(st.integers(1, 200), st.integers(1, 200)),
    st.sampled_from([SCAN, SMOOTH, SegmentParams("paper"), SegmentParams(threshold=1.5, intensity_step=0.2)]),
)
def test_a_block_map_with_its_raster_answers_as_the_raster(
    opened: Opened, seed: int, shape: tuple[int, int], how: SegmentParams
) -> None:
    dataset = opened(scene(seed, shape), 0)
    tiled = Work(64)
    assert equal(extracted(saved(dataset, dataset), how, work=tiled), extracted(dataset, how, work=tiled))


@pytest.mark.parametrize("shape", [(64, 64), (100, 140), (7, 9), (129, 65)])
def test_a_block_map_alone_answers_with_whole_cells(opened: Opened, shape: tuple[int, int]) -> None:
    image = np.maximum(scene(6, shape), 1)
    dataset = opened(image)
    alone = extracted(saved(dataset), NONE)
    exact = extracted(dataset, NONE)
    assert np.array_equal(labels_of(alone), labels_of(exact))  # every pixel is valid
    for name in ("id", "pixels", "mean", "area_m2", "holes"):
        assert alone.regions.columns[name].tolist() == pytest.approx(exact.regions.columns[name].tolist())
    assert np.isnan(alone.regions.columns["std"]).all()
    assert set(alone.regions.columns["source"]) <= {"there.tif"}


def test_cells_with_few_valid_pixels_are_whole_where_the_raster_is_gone(opened: Opened) -> None:
    image = picture("##. ..x", 64)
    image[0:37, 64:128] = 0  # four rows of cells, and five of the eight rows of pixels in the next
    alone = extracted(saved(opened(image, 0)), NONE)
    assert alone.regions.columns["pixels"].tolist() == [64 * 64 + 32 * 64]
    assert alone.regions.columns["mean"].tolist() == pytest.approx([200 / 255], abs=1e-5)


def test_regions_of_a_block_map_are_numbered_by_their_pixels(opened: Opened) -> None:
    image = picture("##.###", 64)
    image[::2, 192:] = 0  # half of the larger region is nodata
    alone = extracted(saved(opened(image, 0)), NONE)
    assert alone.regions.columns["pixels"].tolist() == [3 * 64 * 64, 2 * 64 * 64]


def test_holes_of_a_block_map_are_measured_with_what_was_in_them(opened: Opened) -> None:
    dataset = opened(picture(LAKE))
    alone = extracted(saved(dataset), NONE, fill_holes=pixels(1000))
    exact = extracted(dataset, NONE, fill_holes=pixels(1000))
    assert alone.regions.columns["pixels"].tolist() == exact.regions.columns["pixels"].tolist()
    assert alone.regions.columns["mean"].tolist() == pytest.approx(exact.regions.columns["mean"].tolist())


def test_a_raster_that_changed_is_refused(opened: Opened) -> None:
    image = scene(8, (130, 130))
    changed = image.copy()
    changed[np.unravel_index(np.argmax(image), image.shape)] -= 9
    blocks = saved(opened(image, 0), opened(changed, 0))
    with pytest.raises(
        RasterError, match="make the block map again with uavseg divide, or give --refine none"
    ):
        extracted(blocks, work=Work(64))
    assert len(extracted(blocks, NONE).regions)


def test_a_raster_whose_black_became_nodata_has_changed_too(opened: Opened) -> None:
    image = np.full((64, 64), 200, np.uint8)
    image[24:40, 24:40] = 0
    with pytest.raises(RasterError, match="is not as it was"):
        extracted(saved(opened(image), opened(image, 0)))


def test_a_raster_of_another_size_is_refused(opened: Opened) -> None:
    with pytest.raises(
        ParameterError, match="has not the size of the raster that the block map was made from"
    ):
        extracted(saved(opened(picture("##")), opened(picture("###"))))


# Labels and tiles


def test_labels_are_painted_from_the_top_window_by_window(opened: Opened) -> None:
    found = extracted(opened(scene(2, (200, 70)), 0))
    windows = [window for window, _ in label_strips(found.rings, found.geobox.shape)]
    assert sum(window.rows * window.cols for window in windows) == 200 * 70
    assert [window.row for window in windows] == sorted(window.row for window in windows)


def test_tiles_suit_the_file_where_no_side_is_given(opened: Opened) -> None:
    dataset = opened(scene(2, (200, 300)), 0)
    assert dataset.windows(128) == tiles((200, 300), 128)
    assert {(w.rows, w.cols) for w in dataset.windows()} == {(200, 300)}


def test_folders_and_stems_of_the_source(opened: Opened) -> None:
    dataset = opened(picture("##"))
    assert set(extracted(dataset).regions.columns["source"]) == {Path(dataset.paths[0]).name}
