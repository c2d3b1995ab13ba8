"""Extraction of several classes at once: regions of several ranges of v that do not overlap."""

from collections.abc import Sequence

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.jobs.ranges.ranges import EACH_PIXEL, missed_text, where_to_look
from uavseg.jobs.result.metadata import confidence_facts, drawing_facts, segment_facts, with_metadata
from uavseg.jobs.result.result import Drawing, Extraction, measured
from uavseg.jobs.segment_classes import PartitionRequest, Segmented, segment_classes
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.geobox import Length
from uavseg.regions.confidence import Confidence, check_minimum, confidence_of, none_confident
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.segmentation.params.segment import SegmentParams, ValueClass, ValueClasses


@dataclass(frozen=True, slots=True)
class ClassesRequest:
    """Which classes, and how their regions are drawn.

    The rest is as of `ExtractRequest`: regions of any class within a hole that is filled become part of what
    surrounds them, and structures narrower than the detail part of what is near, or are left out.
    """

    classes: ValueClasses  # of v, after the stretch
    segment: SegmentParams = SegmentParams()  # see `segment_classes.joint_params`
    drawing: Drawing = Drawing()
    fill_holes: Area | None = None
    min_area: Area | None = None
    detail: Length | None = None
    min_confidence: float | None = None

    def __post_init__(self) -> None:
        check_minimum(self.min_confidence, self.segment.refine)


def extract_classes(source: Source, request: ClassesRequest, work: Work = SERIAL) -> Extraction:
    """Extract regions of classes, decided together: no pixel is in two, and adjacent ones share borders.

    With one class, regions are those of `extract` with its range. They have the column `class`, and `color`
    where a class has one ("" for the others); `range_low` and `range_high` are those of the class.
    """
    work = work.begun()
    classes = request.classes.classes
    partition = request.classes.partition
    division = PartitionRequest(partition, request.segment, request.fill_holes, request.detail)
    found = segment_classes(source, division, work)
    outlined, hints = found.outlined, list(found.notes)
    present = set(found.kinds_at(outlined.sums.firsts).tolist())
    outlined = drop_small_regions(outlined, found.info.geobox, request.min_area)
    kind = found.kinds_at(outlined.sums.firsts) - 1
    low = np.array([one.interval.low for one in classes])
    high = np.array([one.interval.high for one in classes])
    columns = {"class": np.array([one.name for one in classes], object)[kind]}
    if any(one.color for one in classes):
        columns["color"] = np.array([one.color or "" for one in classes], object)[kind]
    empty = set(range(1, len(classes) + 1)) - set((kind + 1).tolist())
    if small := sorted(empty & present):
        hints.append(f"all regions of {_named(classes, small)} are smaller than --min-area")
    if missing := sorted(empty - present):
        hints.append(_why_none(missing, found, request, source))
    ends = low[kind], high[kind]
    confidence = Confidence.of(
        outlined, lambda: confidence_of(outlined, *ends), found.refine, request.min_confidence
    )
    result = measured(outlined, found.info, ends, request.drawing, columns, confidence=confidence)
    how = {"classes": [f"{one.name}={one.interval.low:g},{one.interval.high:g}" for one in classes]}
    metadata = segment_facts(request.segment) | drawing_facts(
        request.drawing, request.fill_holes, request.min_area, request.detail
    )
    if result.below_minimum and not len(result.regions):
        hints.append(none_confident(result.below_minimum, request.min_confidence))
    metadata |= confidence_facts(request.min_confidence)
    return work.finished(with_metadata(result, source, "extract", how | metadata), *hints)


def _named(classes: Sequence[ValueClass], numbers: Sequence[int]) -> str:
    return ", ".join(str(classes[number - 1]) for number in numbers)


def _why_none(classes: list[int], found: Segmented, request: ClassesRequest, source: Source) -> str:
    """Tell why there is no region of some classes, for messages."""
    left = "is there" if request.fill_holes is None else "is left once holes are filled"
    left += "" if request.detail is None else f" and is {request.detail} wide"
    none = f"no region of {_named(request.classes.classes, classes)} {left}"
    counts = np.zeros(256, np.int64) if found.count is None else found.count()
    inside, valid = int(counts[classes].sum()), int(counts.sum())
    ways = [] if request.detail is None else ["a smaller --detail keeps more"]
    ways += [] if request.segment.refine == "pixels" else [EACH_PIXEL]
    if not inside or not ways:
        return f"{none}; {where_to_look(source)}"
    return f"{none}, {missed_text(inside, valid, ways, 'it' if len(classes) == 1 else 'them')}"
