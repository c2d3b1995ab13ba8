"""The main job: regions of a raster whose mean intensity lies in a range."""

from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from uavseg._memory import give_back
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, Progress, serial
from uavseg.jobs.result import About, Drawing, Extraction, measured
from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit
from uavseg.raster.tile_pass import TilePass
from uavseg.regions.edit.small import Area, drop_small_regions, fill_small_holes
from uavseg.regions.outline.region_outlines import RegionOutlines
from uavseg.regions.tiles.block_map_regions import outline_block_map, sum_enclosed_cells
from uavseg.regions.tiles.range_tiles import outline_regions, sum_regions
from uavseg.segmentation.blocks.block_file import SavedBlocks
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.intervals import IntensityRange
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine, measure_block_map, measure_block_map_for
from uavseg.segmentation.source import GreySource

Small = Literal["drop", "merge"]


@dataclass(frozen=True, slots=True)
class ExtractParams:
    """How regions are extracted, beyond how pixels are segmented.

    Parameters
    ----------
    segment : SegmentParams
    stretch : Stretch, StretchSpec or str
        How intensity becomes v.
    fill_holes : Area, optional
        Holes of less are filled, and regions within them become part of what surrounds them; this comes
        first.
    min_area : Area, optional
        Regions of less are dropped, after holes are filled; of levels see `small`.
    simplify_m : float, optional
        Outlines keep within about this many metres; shared borders stay shared.
    tile : int, optional
        Side of a tile in pixels, a multiple of 64; what comes out does not depend on it.
    smooth_m : float, optional
        Outlines are drawn without stairs, within this many metres of the pixel edges, before they are
        simplified; shared borders stay shared.
    small : {"drop", "merge"}
        What becomes of segments of less than `min_area`: levels can also be merged, see `eliminate`.
    """

    segment: SegmentParams = field(default_factory=SegmentParams)
    stretch: Stretch | StretchSpec | str = "auto"
    fill_holes: Area | None = None
    min_area: Area | None = None
    simplify_m: float | None = None
    tile: int | None = None
    smooth_m: float | None = None
    small: Small = "drop"

    def __post_init__(self) -> None:
        _ = self.drawing  # sees to its parameters
        if self.small not in get_args(Small):
            raise ParameterError(f"small segments are merged or dropped: merge or drop, not {self.small!r}")

    @property
    def drawing(self) -> Drawing:
        """How outlines are drawn."""
        return Drawing(self.smooth_m, self.simplify_m)


def extract(
    dataset: Dataset,
    interval: IntensityRange,
    params: ExtractParams = ExtractParams(),
    map: Map = serial,
    progress: Progress | None = None,
) -> Extraction:
    """Regions of a raster whose mean intensity lies in a range.

    Parameters
    ----------
    dataset : Dataset
    interval : IntensityRange
        Of v, after the stretch.
    params : ExtractParams
    map : Map
        Who runs the work.
    progress : callable, optional

    Raises
    ------
    UavsegError
        If the raster cannot be read or a parameter does not fit it.
    """
    first, second, third = TilePass.over(dataset, params.tile, map, progress).stages(3)
    source = GreySource(dataset, fit(dataset, params.stretch, first))
    how = params.segment
    blocks = measure_block_map_for(source, interval, how, second)
    inside = cells_to_refine(blocks, interval, how)
    del blocks  # all that is left to do is done with its cells in range
    give_back()
    outlined = _outlined(source, inside, interval, params, third)
    return _extraction(source, outlined, interval, params, third)


def extract_from_blocks(
    saved: SavedBlocks,
    dataset: Dataset | None,
    interval: IntensityRange,
    params: ExtractParams = ExtractParams(),
    map: Map = serial,
    progress: Progress | None = None,
) -> Extraction:
    """Regions answered from a block map, refined where its raster is at hand.

    Parameters
    ----------
    saved : SavedBlocks
    dataset : Dataset or None
        The raster that the block map was made from. Without it, and with ``refine="none"``, regions are made
        of whole cells, and `std` is not known.

    Raises
    ------
    RasterError
        If the raster is not as it was.
    """
    if dataset is None or params.segment.refine == "none":
        return _at_block_edges(saved, interval, params)
    if dataset.geobox.shape != saved.geobox.shape:
        raise ParameterError(
            f"{dataset.source} has not the size of the raster that the block map was made from"
        )
    tile_pass = TilePass.over(dataset, params.tile, map, progress)
    source = GreySource(dataset, saved.stretch)
    how = params.segment
    inside = cells_to_refine(saved.blocks, interval, how)
    outlined = _outlined(source, inside, interval, params, tile_pass, saved.blocks)
    return _extraction(source, outlined, interval, params, tile_pass)


def divide(
    dataset: Dataset,
    stretch: Stretch | StretchSpec | str = "auto",
    tile: int | None = None,
    map: Map = serial,
    progress: Progress | None = None,
) -> tuple[BlockMap, Stretch]:
    """The whole block map of a raster, and the stretch that made its grey."""
    first, second = TilePass.over(dataset, tile, map, progress).stages(2)
    source = GreySource(dataset, fit(dataset, stretch, first))
    return measure_block_map(source, second), source.stretch


def _outlined(
    source: GreySource,
    inside: NDArray[np.uint8],
    interval: IntensityRange,
    params: ExtractParams,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
) -> RegionOutlines:
    refine = params.segment.refine
    found = outline_regions(source, inside, interval, refine, tile_pass, expected)
    give_back()
    return found


def _extraction(
    source: GreySource,
    outlined: RegionOutlines,
    interval: IntensityRange,
    params: ExtractParams,
    tile_pass: TilePass,
) -> Extraction:
    if params.fill_holes is not None:
        filled = fill_small_holes(outlined, source.dataset.geobox, params.fill_holes)
        if filled is not outlined:  # what was in the holes counts now
            outlined = replace(filled, sums=sum_regions(source, filled, tile_pass))
    return _measured(outlined, About.source(source), interval, params)


def _at_block_edges(saved: SavedBlocks, interval: IntensityRange, params: ExtractParams) -> Extraction:
    """Regions of whole cells with valid pixels, from the block map alone."""
    blocks, how = saved.blocks, params.segment
    outlined = outline_block_map(blocks, cells_in_range(blocks, interval, how.division))
    if params.fill_holes is not None:
        outlined = sum_enclosed_cells(blocks, fill_small_holes(outlined, saved.geobox, params.fill_holes))
    return _measured(outlined, About.saved(saved), interval, params)


def _measured(
    outlined: RegionOutlines, about: About, interval: IntensityRange, params: ExtractParams
) -> Extraction:
    """Regions with their attributes, the small ones dropped."""
    if params.small != "drop":
        raise ParameterError("regions of a range have nothing around them to be merged into; drop small ones")
    if params.min_area is not None:
        outlined = drop_small_regions(outlined, about.geobox, params.min_area)
    return measured(outlined, about, interval.low, interval.high, params.drawing)
