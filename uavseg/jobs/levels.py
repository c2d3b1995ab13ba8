"""Division of a raster into levels of equal width, and of each level into segments of adjacent blocks."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.execution.executors import trim_heap
from uavseg.execution.phases import decided, phase
from uavseg.jobs.metadata import drawing_facts, segment_facts, with_metadata
from uavseg.jobs.result import Drawing, Extraction, SourceInfo, measured
from uavseg.jobs.source import Blocks, Pixels, Source
from uavseg.jobs.work import SERIAL, Work
from uavseg.regions.edit.eliminate import eliminate
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.block_map_regions import outline_block_map
from uavseg.regions.tiles.kind_tiles import outline_segments
from uavseg.segmentation.blocks.leaves import cell_levels
from uavseg.segmentation.params import Levels, SegmentParams
from uavseg.segmentation.pipeline import measure_block_map_for
from uavseg.units import CELL

Small = Literal["drop", "merge"]
Kinds = NDArray[np.uint8] | NDArray[np.uint32]


@dataclass(frozen=True, slots=True)
class LevelsRequest:
    """Which levels, and what becomes of small segments.

    Parameters
    ----------
    levels : Levels
        Of v, after the stretch.
    segment : SegmentParams
        Levels end at block edges: its `refine` is "none".
    drawing : Drawing
        How outlines are drawn.
    min_area : Area, optional
    small : {"merge", "drop"}
        Segments of less than `min_area` become part of a neighbour, see `eliminate`, or are dropped.

    Raises
    ------
    ParameterError
        If one of them is not allowed.
    """

    levels: Levels
    segment: SegmentParams = SegmentParams(refine="none")
    drawing: Drawing = Drawing()
    min_area: Area | None = None
    small: Small = "merge"

    def __post_init__(self) -> None:
        if self.segment.refine != "none":
            raise ParameterError(f"levels end at block edges: refine is none, not {self.segment.refine}")
        if self.small not in get_args(Small):
            raise ParameterError(f"small segments are merged or dropped: merge or drop, not {self.small!r}")


def levels(source: Source, request: LevelsRequest, work: Work = SERIAL) -> Extraction:
    """The segments of all levels: adjacent leaves whose means lie in the same interval.

    A block map answers without its raster: segments are whole cells, and `std` is not known.

    Parameters
    ----------
    source : Raster, Blocks or ProbabilityMap
    request : LevelsRequest
    work : Work

    Returns
    -------
    Extraction
        Its regions have the column `level`, from 0, and `range_low` and `range_high` of that level.

    Raises
    ------
    UavsegError
        If the source cannot be read or a parameter does not fit it.
    """
    work = work.begun()
    outlined, kinds, info = (
        _of_blocks(source, request) if isinstance(source, Blocks) else _of_pixels(source, request, work)
    )
    found = _measured(outlined, kinds, info, request)
    small = {"small": request.small} if request.min_area is not None else {}
    how = {"levels": list(request.levels.bounds)} | segment_facts(request.segment)
    how |= drawing_facts(request.drawing, None, request.min_area) | small
    found = with_metadata(found, source, "levels", how)
    if len(found.regions):
        return work.finished(found)
    return work.finished(
        found, "no segment is left: no pixel is valid, or all segments are smaller than the minimum area"
    )


def _of_pixels(
    source: Pixels, request: LevelsRequest, work: Work
) -> tuple[RegionOutlines, Kinds, SourceInfo]:
    """Outlines of segments, the level of each cell (from 1), and the source."""
    stretching, dividing, outlining = work.over(source).stages(3)
    grey = source.grey(stretching)
    segment = request.segment
    with phase("division"):
        blocks = measure_block_map_for(grey, request.levels, segment, dividing)
    decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
    kinds = cell_levels(blocks, request.levels, segment.division)
    del blocks
    trim_heap()
    with phase("outlines"):
        outlined = outline_segments(grey, kinds, outlining)
    trim_heap()
    return outlined, kinds, SourceInfo.of(grey)


def _of_blocks(source: Blocks, request: LevelsRequest) -> tuple[RegionOutlines, Kinds, SourceInfo]:
    """The same from a block map alone."""
    blocks, segment = source.saved.blocks, request.segment
    kinds = cell_levels(blocks, request.levels, segment.division)
    return outline_block_map(blocks, kinds), kinds, SourceInfo.of(source)


def _measured(outlined: RegionOutlines, kinds: Kinds, info: SourceInfo, request: LevelsRequest) -> Extraction:
    """Segments with their levels and attributes, the small ones merged or dropped."""
    if request.min_area is not None and request.small == "drop":
        outlined = drop_small_regions(outlined, info.geobox, request.min_area)
    row, col = outlined.sums.firsts.T // CELL
    level = kinds[row, col].astype(np.int64) - 1
    if request.min_area is not None and request.small == "merge":
        outlined, level = eliminate(outlined, level, info.geobox, request.min_area)
    bounds = np.array(request.levels.bounds)
    return measured(outlined, info, (bounds[level], bounds[level + 1]), request.drawing, {"level": level})
