"""The main job: regions of a raster whose mean intensity lies in a range."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from uavseg._memory import give_back
from uavseg.errors import ParameterError
from uavseg.parallel import Map, Progress, serial
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.stretch import Stretch, StretchSpec, fit
from uavseg.raster.tiling import CELL, Window, in_panels, tile_side, tiles
from uavseg.regions.cleaning import Area, numbered_by_size, without_small_holes, without_small_regions
from uavseg.regions.joining import Outlined
from uavseg.regions.outline import Rings, rasterise, trace
from uavseg.regions.simplify import simplify
from uavseg.regions.table import Regions, make
from uavseg.regions.tilewise import outline_regions, summed
from uavseg.segmentation.blockfile import SavedBlocks
from uavseg.segmentation.blockmap import BlockMap
from uavseg.segmentation.components import Sums, components
from uavseg.segmentation.pipeline import SegmentParams, block_map, block_map_for, stages
from uavseg.segmentation.segments import IntensityRange, in_range
from uavseg.segmentation.source import GreySource


@dataclass(frozen=True, slots=True)
class ExtractParams:
    """How regions are extracted, beyond how pixels are segmented.

    Parameters
    ----------
    segment : SegmentParams
    stretch : StretchSpec or str
        How intensity becomes v.
    fill_holes : Area, optional
        Holes of less are filled, and regions within them become part of what surrounds them; this comes
        first.
    min_area : Area, optional
        Regions of less are dropped.
    simplify_m : float, optional
        Outlines keep within about this many metres; shared borders stay shared.
    tile : int, optional
        Side of a tile in pixels, a multiple of 64; what comes out does not depend on it.
    """

    segment: SegmentParams = field(default_factory=SegmentParams)
    stretch: StretchSpec | str = "auto"
    fill_holes: Area | None = None
    min_area: Area | None = None
    simplify_m: float | None = None
    tile: int | None = None

    def __post_init__(self) -> None:
        if self.simplify_m is not None and not 0 <= self.simplify_m < float("inf"):
            raise ParameterError(
                f"outlines are simplified by metres that are not negative, not {self.simplify_m:g}"
            )


@dataclass(frozen=True)
class Extraction:
    """Regions, and what is needed to tell of them and to paint them.

    Parameters
    ----------
    regions : Regions
    rings : Rings
        Their outlines on pixel edges, not simplified.
    geobox : GeoBox
        Of the raster.
    stretch : Stretch
        The one that was used.
    band_names : str
    warnings : tuple of str
    """

    regions: Regions
    rings: Rings
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    warnings: tuple[str, ...]


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
    windows = windows_of(dataset, params.tile)
    first, second, third = _three(progress)
    source = GreySource(dataset, fit(dataset, params.stretch, map, windows, first))
    blocks = block_map_for(source, interval, params.segment, windows, map, second)
    give_back()
    outlined = _outlined(source, blocks, interval, params, windows, map, third)
    return _extraction(source, outlined, interval, params, windows, map)


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
    windows = windows_of(dataset, params.tile)
    source = GreySource(dataset, saved.stretch)
    outlined = _outlined(source, saved.blocks, interval, params, windows, map, progress, saved.blocks)
    return _extraction(source, outlined, interval, params, windows, map)


def divide(
    dataset: Dataset,
    stretch: StretchSpec | str = "auto",
    tile: int | None = None,
    map: Map = serial,
    progress: Progress | None = None,
) -> tuple[BlockMap, Stretch]:
    """The whole block map of a raster, and the stretch that made its grey."""
    windows = windows_of(dataset, tile)
    first, second = (None, None) if progress is None else stages(progress, 2)
    source = GreySource(dataset, fit(dataset, stretch, map, windows, first))
    return block_map(source, windows, map, second), source.stretch


def windows_of(dataset: Dataset, tile: int | None) -> list[Window]:
    """The tiles of a dataset, in the order of reading: squares of this side, else what suits its files."""
    shape = dataset.geobox.shape
    return in_panels(tiles(shape, tile_side(shape, dataset.file_block) if tile is None else tile))


def _outlined(
    source: GreySource,
    blocks: BlockMap,
    interval: IntensityRange,
    params: ExtractParams,
    windows: Sequence[Window],
    map: Map,
    progress: Progress | None,
    expected: BlockMap | None = None,
) -> Outlined:
    how = params.segment
    inside = in_range(blocks, interval, how.threshold, how.step)
    found = outline_regions(source, inside, interval, how.refine, windows, map, progress, expected)
    give_back()
    return found


def _extraction(
    source: GreySource,
    outlined: Outlined,
    interval: IntensityRange,
    params: ExtractParams,
    windows: Sequence[Window],
    map: Map,
) -> Extraction:
    dataset = source.dataset
    if params.fill_holes is not None:
        filled = without_small_holes(outlined, dataset.geobox, params.fill_holes)
        if filled is not outlined:  # what was in the holes counts now
            outlined = replace(filled, sums=summed(source, filled, windows, map))
    told = dataset.warnings + source.stretch.warnings
    return _measured(
        outlined, dataset.geobox, source.stretch, dataset.band_names, dataset.source, interval, params, told
    )


def _measured(
    outlined: Outlined,
    geobox: GeoBox,
    stretch: Stretch,
    band_names: str,
    name: str,
    interval: IntensityRange,
    params: ExtractParams,
    told: tuple[str, ...],
) -> Extraction:
    """Regions with their attributes, the small ones dropped."""
    if params.min_area is not None:
        outlined = without_small_regions(outlined, geobox, params.min_area)
    rings, sums = outlined.rings, outlined.sums
    pixels = np.bincount(rings.labels, rings.pixel_areas(), len(sums.counts) + 1)[1:].astype(np.int64)
    regions = make(
        rings,
        geobox,
        sums.counts,
        sums.greys,
        sums.squares,
        (interval.low, interval.high),
        name,
        pixels,
    )
    if params.simplify_m:
        regions = simplify(regions, params.simplify_m, geobox)
    return Extraction(regions, rings, geobox, stretch, band_names, told)


def _at_block_edges(saved: SavedBlocks, interval: IntensityRange, params: ExtractParams) -> Extraction:
    """Regions of whole cells with valid pixels, from the block map alone."""
    blocks, how = saved.blocks, params.segment
    rows, cols = saved.geobox.coarsen(CELL).shape
    inside = in_range(blocks, interval, how.threshold, how.step)
    leaves, count = components(np.ascontiguousarray(inside[:rows, :cols]))
    leaves[blocks.counts[:rows, :cols] == 0] = 0
    rings = trace(leaves)
    limit = np.array(saved.geobox.shape, np.int32)
    on_pixels = replace(rings, vertices=np.minimum(rings.vertices * np.int32(CELL), limit))
    outlined = numbered_by_size(on_pixels, _sums_of_cells(blocks, leaves, count))
    if params.fill_holes is not None:
        filled = without_small_holes(outlined, saved.geobox, params.fill_holes)
        on_cells = replace(filled.rings, vertices=-(-filled.rings.vertices // np.int32(CELL)))
        labels = rasterise(on_cells, Window(0, 0, rows, cols))
        outlined = replace(filled, sums=_sums_of_cells(blocks, labels, len(filled.sums.counts)))
    name = saved.origin.rasters[0].rsplit("/", 1)[-1]
    return _measured(
        outlined,
        saved.geobox,
        saved.stretch,
        saved.band_names,
        name,
        interval,
        params,
        saved.stretch.warnings,
    )


def _sums_of_cells(blocks: BlockMap, labels: NDArray[np.uint32], count: int) -> Sums:
    flat = labels.reshape(-1)
    rows, cols = labels.shape
    greys = np.zeros(count + 1, np.uint64)
    counts = np.zeros(count + 1, np.int64)
    np.add.at(greys, flat, blocks.sums[:rows, :cols].reshape(-1).astype(np.uint64))
    np.add.at(counts, flat, blocks.counts[:rows, :cols].reshape(-1))
    names, first = np.unique(flat, return_index=True)
    firsts = np.zeros((count + 1, 2), np.int64)
    firsts[names] = np.stack(np.divmod(first, cols), axis=1)
    return Sums(counts[1:], greys[1:], np.full(count, np.nan), firsts[1:])


def _three(progress: Progress | None) -> list[Progress] | list[None]:
    return [None, None, None] if progress is None else stages(progress, 3)
