"""Regions of an intensity range: outlined tile by tile and stitched, summed, counted or estimated."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, sample_positions, window_cells
from uavseg.regions.outline.rings import EdgeTable, RegionOutlines, edge_tables
from uavseg.regions.outline.stitch import TileOutlines, TileStitcher, outline_tile
from uavseg.segmentation import components
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.components import label_components, label_equal_values
from uavseg.segmentation.params.segment import IntensityRange, Refinement
from uavseg.segmentation.pipeline import refine_tile
from uavseg.segmentation.refine.detail import MARGIN, Detail, ThinLines, apply_detail, find_thin_lines
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import BLOCK, GREY_LEVELS

PART_SIDE = 16 * BLOCK  # of a part of the raster for estimates, in pixels
_PARTS = 5  # along each side of the raster, at most

Refined = tuple[NDArray[np.uint8], GreyTile]


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

    `cells`, (m, n), are bit flags from `pipeline.cells_to_refine`. With the refinement "none", leaves that
    share an edge are one region also where invalid pixels separate their pixels. `expected` are the sums and
    counts that cells must have, if the block map was made earlier, see `check_sums`. Structures narrower than
    a `detail` are removed after refinement, or thin lines are added; not with "none".
    """
    jobs = tile_jobs(cells, tile_pass.windows, expected, detail)
    tiles = tile_pass.run(partial(outline, source, interval, refine, detail), jobs)
    return TileStitcher(source.shape, tile_pass.windows, tiles).finish(cells if refine == "none" else None)


@dataclass(frozen=True, slots=True)
class TileJob:
    """Tile, its cells with those around it, and the sums and counts that its cells must have."""

    window: Window
    cells: NDArray[np.uint8]
    expected: tuple[NDArray[np.uint32], NDArray[np.uint8]] | None
    refined: Window  # the tile, grown by the halo of a detail


def tile_jobs(
    cells: NDArray[np.uint8],
    windows: Sequence[Window],
    expected: BlockMap | None = None,
    detail: Detail | ThinLines | None = None,
    part: Window | None = None,
) -> LazySequence[TileJob]:
    """Return the input of the refinement of each tile; parameters as of `outline_regions`.

    `part` is the window of the raster to which the cells belong, by default all of it.
    """
    halo = detail.halo if detail else 0
    whole = part or Window(0, 0, 0, 0)

    def job(k: int) -> TileJob:
        refined, here = windows[k].grown(halo), window_cells(windows[k])
        return TileJob(
            window=windows[k],
            cells=cells_around(cells, refined.relative_to(whole), REFINE_HALO),
            expected=None if expected is None else (expected.sums[here], expected.counts[here]),
            refined=refined,
        )

    return LazySequence(len(windows), job)


def outline(
    source: GreySource,
    interval: IntensityRange,
    refine: Refinement,
    detail: Detail | ThinLines | None,
    job: TileJob,
) -> TileOutlines | None:
    """Refine and outline a tile; parameters as of `outline_regions`."""
    refined = refine_tile(source, job.cells, interval, refine, job.refined)
    if isinstance(detail, ThinLines):
        refined = _with_thin_lines(source, refined, interval, job.window)
    if refined is None:
        return None
    pixels, tile = with_detail(*refined, detail) if isinstance(detail, Detail) else refined
    check_sums(source, job, tile)
    return outline_tile(pixels, *label_components(pixels, REFINE_HALO), tile, job.window, source.shape[1])


def with_detail(pixels: NDArray[np.uint8], tile: GreyTile, detail: Detail) -> Refined:
    """Remove narrow structures from a refined tile, and crop the halo that this takes.

    `pixels`, (M + 2 m, N + 2 m), are the class of each pixel of `tile`, exact on the tile grown by
    `detail.halo` and one pixel more.
    """
    halo = detail.halo
    inner = np.s_[halo : pixels.shape[0] - halo, halo : pixels.shape[1] - halo]
    return np.ascontiguousarray(apply_detail(pixels, tile.valid, detail)[inner]), tile.cropped(halo)


def _with_thin_lines(
    source: GreySource, refined: Refined | None, interval: IntensityRange, window: Window
) -> Refined | None:
    """Add thin lines to a tile from `refine_tile`; None for an empty tile."""
    if refined is None:
        if source.dataset.is_empty(window.grown(REFINE_HALO).clipped(source.shape)):
            return None
        tile = source.read(window, REFINE_HALO, excess=True)
        refined = np.zeros(tile.grey.shape, np.uint8), tile
    pixels, tile = refined
    inner = np.s_[REFINE_HALO - MARGIN : MARGIN - REFINE_HALO, REFINE_HALO - MARGIN : MARGIN - REFINE_HALO]
    pixels[inner] |= find_thin_lines(tile.grey, tile.valid, interval.greys, REFINE_HALO)
    return pixels, tile


def check_sums(source: GreySource, job: TileJob, tile: GreyTile) -> None:
    """Refuse a tile, with halo, whose cells have other sums or counts than its job expects (RasterError)."""
    if job.expected is None:
        return
    sums, counts = cell_sums(tile.grey, tile.valid, REFINE_HALO)
    change = np.abs(sums.astype(np.int64) - job.expected[0])
    # Range bounds that are compared with intensities move a pixel by one grey at most.
    tolerance = counts if source.stretch.borders else 0
    if (counts != job.expected[1]).any() or (change > tolerance).any():
        raise RasterError(
            f"{source.dataset.source} is not as it was when its block map was made; make the block map again "
            "with uavseg divide, or give --refine none"
        )


def sum_regions(source: GreySource, outlined: RegionOutlines, tile_pass: TilePass) -> components.Sums:
    """Sum each region over all valid pixels that its outlines enclose, read again from the raster.

    The contrast across borders, and the similarity to classes, stay as they were.
    """
    sums = outlined.sums
    greys, squares = np.zeros_like(sums.greys), np.zeros_like(sums.squares)
    counts, excess = np.zeros_like(sums.counts), np.zeros_like(sums.counts)
    jobs = edge_tables(outlined.rings, tile_pass.windows)
    for labels, parts in tile_pass.silent.run(partial(_sum_tile, source), jobs):
        if parts is not None:
            counts[labels - 1] += parts.counts
            greys[labels - 1] += parts.greys
            squares[labels - 1] += parts.squares
            if parts.excess is not None:
                excess[labels - 1] += parts.excess
    return replace(sums, counts=counts, greys=greys, squares=squares, excess=excess if excess.any() else None)


def _sum_tile(source: GreySource, edges: EdgeTable) -> tuple[NDArray[np.int64], components.Sums | None]:
    """Return the labels in a tile, and the sums of each over its valid pixels; None without labels."""
    window, image = edges.window, edges.rasterise()
    present = np.zeros(int(image.max()) + 1, bool)
    present[image] = True
    present[0] = False
    labels = np.flatnonzero(present)
    if len(labels) == 0:
        return labels, None
    tile = source.read(window, 0, excess=True)
    inner = (slice(window.rows), slice(window.cols))
    names = np.cumsum(present, dtype=np.uint32)[image]
    names[tile.valid[inner] == 0] = 0
    sums = components.component_sums(names, len(labels), np.ascontiguousarray(tile.grey[inner]))
    return labels, components.with_excess(sums, names, None if tile.excess is None else tile.excess[inner])


def estimate_regions(
    source: GreySource,
    cells: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    tile_pass: TilePass,
) -> tuple[int, float]:
    """Estimate the number of regions of `outline_regions`, and their share of the valid pixels.

    A ratio estimate: regions of leaves are counted over the whole raster, and multiplied by what refinement
    makes of their number in 5 x 5 evenly spaced parts of 1024 x 1024 pixels. Where no leaf of these parts is
    in range, their number per pixel is used. The share is that in these parts. `cells`, (m, n), are 1 where
    the leaf of a cell is in range, from `leaves.cells_in_range`. Of `tile_pass`, the executor and the
    progress are used.
    """
    whole = int(label_equal_values(cells)[1]) if cells.any() else 0
    count_part = partial(_count_part, source, cells, interval, refine)
    counted = list(tile_pass.run(count_part, sample_parts(source.shape)))
    of_cells, refined, inside, valid = (int(sum(counts)) for counts in zip(*counted, strict=True))
    share = inside / max(valid, 1)
    if of_cells:
        return max(round(whole * refined / of_cells), 1), share
    sampled = sum(part.rows * part.cols for part in sample_parts(source.shape))
    return round(refined * math.prod(source.shape) / sampled), share


def count_greys(source: GreySource, tile_pass: TilePass, exact: bool = True) -> NDArray[np.int64]:
    """Count valid pixels by grey, (65536,) int64: all, or if not `exact` those of `sample_parts`."""
    counts = np.zeros(GREY_LEVELS, np.int64)
    for part in tile_pass.run(partial(_count_greys, source), None if exact else sample_parts(source.shape)):
        counts += part
    return counts


def count_pixels(source: GreySource, table: NDArray[np.uint8], tile_pass: TilePass) -> NDArray[np.int64]:
    """Count the valid pixels of each class by their intensity, (256,) int64.

    `table`, (65536,), is the class of each grey, see `Partition.grey_table`.
    """
    return np.bincount(table, count_greys(source, tile_pass), 256).astype(np.int64)


def has_thin_lines(source: GreySource, interval: IntensityRange, tile_pass: TilePass) -> bool:
    """Check whether there are thin lines in the `sample_parts` of a raster."""
    parts = tile_pass.run(partial(_has_lines, source, interval), sample_parts(source.shape))
    return any(list(parts))


def sample_parts(shape: tuple[int, int]) -> list[Window]:
    """Return evenly spaced parts of a raster, none adjacent where it is large enough."""
    blocks = [-(-length // PART_SIDE) for length in shape]
    rows, cols = (sample_positions(0, count, min(count, _PARTS)).tolist() for count in blocks)
    corners = [(row * PART_SIDE, col * PART_SIDE) for row in rows for col in cols]
    return [Window(row, col, PART_SIDE, PART_SIDE).clipped(shape) for row, col in corners]


def _count_greys(source: GreySource, window: Window) -> NDArray[np.int64]:
    if source.dataset.is_empty(window):
        return np.zeros(GREY_LEVELS, np.int64)
    tile = source.read(window, 0)
    return np.bincount(tile.grey[tile.valid > 0], minlength=GREY_LEVELS)


def _has_lines(source: GreySource, interval: IntensityRange, window: Window) -> bool:
    lines = _with_thin_lines(source, None, interval, window)
    return lines is not None and bool(lines[0][REFINE_HALO:-REFINE_HALO, REFINE_HALO:-REFINE_HALO].any())


def _count_part(
    source: GreySource, cells: NDArray[np.uint8], interval: IntensityRange, refine: Refinement, window: Window
) -> tuple[int, int, int, int]:
    """Count in a part: regions of cells, regions after refinement, their pixels, all valid pixels."""
    here = np.ascontiguousarray(cells[window_cells(window)])
    refined = refine_tile(source, cells_around(cells, window, REFINE_HALO), interval, refine, window)
    if refined is None:
        return 0, 0, 0, int(np.count_nonzero(source.read(window, 0).valid))
    pixels, tile = refined
    core = np.s_[REFINE_HALO:-REFINE_HALO, REFINE_HALO:-REFINE_HALO]
    inside, valid = (int(np.count_nonzero(image[core])) for image in (pixels, tile.valid))
    return label_equal_values(here)[1], label_components(pixels, REFINE_HALO)[1], inside, valid
