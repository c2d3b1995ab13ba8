"""Stitching: tiles of any size give the outlines and sums of the whole image."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.ndimage import label as connected

from uavseg.raster.grid.tiling import Window, tiles
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.outline.stitch import TileOutlines, TileStitcher, outline_tile
from uavseg.segmentation.components import component_sums, label_components, label_equal_values
from uavseg.segmentation.source import GreyTile

MARGIN = 8
Image = NDArray[np.uint8]
Grey = NDArray[np.uint16]


def images(seed: int) -> tuple[Image, Grey]:
    """A mask of blobs, or of noise, and grey levels."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 200, 2))
    grain = int(rng.choice([1, 5, 30]))
    coarse = rng.random((shape[0] // grain + 1, shape[1] // grain + 1)) < rng.choice([0.3, 0.6, 0.9])
    mask = np.kron(coarse, np.ones((grain, grain), np.uint8))[: shape[0], : shape[1]].astype(np.uint8)
    return mask, rng.integers(0, 65536, shape).astype(np.uint16)


def has_beyond(window: Window) -> bool:
    """Whether pixels of a tile lie beyond the stretch: not in the first."""
    return (window.row, window.col) != (0, 0)


def beyond_of(grey: Grey) -> NDArray[np.int32]:
    """Greys beyond the stretch of some pixels."""
    found: NDArray[np.int32] = (grey.astype(np.int32) - 32768) * (grey % 7 == 1)
    return found


def outline(mask: Image, grey: Grey, window: Window) -> TileOutlines | None:
    """One tile with its halo; whole blocks of 64 may reach beyond the image."""
    rows, cols = -(-window.rows // 64) * 64, -(-window.cols // 64) * 64
    room = ((MARGIN, MARGIN + 64), (MARGIN, MARGIN + 64))
    near = np.s_[window.row : window.row + rows + 2 * MARGIN, window.col : window.col + cols + 2 * MARGIN]
    pixels, greys = (np.ascontiguousarray(np.pad(image, room)[near]) for image in (mask, grey))
    beyond = beyond_of(greys) if has_beyond(window) else None
    tile = GreyTile(greys, pixels, False, beyond)
    return outline_tile(pixels, *label_components(pixels, MARGIN), tile, window, mask.shape[1])


def by_size(mask: Image) -> NDArray[np.uint32]:
    """4-connected components, numbered by size; ties in raster order."""
    apart, count = connected(mask)
    names, firsts, sizes = np.unique(apart, return_index=True, return_counts=True)
    order = sorted(range(count), key=lambda k: (-sizes[names > 0][k], firsts[names > 0][k]))
    number = np.zeros(count + 1, np.uint32)
    number[np.array(order, int) + 1] = np.arange(1, count + 1)
    return number[apart]


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from([64, 128, 256]))
@settings(max_examples=40)
def test_stitched_tiles_are_the_components_of_the_whole(seed: int, side: int) -> None:
    mask, grey = images(seed)
    windows = tiles(mask.shape, side)
    found = TileStitcher(mask.shape, windows, (outline(mask, grey, w) for w in windows)).finish()
    expected = by_size(mask)
    assert np.array_equal(rasterise(found.rings, Window(0, 0, *mask.shape)), expected)
    sums = component_sums(expected, int(expected.max()), grey)
    for name in ("counts", "greys", "squares", "firsts"):
        assert np.array_equal(getattr(found.sums, name), getattr(sums, name)), name
    beyond = np.zeros(int(expected.max()) + 1, np.int64)
    for window in filter(has_beyond, windows):
        np.add.at(beyond, expected[window.slices], beyond_of(grey[window.slices]))
    known = np.zeros_like(beyond[1:]) if found.sums.excess is None else found.sums.excess
    assert np.array_equal(known, beyond[1:])


def test_cells_that_share_an_edge_are_one_region_though_no_pixels_touch() -> None:
    leaves = np.array([[1, 1, 2]], np.uint8)
    valid = np.ones((8, 24), np.uint8)
    valid[:, 8] = 0  # separates the pixels of the first two cells
    mask = valid * leaves.repeat(8, 0).repeat(8, 1)
    pixels = np.pad(mask, ((MARGIN, MARGIN + 56), (MARGIN, MARGIN + 40)))
    grey = np.zeros(pixels.shape, np.uint16)
    labels, count = label_equal_values(pixels, MARGIN)
    tile = outline_tile(pixels, labels, count, GreyTile(grey, pixels, False), Window(0, 0, 8, 24), 24)
    found = TileStitcher((8, 24), [Window(0, 0, 8, 24)], [tile]).finish(leaves)
    assert found.sums.counts.tolist() == [64 + 56, 64]
    assert found.rings.labels.tolist() == [1, 1, 2] and found.rings.parts.tolist() == [0, 1, 2]


def test_tiles_without_components_have_no_regions() -> None:
    mask, grey = np.zeros((70, 130), np.uint8), np.zeros((70, 130), np.uint16)
    windows = tiles(mask.shape, 64)
    assert [outline(mask, grey, w) for w in windows] == [None] * len(windows)
    found = TileStitcher(mask.shape, windows, [None] * len(windows)).finish()
    assert len(found.rings.labels) == len(found.sums.counts) == 0
