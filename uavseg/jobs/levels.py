"""Levels: a raster divided into intervals of equal width, each segment with its level."""

import numpy as np
from numpy.typing import NDArray

from uavseg._memory import give_back
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, Progress, serial
from uavseg.jobs.extract import ExtractParams
from uavseg.jobs.result import About, Extraction, measured
from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import fit
from uavseg.raster.tile_pass import TilePass
from uavseg.regions.edit.eliminate import eliminate
from uavseg.regions.edit.small import drop_small_regions
from uavseg.regions.outline.region_outlines import RegionOutlines
from uavseg.regions.tiles.block_map_regions import outline_block_map
from uavseg.regions.tiles.kind_tiles import outline_segments
from uavseg.segmentation.blocks.block_file import SavedBlocks
from uavseg.segmentation.blocks.leaves import cell_levels
from uavseg.segmentation.intervals import Levels
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.pipeline import measure_block_map_for
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL

PARAMS = ExtractParams(SegmentParams(refine="none"), small="merge")
"""How levels are found unless something else is said."""


def extract_levels(
    dataset: Dataset,
    levels: Levels,
    params: ExtractParams = PARAMS,
    map: Map = serial,
    progress: Progress | None = None,
) -> Extraction:
    """The segments of all levels: adjacent leaves whose means lie in the same interval.

    Parameters
    ----------
    dataset : Dataset
    levels : Levels
        Of v, after the stretch.
    params : ExtractParams
        Levels are not refined, and their holes are other segments: `segment.refine` is "none" and
        `fill_holes` is not given. Segments of less than `min_area` become part of their neighbours, or are
        dropped, as `small` says.
    map : Map
        Who runs the work.
    progress : callable, optional

    Returns
    -------
    Extraction
        Its regions have the column `level`, from 0, and `range_low` and `range_high` of that level.

    Raises
    ------
    UavsegError
        If the raster cannot be read or a parameter does not fit it.
    """
    _check(params)
    first, second, third = TilePass.over(dataset, params.tile, map, progress).stages(3)
    source = GreySource(dataset, fit(dataset, params.stretch, first))
    how = params.segment
    blocks = measure_block_map_for(source, levels, how, second)
    kinds = cell_levels(blocks, levels, how.division)
    del blocks
    give_back()
    outlined = outline_segments(source, kinds, third)
    give_back()
    return _extraction(outlined, About.source(source), levels, kinds, params)


def levels_from_blocks(saved: SavedBlocks, levels: Levels, params: ExtractParams = PARAMS) -> Extraction:
    """Levels answered from a block map alone: segments are whole cells, and `std` is not known.

    Parameters
    ----------
    saved : SavedBlocks
    levels, params
        As of `extract_levels`.
    """
    _check(params)
    how = params.segment
    kinds = cell_levels(saved.blocks, levels, how.division)
    outlined = outline_block_map(saved.blocks, kinds)
    return _extraction(outlined, About.saved(saved), levels, kinds, params)


def _check(params: ExtractParams) -> None:
    if params.segment.refine != "none":
        raise ParameterError(f"levels end at block edges: refine is none, not {params.segment.refine}")
    if params.fill_holes is not None:
        raise ParameterError("holes in a level are segments of other levels; leave fill_holes out")


def _extraction(
    outlined: RegionOutlines,
    about: About,
    levels: Levels,
    kinds: NDArray[np.uint8] | NDArray[np.uint32],
    params: ExtractParams,
) -> Extraction:
    """Segments with their levels, which are the kinds of their cells."""
    if params.min_area is not None and params.small == "drop":
        outlined = drop_small_regions(outlined, about.geobox, params.min_area)
    row, col = outlined.sums.firsts.T // CELL
    level = kinds[row, col].astype(np.int64) - 1
    if params.min_area is not None and params.small == "merge":
        outlined, level = eliminate(outlined, level, about.geobox, params.min_area)
    bounds = np.array(levels.bounds)
    columns = {"level": level}
    return measured(outlined, about, bounds[level], bounds[level + 1], params.drawing, columns)
