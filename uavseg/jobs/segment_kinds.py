"""Segments of several intervals of v at once: what classes and levels have in common."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.execution.executors import trim_heap
from uavseg.execution.phases import decided, phase
from uavseg.jobs.detail import Length, detail_of, refuse_without_pixels
from uavseg.jobs.fill_holes import filled
from uavseg.jobs.ranges import decided_grey
from uavseg.jobs.result import SourceInfo
from uavseg.jobs.source import Blocks, Raster, Source
from uavseg.jobs.unchanged import check_unchanged
from uavseg.jobs.work import Work
from uavseg.raster.tiling import TilePass
from uavseg.regions.edit.small import Area, fill_small_holes
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.kinds import kinds_to_refine
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.partition import Partition
from uavseg.segmentation.pipeline import measure_block_map, measure_block_map_for
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL, MAX_KINDS

Firsts = NDArray[np.int64]
ChoosePartition = Callable[[BlockMap], Partition]


@dataclass(frozen=True, slots=True)
class KindsRequest:
    """Which intervals, and how their segments are found.

    Parameters
    ----------
    partition : Partition or callable
        Or what chooses it from the whole block map.
    segment : SegmentParams
        Its `refine` is "tv" or "none".
    fill_holes : Area, optional
    detail : Length, optional
        Structures that are narrower become part of what is near.
    cover : bool
        Whether kinds cover the raster, so that a detail leaves no pixel without one.
    """

    partition: Partition | ChoosePartition
    segment: SegmentParams
    fill_holes: Area | None = None
    detail: Length | None = None
    cover: bool = False


@dataclass(frozen=True)
class Segmented:
    """Segments of several kinds.

    Parameters
    ----------
    outlined : RegionOutlines
    kinds_at : callable
        The kinds (k,) of segments by their first pixels (k, 2), also after some were dropped or renumbered.
    info : SourceInfo
    partition : Partition
    refine : str
        How they were refined: "tv", or "none" for those at block edges.
    notes : tuple of str
    """

    outlined: RegionOutlines
    kinds_at: Callable[[Firsts], NDArray[np.int64]]
    info: SourceInfo
    partition: Partition
    refine: str
    notes: tuple[str, ...] = ()


def joint_params(segment: SegmentParams, refine: str | None) -> SegmentParams:
    """How segments of several intervals are found: refined together by total variation, or not at all.

    Parameters
    ----------
    segment : SegmentParams
    refine : str, optional
        What was asked for; by default "tv", and "none" with the paper's method.

    Raises
    ------
    ParameterError
        If it is another refinement, which decides for one range alone.
    """
    if refine is None:
        refine = "none" if segment.method == "paper" else "tv"
    if refine not in ("tv", "none"):
        raise ParameterError(f"intervals of v are refined together by tv, or none; {refine} is for one range")
    return SegmentParams.from_words(segment.method, segment.threshold, segment.intensity_step, refine)


def segment_kinds(source: Source, request: KindsRequest, work: Work) -> Segmented:
    """Segments of several intervals, each pixel in one of them at most.

    A block map answers without its raster where segments may end at cells; otherwise they are refined with
    it, if it is where it was.

    Parameters
    ----------
    source : Raster, ProbabilityMap or Blocks
    request : KindsRequest
    work : Work

    Raises
    ------
    UavsegError
        If the source cannot be read, or is not as it was when its block map was made.
    """
    detail_of(request.detail, source.geobox, request.segment.refine)  # refused before any work
    if not isinstance(source, Blocks):
        stretching, dividing, outlining = work.over(source).stages(3)
        grey = source.grey(stretching)
        with phase("division"):
            if isinstance(request.partition, Partition):
                partition = request.partition
                grey = decided_grey(grey, partition.edges, partition.bounds)
                blocks = measure_block_map_for(grey, partition, request.segment, dividing)
            else:
                blocks = measure_block_map(grey, dividing)
                partition = request.partition(blocks)
            _check_count(partition, request.segment)
            cells = kinds_to_refine(blocks, partition, request.segment)
        decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
        decided("intervals of v end at %s", ", ".join(f"{bound:.7g}" for bound in partition.bounds))
        del blocks
        trim_heap()
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


def _check_count(partition: Partition, segment: SegmentParams) -> None:
    if segment.refine == "tv" and partition.count > MAX_KINDS:
        raise ParameterError(
            f"there are {partition.count} intervals, and up to {MAX_KINDS} are refined to the pixel; give "
            "fewer, or --refine none, with which they end at block edges"
        )


def _refined(
    source: Blocks, raster: Raster, partition: Partition, request: KindsRequest, work: Work
) -> Segmented:
    """From the division on, with blocks that are known."""
    outlining = work.over(raster)
    grey = source.grey(raster, outlining)
    with work.reading_here():
        check_unchanged(grey, source)
    cells = kinds_to_refine(source.saved.blocks, partition, request.segment)
    return _outlined(grey, cells, partition, request, outlining, source.saved.blocks)


def _outlined(
    grey: GreySource,
    cells: NDArray[Any],
    partition: Partition,
    request: KindsRequest,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
) -> Segmented:
    """Outlines of segments, with small holes filled."""
    from uavseg.regions.tiles.kind_tiles import outline_segments
    from uavseg.regions.tiles.refined_kinds import outline_refined_kinds

    kinds_at: Callable[[Firsts], NDArray[np.int64]]
    if request.segment.refine == "none":
        outlined, kinds_at = outline_segments(grey, cells, tile_pass), _of_cells(cells)
    else:
        detail = detail_of(request.detail, grey.dataset.geobox, request.segment.refine, request.cover)
        outlined, kinds = outline_refined_kinds(grey, cells, partition, tile_pass, expected, detail)
        kinds_at = kinds.at
    trim_heap()
    outlined = filled(grey, outlined, request.fill_holes, tile_pass)
    return Segmented(outlined, kinds_at, SourceInfo.of(grey), partition, request.segment.refine)


def _at_block_edges(
    source: Blocks, partition: Partition, request: KindsRequest, notes: tuple[str, ...] = ()
) -> Segmented:
    """Segments of whole cells with valid pixels, from the block map alone; their `std` is not known."""
    from uavseg.regions.tiles.block_map_regions import outline_block_map, sum_enclosed_cells
    from uavseg.segmentation.blocks.leaves import cell_kinds

    refuse_without_pixels(request.detail)
    blocks = source.saved.blocks
    kinds = cell_kinds(blocks, partition, request.segment.division)
    outlined = outline_block_map(blocks, kinds)
    if request.fill_holes is not None:
        outlined = sum_enclosed_cells(blocks, fill_small_holes(outlined, source.geobox, request.fill_holes))
    return Segmented(outlined, _of_cells(kinds), SourceInfo.of(source), partition, "none", notes)


def _of_cells(cells: NDArray[Any]) -> Callable[[Firsts], NDArray[np.int64]]:
    """The kinds of segments that end at cells, by their first pixels."""

    def kinds_at(firsts: Firsts) -> NDArray[np.int64]:
        row, col = firsts.T // CELL
        return np.asarray(cells[row, col], np.int64)

    return kinds_at
