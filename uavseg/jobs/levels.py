"""Division of a raster into levels between breaks of v, and of each level into adjacent segments."""

from typing import Literal, get_args

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.jobs.ranges.level_breaks import BreakChoice
from uavseg.jobs.result.metadata import confidence_facts, drawing_facts, segment_facts, with_metadata
from uavseg.jobs.result.result import Drawing, Extraction, measured
from uavseg.jobs.segment_classes import (
    ChoosePartition,
    PartitionRequest,
    Segmented,
    joint_params,
    segment_classes,
)
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.geobox import Length
from uavseg.regions.confidence import Confidence, check_minimum, confidence_of, none_confident
from uavseg.regions.edit.eliminate import eliminate
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.params.segment import Breaks, Levels, Partition, SegmentParams, partition_of_levels
from uavseg.units import MAX_PIXEL_CLASSES

Small = Literal["drop", "merge"]


@dataclass(frozen=True, slots=True)
class LevelsRequest:
    """Which levels, and what becomes of small segments.

    Structures narrower than the detail become part of what is near; then segments of less than `min_area`
    become part of a neighbour, see `eliminate`, or are dropped. A ParameterError says that one of the
    parameters is not allowed.
    """

    levels: Levels | Breaks | BreakChoice  # of v, after the stretch
    segment: SegmentParams = SegmentParams()  # see `segment_classes.joint_params`
    drawing: Drawing = Drawing()
    min_area: Area | None = None
    small: Small = "merge"  # "merge" or "drop"
    detail: Length | None = None
    min_confidence: float | None = None  # segments of less are dropped at last

    def __post_init__(self) -> None:
        check_minimum(self.min_confidence, self.segment.refine)
        joint_params(self.segment, self.segment.refine)
        if self.small not in get_args(Small):
            raise ParameterError(f"small segments are merged or dropped: merge or drop, not {self.small!r}")


def level_params(
    segment: SegmentParams, refine: str | None, levels: Levels | Breaks | BreakChoice
) -> SegmentParams:
    """Return how segments of levels are found, see `joint_params`; more than 127 end at block edges."""
    if refine is None and not isinstance(levels, BreakChoice) and levels.count > MAX_PIXEL_CLASSES:
        refine = "none"
    return joint_params(segment, refine)


def levels(source: Source, request: LevelsRequest, work: Work = SERIAL) -> Extraction:
    """Find the segments of all levels: adjacent pixels, or leaves if not refined, of the same interval.

    A block map answers without its raster where segments may end at cells; then `std` is not known. Regions
    have the column `level`, from 0, and `range_low` and `range_high` of that level.
    """
    work = work.begun()
    classes = PartitionRequest(_partition(request), request.segment, detail=request.detail, cover=True)
    found = segment_classes(source, classes, work)
    notes = [*found.notes, *_notes(found.partition, request)]
    small = {"small": request.small} if request.min_area is not None else {}
    how = {"levels": [0.0, *found.partition.edges, 1.0]} | segment_facts(request.segment)
    how |= drawing_facts(request.drawing, None, request.min_area, request.detail) | small
    how |= confidence_facts(request.min_confidence)
    result = with_metadata(_measured(found, request), source, "levels", how)
    if not len(result.regions) and result.below_minimum:
        notes.append(none_confident(result.below_minimum, request.min_confidence))
    elif not len(result.regions):
        notes.append(
            "no segment is left: no pixel is valid, or all segments are smaller than the minimum area"
        )
    return work.finished(result, *notes)


def _partition(request: LevelsRequest) -> Partition | ChoosePartition:
    """Return the levels, or what chooses them from a block map."""
    choice = request.levels
    if not isinstance(choice, BreakChoice):
        return partition_of_levels(choice)

    def choose(blocks: BlockMap) -> Partition:
        return partition_of_levels(choice.breaks(blocks, request.segment.division))

    return choose


def _notes(partition: Partition, request: LevelsRequest) -> list[str]:
    """Return where levels are not as they were asked for."""
    choice, notes = request.levels, []
    if isinstance(choice, BreakChoice):
        if partition.count == 1:
            notes.append("all leaves have one mean, so there is one level")
        elif choice.count is not None and partition.count < choice.count:
            notes.append(
                f"the means of leaves differ too little for {choice.count} levels; "
                f"there are {partition.count}"
            )
    elif partition.count > MAX_PIXEL_CLASSES and request.segment.method == "adaptive":
        notes.append(
            f"more than {MAX_PIXEL_CLASSES} levels end at block edges; fewer are refined to the pixel"
        )
    return notes


def _measured(found: Segmented, request: LevelsRequest) -> Extraction:
    """Return segments with their levels and attributes, the small ones merged or dropped."""
    outlined, info = found.outlined, found.info
    if request.small == "drop":
        outlined = drop_small_regions(outlined, info.geobox, request.min_area)
    level = found.kinds_at(outlined.sums.firsts) - 1
    if request.min_area is not None and request.small == "merge":
        outlined, level = eliminate(outlined, level, info.geobox, request.min_area)
    bounds = np.array([0.0, *found.partition.edges, 1.0])
    ends = bounds[level], bounds[level + 1]
    confidence = Confidence.of(
        outlined, lambda: confidence_of(outlined, *ends), found.refine, request.min_confidence
    )
    return measured(outlined, info, ends, request.drawing, {"level": level}, confidence=confidence)
