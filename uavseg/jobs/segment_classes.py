"""Segments of several intervals of v at once: classes, and levels, whose breaks may be chosen by a rule."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError, caused_errors
from uavseg.execution.executors import decided, phase, trim_heap
from uavseg.jobs.ranges.ranges import EACH_PIXEL, decided_grey, missed_text, where_to_look
from uavseg.jobs.result import result as results
from uavseg.jobs.result.result import Extraction, RegionRequest, SourceInfo
from uavseg.jobs.source.source import Blocks, Pixels, Source, check_unchanged, detail_of, refuse_at_cells
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.geobox import Length
from uavseg.raster.grid.tiling import TilePass
from uavseg.regions.confidence import check_minimum, confidence_of, none_confident
from uavseg.regions.edit.eliminate import eliminate
from uavseg.regions.edit.small import Area, drop_small_regions, join_at_corners
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.range_tiles import count_pixels
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cell_classes, histogram_of_means
from uavseg.segmentation.params import segment as params
from uavseg.segmentation.params.segment import Breaks, Levels, Partition, SegmentParams, ValueClasses
from uavseg.segmentation.pipeline import measure_block_map, measure_block_map_for
from uavseg.segmentation.range_choice import MAX_CLASSES, propose_ranges
from uavseg.segmentation.source import GreySource, with_statistics
from uavseg.units import CELL, GREY_MAX, MAX_PIXEL_CLASSES

ChoosePartition = Callable[[BlockMap], Partition]
Small = Literal["drop", "merge"]
BreakRule = Literal["otsu", "quantile"]
_QUANTILES = 5
_MAX_QUANTILES = 100
_EXPECTED = "breaks are numbers such as 0.2,0.5, otsu, otsu:3, quantile or quantile:4"


@dataclass(frozen=True, slots=True)
class PartitionRequest:
    """Which intervals, or what chooses them from the whole block map, and how their segments are found."""

    partition: Partition | ChoosePartition
    segment: SegmentParams  # refined by "tv", "pixels" or "none"
    fill_holes: Area | None = None
    detail: Length | None = None  # structures that are narrower become part of what is near
    cover: bool = False  # kinds cover the raster, so a detail leaves no pixel without one


@dataclass(frozen=True)
class Segmented:
    """Segments of several kinds."""

    outlined: RegionOutlines
    kinds_at: Callable[[Integers], Integers]  # of first pixels (k, 2), also after renumbering
    info: SourceInfo
    partition: Partition
    refine: str  # "tv", "pixels", or "none" for segments at block edges
    notes: tuple[str, ...] = ()
    count: Callable[[], Integers] | None = None  # by value; not of a block map


def joint_params(segment: SegmentParams, refine: str | None) -> SegmentParams:
    """Return how segments of several intervals are found: refined together, by tv or pixels, or not at all.

    By default they are refined by tv, and with the paper's method not at all. ParameterError is raised for
    another refinement, which decides for one range alone.
    """
    if refine is None:
        refine = "none" if segment.method == "paper" else "tv"
    if refine not in ("tv", "pixels", "none"):
        raise ParameterError(
            f"intervals of v are refined together by tv, pixels or none; {refine} is for one range"
        )
    return replace(segment, refine=refine)  # type: ignore[arg-type]


def segment_classes(source: Source, request: PartitionRequest, work: Work) -> Segmented:
    """Return segments of several intervals, each pixel in one of them at most.

    A block map answers without its raster where segments may end at cells; otherwise they are refined with
    it, if it is where it was. RasterError is raised if the raster is not as it was when its block map was
    made.
    """
    detail_of(request.detail, source.geobox, request.segment.refine)  # refused before any work
    if not isinstance(source, Blocks):
        divides = not (isinstance(request.partition, Partition) and request.segment.decides_pixels)
        stretching, *dividing, outlining = work.over(source).stages(2 + divides)
        grey = source.grey(stretching)
        if isinstance(request.partition, Partition):
            grey = decided_grey(grey, request.partition.edges, request.partition.bounds)
        partition, cells = _divided(grey, request, *dividing)
        trim_heap()
        _check_count(partition, request.segment)
        decided("intervals of v end at %s", ", ".join(f"{bound:.7g}" for bound in partition.bounds))
        with phase("refinement and outlines"):
            return _outlined(grey, cells, partition, request, outlining)
    blocks = source.saved.blocks
    partition = request.partition if isinstance(request.partition, Partition) else request.partition(blocks)
    _check_count(partition, request.segment)
    if request.segment.refine == "none":
        return _at_block_edges(source, partition, request)
    if source.raster is None:
        note = f"{source.saved.origin.rasters[0]} is not where it was, so segments end at block edges"
        return _at_block_edges(source, partition, request, (note,))
    return _refined(source, source.raster, partition, request, work)


def _divided(
    grey: GreySource, request: PartitionRequest, tile_pass: TilePass | None = None
) -> tuple[Partition, NDArray[Any] | None]:
    """Return the intervals, and the kinds of cells where leaves decide; no pass where none needs leaves."""
    partition, segment = request.partition, request.segment
    if tile_pass is None:
        assert isinstance(partition, Partition)
        return partition, None
    with phase("division"):
        if isinstance(partition, Partition):
            blocks = measure_block_map_for(grey, partition, segment, tile_pass)
        else:
            blocks = measure_block_map(grey, tile_pass)
            partition = partition(blocks)
        decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
        if segment.decides_pixels:
            return partition, None
        return partition, cell_classes(blocks, partition, segment.division)


def _check_count(partition: Partition, segment: SegmentParams) -> None:
    if segment.refine != "none" and partition.count > MAX_PIXEL_CLASSES:
        raise ParameterError(
            f"there are {partition.count} intervals, and up to {MAX_PIXEL_CLASSES} are refined to the pixel; "
            "give fewer, or --refine none, with which they end at block edges"
        )


def _refined(
    source: Blocks, raster: Pixels, partition: Partition, request: PartitionRequest, work: Work
) -> Segmented:
    outlining = work.over(raster)
    grey = source.grey(raster, outlining)
    with work.reading_here():
        check_unchanged(grey, source)
    if isinstance(request.partition, Partition):
        grey = decided_grey(grey, partition.edges, partition.bounds)
    return _outlined(grey, None, partition, request, outlining, source.saved.blocks)


def _outlined(
    grey: GreySource,
    cells: NDArray[Any] | None,
    partition: Partition,
    request: PartitionRequest,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
) -> Segmented:
    """Return outlines of segments, with small holes filled; `cells` are their kinds where leaves decide."""
    from uavseg.regions.tiles.class_tiles import outline_refined_classes, outline_segments

    kinds_at: Callable[[Integers], Integers]
    how = request.segment.refine
    if cells is not None:
        outlined, kinds_at = outline_segments(grey, cells, tile_pass), _of_cells(cells)
    else:
        grey = with_statistics(grey, tile_pass)
        detail = detail_of(request.detail, grey.dataset.geobox, how, request.cover)
        outlined, classes = outline_refined_classes(grey, partition, how, tile_pass, expected, detail)
        kinds_at = classes.at
    trim_heap()
    outlined = results.filled(grey, outlined, request.fill_holes, tile_pass)

    def count() -> Integers:
        return count_pixels(grey, partition.grey_table, tile_pass.silent)

    return Segmented(outlined, kinds_at, SourceInfo.of(grey), partition, how, count=count)


def _at_block_edges(
    source: Blocks, partition: Partition, request: PartitionRequest, notes: tuple[str, ...] = ()
) -> Segmented:
    """Return segments of whole cells with valid pixels, from the block map alone; `std` is not known."""
    refuse_at_cells(request.detail, request.segment.refine)
    classes = cell_classes(source.saved.blocks, partition, request.segment.division)
    outlined = results.outlined_cells(source, classes, request.fill_holes)
    return Segmented(outlined, _of_cells(classes), SourceInfo.of(source), partition, "none", notes)


def _of_cells(cells: NDArray[Any]) -> Callable[[Integers], Integers]:
    """Return the kinds of segments that end at cells, by their first pixels."""
    return lambda firsts: np.asarray(cells[tuple(firsts.T // CELL)], np.int64)


@dataclass(frozen=True, slots=True)
class ClassesRequest(RegionRequest):
    """Which classes, and how their regions are drawn.

    The rest is as of `ExtractRequest`: regions of any class within a hole that is filled become part of what
    surrounds them, and structures narrower than the detail part of what is near, or are left out.
    """

    classes: ValueClasses  # of v, after the stretch
    segment: SegmentParams = SegmentParams()  # see `segment_classes.joint_params`
    fill_holes: Area | None = None
    diagonally: bool = False  # 8-connectivity: regions of a class that touch at a corner of a pixel are one

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
    kind = found.kinds_at(outlined.sums.firsts)
    present = set(kind.tolist())
    if request.diagonally:
        outlined, _ = join_at_corners(outlined, kind)
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
    sure = partial(confidence_of, outlined, found.info.statistics)
    result = results.measured(outlined, found.info, ends, request, columns, sure, found.refine)
    names = [f"{one.name}={one.interval.low:g},{one.interval.high:g}" for one in classes]
    how: dict[str, Any] = {"classes": names} | results.segment_facts(request.segment)
    how |= {"connectivity": 8 if request.diagonally else None}
    how |= results.drawing_facts(request, request.fill_holes)
    if result.below_minimum and not len(result.regions):
        hints.append(none_confident(result.below_minimum, request.min_confidence))
    return work.finished(results.with_metadata(result, source, "extract", how), *hints)


def _named(classes: Sequence[params.ValueClass], numbers: Sequence[int]) -> str:
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


@dataclass(frozen=True, slots=True)
class BreakChoice:
    """How many levels, and the rule for the breaks between them, from the means of leaves.

    With "otsu" the variance within levels is smallest, as `suggest` has it: 2 to 8 levels, by default as many
    as valleys of the histogram separate. With "quantile" each has the same number of pixels: 2 to 100, by
    default 5. A ParameterError says that one of them is not allowed.
    """

    rule: BreakRule
    count: int | None = None  # of levels

    def __post_init__(self) -> None:
        if self.rule not in get_args(BreakRule):
            raise ParameterError(f"{_EXPECTED}, not {self.rule!r}")
        most = MAX_CLASSES if self.rule == "otsu" else _MAX_QUANTILES
        if self.count is not None and not 2 <= self.count <= most:
            raise ParameterError(f"levels by {self.rule} are 2 to {most} in number, not {self.count}")

    def breaks(self, blocks: BlockMap, division: params.DivisionParams) -> Breaks:
        """Return the breaks that a block map gives; raise RasterError if it has no valid pixel."""
        histogram = histogram_of_means(blocks, division)
        if not histogram.any():
            raise RasterError("no pixel is valid, so there are no breaks; look at nodata with uavseg info")
        if self.rule == "otsu":
            return Breaks(propose_ranges(histogram, self.count).edges)
        return Breaks(quantile_breaks(histogram, self.count or _QUANTILES))


@dataclass(frozen=True, slots=True)
class LevelsRequest(RegionRequest):
    """Which levels, and what becomes of small segments.

    Structures narrower than the detail become part of what is near; then segments of less than `min_area`
    become part of a neighbour, see `eliminate`, or are dropped. A ParameterError says that one of the
    parameters is not allowed.
    """

    levels: Levels | Breaks | BreakChoice  # of v, after the stretch
    segment: SegmentParams = SegmentParams()  # see `segment_classes.joint_params`
    small: Small = "merge"  # "merge" or "drop"
    diagonally: bool = False  # 8-connectivity: segments of a level that touch at a corner of a pixel are one

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
    small = None if request.min_area is None else request.small
    how = {"levels": [0.0, *found.partition.edges, 1.0]} | results.segment_facts(request.segment)
    how |= {"connectivity": 8 if request.diagonally else None, "small": small}
    how |= results.drawing_facts(request)
    result = results.with_metadata(_measured(found, request), source, "levels", how)
    if not len(result.regions) and result.below_minimum:
        notes.append(none_confident(result.below_minimum, request.min_confidence))
    elif not len(result.regions):
        why = "no pixel is valid, or all segments are smaller than the minimum area"
        notes.append(f"no segment is left: {why}")
    return work.finished(result, *notes)


def _partition(request: LevelsRequest) -> Partition | ChoosePartition:
    """Return the levels, or what chooses them from a block map."""
    choice = request.levels
    if not isinstance(choice, BreakChoice):
        return params.partition_of_levels(choice)
    division = request.segment.division
    return lambda blocks: params.partition_of_levels(choice.breaks(blocks, division))


def _notes(partition: Partition, request: LevelsRequest) -> list[str]:
    """Return where levels are not as they were asked for."""
    choice, notes = request.levels, []
    if isinstance(choice, BreakChoice):
        if partition.count == 1:
            notes.append("all leaves have one mean, so there is one level")
        elif choice.count is not None and partition.count < choice.count:
            little = f"the means of leaves differ too little for {choice.count} levels"
            notes.append(f"{little}; there are {partition.count}")
    elif partition.count > MAX_PIXEL_CLASSES and request.segment.method == "adaptive":
        notes.append(
            f"more than {MAX_PIXEL_CLASSES} levels end at block edges; fewer are refined to the pixel"
        )
    return notes


def _measured(found: Segmented, request: LevelsRequest) -> Extraction:
    outlined, info = found.outlined, found.info
    if request.diagonally:
        outlined, _ = join_at_corners(outlined, found.kinds_at(outlined.sums.firsts))
    if request.small == "drop":
        outlined = drop_small_regions(outlined, info.geobox, request.min_area)
    level = found.kinds_at(outlined.sums.firsts) - 1
    if request.min_area is not None and request.small == "merge":
        outlined, level = eliminate(outlined, level, info.geobox, request.min_area)
        if request.diagonally:  # merged segments touch others
            outlined, level = join_at_corners(outlined, level)
    bounds = np.array([0.0, *found.partition.edges, 1.0])
    ends = bounds[level], bounds[level + 1]
    sure = partial(confidence_of, outlined, info.statistics)
    return results.measured(outlined, info, ends, request, {"level": level}, sure, found.refine)


def quantile_breaks(histogram: Integers, count: int) -> tuple[float, ...]:
    """Return breaks below which 1 / count, 2 / count, ... of the pixels lie; fewer where many have one value.

    The histogram, (65536,), is of pixels by grey.

    Examples
    --------
    >>> histogram = np.zeros(65536, np.int64)
    >>> histogram[[6000, 20000, 40000, 60000]] = 1
    >>> quantile_breaks(histogram, 2)
    (0.4,)
    """
    below = np.cumsum(histogram)
    wanted = np.array([-(-k * int(below[-1]) // count) for k in range(1, count)])
    greys = np.unique(np.searchsorted(below, wanted))
    greys = greys[below[greys] < below[-1]]  # the last grey belongs to the last level
    occupied = np.flatnonzero(histogram)
    after = occupied[np.searchsorted(occupied, greys, "right")]
    return tuple(_break_between(*pair) for pair in zip(greys.tolist(), after.tolist(), strict=True))


def _break_between(low: int, high: int) -> float:
    """Return the number above 0 of the fewest decimals from a grey on that is not nearer to a higher one."""
    for decimals in range(1, 7):  # six decimals, a fifteenth of a grey, always do
        unit = 10**decimals
        found = max(-(-low * unit // GREY_MAX), 1) / unit
        if found < (high - 0.5) / GREY_MAX:
            break
    return float(found)


def breaks_of(breaks: Sequence[float] | str | None) -> Breaks | BreakChoice:
    """Return breaks: numbers (as text between commas too), otsu or quantile, perhaps with a number of levels.

    ParameterError is raised if it is none of them.

    Examples
    --------
    >>> breaks_of("otsu:3"), breaks_of("0.2,0.5")
    (BreakChoice(rule='otsu', count=3), Breaks(edges=(0.2, 0.5)))
    """
    if breaks is not None and not isinstance(breaks, str):
        return Breaks(tuple(float(one) for one in breaks))
    text = breaks or ""
    rule, _, count = text.strip().partition(":")
    with caused_errors(f"{_EXPECTED}, not {text!r}", ParameterError, ValueError, form="{}"):
        if rule in get_args(BreakRule):
            return BreakChoice(rule, int(count) if ":" in text else None)  # type: ignore[arg-type]
        return Breaks(tuple(float(part) for part in text.split(",")))
