"""The phases in a row, from a raster to its block map and to refined tiles: read this first.

stretch  -> measured: cells and contrast   (one pass over all tiles)
         -> divided: R where it is wanted  (the tiles with such blocks)
         -> in_range: leaves               (on the block map alone)
         -> refined: a tile of pixels      (one pass over all tiles)
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.parallel import Map, Progress, serial
from uavseg.raster.dataset import Dataset
from uavseg.raster.stretch import Stretch
from uavseg.raster.tiling import BLOCK, CELL, Window
from uavseg.segmentation.blockmap import BlockMap, cell_sums, undecided
from uavseg.segmentation.division import block_ratios
from uavseg.segmentation.refinement import REACH, scan, smooth
from uavseg.segmentation.segments import IntensityRange
from uavseg.segmentation.texture import GREYS, contrast_cuts, contrast_histogram

Method = Literal["paper", "adaptive"]
Refinement = Literal["none", "scan", "smooth"]


@dataclass(frozen=True, slots=True)
class SegmentParams:
    """How to segment.

    Parameters
    ----------
    method : {"adaptive", "paper"}
        Whether blocks are divided by intensity too, or by texture alone.
    threshold : float
        X, at least 0: a block is divided where R = G_max / G_min is larger.
    intensity_step : float
        Tau, 0 to 1: the adaptive method also divides where the means of the children differ by more.
    refine : {"scan", "none", "smooth"}
        How boundaries are found to the pixel.

    Raises
    ------
    ParameterError
        If one of them is not what it may be.
    """

    method: Method = "adaptive"
    threshold: float = 1.2
    intensity_step: float = 0.05
    refine: Refinement = "scan"

    def __post_init__(self) -> None:
        if self.method not in ("paper", "adaptive"):
            raise ParameterError(f"a method is paper or adaptive, not {self.method!r}")
        if self.refine not in ("none", "scan", "smooth"):
            raise ParameterError(f"a refinement is none, scan or smooth, not {self.refine!r}")
        if not self.threshold >= 0:
            raise ParameterError(f"the threshold X of the division is at least 0, not {self.threshold:g}")
        if not 0 <= self.intensity_step <= 1:
            raise ParameterError(f"an intensity step lies in 0..1, not {self.intensity_step:g}")

    @property
    def step(self) -> float:
        """Tau as it is applied: infinite where the method has no intensity test."""
        return self.intensity_step if self.method == "adaptive" else inf


@dataclass(frozen=True, slots=True)
class GreyTile:
    """Grey of a window with a margin; what lies outside the raster is invalid.

    Parameters
    ----------
    grey : (M + 2 m, N + 2 m) uint16 array
        0 where invalid; M and N are the window's sides, rounded up to whole blocks.
    valid : (M + 2 m, N + 2 m) uint8 array
    every : bool
        Whether all of it is valid.
    """

    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]
    every: bool


@dataclass(frozen=True)
class GreySource:
    """A dataset seen through a stretch."""

    dataset: Dataset
    stretch: Stretch

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.dataset.geobox.shape

    def read(self, window: Window, margin: int) -> GreyTile:
        """The grey of a window with `margin` pixels more on every side."""
        shape = (_whole(window.rows) + 2 * margin, _whole(window.cols) + 2 * margin)
        part = window.grown(margin).clipped(self.shape)
        values, known = self.dataset.read(part)
        pixels = self.stretch.apply(values, known)
        if part.rows == shape[0] and part.cols == shape[1]:
            whole = np.ones(shape, np.uint8) if known is None else known.view(np.uint8)
            return GreyTile(np.ascontiguousarray(pixels), np.ascontiguousarray(whole), known is None)
        grey, valid = np.zeros(shape, np.uint16), np.zeros(shape, np.uint8)
        place = Window(part.row - window.row + margin, part.col - window.col + margin, part.rows, part.cols)
        grey[place.slices] = pixels
        valid[place.slices] = 1 if known is None else known
        return GreyTile(grey, valid, False)


@dataclass(frozen=True)
class Measured:
    """What one pass over the raster tells: the block map's cells, and the cuts of contrast."""

    blocks: BlockMap
    cuts: NDArray[np.int32] = field(repr=False)


def block_map(
    source: GreySource,
    windows: Sequence[Window],
    map: Map = serial,
    progress: Progress | None = None,
) -> BlockMap:
    """The whole block map of a raster: sums and counts of its cells, R of all its blocks.

    Parameters
    ----------
    source : GreySource
    windows : sequence of Window
        Tiles that cover the raster, see `raster.tiling.tiles`.
    map : Map
        Who runs the work.
    progress : callable, optional
    """
    parts = [None, None] if progress is None else stages(progress, 2)
    measured = measure(source, windows, map, parts[0])
    everywhere = _any_valid(measured.blocks)
    divide(source, measured, everywhere, windows, map, parts[1])
    return measured.blocks


def block_map_for(
    source: GreySource,
    interval: IntensityRange,
    params: SegmentParams,
    windows: Sequence[Window],
    map: Map = serial,
    progress: Progress | None = None,
) -> BlockMap:
    """A block map that answers one range exactly: R is known where the range does not decide by itself."""
    parts = [None, None] if progress is None else stages(progress, 2)
    measured = measure(source, windows, map, parts[0])
    wanted = undecided(measured.blocks, interval.low, interval.high, params.step)
    divide(source, measured, wanted, windows, map, parts[1])
    return measured.blocks


def measure(
    source: GreySource,
    windows: Sequence[Window],
    map: Map,
    progress: Progress | None = None,
) -> Measured:
    """Sums and counts of all cells, and the cuts of contrast over the whole raster."""
    blocks = BlockMap.empty(source.shape)
    histogram = np.zeros(GREYS, np.int64)
    for window, found in zip(windows, map(partial(_measure_tile, source), windows, progress), strict=True):
        if found is None:
            continue
        sums, counts, contrasts = found
        cells = window_cells(window)
        blocks.sums[cells], blocks.counts[cells] = sums, counts
        histogram += contrasts
    return Measured(blocks, contrast_cuts(histogram))


def divide(
    source: GreySource,
    measured: Measured,
    wanted: NDArray[np.bool_],
    windows: Sequence[Window],
    map: Map,
    progress: Progress | None = None,
) -> None:
    """Fill in R of the blocks that are wanted, a (B, C) bool array."""
    jobs = [job for window in windows if (job := _blocks_in(window, wanted)) is not None]
    tile_ratios = partial(_divide_tile, source, measured.cuts)
    for (window, corners), ratios in zip(jobs, map(tile_ratios, jobs, progress), strict=True):
        rows = (corners[:, 0] + window.row) // BLOCK
        measured.blocks.ratios[rows, (corners[:, 1] + window.col) // BLOCK] = ratios


def refined(
    source: GreySource,
    inside: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    window: Window,
) -> tuple[NDArray[np.uint8], GreyTile] | None:
    """A tile's pixels in regions.

    Parameters
    ----------
    inside : (m, n) uint8 array
        Cells of the window grown by REACH on every side; 1 where the leaf is in range, 0 outside the raster.

    Returns
    -------
    pixels : (M + 2 REACH, N + 2 REACH) uint8 array
        1 in regions; exact on the window and a pixel around it.
    tile : GreyTile
        Grey of the same pixels; None in place of both where nothing is in range.
    """
    if not inside.any():
        return None
    tile = source.read(window, REACH)
    pixels = inside.repeat(CELL, axis=0).repeat(CELL, axis=1) & tile.valid
    if refine == "scan" and not inside.all():
        low, high = interval.greys
        matching = ((tile.grey >= low) & (tile.grey <= high)).view(np.uint8) & tile.valid
        scan(pixels, tile.valid, matching)
    elif refine == "smooth" and not inside.all():
        pixels = smooth(pixels, tile.valid, tile.grey, interval.low, interval.high)
    return pixels, tile


def cells_around(inside: NDArray[np.uint8], window: Window) -> NDArray[np.uint8]:
    """Cells of a window grown by REACH; 0 outside the raster."""
    margin = REACH // CELL
    rows, cols = _whole(window.rows) // CELL, _whole(window.cols) // CELL
    around = np.zeros((rows + 2 * margin, cols + 2 * margin), np.uint8)
    first = Window(window.row // CELL - margin, window.col // CELL - margin, *around.shape)
    part = first.clipped(inside.shape)
    place = Window(part.row - first.row, part.col - first.col, part.rows, part.cols)
    around[place.slices] = inside[part.slices]
    return around


def stages(progress: Progress, count: int) -> list[Progress]:
    """One progress for each of several stages, which together make the given one."""

    def stage(k: int, done: int, total: int) -> None:
        progress(k * total + done, count * total)

    return [partial(stage, k) for k in range(count)]


def _measure_tile(
    source: GreySource, window: Window
) -> tuple[NDArray[np.uint32], NDArray[np.uint8], NDArray[np.int64]] | None:
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, 1)
    sums, counts = cell_sums(tile.grey, tile.valid, margin=1)
    return sums, counts, contrast_histogram(tile.grey, None if tile.every else tile.valid)


def _divide_tile(
    source: GreySource, cuts: NDArray[np.int32], job: tuple[Window, NDArray[np.int64]]
) -> NDArray[np.float64]:
    window, corners = job
    tile = source.read(window, 1)
    return block_ratios(tile.grey, None if tile.every else tile.valid, cuts, corners)


def _blocks_in(window: Window, wanted: NDArray[np.bool_]) -> tuple[Window, NDArray[np.int64]] | None:
    """The smallest part of a window with all its wanted blocks, and where they begin in it."""
    top, left = window.row // BLOCK, window.col // BLOCK
    here = wanted[
        top : -(-(window.row + window.rows) // BLOCK), left : -(-(window.col + window.cols) // BLOCK)
    ]
    rows, cols = np.nonzero(here)
    if len(rows) == 0:
        return None
    first_row, first_col = rows.min(), cols.min()
    part = Window(
        window.row + int(first_row) * BLOCK,
        window.col + int(first_col) * BLOCK,
        int(rows.max() - first_row + 1) * BLOCK,
        int(cols.max() - first_col + 1) * BLOCK,
    )
    return part, np.stack([rows - first_row, cols - first_col], axis=1) * BLOCK


def window_cells(window: Window) -> tuple[slice, slice]:
    """A window's cells in the block map, to the end of its last blocks."""
    return Window(
        window.row // CELL, window.col // CELL, _whole(window.rows) // CELL, _whole(window.cols) // CELL
    ).slices


def _any_valid(blocks: BlockMap) -> NDArray[np.bool_]:
    rows, cols = blocks.blocks
    return np.asarray(blocks.counts.reshape(rows, 8, cols, 8).any(axis=(1, 3)))


def _whole(length: int) -> int:
    return -(-length // BLOCK) * BLOCK
