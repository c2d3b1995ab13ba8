"""The phases in a row, from a raster to its block map and to refined tiles: read this first.

stretch  -> measured: cells and contrast   (one pass over all tiles)
         -> divided: R where it is wanted  (the tiles with such blocks)
         -> cells_to_refine: leaves        (on the block map alone)
         -> refined: a tile of pixels      (one pass over all tiles)
"""

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tile_pass import TilePass
from uavseg.raster.tiling import Window, window_blocks, window_cells
from uavseg.segmentation.blocks.block_cache import SIDE, Patches
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums, undecided
from uavseg.segmentation.blocks.division import EVERY, block_ratios, wanted_ratios
from uavseg.segmentation.blocks.lbp import contrast_cuts, contrast_histogram
from uavseg.segmentation.blocks.leaves import in_range, matching, pixels_of
from uavseg.segmentation.blocks.mixed_cells import unsettled
from uavseg.segmentation.intervals import Cut, IntensityRange
from uavseg.segmentation.params import Refinement, SegmentParams
from uavseg.segmentation.refine.range_scans import REACH, scan, smooth
from uavseg.segmentation.refine.tv import denoised
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import BLOCK, GREY_LEVELS

IN_RANGE, UNSETTLED = np.uint8(1), np.uint8(2)


@dataclass(frozen=True)
class Measured:
    """What one pass over the raster tells: the block map's cells, and the cuts of contrast."""

    blocks: BlockMap
    cuts: NDArray[np.int32] = field(repr=False)


def block_map(
    source: GreySource,
    tile_pass: TilePass,
) -> BlockMap:
    """The whole block map of a raster: sums and counts of its cells, R of all its blocks.

    Parameters
    ----------
    source : GreySource
    tile_pass : TilePass
        Tiles that cover the raster, the executor and the progress.
    """
    measuring, dividing = tile_pass.stages(2)
    measured = measure(source, measuring)
    everywhere = np.where(_any_valid(measured.blocks), EVERY, np.uint32(0))
    divide(source, measured, everywhere, dividing)
    return measured.blocks


def block_map_for(
    source: GreySource,
    cut: Cut,
    params: SegmentParams,
    tile_pass: TilePass,
) -> BlockMap:
    """A block map that answers one range, states or levels exactly.

    R is known where the cells of a block do not decide by themselves in which interval its leaves lie.

    Parameters
    ----------
    source : GreySource
    cut : IntensityRange, StateLimits or Levels
    params : SegmentParams
    tile_pass : TilePass
    """
    measuring, dividing = tile_pass.stages(2)
    question = Question(cut.edges, params.step, params.threshold)
    measured = measure(source, measuring, question)
    wanted = question.open_in(measured.blocks.sums, measured.blocks.counts)
    divide(source, measured, wanted, dividing, question)
    return measured.blocks


@dataclass(frozen=True)
class Question:
    """What is asked of a raster, as far as it says which blocks are looked at; and what is kept of them."""

    edges: tuple[float, ...]
    step: float
    threshold: float
    patches: Patches = field(default_factory=Patches, repr=False, compare=False)

    def open_in(self, sums: NDArray[np.uint32], counts: NDArray[np.uint8]) -> NDArray[np.uint32]:
        """Which R the cells leave open, see `blockmap.undecided`."""
        return undecided(sums, counts, self.edges, self.step)


@dataclass(frozen=True)
class _InPassing:
    """A question whose blocks are kept while cells are measured; what is measured does not depend on it."""

    question: Question | None

    def fingerprint(self) -> tuple[()]:
        """Nothing, so that cells that were measured serve every question, see `resuming`."""
        return ()

    def keep(
        self, window: Window, tile: GreyTile, sums: NDArray[np.uint32], counts: NDArray[np.uint8]
    ) -> None:
        """Keep the blocks of a tile that the question will look at."""
        if self.question is not None:
            self.question.patches.put(window, tile, _corners(self.question.open_in(sums, counts)))


def measure(
    source: GreySource,
    tile_pass: TilePass,
    question: Question | None = None,
) -> Measured:
    """Sums and counts of all cells, and the cuts of contrast over the whole raster."""
    blocks = BlockMap.empty(source.shape)
    histogram = np.zeros(GREY_LEVELS, np.int64)
    measure_tile = partial(_measure_tile, source, _InPassing(question))
    for window, found in zip(tile_pass.windows, tile_pass.run(measure_tile), strict=True):
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
    wanted: NDArray[np.uint32],
    tile_pass: TilePass,
    question: Question | None = None,
) -> None:
    """Fill in the R whose bits are set in `wanted`, (B, C); what a question does not come to need stays 0."""
    jobs = [(window, here) for window in tile_pass.windows if (here := wanted[window_blocks(window)]).any()]
    divide_tile = partial(_divide_tile, source, measured.cuts, question)
    for (window, bits), ratios in zip(jobs, tile_pass.run(divide_tile, jobs), strict=True):
        rows, cols = np.nonzero(bits)
        measured.blocks.ratios[rows + window.row // BLOCK, cols + window.col // BLOCK] = ratios


def cells_to_refine(blocks: BlockMap, interval: IntensityRange, params: SegmentParams) -> NDArray[np.uint8]:
    """What the block map says of each cell: 1 where its leaf is in range, 2 more where its pixels are to be
    decided one by one (with total variation).
    """
    cells = in_range(blocks, interval, params.threshold, params.step)
    if params.refine == "tv":
        cells |= UNSETTLED * unsettled(blocks, cells, interval.low, interval.high)
    return cells


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
        Cells of the window grown by REACH on every side, from `cells_to_refine`; 0 outside the raster.

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
    pixels = pixels_of(inside & IN_RANGE, tile.valid)
    if refine == "scan" and not inside.all():
        scan(pixels, tile.valid, matching(tile.grey, tile.valid, *interval.greys))
    elif refine == "smooth" and not inside.all():
        pixels = smooth(pixels, tile.valid, tile.grey, interval.low, interval.high)
    elif refine == "tv":
        fits = matching(tile.grey, tile.valid, *interval.greys)
        denoised(pixels, inside & UNSETTLED, tile.valid, tile.grey, fits, interval.greys)
    return pixels, tile


def _measure_tile(
    source: GreySource, in_passing: _InPassing, window: Window
) -> tuple[NDArray[np.uint32], NDArray[np.uint8], NDArray[np.int64]] | None:
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, 1)
    sums, counts = cell_sums(tile.grey, tile.valid, margin=1)
    in_passing.keep(window, tile, sums, counts)
    return sums, counts, contrast_histogram(tile.grey, None if tile.every else tile.valid)


def _divide_tile(
    source: GreySource,
    cuts: NDArray[np.int32],
    question: Question | None,
    job: tuple[Window, NDArray[np.uint32]],
) -> NDArray[np.float64]:
    window, bits = job
    corners = _corners(bits)
    patch = None if question is None else question.patches.take(window)
    if patch is not None:
        grey, valid = patch.grey, patch.valid
        corners = np.stack([np.arange(len(corners)) * SIDE, np.zeros(len(corners), np.int64)], axis=1)
    else:
        part = _around(window, corners)
        tile = source.read(part, 1)
        grey, valid = tile.grey, None if tile.every else tile.valid
        corners = corners - (part.row - window.row, part.col - window.col)
    if question is None:
        return block_ratios(grey, valid, cuts, corners)
    return wanted_ratios(grey, valid, cuts, corners, bits[bits > 0], question.threshold)


def _corners(bits: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Where the blocks begin of which anything is wanted."""
    return np.stack(np.nonzero(bits), axis=1) * BLOCK


def _around(window: Window, corners: NDArray[np.int64]) -> Window:
    """The smallest part of a window with all the blocks that begin at `corners`."""
    row, col = (int(first) for first in corners.min(axis=0))
    end_row, end_col = (int(last) + BLOCK for last in corners.max(axis=0))
    return Window(window.row + row, window.col + col, end_row - row, end_col - col)


def _any_valid(blocks: BlockMap) -> NDArray[np.bool_]:
    rows, cols = blocks.blocks
    return np.asarray(blocks.counts.reshape(rows, 8, cols, 8).any(axis=(1, 3)))
