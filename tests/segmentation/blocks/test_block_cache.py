"""Cached blocks are the pixels of the tile, and the cache never exceeds its capacity."""

import pickle

import numpy as np
import pytest

from uavseg.raster.grid.tiling import Window
from uavseg.segmentation.source import CACHED_SIDE, BlockCache, GreyTile

HERE = Window(0, 0, 128, 192)
CORNERS = np.array([[0, 0], [64, 128], [64, 0]])


def tile(all_valid: bool) -> GreyTile:
    rng = np.random.default_rng(0)
    valid = np.ones((130, 194), np.uint8) if all_valid else rng.integers(0, 2, (130, 194)).astype(np.uint8)
    return GreyTile(rng.integers(0, 65536, (130, 194)).astype(np.uint16), valid, all_valid)


@pytest.mark.parametrize("all_valid", [True, False])
def test_blocks_are_cached_with_the_pixels_around_them(all_valid: bool) -> None:
    cache, full = BlockCache(), tile(all_valid)
    cache.put(HERE, full, CORNERS)
    cached = cache.take(HERE)
    assert cached is not None
    grey, valid = cached
    for k, (row, col) in enumerate(CORNERS):
        around = slice(row, row + 66), slice(col, col + 66)
        assert np.array_equal(grey[66 * k : 66 * k + 66], full.grey[around])
        if all_valid:
            assert valid is None
        else:
            assert valid is not None
            assert np.array_equal(valid[66 * k : 66 * k + 66], full.valid[around])
    assert cache.take(HERE) is None  # taken before


def test_blocks_beyond_the_capacity_are_not_cached() -> None:
    size = 3 * CACHED_SIDE * CACHED_SIDE * 2
    cache = BlockCache(2 * size - 1)
    cache.put(HERE, tile(True), CORNERS)
    cache.put(Window(128, 0, 128, 192), tile(True), CORNERS)
    assert cache.take(HERE) is not None
    assert cache.take(Window(128, 0, 128, 192)) is None


def test_a_copy_for_another_process_is_empty_and_caches_nothing() -> None:
    cache = BlockCache()
    cache.put(HERE, tile(True), CORNERS)
    copy = pickle.loads(pickle.dumps(cache))
    assert copy.take(HERE) is None
    copy.put(HERE, tile(True), CORNERS)
    assert copy.take(HERE) is None
