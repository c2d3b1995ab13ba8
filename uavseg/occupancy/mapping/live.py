"""Incremental segmentation of a map that changes: only blocks that a change affects are divided again.

The result of a block depends on its own cells, on the pixels one beyond its edge, which the texture reads,
and on the contrast bin edges, which are fitted once and stay until `refit`. So after any changes the segments
are those of the whole map segmented from scratch with the same bin edges.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.occupancy.mapping.grey_map import GreyMap, Mask
from uavseg.occupancy.mapping.live_blocks import BlockIndices, classify_leaves, required_ratios_at
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.division import block_ratios, selected_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.params.segment import IntensityRange, Intervals, SegmentParams, StateLimits
from uavseg.segmentation.pipeline import LeafQuery
from uavseg.units import BLOCK, CELL, GREY_MAX

MAX_INTERVALS = 255


class LiveSegmentation:
    """The segments of a map as it is now, with boundaries at the edges of cells of 8 x 8 pixels.

    Parameters
    ----------
    grey_map : GreyMap
        Of the map.
    partition : StateLimits, IntensityRange or Levels, optional
        Intervals of v by which the segments are classified; by default the paper's states.
    params : SegmentParams, optional
        By default the paper's method. Pixels are not refined.

    Attributes
    ----------
    bin_edges : (7,) int32 array
        Of the contrast histogram; fitted when the segmentation is made and by `refit`.

    Raises
    ------
    ParameterError
        If there are more than 255 intervals.
    """

    def __init__(
        self, grey_map: GreyMap, partition: Intervals | None = None, params: SegmentParams | None = None
    ) -> None:
        self.partition = StateLimits() if partition is None else partition
        self.params = SegmentParams(method="paper") if params is None else params
        self._query = LeafQuery(self.partition.edges, self.params.division)
        count = len(self.partition.edges) + 1
        if count > MAX_INTERVALS:
            raise ParameterError(
                f"a live segmentation has at most {MAX_INTERVALS} intervals, not {count}; give a larger width"
            )
        self._grey_map = grey_map
        self._changes = grey_map.new_log()
        ratios = BlockMap.empty(grey_map.shape).ratios
        self._blocks = BlockMap(grey_map.shape, grey_map.sums, grey_map.counts, ratios)
        self._required = np.zeros(self._blocks.blocks, np.uint32)
        cells = self._blocks.counts.shape
        self._leaves = (np.zeros(cells, np.uint8), np.zeros(cells))
        self._intervals = np.zeros(cells, np.uint8)
        self._all_ratios = self._blocks.ratios.copy()
        self._stale = np.ones(self._blocks.blocks, bool)
        self._is_inner = _inner_blocks(grey_map.shape)
        self.refit()

    @property
    def intervals(self) -> NDArray[np.uint8]:
        """Interval in which the leaf of each cell of 8 x 8 pixels lies, counted from 1.

        For states: 1 free, 2 unknown, 3 occupied; for a range: 1 below, 2 inside, 3 above it. 0 where a cell
        lies beyond the map.

        Returns
        -------
        intervals : (8 B, 8 C) uint8 array
            A read-only view; later updates show in it.
        """
        self.settle()
        shown = self._intervals.view()
        shown.flags.writeable = False
        return shown

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Cells of the leaves whose mean lies in the range, an (8 B, 8 C) bool array.

        Raises
        ------
        ParameterError
            If this is not a segmentation by a range.
        """
        if not isinstance(self.partition, IntensityRange):
            raise ParameterError(f"only a range has an inside; this segmentation is by {self.partition}")
        return np.asarray(self.intervals == 2)

    def agreeing(self, interval: int) -> Mask:
        """Pixels whose leaf and whose own v both lie in an interval: the cells that a path may pass.

        Walls thinner than a block lie in leaves whose mean is free; this excludes the pixels of such walls.

        Parameters
        ----------
        interval : int
            As in `intervals`: 1 for free.

        Returns
        -------
        agreeing : (rows, cols) bool array

        Raises
        ------
        ParameterError
            If there is no such interval.
        """
        count = len(self.partition.edges) + 1
        if not 1 <= interval <= count:
            raise ParameterError(f"intervals are 1 to {count} here, not {interval}")
        v = np.arange(1 << 16) / GREY_MAX
        within = np.flatnonzero(np.searchsorted(self.partition.edges, v) == interval - 1)
        low, high = (int(within[0]), int(within[-1])) if len(within) else (1, 0)
        rows, cols = self._grey_map.shape
        leaves = (self.intervals == interval).view(np.uint8)
        grey = self._grey_map.grey[1 : rows + 1, 1 : cols + 1]
        shown = leaves.repeat(CELL, 0).repeat(CELL, 1)[:rows, :cols].view(bool)
        return np.asarray(shown & (grey >= low) & (grey <= high))

    def block_map(self) -> BlockMap:
        """The block map with every R, which answers any other question too.

        R are measured for the blocks that have changed since the last call.
        """
        self.settle()
        indices = _block_indices(self._stale)
        for part, valid in self._by_validity(indices):
            ratios = block_ratios(self._grey_map.grey, valid, self.bin_edges, part * BLOCK)
            self._all_ratios[part[:, 0], part[:, 1]] = ratios
        self._stale[:] = False
        found = self._blocks
        return BlockMap(found.shape, found.sums.copy(), found.counts.copy(), self._all_ratios.copy())

    def refit(self) -> None:
        """Fit the contrast bin edges to the whole map as it is now, and divide every block again."""
        self.bin_edges = contrast_bin_edges(contrast_histogram(self._grey_map.grey, self._grey_map.valid))
        self._grey_map.flush_changes()
        self._changes.pop()
        self._update_blocks(*np.ones((2, *self._stale.shape), bool))

    def settle(self) -> Mask:
        """Divide again the blocks that have changed since the last call.

        Returns
        -------
        blocks : (B, C) bool array
            The blocks that were measured or divided again.
        """
        self._grey_map.flush_changes()
        own, near = self._changes.pop()
        if near.any():
            self._update_blocks(own, near)
        return near

    def _update_blocks(self, own: Mask, near: Mask) -> None:
        """Divide the blocks again whose grey (`own`) or whose texture at the edges (`near`) has changed."""
        self._stale |= near
        self._find_required(own)
        divided = near & (self._required > 0)
        self._measure_ratios(divided)
        indices = _block_indices(own | divided)
        required = self._required[tuple(indices.T)]
        classify_leaves(self._blocks, self._query, indices, required, self._leaves, self._intervals)

    def _find_required(self, changed: Mask) -> None:
        """Find which R of changed blocks the query requires, and reset their R."""
        indices = _block_indices(changed)
        rows, cols = indices.T
        self._required[rows, cols] = required_ratios_at(self._blocks, self._query, indices)
        self._blocks.ratios[rows, cols] = 0

    def _measure_ratios(self, divided: Mask) -> None:
        """Measure the required R of blocks."""
        for part, valid in self._by_validity(_block_indices(divided)):
            rows, cols = part.T
            self._blocks.ratios[rows, cols] = selected_ratios(
                self._grey_map.grey,
                valid,
                self.bin_edges,
                part * BLOCK,
                self._required[rows, cols],
                self.params.threshold,
            )

    def _by_validity(self, indices: BlockIndices) -> Iterator[tuple[BlockIndices, NDArray[np.uint8] | None]]:
        """Blocks that are valid throughout (with None), and blocks at the edge of the map (with `valid`)."""
        inner = self._is_inner[indices[:, 0], indices[:, 1]]
        for part, valid in ((indices[inner], None), (indices[~inner], self._grey_map.valid)):
            if len(part):
                yield part, valid


def _block_indices(blocks: Mask) -> BlockIndices:
    """Row and column of the blocks that are set, an (n, 2) array."""
    return np.ascontiguousarray(np.argwhere(blocks))


def _inner_blocks(shape: tuple[int, int]) -> Mask:
    """Blocks in which every pixel has eight neighbours in the map."""
    rows, cols = (np.arange(0, length, BLOCK) for length in shape)
    inner_rows = (rows > 0) & (rows + BLOCK < shape[0])
    inner_cols = (cols > 0) & (cols + BLOCK < shape[1])
    return np.asarray(inner_rows[:, np.newaxis] & inner_cols)
