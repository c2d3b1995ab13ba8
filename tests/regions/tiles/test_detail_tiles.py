"""A refined tile with a detail loses the halo that the detail takes."""

import numpy as np

from uavseg.regions.tiles.range_tiles import with_detail
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.source import GreyTile


def test_a_tile_is_cropped_by_the_halo() -> None:
    detail = Detail(3, 3)
    classes = np.zeros((2 * detail.halo + 40, 2 * detail.halo + 48), np.uint8)
    classes[detail.halo + 10 : detail.halo + 20] = 1
    grey = np.arange(classes.size).astype(np.uint16).reshape(classes.shape)
    found, tile = with_detail(classes, GreyTile(grey, np.ones_like(classes), True), detail)
    inner = np.s_[detail.halo : -detail.halo, detail.halo : -detail.halo]
    assert np.array_equal(found, classes[inner]) and np.array_equal(tile.grey, grey[inner])
    assert tile.valid.shape == found.shape and tile.excess is None
