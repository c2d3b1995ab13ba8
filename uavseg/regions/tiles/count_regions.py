"""Number of regions of an intensity range after refinement, counted or estimated; and of pixels."""

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import TilePass, Window, cells_around, sample_positions, window_cells
from uavseg.regions.tiles.range_tiles import outline_regions
from uavseg.regions.tiles.thin_tiles import with_thin_lines
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.components import label_components, label_equal_values
from uavseg.segmentation.params.segment import IntensityRange, Refinement
from uavseg.segmentation.pipeline import refine_tile
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource
from uavseg.units import BLOCK, GREY_LEVELS

PART_SIDE = 16 * BLOCK  # of a part that is looked at
_PARTS = 5  # along each side of the raster, at most


def count_regions(
    source: GreySource,
    cells: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
) -> tuple[int, int]:
    """How many regions `outline_regions` finds, and their pixels; the parameters are its own."""
    counts = outline_regions(source, cells, interval, refine, tile_pass, expected).sums.counts
    return len(counts), int(counts.sum())


def estimate_regions(
    source: GreySource,
    cells: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    tile_pass: TilePass,
) -> tuple[int, float]:
    """About how many regions `outline_regions` would find, and their share of the valid pixels.

    A ratio estimate: regions of leaves are counted over the whole raster, and multiplied by what refinement
    makes of their number in 5 x 5 evenly spaced parts of 1024 x 1024 pixels. Where no leaf of these parts is
    in range, their number for each pixel counts. The share is that in these parts.

    Parameters
    ----------
    source : GreySource
    cells : (m, n) uint8 array
        1 where the leaf of a cell is in range, from `leaves.cells_in_range`.
    interval : IntensityRange
    refine : {"none", "scan", "smooth", "tv", "pixels"}
    tile_pass : TilePass
        Its executor and its progress are used.
    """
    whole = int(label_equal_values(cells)[1]) if cells.any() else 0
    count_part = partial(_count_part, source, cells, interval, refine)
    found = list(tile_pass.run(count_part, sample_parts(source.shape)))
    of_cells, refined, held, valid = (int(sum(counts)) for counts in zip(*found, strict=True))
    share = held / max(valid, 1)
    if of_cells:
        return max(round(whole * refined / of_cells), 1), share
    seen = sum(part.rows * part.cols for part in sample_parts(source.shape))
    return round(refined * math.prod(source.shape) / seen), share


def count_greys(source: GreySource, tile_pass: TilePass, exact: bool = True) -> NDArray[np.int64]:
    """Valid pixels by grey, (65536,): all, or those of the parts that `estimate_regions` looks at."""
    counts = np.zeros(GREY_LEVELS, np.int64)
    for part in tile_pass.run(partial(_count_greys, source), None if exact else sample_parts(source.shape)):
        counts += part
    return counts


def count_pixels(source: GreySource, table: NDArray[np.uint8], tile_pass: TilePass) -> NDArray[np.int64]:
    """How many valid pixels are of each kind by their own value.

    Parameters
    ----------
    source : GreySource
    table : (65536,) uint8 array
        The kind of each grey, see `Partition.grey_table`.
    tile_pass : TilePass

    Returns
    -------
    counts : (256,) int64 array
    """
    return np.bincount(table, count_greys(source, tile_pass), 256).astype(np.int64)


def has_thin_lines(source: GreySource, interval: IntensityRange, tile_pass: TilePass) -> bool:
    """Whether `with_thin_lines` finds any in the parts that `estimate_regions` looks at."""
    found = tile_pass.run(partial(_has_lines, source, interval), sample_parts(source.shape))
    return any(list(found))


def sample_parts(shape: tuple[int, int]) -> list[Window]:
    """Evenly spaced parts of a raster, none beside another where it is large enough."""
    blocks = [-(-length // PART_SIDE) for length in shape]
    rows, cols = (sample_positions(0, count, min(count, _PARTS)).tolist() for count in blocks)
    corners = [(row * PART_SIDE, col * PART_SIDE) for row in rows for col in cols]
    return [Window(row, col, PART_SIDE, PART_SIDE).clipped(shape) for row, col in corners]


def _count_greys(source: GreySource, window: Window) -> NDArray[np.int64]:
    if source.dataset.is_empty(window):
        return np.zeros(GREY_LEVELS, np.int64)
    tile = source.read(window, 0)
    return np.bincount(tile.grey[tile.valid > 0], minlength=GREY_LEVELS)


def _has_lines(source: GreySource, interval: IntensityRange, window: Window) -> bool:
    found = with_thin_lines(source, None, interval, window)
    return found is not None and bool(found[0][REFINE_HALO:-REFINE_HALO, REFINE_HALO:-REFINE_HALO].any())


def _count_part(
    source: GreySource,
    cells: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    window: Window,
) -> tuple[int, int, int, int]:
    """Of a part of the raster: regions of cells, regions after refinement, their pixels, all valid ones."""
    here = np.ascontiguousarray(cells[window_cells(window)])
    found = refine_tile(source, cells_around(cells, window, REFINE_HALO), interval, refine, window)
    if found is None:
        return 0, 0, 0, int(np.count_nonzero(source.read(window, 0).valid))
    inner = np.s_[REFINE_HALO:-REFINE_HALO, REFINE_HALO:-REFINE_HALO]
    held, valid = (int(np.count_nonzero(one[inner])) for one in (found[0], found[1].valid))
    return label_equal_values(here)[1], label_components(found[0], REFINE_HALO)[1], held, valid
