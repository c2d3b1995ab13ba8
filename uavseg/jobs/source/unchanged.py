"""Check that a raster is as it was when its block map was made."""

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RasterError
from uavseg.jobs.source.source import Blocks
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, window_cells
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.source import GreySource
from uavseg.units import BLOCK

SAMPLED = 64  # blocks of 64 x 64 pixels that are read
_MOVED_PIXELS = 0.1  # what writing and reading a georeference may change, and more
_AGAIN = "make the block map again with uavseg divide, or give --refine none"


def check_unchanged(grey: GreySource, source: Blocks) -> None:
    """Check size, place and a sample of the pixels of a raster, in its stretch, against its block map.

    The block map itself is what pixels are compared with: the sums and counts of the cells of up to 64
    blocks, which are spread over the raster and the same each time. Tiles with cells in range are compared as
    a whole when they are refined. So nothing else has to be stored, copies of both files pass, and block maps
    of earlier versions are checked too. A ParameterError says that the raster has another size, a RasterError
    that it lies elsewhere, or that a block of the sample has other pixels.
    """
    name, blocks = grey.dataset.source, source.saved.blocks
    if grey.shape != source.geobox.shape:
        raise ParameterError(f"{name} has not the size of the raster that the block map was made from")
    if not _is_same_place(grey.dataset.geobox, source.geobox):
        raise RasterError(f"{name} does not lie where it lay when its block map was made; {_AGAIN}")
    if not all(_is_same(grey, blocks, window) for window in sampled_blocks(blocks.shape, SAMPLED)):
        raise RasterError(f"{name} is not as it was when its block map was made; {_AGAIN}")


def sampled_blocks(shape: tuple[int, int], count: int) -> list[Window]:
    """Return windows of up to `count` blocks of a raster, in reading order; the same for the same shape."""
    rows, cols = (-(-length // BLOCK) for length in shape)
    chosen = np.random.default_rng(0).choice(rows * cols, min(count, rows * cols), replace=False)
    found = zip(*np.divmod(np.sort(chosen), cols), strict=True)
    return [Window(int(row) * BLOCK, int(col) * BLOCK, BLOCK, BLOCK).clipped(shape) for row, col in found]


def _is_same(grey: GreySource, blocks: BlockMap, window: Window) -> bool:
    tile = grey.read(window, 0)
    sums, counts = cell_sums(tile.grey, tile.valid)
    here = window_cells(window)
    return np.array_equal(sums, blocks.sums[here]) and np.array_equal(counts, blocks.counts[here])


def _is_same_place(one: GeoBox, other: GeoBox) -> bool:
    """Return whether the corners of two grids are at the same places, and on the ground too."""
    (x, y), (x2, y2) = _corners(one), _corners(other)
    t = one.transform
    side = min(float(np.hypot(t.a, t.d)), float(np.hypot(t.b, t.e)))
    if not _are_near(np.hypot(x - x2, y - y2), side) or (one.crs is None) != (other.crs is None):
        return False
    if one.crs is None or other.crs is None or one.crs == other.crs:
        return True
    try:
        (lon, lat), (lon2, lat2) = one.lonlat_from_xy(x, y), other.lonlat_from_xy(x2, y2)
    except RasterError:  # one is without longitude and latitude: the texts are all there is to compare
        return False
    length = np.hypot(lon[0] - lon[-1], lat[0] - lat[-1]) / np.hypot(*one.shape)  # of a pixel, in degrees
    return _are_near(np.hypot(lon - lon2, lat - lat2), float(length))


def _corners(geobox: GeoBox) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows, cols = geobox.shape
    return geobox.xy_from_pixel(np.array([0, 0, rows, rows]), np.array([0, cols, 0, cols]))


def _are_near(distances: NDArray[np.float64], side: float) -> bool:
    return bool((distances <= _MOVED_PIXELS * side).all())
