"""LiveSegmentation: the segments of a map that changes, blocks divided again where it does.

What a block gives depends on its own cells, on the pixels one beyond its edge, where texture looks, and on
the cuts of contrast; these are fitted once and stay until they are asked for again. So after any changes the
segments are those of the whole map segmented afresh with the same cuts.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.occupancy.mapping.grey_map import Ground, Mask
from uavseg.occupancy.mapping.live_blocks import Places, decide, undecided_at
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.division import block_ratios, selected_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.intervals import IntensityRange, Intervals, StateLimits
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.pipeline import LeafQuery
from uavseg.units import BLOCK, CELL, GREY_MAX

MOST_INTERVALS = 255


class LiveSegmentation:
    """The segments of a map as it is now, at the edges of blocks.

    Parameters
    ----------
    ground : Ground
        Of the map.
    cut : StateLimits, IntensityRange or Levels
        What is asked of the segments; the paper's states if left out.
    params : SegmentParams
        The paper's method if left out. Pixels are not refined.

    Attributes
    ----------
    cuts : (7,) int32 array
        Of the contrast; fitted when the segmentation began and by `refit`.

    Raises
    ------
    ParameterError
        If there are more than 255 intervals.
    """

    def __init__(
        self, ground: Ground, cut: Intervals | None = None, params: SegmentParams | None = None
    ) -> None:
        self.cut = StateLimits() if cut is None else cut
        self.params = SegmentParams(method="paper") if params is None else params
        self._question = LeafQuery(self.cut.edges, self.params.division)
        if len(self.cut.edges) >= MOST_INTERVALS:
            raise ParameterError(
                f"a live segmentation has at most {MOST_INTERVALS} intervals, not {len(self.cut.edges) + 1}; "
                "give a larger width"
            )
        self._ground = ground
        self._watch = ground.watch()
        ratios = BlockMap.empty(ground.shape).ratios
        self._blocks = BlockMap(ground.shape, ground.sums, ground.counts, ratios)
        self._open = np.zeros(self._blocks.blocks, np.uint32)
        cells = self._blocks.counts.shape
        self._leaves = (np.zeros(cells, np.uint8), np.zeros(cells))
        self._intervals = np.zeros(cells, np.uint8)
        self._every = self._blocks.ratios.copy()
        self._stale = np.ones(self._blocks.blocks, bool)
        self._inner = _inner_blocks(ground.shape)
        self.refit()

    @property
    def intervals(self) -> NDArray[np.uint8]:
        """In which interval of the cut the leaf of each 8 x 8 pixels lies, counted from 1.

        Of states that is 1 free, 2 unknown, 3 occupied; of a range 1 below, 2 inside, 3 above it. Where a
        cell lies beyond the map it is 0.

        Returns
        -------
        intervals : (8 B, 8 C) uint8 array
            Not to be written to; later updates show in it.
        """
        self.settle()
        shown = self._intervals.view()
        shown.flags.writeable = False
        return shown

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Cells of the leaves whose mean lies in the range that was asked for.

        Raises
        ------
        ParameterError
            If something other than a range was asked for.
        """
        if not isinstance(self.cut, IntensityRange):
            raise ParameterError(f"only a range has an inside; this segmentation was asked for {self.cut}")
        return np.asarray(self.intervals == 2)

    def agreeing(self, interval: int) -> Mask:
        """Pixels whose leaf lies in an interval, and their own v as well: what a path may pass, say.

        Walls thinner than a block lie in leaves whose mean is free; no pixel of such a wall is among these.

        Parameters
        ----------
        interval : int
            As of `intervals`: 1 for free.

        Returns
        -------
        agreeing : (rows, cols) bool array

        Raises
        ------
        ParameterError
            If there is no such interval.
        """
        if not 1 <= interval <= len(self.cut.edges) + 1:
            raise ParameterError(f"intervals are 1 to {len(self.cut.edges) + 1} here, not {interval}")
        v = np.arange(1 << 16) / GREY_MAX
        within = np.flatnonzero(np.searchsorted(self.cut.edges, v) == interval - 1)
        low, high = (int(within[0]), int(within[-1])) if len(within) else (1, 0)
        rows, cols = self._ground.shape
        leaves = (self.intervals == interval).view(np.uint8)
        grey = self._ground.grey[1 : rows + 1, 1 : cols + 1]
        shown = leaves.repeat(CELL, 0).repeat(CELL, 1)[:rows, :cols].view(bool)
        return np.asarray(shown & (grey >= low) & (grey <= high))

    def block_map(self) -> BlockMap:
        """The block map with every R, from which any other question is answered as well.

        R are measured of those blocks that have changed since the last time.
        """
        self.settle()
        places = _places(self._stale)
        for some, valid in self._by_validity(places):
            ratios = block_ratios(self._ground.grey, valid, self.cuts, some * BLOCK)
            self._every[some[:, 0], some[:, 1]] = ratios
        self._stale[:] = False
        found = self._blocks
        return BlockMap(found.shape, found.sums.copy(), found.counts.copy(), self._every.copy())

    def refit(self) -> None:
        """Fit the cuts of contrast to the whole map as it is now, and divide every block again."""
        self.cuts = contrast_bin_edges(contrast_histogram(self._ground.grey, self._ground.valid))
        self._ground.hand_out()
        self._watch.taken()
        self._settle(*np.ones((2, *self._stale.shape), bool))

    def settle(self) -> Mask:
        """Divide again what has changed since the last time.

        Returns
        -------
        blocks : (B, C) bool array
            The blocks that were measured or divided again.
        """
        self._ground.hand_out()
        own, near = self._watch.taken()
        if near.any():
            self._settle(own, near)
        return near

    def _settle(self, own: Mask, near: Mask) -> None:
        """Divide blocks again whose grey has changed, or the texture at their edges."""
        self._stale |= near
        self._measure(own)
        divided = near & (self._open > 0)
        self._divide(divided)
        question = self._question
        places = _places(own | divided)
        division = question.division
        where = (question.edges, division.threshold, division.step, places, self._open[tuple(places.T)])
        decide(self._blocks, *where, self._leaves, self._intervals)

    def _measure(self, changed: Mask) -> None:
        """Which R the cells of blocks leave open, now that these have changed."""
        places = _places(changed)
        rows, cols = places.T
        question = self._question
        self._open[rows, cols] = undecided_at(self._blocks, question.edges, question.division.step, places)
        self._blocks.ratios[rows, cols] = 0

    def _divide(self, divided: Mask) -> None:
        """R of blocks, where they are open."""
        for some, valid in self._by_validity(_places(divided)):
            rows, cols = some.T
            self._blocks.ratios[rows, cols] = selected_ratios(
                self._ground.grey,
                valid,
                self.cuts,
                some * BLOCK,
                self._open[rows, cols],
                self.params.threshold,
            )

    def _by_validity(self, places: Places) -> Iterator[tuple[Places, NDArray[np.uint8] | None]]:
        """Blocks whose pixels all count, and blocks at the edge of the map, of which `valid` tells."""
        inner = self._inner[places[:, 0], places[:, 1]]
        for some, valid in ((places[inner], None), (places[~inner], self._ground.valid)):
            if len(some):
                yield some, valid


def _places(blocks: Mask) -> Places:
    """Row and column of the blocks that are set."""
    return np.ascontiguousarray(np.argwhere(blocks))


def _inner_blocks(shape: tuple[int, int]) -> Mask:
    """Blocks all whose pixels have eight neighbours in the map."""
    rows, cols = (np.arange(0, length, BLOCK) for length in shape)
    inner_rows = (rows > 0) & (rows + BLOCK < shape[0])
    inner_cols = (cols > 0) & (cols + BLOCK < shape[1])
    return np.asarray(inner_rows[:, np.newaxis] & inner_cols)
