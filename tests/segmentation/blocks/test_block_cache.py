"""Patches: what was kept is what would be read again, and there is never more than there is room for."""

import pickle

import numpy as np
import pytest

from uavseg.raster.tiling import Window
from uavseg.segmentation.blocks.block_cache import CACHED_SIDE, BlockCache
from uavseg.segmentation.source import GreyTile

HERE = Window(0, 0, 128, 192)
CORNERS = np.array([[0, 0], [64, 128], [64, 0]])


def tile(every: bool) -> GreyTile:
    rng = np.random.default_rng(0)
    valid = np.ones((130, 194), np.uint8) if every else rng.integers(0, 2, (130, 194)).astype(np.uint8)
    return GreyTile(rng.integers(0, 65536, (130, 194)).astype(np.uint16), valid, every)


@pytest.mark.parametrize("every", [True, False])
def test_blocks_are_kept_with_the_pixels_around_them(every: bool) -> None:
    patches, full = BlockCache(), tile(every)
    patches.put(HERE, full, CORNERS)
    patch = patches.take(HERE)
    assert patch is not None
    for k, (row, col) in enumerate(CORNERS):
        around = slice(row, row + 66), slice(col, col + 66)
        assert np.array_equal(patch.grey[66 * k : 66 * k + 66], full.grey[around])
        if every:
            assert patch.valid is None
        else:
            assert patch.valid is not None
            assert np.array_equal(patch.valid[66 * k : 66 * k + 66], full.valid[around])
    assert patches.take(HERE) is None  # it was taken


def test_what_has_no_room_is_not_kept() -> None:
    size = 3 * CACHED_SIDE * CACHED_SIDE * 2
    patches = BlockCache(2 * size - 1)
    patches.put(HERE, tile(True), CORNERS)
    patches.put(Window(128, 0, 128, 192), tile(True), CORNERS)
    assert patches.take(HERE) is not None
    assert patches.take(Window(128, 0, 128, 192)) is None


def test_a_copy_for_another_process_is_empty_and_keeps_nothing() -> None:
    patches = BlockCache()
    patches.put(HERE, tile(True), CORNERS)
    copy = pickle.loads(pickle.dumps(patches))
    assert copy.take(HERE) is None
    copy.put(HERE, tile(True), CORNERS)
    assert copy.take(HERE) is None
