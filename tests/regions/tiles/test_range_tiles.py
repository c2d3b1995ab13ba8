"""Regions of a range: tiles, workers and their order change nothing."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import example, given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.execution.executors import Map, serial, threads
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import RegionOutlines, Rings, rasterise
from uavseg.regions.outline.trace import trace
from uavseg.regions.tiles.class_tiles import outline_block_map, outline_segments, sum_enclosed_cells
from uavseg.regions.tiles.range_tiles import outline_regions, sum_regions
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.pipeline import measure_cells
from uavseg.segmentation.source import GreySource

Image = NDArray[np.uint8]
Sourced = Callable[[Image], GreySource]
BRIGHT = IntensityRange(0.5, 0.8)
BITS_8 = Stretch(0.0, 255.0, "dtype")
SIDES: list[Any] = [64, 128, 192, (64, 256), (192, 64)]


@pytest.fixture(scope="session")
def sourced(tmp_path_factory: pytest.TempPathFactory) -> Sourced:
    """Grey of an 8-bit image in which 0 is nodata."""
    folder, numbers = tmp_path_factory.mktemp("tilewise"), count()

    def write(image: Image) -> GreySource:
        path = folder / f"{next(numbers)}.tif"
        rows, cols = image.shape
        place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": 0}
        with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype="uint8", **place) as file:
            file.write(image, 1)
        return GreySource(Dataset.open(path), BITS_8)

    return write


def picture(text: str) -> Image:
    """A drawing in which every letter is a cell of 8 x 8 pixels: # bright, . dark, and x nodata."""
    values = {"#": 160, ".": 40, "x": 0}
    small = np.array([[values[c] for c in row] for row in text.split()], np.uint8)
    return small.repeat(8, 0).repeat(8, 1)


def scene(seed: int, shape: tuple[int, int]) -> Image:
    """Patches of some brightness with noise, and nodata in patches and specks."""
    rng = np.random.default_rng(seed)
    grain = int(rng.choice([3, 8, 20]))
    coarse = rng.integers(60, 240, (shape[0] // grain + 1, shape[1] // grain + 1))
    image = np.kron(coarse, np.ones((grain, grain), int))[: shape[0], : shape[1]]
    image = np.clip(image + rng.normal(0, rng.choice([2, 30]), shape), 1, 255).astype(np.uint8)
    gone = np.kron(rng.random(coarse.shape) < 0.1, np.ones((grain, grain), bool))[: shape[0], : shape[1]]
    image[gone | (rng.random(shape) < 0.01)] = 0
    return image


def random_cells(seed: int, shape: tuple[int, int]) -> Image:
    """Cells in range, on a grid that goes on to whole blocks."""
    rows, cols = (-(-side // 64) * 8 for side in shape)
    return (np.random.default_rng(seed).random((rows, cols)) < [0.3, 0.6, 0.9][seed % 3]).astype(np.uint8)


def leaves_of(image: Image) -> Image:
    """Cells of the bright parts of a drawing."""
    rows, cols = image.shape
    inside = np.zeros((-(-rows // 64) * 8, -(-cols // 64) * 8), np.uint8)
    inside[: rows // 8, : cols // 8] = (image == 160)[::8, ::8]
    return inside


def whole(outlined: RegionOutlines, image: Image) -> NDArray[np.uint32]:
    return rasterise(outlined.rings, Window(0, 0, *image.shape))


def one_tile(image: Image) -> list[Window]:
    return tiles(image.shape, 4096)


def same(one: RegionOutlines, other: RegionOutlines) -> bool:
    rings = [(getattr(one.rings, f), getattr(other.rings, f)) for f in Rings.__dataclass_fields__]
    sums = [(getattr(one.sums, f), getattr(other.sums, f)) for f in ("counts", "greys", "squares", "firsts")]
    return all(np.array_equal(a, b) for a, b in rings + sums)


def shuffled(seed: int) -> Map:
    """A map whose items are worked on in any order."""

    def run(function: Any, items: Sequence[Any], progress: Any = None) -> Iterator[Any]:
        results: dict[int, Any] = {}
        for k in np.random.default_rng(seed).permutation(len(items)):
            results[int(k)] = function(items[int(k)])
        yield from (results[k] for k in range(len(items)))

    return run


# Pictures


def test_unrefined_leaves_separated_by_invalid_pixels_are_one_region(sourced: Sourced) -> None:
    image = picture("### ...")
    image[:, 12] = 0  # a line of nodata within the second cell
    inside = leaves_of(image)
    kept = outline_regions(sourced(image), inside, BRIGHT, "none", TilePass(one_tile(image)))
    assert kept.rings.labels.tolist() == [1, 1] and kept.rings.parts.tolist() == [0, 1]
    assert kept.sums.counts.tolist() == [8 * 23]
    parted = outline_regions(sourced(image), inside, BRIGHT, "scan", TilePass(one_tile(image)))
    assert parted.sums.counts.tolist() == [12 * 8, 11 * 8]


def test_leaves_that_touch_at_a_corner_are_two_regions(sourced: Sourced) -> None:
    image = picture("#. .#")
    for refine in ("none", "scan"):
        found = outline_regions(sourced(image), leaves_of(image), BRIGHT, refine, TilePass(one_tile(image)))
        assert found.sums.firsts.tolist() == [[0, 0], [8, 8]]


def test_the_largest_comes_first_and_ties_are_in_raster_order(sourced: Sourced) -> None:
    image = picture("..#.#  #.#..  #....  ..##.  #....")
    found = outline_regions(sourced(image), leaves_of(image), BRIGHT, "none", TilePass(one_tile(image)))
    names = np.array(list(".12345"))[whole(found, image)[::8, ::8]]
    assert " ".join("".join(row) for row in names) == "..1.4 2.1.. 2.... ..33. 5...."


SPIRAL = """
    ################
    ...............#
    ##############.#
    #............#.#
    #.##########.#.#
    #.#........#.#.#
    #.#.######.#.#.#
    #.#.#....#.#.#.#
    #.#.#.##.#.#.#.#
    #.#.#.#..#.#.#.#
    #.#.#.####.#.#.#
    #.#.#......#.#.#
    #.#.########.#.#
    #.#..........#.#
    #.############.#
    #..............#
    ################
"""


def test_a_region_that_winds_through_many_tiles_is_one(sourced: Sourced) -> None:
    image = picture(SPIRAL)
    found = outline_regions(
        sourced(image), leaves_of(image), BRIGHT, "none", TilePass(tiles(image.shape, 64))
    )
    assert found.sums.counts.tolist() == [64 * SPIRAL.count("#")]
    assert np.array_equal(whole(found, image), image == 160)


def test_nothing_in_range_is_no_region(sourced: Sourced) -> None:
    image = picture("... ...")
    found = outline_regions(sourced(image), leaves_of(image), BRIGHT, "scan", TilePass(one_tile(image)))
    assert len(found.sums.counts) == 0 and len(found.rings.labels) == 0


# Laws


def check_against_reference(
    reference: ModuleType, sourced: Sourced, image: Image, inside: Image, refine: Any
) -> None:
    valid = image > 0
    grey = reference.grey(image, valid, 0, 255)
    cells = reference.pixels(inside.astype(int), valid) > 0
    if refine == "none":
        wanted = reference.by_size(reference.pixels(reference.connected(inside.astype(int)), valid))
    else:
        wanted = reference.components(reference.refine_scan_by_lines(cells, grey, valid, 0.5, 0.8))
    found = outline_regions(sourced(image), inside, BRIGHT, refine, TilePass(tiles(image.shape, 64)))
    labels = whole(found, image)
    assert np.array_equal(labels, wanted)
    flat, g = labels.reshape(-1), grey.reshape(-1).astype(np.float64)
    assert found.sums.counts.tolist() == np.bincount(flat)[1:].tolist()
    assert found.sums.greys.tolist() == np.bincount(flat, g)[1:].tolist()
    assert found.sums.squares.tolist() == np.bincount(flat, g * g)[1:].tolist()
    names, firsts = np.unique(flat, return_index=True)
    places = np.stack(np.unravel_index(firsts[names > 0], image.shape), 1)
    assert found.sums.firsts.tolist() == places.tolist()
    rings = trace(labels)
    assert all(np.array_equal(getattr(found.rings, f), getattr(rings, f)) for f in Rings.__dataclass_fields__)


@pytest.mark.parametrize("refine", ["none", "scan"])
@pytest.mark.parametrize(
    ("seed", "shape"),
    [(0, (1, 1)), (1, (70, 130)), (2, (64, 64)), (3, (129, 65)), (4, (1, 200)), (5, (190, 9))],
)
def test_labels_and_sums_are_those_of_the_reference(
    reference: ModuleType, sourced: Sourced, seed: int, shape: tuple[int, int], refine: str
) -> None:
    check_against_reference(reference, sourced, scene(seed, shape), random_cells(seed, shape), refine)


@pytest.mark.slow
@settings(max_examples=25)
@given(
    st.integers(0, 10**6),
    st.tuples(st.integers(1, 280), st.integers(1, 280)),
    st.sampled_from(["none", "scan", "smooth", "tv", "pixels"]),
    st.sampled_from(SIDES),
)
@example(7, (128, 128), "smooth", 64)
@example(7, (200, 280), "tv", 64)
def test_tiles_workers_and_their_order_change_nothing(
    sourced: Sourced, seed: int, shape: tuple[int, int], refine: Any, side: Any
) -> None:
    image, inside = scene(seed, shape), random_cells(seed, shape)
    source = sourced(image)
    wanted = outline_regions(source, inside, BRIGHT, refine, TilePass(one_tile(image)))
    for run in (serial, threads(2), shuffled(seed)):
        assert same(
            wanted, outline_regions(source, inside, BRIGHT, refine, TilePass(tiles(shape, side), run))
        )


@settings(max_examples=10)
@given(st.integers(0, 10**6), st.sampled_from(SIDES))
def test_sums_are_recovered_from_the_outlines(sourced: Sourced, seed: int, side: Any) -> None:
    image = scene(seed, (150, 200))
    source, windows = sourced(image), tiles((150, 200), side)
    found = outline_regions(source, random_cells(seed, image.shape), BRIGHT, "scan", TilePass(windows))
    again = sum_regions(source, found, TilePass(windows, shuffled(seed)))
    assert same(RegionOutlines(found.rings, again), found)


@pytest.mark.slow
@settings(max_examples=30)
@given(st.integers(0, 10**6), st.tuples(st.integers(1, 280), st.integers(1, 280)), st.sampled_from(SIDES))
def test_cells_alone_tiles_and_the_whole_give_the_same_regions(
    sourced: Sourced, seed: int, shape: tuple[int, int], side: Any
) -> None:
    """Where all pixels are valid; only the squares are not in a block map."""
    image, classes = np.maximum(scene(seed, shape), 1), random_cells(seed, shape)
    classes *= 1 + random_cells(seed + 1, shape)
    classes[-(-shape[0] // 8) :] = classes[:, -(-shape[1] // 8) :] = (
        0  # no leaf lies wholly beyond the raster
    )
    source = sourced(image)
    blocks = measure_cells(source, TilePass(one_tile(image))).blocks
    cells = outline_block_map(blocks, classes)
    for windows in (one_tile(image), tiles(shape, side)):
        pixels = outline_segments(source, classes, TilePass(windows))
        sums = replace(cells.sums, squares=pixels.sums.squares)
        assert same(RegionOutlines(cells.rings, sums), pixels)


@pytest.mark.slow
@settings(max_examples=30)
@given(st.integers(0, 10**6), st.tuples(st.integers(1, 280), st.integers(1, 280)))
def test_the_first_place_of_a_region_of_cells_is_the_first_pixel_that_it_encloses(
    sourced: Sourced, seed: int, shape: tuple[int, int]
) -> None:
    """Also where cells have no valid pixels, and with the sums of all cells enclosed."""
    image, classes = scene(seed, shape), random_cells(seed, shape)
    blocks = measure_cells(sourced(image), TilePass(one_tile(image))).blocks
    found = outline_block_map(blocks, classes)
    names, firsts = np.unique(whole(found, image), return_index=True)
    places = np.stack(np.unravel_index(firsts[names > 0], shape), 1).tolist()
    assert found.sums.firsts.tolist() == places
    assert sum_enclosed_cells(blocks, found).sums.firsts.tolist() == places


def test_progress_counts_every_tile(sourced: Sourced) -> None:
    image, told = scene(1, (128, 192)), []
    cells = random_cells(1, image.shape)
    outline_regions(
        sourced(image),
        cells,
        BRIGHT,
        "scan",
        TilePass(tiles(image.shape, 64), threads(2), lambda *step: told.append(step)),
    )
    assert told == [(k, 6) for k in range(1, 7)]


@pytest.mark.parametrize("row", [3, 100])
def test_a_raster_whose_cells_have_changed_is_refused(sourced: Sourced, row: int) -> None:
    image = scene(3, (130, 70))
    cells = np.ones((24, 16), np.uint8)
    windows = tiles(image.shape, 64)
    blocks = measure_cells(sourced(image), TilePass(windows)).blocks
    outline_regions(sourced(image), cells, BRIGHT, "scan", TilePass(windows), expected=blocks)
    changed = image.copy()
    changed[row, 5] ^= 64
    with pytest.raises(RasterError, match="is not as it was when its block map was made"):
        outline_regions(sourced(changed), cells, BRIGHT, "scan", TilePass(windows), expected=blocks)
