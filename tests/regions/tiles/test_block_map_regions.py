"""Regions of whole cells: where they begin, and what their cells add up to."""

import numpy as np
import pytest
from affine import Affine

from uavseg.jobs.divide import divide
from uavseg.jobs.open_source import Raster
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tiling import Window
from uavseg.regions.outline.rasterise import rasterise
from uavseg.regions.tiles.block_map_regions import outline_cells
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.params import IntensityRange, SegmentParams


def block_map_of(seed: int, shape: tuple[int, int]) -> BlockMap:
    image = np.random.default_rng(seed).integers(1, 255, (shape[0] // 16 + 1, shape[1] // 16 + 1))
    image = image.repeat(16, 0).repeat(16, 1)[: shape[0], : shape[1]].astype(np.uint8)
    box = GeoBox(shape, Affine.identity(), None)
    return divide(Raster(Dataset.of_values(image, box, "scene"))).saved.blocks


@pytest.mark.parametrize(("seed", "shape"), [(1, (100, 140)), (2, (64, 200)), (3, (129, 65))])
def test_the_first_pixel_of_a_region_is_a_pixel_of_it(seed: int, shape: tuple[int, int]) -> None:
    blocks = block_map_of(seed, shape)
    division = SegmentParams(refine="none").division
    found = outline_cells(blocks, cells_in_range(blocks, IntensityRange(0.3, 0.8), division))
    labels = rasterise(found.rings, Window(0, 0, *shape))
    names = np.arange(1, len(found.sums.counts) + 1)
    assert len(names) > 1
    assert labels[tuple(found.sums.firsts.T)].tolist() == names.tolist()
    first = [np.argmax(labels.ravel() == name) for name in names]
    assert np.array_equal(np.stack(np.unravel_index(first, shape), 1), found.sums.firsts)
