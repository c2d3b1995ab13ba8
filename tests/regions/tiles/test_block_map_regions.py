"""Regions from a block map alone: whole cells, summed over their valid pixels."""

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.ndimage import label as connected

from uavseg.jobs.divide import divide
from uavseg.jobs.source.source import Raster
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.tiles.class_tiles import count_segments, outline_block_map, sum_enclosed_cells
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

Cells = NDArray[np.uint8]


@st.composite
def block_maps(draw: st.DrawFn) -> tuple[BlockMap, Cells]:
    """A block map, some of whose cells have no valid pixel, and kinds 0..3 of its cells."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    shape = (int(rng.integers(1, 150)), int(rng.integers(1, 150)))
    blocks = BlockMap.empty(shape)
    rows, cols = -(-shape[0] // 8), -(-shape[1] // 8)
    blocks.counts[:rows, :cols] = rng.integers(0, 4, (rows, cols)) * rng.integers(0, 2, (rows, cols))
    blocks.sums[:rows, :cols] = blocks.counts[:rows, :cols] * rng.integers(0, 65536, (rows, cols))
    return blocks, rng.integers(0, 4, blocks.counts.shape).astype(np.uint8)


def segments_of(classes: Cells) -> tuple[NDArray[np.int64], list[int]]:
    """Connected cells of one kind, numbered from 1, and the kind of each."""
    labels, kind_of = np.zeros(classes.shape, np.int64), []
    for kind in (1, 2, 3):
        apart, count = connected(classes == kind)
        labels[apart > 0] = apart[apart > 0] + len(kind_of)
        kind_of += [kind] * count
    return labels, kind_of


@given(block_maps())
@settings(max_examples=60)
def test_regions_are_connected_cells_of_one_kind_with_valid_pixels(drawn: tuple[BlockMap, Cells]) -> None:
    blocks, classes = drawn
    found = outline_block_map(blocks, classes)
    image = rasterise(found.rings, Window(0, 0, *blocks.shape))
    rows, cols = -(-blocks.shape[0] // 8), -(-blocks.shape[1] // 8)
    cells = image[::8, ::8]
    assert np.array_equal(image, cells.repeat(8, 0).repeat(8, 1)[: blocks.shape[0], : blocks.shape[1]])
    known = blocks.counts[:rows, :cols] > 0
    labels, _ = segments_of(classes[:rows, :cols])
    labels[~known] = 0
    assert np.array_equal(cells > 0, labels > 0)
    pairs = set(zip(labels[labels > 0].tolist(), cells[labels > 0].tolist(), strict=True))
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs}) == len(found.sums.counts)
    for k in range(1, len(found.sums.counts) + 1):
        assert found.sums.counts[k - 1] == blocks.counts[:rows, :cols][cells == k].sum()
        assert found.sums.greys[k - 1] == blocks.sums[:rows, :cols][cells == k].sum()


@given(block_maps())
@settings(max_examples=60)
def test_segments_are_counted_as_if_they_were_outlined(drawn: tuple[BlockMap, Cells]) -> None:
    blocks, classes = drawn
    rows, cols = -(-blocks.shape[0] // 8), -(-blocks.shape[1] // 8)
    _, kind_of = segments_of(classes[:rows, :cols])
    assert count_segments(blocks, classes, 3).tolist() == [kind_of.count(kind) for kind in (1, 2, 3)]


@given(block_maps())
@settings(max_examples=40)
def test_the_cells_that_outlines_enclose_have_the_sums_of_their_regions(
    drawn: tuple[BlockMap, Cells],
) -> None:
    found = outline_block_map(*drawn)
    again = sum_enclosed_cells(drawn[0], found)
    assert np.array_equal(again.sums.counts, found.sums.counts)
    assert np.array_equal(again.sums.greys, found.sums.greys)


def block_map_of(seed: int, shape: tuple[int, int]) -> BlockMap:
    image = np.random.default_rng(seed).integers(1, 255, (shape[0] // 16 + 1, shape[1] // 16 + 1))
    image = image.repeat(16, 0).repeat(16, 1)[: shape[0], : shape[1]].astype(np.uint8)
    box = GeoBox(shape, Affine.identity(), None)
    return divide(Raster(Dataset.of_values(image, box, "scene"))).saved.blocks


@pytest.mark.parametrize(("seed", "shape"), [(1, (100, 140)), (2, (64, 200)), (3, (129, 65))])
def test_the_first_pixel_of_a_region_is_a_pixel_of_it(seed: int, shape: tuple[int, int]) -> None:
    blocks = block_map_of(seed, shape)
    division = SegmentParams(refine="none").division
    found = outline_block_map(blocks, cells_in_range(blocks, IntensityRange(0.3, 0.8), division))
    labels = rasterise(found.rings, Window(0, 0, *shape))
    names = np.arange(1, len(found.sums.counts) + 1)
    assert len(names) > 1
    assert labels[tuple(found.sums.firsts.T)].tolist() == names.tolist()
    first = [np.argmax(labels.ravel() == name) for name in names]
    assert np.array_equal(np.stack(np.unravel_index(first, shape), 1), found.sums.firsts)
