"""Extraction of the regions of a raster whose mean intensity lies in a range: the main job.

With a folder as output, workers outline, join, measure and write the regions; the driver holds what reaches
the borders of partitions.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from uavseg.arrays import Path_, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError
from uavseg.execution.checkpoint import stage_folder
from uavseg.execution.executors import decided, phase, trim_heap
from uavseg.jobs.ranges import ranges
from uavseg.jobs.result import result as results
from uavseg.jobs.result.result import Extraction, RegionRequest, SourceInfo, measured
from uavseg.jobs.source.source import Blocks, Pixels, Source, check_unchanged, detail_of, refuse_at_cells
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.output.atomic import atomic_file
from uavseg.output.renames import recover
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.value_range import DetectedRange, ValueRange
from uavseg.regions.confidence import check_minimum, confidence_of, none_confident
from uavseg.regions.edit.small import Area, drop_small_regions, join_at_corners
from uavseg.regions.formats.export import check_region_folder, write_regions
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.stitch import concatenate_sums, number_regions
from uavseg.regions.tiles.partitions import PARTITION, PartitionJob, join_partitions
from uavseg.regions.tiles.range_tiles import count_pixels, has_thin_lines, outline_regions
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.params.segment import IntensityRange, Partition, SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine, every_cell, measure_block_map_for
from uavseg.segmentation.refine.detail import ThinLines
from uavseg.segmentation.source import GreySource, with_statistics

Measured = GreySource | Blocks


@dataclass(frozen=True, slots=True)
class ExtractRequest(RegionRequest):
    """Which regions, and how they are drawn.

    In this order: thin lines are added where their contrast along 15 pixels is significant; structures
    narrower than the detail are left out, necks cut and gaps closed; holes are filled, and regions within
    them become part of what surrounds them; regions are joined at corners; small regions are dropped, and
    those of a low confidence at last.

    A ParameterError says that thin lines are asked for with a detail, which leaves them out, or without
    refinement to the pixel; that the minimum confidence is not within 0 and 1, or that regions end at block
    edges, where it is not known.
    """

    interval: ranges.AnyRange  # in v, values in the units of the raster, or percentiles of them
    segment: SegmentParams = SegmentParams()
    fill_holes: Area | None = None  # holes of less are filled
    thin_lines: bool = False  # of 1 to 3 pixels
    diagonally: bool = False  # 8-connectivity: regions that touch at a corner of a pixel are one

    def __post_init__(self) -> None:
        check_minimum(self.min_confidence, self.segment.refine)
        if self.thin_lines and self.detail is not None:
            raise ParameterError("a detail leaves out the lines that thin lines adds; give one of them")
        if self.thin_lines and self.segment.refine == "none":
            raise ParameterError(
                "thin lines are decided to the pixel, and these regions end at block edges; leave thin lines "
                "out, or refine to the pixel"
            )


def extract(source: Source, request: ExtractRequest, work: Work = SERIAL) -> Extraction:
    """Extract regions of a raster whose mean intensity lies in a range.

    A block map answers without its raster where regions may end at cells; otherwise they are refined with it,
    if it is where it was. RasterError is raised if the raster is not as it was when its block map was made.
    """
    work = work.begun()
    detail_of(request.detail, source.geobox, request.segment.refine)  # refused before any work
    hints: list[str] = []
    if not isinstance(source, Blocks):
        found = regions_of_pixels(source, request, work)
    elif request.segment.refine == "none":
        found = _at_block_edges(source, request)
    elif source.raster is not None:
        found = _refined(source, source.raster, request, work)
    else:
        hints.append(f"{source.saved.origin.rasters[0]} is not where it was, so regions end at block edges")
        found = _at_block_edges(source, request)
    hints += [found.nothing] if found.nothing else []
    return work.finished(with_facts(found, source, request), *hints)


def with_facts(found: Extraction, source: Source, request: ExtractRequest) -> Extraction:
    """Return a result whose regions say what they were made from, and how."""
    how = results.range_facts(found.detected, found.axis) | results.segment_facts(request.segment)
    how |= {"connectivity": 8 if request.diagonally else None, "thin_lines": request.thin_lines or None}
    how |= results.drawing_facts(request, request.fill_holes)
    return results.with_metadata(found, source, "extract", how)


def regions_of_pixels(source: Pixels, request: ExtractRequest, work: Work) -> Extraction:
    """Run the phases of the paper, from pixels to regions: read this first."""
    stretching, *dividing, outlining = work.over(source).stages(2 + (not request.segment.decides_pixels))
    grey, detected = ranges.grey_for(source, request.interval, stretching)  # intensity -> v
    grey = with_statistics(grey, outlining)
    cells = every_cell(grey.shape)
    for stage in dividing:  # texture, division of blocks, segments of leaves in range
        with phase("division"):
            blocks = measure_block_map_for(grey, detected.interval, request.segment, stage)
            cells = cells_to_refine(blocks, detected.interval, request.segment)
        decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
        decided("of %d cells of 8 x 8 pixels %d are in range", cells.size, np.count_nonzero(cells))
        del blocks
        trim_heap()
    with phase("refinement and outlines"):  # to the pixel; small holes
        outlined = _outlined(grey, cells, detected, request, outlining)
    with phase("attributes and drawing"):  # small regions too
        return _measured(outlined, grey, detected, request, outlining)


def _refined(source: Blocks, raster: Pixels, request: ExtractRequest, work: Work) -> Extraction:
    outlining = work.over(raster)
    grey = source.grey(raster, outlining)
    with work.reading_here():
        check_unchanged(grey, source)
    detected, requested = ranges.range_of_blocks(source, request.interval), request.interval
    if request.segment.decides_pixels and not isinstance(requested, ValueRange):
        grey = ranges.decided_grey(grey, requested.edges, (requested.low, requested.high))
    grey = with_statistics(grey, outlining)
    cells = cells_to_refine(source.saved.blocks, detected.interval, request.segment)
    with phase("refinement and outlines"):
        outlined = _outlined(grey, cells, detected, request, outlining, source.saved.blocks)
    return _measured(outlined, grey, detected, request, outlining)


def _at_block_edges(source: Blocks, request: ExtractRequest) -> Extraction:
    """Return regions of whole cells with valid pixels, from the block map alone; their `std` is not known."""
    refuse_at_cells(request.detail, request.segment.refine)
    if request.thin_lines:
        raise ParameterError(
            "thin lines are decided to the pixel, and regions from this block map end at block edges; leave "
            "them out, or give the raster"
        )
    detected = ranges.range_of_blocks(source, request.interval)
    cells = cells_in_range(source.saved.blocks, detected.interval, request.segment.division)
    outlined = results.outlined_cells(source, cells, request.fill_holes)
    return _measured(outlined, source, detected, request)


def _outlined(
    grey: GreySource,
    cells: Uint8s,
    detected: DetectedRange,
    request: ExtractRequest,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
) -> RegionOutlines:
    """Return outlines of the regions, with small holes filled."""
    refine = request.segment.refine
    detail = ThinLines() if request.thin_lines else detail_of(request.detail, grey.dataset.geobox, refine)
    outlined = outline_regions(grey, cells, detected.interval, refine, tile_pass, expected, detail)
    trim_heap()
    return results.filled(grey, outlined, request.fill_holes, tile_pass)


def _measured(
    outlined: RegionOutlines,
    source: Measured,
    detected: DetectedRange,
    request: ExtractRequest,
    tiles: TilePass | None = None,
) -> Extraction:
    """Return regions with their attributes, the small ones dropped; where there are none, why."""
    if request.diagonally:
        outlined, _ = join_at_corners(outlined, np.zeros_like(outlined.sums.counts))
    result, whole = measure(outlined, source, detected, request), len(outlined.sums.counts)
    if len(result.regions):
        return result
    return replace(result, nothing=why_none(result, whole, source, request, tiles))


def measure(
    outlined: RegionOutlines, source: Measured, detected: DetectedRange, request: ExtractRequest
) -> Extraction:
    """Return regions with their attributes, the small ones dropped: no region depends on another."""
    info = SourceInfo.of(source)
    outlined = drop_small_regions(outlined, info.geobox, request.min_area)
    ends = detected.interval.low, detected.interval.high
    sure, refine = partial(confidence_of, outlined, info.statistics), request.segment.refine
    return measured(outlined, info, ends, request, confidence=sure, refine=refine, detected=detected)


def why_none(
    found: Extraction, dropped: int, source: Measured, request: ExtractRequest, tiles: TilePass | None
) -> str:
    """Tell why there is no region, for messages; pixels in range are counted where there is a pass."""
    sought = f"a mean {ranges.range_text(request.interval, found.axis)}"
    if found.below_minimum:
        return none_confident(found.below_minimum, request.min_confidence)
    if dropped:
        regions = f"the only region with {sought} is"
        regions = regions if dropped == 1 else f"all {dropped:,} regions with {sought} are"
        return f"{regions} smaller than --min-area; a smaller one keeps more"
    none = f"no region has {sought}" + ("" if request.detail is None else f" and is {request.detail} wide")
    if tiles is not None and found.detected is not None and isinstance(source, GreySource):
        interval = found.detected.interval
        classes = Partition(interval.edges, (0, 1, 0), ()).grey_table
        outside, inside, *_ = count_pixels(source, classes, tiles.silent).tolist()
        if inside:
            ways = _ways(source, interval, request, tiles.silent)
            return f"{none}, {ranges.missed_text(inside, outside + inside, ways)}"
    by_v = isinstance(request.interval, IntensityRange)
    return f"{none}; {ranges.where_to_look(source) if by_v else 'uavseg info shows which values there are'}"


def _ways(grey: GreySource, interval: IntensityRange, request: ExtractRequest, tiles: TilePass) -> list[str]:
    """Return options that find the pixels in range of which no region was found."""
    ways = [] if request.segment.refine == "pixels" else [ranges.EACH_PIXEL]
    if request.detail is not None:
        return ["a smaller --detail keeps more", *ways]
    if not request.thin_lines and has_thin_lines(grey, interval, tiles):
        return ["--thin-lines finds lines of 1 to 3 pixels", *ways]
    return ways


@dataclass(frozen=True, slots=True)
class Written:
    """What was written of partitions, which merges by adding."""

    outlined: int = 0  # regions before small ones were dropped
    below_minimum: int = 0  # of too low a confidence
    regions: int = 0  # in files
    files: int = 0
    area: float = 0.0  # of the regions in files
    largest: tuple[int, float] = (0, 0.0)  # pixels and area of the largest

    def __add__(self, other: "Written") -> "Written":
        names = ("outlined", "below_minimum", "regions", "files", "area")
        added: dict[str, Any] = {name: getattr(self, name) + getattr(other, name) for name in names}
        return Written(**added, largest=max(self.largest, other.largest))


def extract_partitions(
    source: Source,
    request: ExtractRequest,
    path: Path_,
    work: Work = SERIAL,
    overwrite: bool = False,
    side: int = PARTITION,
) -> tuple[Extraction, Written]:
    """Extract regions as `extract` does, and write them to files of a folder; return the rest of the result.

    The regions are the same, apart from their ids: the id of a region is the number of its first pixel,
    counted from 1 row by row. It is in the file of the partition in which that pixel lies, the largest first.
    Neither ids nor files depend on tiles or workers. The workers share the folder, `path`; `side` is that of
    a partition in pixels, a multiple of 64. A ParameterError says that an option needs all regions at once,
    another UavsegError as of `extract`, or that the folder cannot be written.
    """
    check_local(request)
    if isinstance(source, Blocks):
        raise ParameterError(f"a folder of regions is made from rasters; {source.name} is a block map")
    work = work.begun()
    narrow = ThinLines() if request.thin_lines else None
    detail = narrow or detail_of(request.detail, source.geobox, request.segment.refine)
    check_region_folder(path, overwrite)
    stretching, joining, writing = work.over(source, block_map=False).stages(3)
    grey, detected = ranges.grey_for(source, request.interval, stretching)
    grey = with_statistics(grey, stretching)
    none = np.empty(0, np.int64)
    found = measure(number_regions(concatenate_sums([]), none, none, []), grey, detected, request)
    found = with_facts(found, source, request)
    empty = results.with_band_statistics(found.regions, grey.dataset, request.drawing)
    with atomic_file(path, overwrite) as made:
        folder = made.absolute()
        folder.mkdir()
        join = partial(join_partitions, grey, detected.interval, request.segment, detail=detail, side=side)
        with _components_in(folder, work, partial(join, joining.windows[0])) as scratch:
            with phase("refinement and outlines"):
                jobs = join(joining, Path(scratch))
            with phase("attributes and files"):
                how = request, found.regions.metadata, scratch, str(folder)
                write = partial(_write_partition, grey, detected, *how)
                written = sum(writing.run(write, jobs), Written())
        recover(folder)  # what workers left that were killed
        if len(list(folder.iterdir())) < written.files:
            raise OutputError(f"files of {path} are not here; workers must share its folder")
        if request.min_confidence is not None:
            found = replace(found, below_minimum=written.below_minimum)
        if not written.files:  # readers find no columns in an empty folder
            write_regions(empty, folder / _name(0))
            found = replace(found, nothing=why_none(found, written.outlined, grey, request, writing))
    return work.finished(found, *([found.nothing] if found.nothing else [])), written


@contextmanager
def _components_in(folder: Path, work: Work, stage: Callable[..., Any]) -> Iterator[str]:
    """Enter a folder for components: one that is deleted, or that of a stage in the checkpoint."""
    if work.checkpoint is None:
        with TemporaryDirectory(prefix="joins-", dir=folder) as scratch:
            yield scratch
    else:
        yield str(stage_folder(Path(work.checkpoint).absolute(), stage))


def check_local(request: object) -> ExtractRequest:
    """Refuse what needs all regions at once, and other jobs; return the request."""
    if not isinstance(request, ExtractRequest):
        raise ParameterError("a folder of regions is of one range, not of classes; write classes to a file")
    refused = {
        "filled holes": request.fill_holes is not None,
        "connectivity 8": request.diagonally,
        "smooth outlines": bool(request.drawing.smooth_m),
        "regularized outlines": bool(request.drawing.regularize_m),
        "simplified outlines": bool(request.drawing.simplify_m),
        "the refinement none": request.segment.refine == "none",
    }
    if given := [what for what, is_given in refused.items() if is_given]:
        why = f"a folder of regions is written without {given[0]}"
        raise ParameterError(f"{why}; leave it out, or write one file")
    return request


def _write_partition(
    grey: GreySource,
    detected: DetectedRange,
    request: ExtractRequest,
    metadata: Mapping[str, Any],
    scratch: str,
    folder: str,
    job: PartitionJob,
) -> Written:
    """Put the regions of a partition together, measure them and write them to its file."""
    outlined = job.outlines(scratch)
    found = measure(outlined, grey, detected, request)
    regions, rings = found.regions, found.rings
    written = Written(outlined=len(outlined.sums.counts), below_minimum=found.below_minimum or 0)
    if not len(regions):
        return written
    corners = rings.vertices[rings.starts[np.searchsorted(rings.labels, regions.columns["id"])]]
    ids = corners.astype(np.int64) @ (grey.shape[1], 1) + 1  # a ring begins at its first pixel
    regions = replace(regions, columns=regions.columns | {"id": ids}, metadata=metadata)
    regions = results.with_band_statistics(regions, grey.dataset, request.drawing)
    write_regions(regions, Path(folder, _name(job.number)), overwrite=True)  # one that was sent twice
    pixels, areas = regions.columns["pixels"], regions.columns["area_m2"]
    largest = int(pixels[0]), float(areas[0])
    return replace(written, regions=len(regions), files=1, area=float(areas.sum()), largest=largest)


def _name(number: int) -> str:
    return f"part-{number:06d}.parquet"
