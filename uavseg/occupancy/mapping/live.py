"""Incremental segmentation of a map that changes: only blocks that a change affects are divided again.

The result of a block depends on its cells, on the pixels next to its edge, which the texture reads,
and on the contrast bin edges, which are fitted once and stay until `refit`. So after any changes the segments
are those of the whole map segmented from scratch with the same bin edges.
"""

from collections.abc import Iterable, Iterator, Mapping
from math import inf

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.occupancy.mapping.pending import GreyMap
from uavseg.segmentation.blocks.block_map import BlockMap, leaves_of_block, mean_v
from uavseg.segmentation.blocks.division import block_ratios, selected_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.params.segment import IntensityRange, Intervals, SegmentParams, StateLimits
from uavseg.segmentation.pipeline import LeafQuery
from uavseg.units import BLOCK, CELL, CELLS, GREY_MAX

MAX_INTERVALS = 255

BlockIndices = NDArray[np.int64]  # (n, 2): row and column of each block
REACH = 3.0  # cells of 8 x 8 pixels between the centres of a segment that moved without overlap
MAX_ABSENT_UPDATES = 5  # updates after which a number that vanished does not come back

Groups = Mapping[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class SegmentChanges:
    """What became of segments since the last call, by number."""

    appeared: tuple[int, ...]
    vanished: tuple[int, ...]
    moved: tuple[int, ...]  # their centres, by half a cell and more
    split: Groups  # what came out of a segment
    merged: Groups  # what has become part of a segment


class SegmentTracks:
    """Tracking of the segments of one interval; `numbers` (8 B, 8 C) has that of each cell, 0 for none.

    A component takes the number whose cells it covers most, or that was nearest. Where segments merge, one
    number stays and the others rest in it, with the cells that they had alone; a part that splits off takes
    one of them. A number that vanished comes back at its place within some updates. None is used twice.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.numbers = np.zeros(shape, np.int64)
        self._last = 0
        # The segment that each number is in: itself, or another; or minus the updates since it vanished.
        self._hosts: dict[int, int] = {}
        self._cells: dict[int, Integers] = {}  # flat cells of each number when it was last alone

    def update(self, inside: Bools) -> SegmentChanges:
        """Number the components of cells (8 B, 8 C), and tell what changed."""
        from scipy import ndimage

        components, count = ndimage.label(inside, np.ones((3, 3), bool))
        labels, before, old = components.ravel(), self.numbers.ravel(), self._hosts
        cells = {label: np.flatnonzero(labels == label) for label in range(1, count + 1)}
        shared = (labels > 0) & (before > 0)
        pairs = np.unique(np.stack([before[shared], labels[shared]], 1), axis=0).tolist()
        ties = {(host, label) for host, label in pairs}
        lonely = cells.keys() - {label for _, label in ties}
        centres = {one: self._centre(where) for one, where in self._cells.items()}
        found = {label: self._centre(where) for label, where in cells.items()}
        wanted: list[tuple[int, float, int, int, int]] = []  # rank and its values, number, label
        for one, host in old.items():
            covered = dict(zip(*np.unique_counts(labels[self._cells[one]]), strict=True))
            for label in cells:
                if (host, label) in ties or (host < 0 and label in covered):
                    sizes = -int(covered.get(label, 0)), -len(cells[label])
                    wanted.append((int(host < 0), *sizes, one, label))
                elif host > 0 and label in lonely and (far := _gap(found[label], centres[one])) <= REACH:
                    wanted.append((2, far, 0, one, label))
        labels_of: dict[int, int] = {}
        taken: set[int] = set()
        for *_, one, label in sorted(wanted):
            if one not in labels_of and label not in taken:
                labels_of[one] = label
                taken.add(label)
        for label in sorted(cells.keys() - taken):
            self._last += 1
            labels_of[self._last] = label
        numbers = {label: one for one, label in labels_of.items()}
        hosts = {one: one for one in labels_of}
        for one in old.keys() - labels_of.keys():
            inner = [numbers[label] for host, label in pairs if host == old[one]]
            if inner or old[one] > -MAX_ABSENT_UPDATES:
                hosts[one] = inner[0] if inner else min(old[one], 0) - 1
        came = {one: [host for host, label in pairs if label == labels_of[one]] for one in labels_of}
        was = {one: max(old.get(one, 0), 0) for one in hosts}
        stay = [one for one in labels_of if was[one] == one]
        changes = SegmentChanges(
            appeared=tuple(one for one in labels_of if not was[one] and not came[one]),
            vanished=tuple(one for one, host in old.items() if host > 0 >= hosts.get(one, 0)),
            moved=tuple(one for one in stay if _gap(found[labels_of[one]], centres[one]) >= 0.5),
            split=_grouped(
                (was[one] or min(came[one], default=0), one) for one in labels_of if was[one] != one
            ),
            merged=_grouped((host, one) for one, host in hosts.items() if host not in (one, was[one])),
        )
        busy = {host for one, host in hosts.items() if one != host}
        shown = {one: cells[label] for one, label in labels_of.items()}
        kept = shown | self._cells | {one: where for one, where in shown.items() if one not in busy}
        self._hosts, self._cells = hosts, {one: kept[one] for one in hosts}
        self.numbers = np.array([0, *(numbers[label] for label in cells)])[components]
        return changes

    def _centre(self, cells: Integers) -> Floats:
        return np.asarray(np.array(np.unravel_index(cells, self.numbers.shape)).mean(axis=1))


def _gap(one: Floats, other: Floats) -> float:
    return float(np.hypot(*(one - other)))


def _grouped(pairs: Iterable[tuple[int, int]]) -> Groups:
    known = sorted(pair for pair in pairs if pair[0] > 0)
    return {host: tuple(one for first, one in known if first == host) for host, _ in known}


class LiveSegmentation:
    """The segments of a map as it is now, with boundaries at the edges of cells of 8 x 8 pixels.

    A ParameterError says that there are more than 255 intervals.

    Parameters
    ----------
    partition : StateLimits, IntensityRange or Levels, optional
        Intervals of v by which the segments are classified; by default the paper's states.
    params : SegmentParams, optional
        By default the paper's method. Pixels are not refined.

    Attributes
    ----------
    bin_edges : (7,) int32 array
        Of the contrast histogram; fitted when the segmentation is made and by `refit`.
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
        self._tracks: dict[int, SegmentTracks] = {}
        self._stale = np.ones(self._blocks.blocks, bool)
        # blocks in which every pixel has eight neighbours in the map
        rows, cols = (np.arange(0, length, BLOCK) for length in grey_map.shape)
        inner_rows = (rows > 0) & (rows + BLOCK < grey_map.shape[0])
        inner_cols = (cols > 0) & (cols + BLOCK < grey_map.shape[1])
        self._is_inner = np.asarray(inner_rows[:, np.newaxis] & inner_cols)
        self.refit()

    @property
    def intervals(self) -> Uint8s:
        """Return the interval in which the leaf of each cell of 8 x 8 pixels lies, counted from 1.

        For states: 1 free, 2 unknown, 3 occupied; for a range: 1 below, 2 inside, 3 above it. 0 where a cell
        lies outside the map. The result (8 B, 8 C) is a read-only view; later updates show in it.
        """
        self.settle()
        shown = self._intervals.view()
        shown.flags.writeable = False
        return shown

    @property
    def inside(self) -> Bools:
        """Return which cells are of leaves in the range, (8 B, 8 C) bool; ParameterError without a range."""
        if not isinstance(self.partition, IntensityRange):
            raise ParameterError(f"only a range has an inside; this segmentation is by {self.partition}")
        return np.asarray(self.intervals == 2)

    def changes(self, interval: int | None = None) -> SegmentChanges:
        """Tell which segments of an interval appeared, vanished, moved, split or merged since the last call.

        By default those of the highest interval, such as what is occupied. Their cells need not share edges:
        corners do. See `numbers` for the segments by number; the first call gives the first numbers.
        """
        interval = self._checked(interval)
        if interval not in self._tracks:
            self._tracks[interval] = SegmentTracks(self._intervals.shape)
        return self._tracks[interval].update(self.intervals == interval)

    def numbers(self, interval: int | None = None) -> Integers:
        """Return the number of the segment of each cell when `changes` was last called, (8 B, 8 C); or 0."""
        tracks = self._tracks.get(self._checked(interval))
        return np.zeros(self._intervals.shape, np.int64) if tracks is None else tracks.numbers.copy()

    def agreeing(self, interval: int) -> Bools:
        """Return the pixels whose leaf and whose v both lie in an interval: the cells that a path may pass.

        Walls thinner than a block lie in leaves whose mean is free; this excludes the pixels of such walls.
        An interval is as in `intervals`, 1 for free; a ParameterError says that there is none. The result is
        (rows, cols).
        """
        interval = self._checked(interval)
        v = np.arange(1 << 16) / GREY_MAX
        within = np.flatnonzero(np.searchsorted(self.partition.edges, v) == interval - 1)
        low, high = (int(within[0]), int(within[-1])) if len(within) else (1, 0)
        rows, cols = self._grey_map.shape
        leaves = (self.intervals == interval).view(np.uint8)
        grey = self._grey_map.grey[1 : rows + 1, 1 : cols + 1]
        shown = leaves.repeat(CELL, 0).repeat(CELL, 1)[:rows, :cols].view(bool)
        return np.asarray(shown & (grey >= low) & (grey <= high))

    def _checked(self, interval: int | None) -> int:
        """Return an interval, the highest for None; refuse one that there is not."""
        count = len(self.partition.edges) + 1
        interval = count if interval is None else interval
        if not 1 <= interval <= count:
            raise ParameterError(f"intervals are 1 to {count} here, not {interval}")
        return interval

    def block_map(self) -> BlockMap:
        """Return the block map with every R, measured for blocks that changed since the last call."""
        self.settle()
        for part, valid in self._by_validity(self._stale):
            ratios = block_ratios(self._grey_map.grey, valid, self.bin_edges, part * BLOCK)
            self._all_ratios[part[:, 0], part[:, 1]] = ratios
        self._stale[:] = False
        blocks = self._blocks
        return BlockMap(blocks.shape, blocks.sums.copy(), blocks.counts.copy(), self._all_ratios.copy())

    def refit(self) -> None:
        """Fit the contrast bin edges to the whole map as it is now, and divide every block again."""
        self.bin_edges = contrast_bin_edges(contrast_histogram(self._grey_map.grey, self._grey_map.valid))
        self._grey_map.flush_changes()
        self._changes.pop()
        self._update_blocks(*np.ones((2, *self._stale.shape), bool))

    def settle(self) -> Bools:
        """Divide again the blocks that have changed since the last call; return which these are, (B, C)."""
        self._grey_map.flush_changes()
        changed, affected = self._changes.pop()
        if affected.any():
            self._update_blocks(changed, affected)
        return affected

    def _update_blocks(self, changed: Bools, affected: Bools) -> None:
        """Divide blocks again: changed ones by their grey, affected ones by the texture at their edges."""
        self._stale |= affected
        indices = _block_indices(changed)
        rows, cols = indices.T
        self._required[rows, cols] = _required_ratios_at(self._blocks, self._query, indices)
        self._blocks.ratios[rows, cols] = 0
        divided = affected & (self._required > 0)
        for part, valid in self._by_validity(divided):
            rows, cols = part.T
            required = self._required[rows, cols]
            self._blocks.ratios[rows, cols] = selected_ratios(
                self._grey_map.grey, valid, self.bin_edges, part * BLOCK, required, self.params.threshold
            )
        indices = _block_indices(changed | divided)
        required = self._required[tuple(indices.T)]
        _classify_leaves(self._blocks, self._query, indices, required, self._leaves, self._intervals)

    def _by_validity(self, blocks: Bools) -> Iterator[tuple[BlockIndices, Uint8s | None]]:
        """Split blocks into those that are valid throughout (with None) and the others (with `valid`)."""
        indices = _block_indices(blocks)
        inner = self._is_inner[indices[:, 0], indices[:, 1]]
        for part, valid in ((indices[inner], None), (indices[~inner], self._grey_map.valid)):
            if len(part):
                yield part, valid


def _block_indices(blocks: Bools) -> BlockIndices:
    return np.ascontiguousarray(np.argwhere(blocks))


def _required_ratios_at(blocks: BlockMap, query: LeafQuery, indices: BlockIndices) -> Uint32s:
    """Find the R of some blocks that must be known to answer a query, one bit each, see `block_map`."""
    chosen, shape = (indices[:, 0], slice(None), indices[:, 1]), (-1, CELLS, blocks.blocks[1], CELLS)
    sums = blocks.sums.reshape(shape)[chosen].reshape(-1, CELLS)  # one block below the other
    counts = blocks.counts.reshape(shape)[chosen].reshape(-1, CELLS)
    return query.required_ratios(sums, counts)[:, 0]


def _classify_leaves(
    blocks: BlockMap,
    query: LeafQuery,
    indices: BlockIndices,
    required: Uint32s,
    scratch: tuple[Uint8s, Floats],
    intervals: Uint8s,
) -> None:
    """Divide some blocks into leaves, and write the interval of each leaf's mean, 0 without a valid pixel."""
    division = (blocks.sums, blocks.counts, blocks.ratios, query.division.threshold, query.division.step)
    edges = np.array(query.edges, np.float64)
    _classify(*division, edges, indices, required, *scratch, intervals)


@inlined
def _index_of_interval(value, edges):  # type: ignore[no-untyped-def]
    """Return the interval of a mean, counted from 1; 0 for the -1 of a leaf without a valid pixel."""
    interval = np.uint8(value >= 0.0)
    for edge in edges:
        interval += np.uint8(edge < value)
    return interval


@kernel(
    "void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, f8[::1], i8[:,::1], u4[::1], "
    "u1[:,::1], f8[:,::1], u1[:,::1])"
)
def _classify(  # type: ignore[no-untyped-def]
    sums, counts, ratios, threshold, step, edges, indices, required, side, mean, intervals
):
    for k in range(indices.shape[0]):
        row, col = max(indices[k, 0], 0), max(indices[k, 1], 0)  # lets the compiler see that they are not < 0
        if required[k] == 0 and step == inf:  # all cells lie in one interval, whatever the division
            one = _index_of_interval(mean_v(sums, counts, 8 * row, 8 * col, 8), edges)
            for r in range(8):
                for c in range(8):
                    is_valid = np.uint8(counts[8 * row + r, 8 * col + c] > 0)
                    intervals[8 * row + r, 8 * col + c] = one * is_valid
            continue
        leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)
        for r in range(8 * row, 8 * row + 8):
            for c in range(8 * col, 8 * col + 8):
                intervals[r, c] = _index_of_interval(mean[r, c], edges) * np.uint8(counts[r, c] > 0)
