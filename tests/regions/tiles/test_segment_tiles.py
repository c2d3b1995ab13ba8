"""Segments of several kinds, and of states: tiles change nothing, and pixels keep the kind of their cell."""

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, tiles
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import RegionOutlines, rasterise
from uavseg.regions.tiles.class_tiles import cell_jobs, outline_segments, outline_state
from uavseg.segmentation.params.segment import StateLimits
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.classify_strips import classify_states, state_strips

Kinds = NDArray[np.uint8]


def scene(seed: int) -> tuple[GreySource, Kinds]:
    """A raster with nodata (NaN), and kinds 0..3 of the cells that hold its pixels."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 260, 2))
    image = rng.integers(0, 256, shape).astype(np.float32)
    image[rng.random(shape) < rng.choice([0, 0.05])] = np.nan
    box = GeoBox(image.shape, Affine.identity(), None)
    source = GreySource(Dataset.of_values(image, box, "a"), Stretch(0.0, 255.0, "dtype"))
    classes = np.zeros(tuple(-(-side // 64) * 8 for side in shape), np.uint8)
    rows, cols = (-(-side // 8) for side in shape)
    classes[:rows, :cols] = rng.integers(0, 4, (rows, cols))
    return source, classes


def equal(one: RegionOutlines, other: RegionOutlines) -> bool:
    rings = [(getattr(one.rings, f), getattr(other.rings, f)) for f in ("vertices", "labels", "parts")]
    sums = [(getattr(one.sums, f), getattr(other.sums, f)) for f in ("counts", "greys", "squares", "firsts")]
    return all(np.array_equal(a, b) for a, b in rings + sums)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from([64, 128]))
@settings(max_examples=25)
def test_tiles_change_no_segment(seed: int, side: int) -> None:
    source, classes = scene(seed)
    whole, parts = (
        outline_segments(source, classes, TilePass(tiles(source.shape, tile))) for tile in (4096, side)
    )
    assert equal(whole, parts)


@given(st.integers(0, 10**6))
@settings(max_examples=25)
def test_segments_hold_the_valid_pixels_of_cells_of_one_kind(seed: int) -> None:
    source, classes = scene(seed)
    found = outline_segments(source, classes, TilePass(tiles(source.shape, 128)))
    rows, cols = source.shape
    image = rasterise(found.rings, Window(0, 0, rows, cols))
    pixels = classes.repeat(8, 0).repeat(8, 1)[:rows, :cols]
    valid = source.read(Window(0, 0, rows, cols), 0).valid[:rows, :cols] > 0
    assert np.array_equal(image > 0, (pixels > 0) & valid)
    for k in range(1, len(found.sums.counts) + 1):
        assert len(np.unique(pixels[image == k])) == 1
        assert found.sums.counts[k - 1] == (image == k).sum()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("refine", ["none", "scan"])
def test_objects_are_the_pixels_of_a_state_whatever_the_tiles(seed: int, refine: str) -> None:
    source, classes = scene(seed)
    strips = state_strips(source.shape, (64, 64), 64)
    tile_pass = TilePass([tile for strip in strips for tile in strip])
    found = classify_states(source, classes, StateLimits(), refine, tile_pass)  # type: ignore[arg-type]
    whole, parts = (
        outline_state(source, found.image, 3, TilePass(tiles(source.shape, tile))) for tile in (4096, 64)
    )
    assert equal(whole, parts)
    rows, cols = source.shape
    states = np.concatenate([found.image.read_codes(row, 64) for row in range(0, rows, 64)])[:rows, :cols] & 3
    assert np.array_equal(rasterise(whole.rings, Window(0, 0, rows, cols)) > 0, states == 3)


@given(st.integers(0, 10**6), st.sampled_from([8, 64]))
@settings(max_examples=20)
def test_jobs_hold_the_cells_of_their_tile_and_of_its_halo(seed: int, halo: int) -> None:
    source, classes = scene(seed)
    windows = tiles(source.shape, 64)
    jobs = cell_jobs(classes, windows, halo)
    assert len(jobs) == len(windows)
    for window, (own, cells) in zip(windows, jobs, strict=True):
        assert own == window
        assert np.array_equal(cells, cells_around(classes, window, halo))
