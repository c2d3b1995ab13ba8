"""Regions of an intensity range: tiles are refined, labelled and traced one by one, then stitched."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.execution.lazy_sequence import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, window_cells
from uavseg.regions.outline.rasterise import EdgeTable, edge_tables
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.stitch import TileOutlines, outline_tile, stitch_tiles
from uavseg.regions.tiles.detail_tiles import with_detail
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.components import Sums, component_sums, label_components, with_beyond
from uavseg.segmentation.params.segment import IntensityRange, Refinement
from uavseg.segmentation.pipeline import refine_tile
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.thin_lines import ThinLines
from uavseg.segmentation.source import GreySource, GreyTile


def outline_regions(
    source: GreySource,
    cells: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
    detail: Detail | ThinLines | None = None,
) -> RegionOutlines:
    """Outline the regions of a raster, refined to the pixel.

    Parameters
    ----------
    source : GreySource
    cells : (m, n) uint8 array
        Bit flags of cells, from `pipeline.cells_to_refine`.
    interval : IntensityRange
    refine : {"none", "scan", "smooth", "tv", "pixels"}
        With "none", leaves that share an edge are one region also where invalid pixels separate their pixels.
    tile_pass : TilePass
    expected : BlockMap, optional
        The sums and counts that cells must have, if the block map was made earlier.
    detail : Detail or ThinLines, optional
        Structures that are narrower vanish from what was refined, or thin lines are added; not with "none".

    Raises
    ------
    RasterError
        If a cell has other sums or counts than expected.
    """
    jobs = tile_jobs(cells, tile_pass.windows, expected, detail)
    tiles = tile_pass.run(partial(_outline_tile, source, interval, refine, detail), jobs)
    return stitch_tiles(source.shape, tile_pass.windows, tiles).finish(cells if refine == "none" else None)


@dataclass(frozen=True, slots=True)
class TileJob:
    """A tile, its cells with those around it, and the sums and counts that its cells must have.

    `refined` is the window that is refined: the tile, grown by the halo of a detail.
    """

    window: Window
    cells: NDArray[np.uint8]
    expected: tuple[NDArray[np.uint32], NDArray[np.uint8]] | None
    refined: Window


def tile_jobs(
    cells: NDArray[np.uint8],
    windows: Sequence[Window],
    expected: BlockMap | None,
    detail: Detail | ThinLines | None = None,
) -> LazySequence[TileJob]:
    """Tiles with what their refinement takes; the sums of cells are those of a block map, if one is given."""
    halo = 0 if detail is None else detail.halo
    return LazySequence(len(windows), partial(_job, cells, windows, expected, halo))


def _job(
    cells: NDArray[np.uint8], windows: Sequence[Window], expected: BlockMap | None, halo: int, k: int
) -> TileJob:
    window = windows[k]
    refined = window.grown(halo)
    here = window_cells(window)
    sums = None if expected is None else (expected.sums[here], expected.counts[here])
    return TileJob(window, cells_around(cells, refined, REFINE_HALO), sums, refined)


def _outline_tile(
    source: GreySource,
    interval: IntensityRange,
    refine: Refinement,
    detail: Detail | ThinLines | None,
    job: TileJob,
) -> TileOutlines | None:
    found = refine_tile(source, job.cells, interval, refine, job.refined)
    if isinstance(detail, ThinLines):
        from uavseg.regions.tiles.thin_tiles import with_thin_lines

        found = with_thin_lines(source, found, interval, job.window)
    if found is None:
        return None
    pixels, tile = with_detail(*found, detail) if isinstance(detail, Detail) else found
    check_sums(source, job, tile)
    return outline_tile(pixels, *label_components(pixels, REFINE_HALO), tile, job.window, source.shape[1])


def check_sums(source: GreySource, job: TileJob, tile: GreyTile) -> None:
    """Check that the cells of a tile have the sums and counts that its job expects.

    Raises
    ------
    RasterError
        If they have others.
    """
    if job.expected is None:
        return
    sums, counts = cell_sums(tile.grey, tile.valid, REFINE_HALO)
    moved = np.abs(sums.astype(np.int64) - job.expected[0])
    # Bounds of a range that are decided by intensities move a pixel by one grey at most.
    most = counts if source.stretch.borders else 0
    if (counts != job.expected[1]).any() or (moved > most).any():
        raise RasterError(
            f"{source.dataset.source} is not as it was when its block map was made; make the block map again "
            "with uavseg divide, or give --refine none"
        )


def sum_regions(source: GreySource, outlined: RegionOutlines, tile_pass: TilePass) -> Sums:
    """Sums of each region over all valid pixels that its outlines enclose, read again from the raster.

    The contrast across borders, and the likeness of classes, stay as they were.
    """
    sums = outlined.sums
    greys, squares = np.zeros_like(sums.greys), np.zeros_like(sums.squares)
    counts, beyond = np.zeros_like(sums.counts), np.zeros_like(sums.counts)
    jobs = edge_tables(outlined.rings, tile_pass.windows)
    for found in tile_pass.silent.run(partial(_sum_tile, source), jobs):
        if found is not None:
            labels, parts = found
            counts[labels - 1] += parts.counts
            greys[labels - 1] += parts.greys
            squares[labels - 1] += parts.squares
            if parts.beyond is not None:
                beyond[labels - 1] += parts.beyond
    return Sums(counts, greys, squares, sums.firsts, beyond if beyond.any() else None, sums.steps, sums.alike)


def _sum_tile(source: GreySource, edges: EdgeTable) -> tuple[NDArray[np.int64], Sums] | None:
    """The labels in a tile, and the sums of each over its valid pixels; None without labels."""
    window, image = edges.window, edges.rasterise()
    labels = np.unique(image).astype(np.int64)
    labels = labels[labels > 0]
    if len(labels) == 0:
        return None
    tile = source.read(window, 0, beyond=True)
    valid = tile.valid[: window.rows, : window.cols] > 0
    numbers = np.searchsorted(labels, image) + 1
    numbers[(image == 0) | ~valid] = 0
    grey = np.ascontiguousarray(tile.grey[: window.rows, : window.cols])
    names, inner = numbers.astype(np.uint32), (slice(window.rows), slice(window.cols))
    beyond = None if tile.beyond is None else tile.beyond[inner]
    return labels, with_beyond(component_sums(names, len(labels), grey), names, beyond)
