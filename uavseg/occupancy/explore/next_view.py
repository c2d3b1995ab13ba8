"""Where to look next: few views that see all frontiers, in the order of a short tour through them.

A view that sees a frontier need not stand on it. So the candidates are places from which frontiers are seen
within the range; the greedy set cover (V. Chvatal, 1979) chooses few of them, those near by first; and the
first of the shortest tour through the chosen (M. Kulich, J. Faigl and L. Preucil, "On distance utility in the
exploration task", ICRA 2011) is where to go. The tour ends where unknown space goes on farthest: what is
behind the other frontiers is explored on the way, and nobody has to come back for it. The first view is moved
to where the way on is short, as long as it sees what it alone was to see.
"""

from dataclasses import field
from math import ceil, tau

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.arrays import Bools, Floats, Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.flight.order.tour import Stops, short_tour
from uavseg.occupancy.explore.block_graph import BlockGraph, block_graph
from uavseg.occupancy.explore.frontiers import Frontiers, States, find_frontiers, seen_from
from uavseg.occupancy.paths.clearance import clearance, is_at_least
from uavseg.units import FREE, UNKNOWN

_SPACING = 0.1  # of candidates, in ranges
_DEEP = 3.0  # ranges; farther unknown space is as deep as that
_REACHES = (0.9, 0.3, 0.1)  # of the range, from which a frontier is looked at first, second and third
_DISCOUNT = 0.6  # of views that are farther away by the range: e^-0.6
_ROUNDS = 60  # of the search for a tour

Cell = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Places from which frontiers are seen."""

    cells: Integers  # (n, 2); row and column
    away: Floats  # (n,); cells from the robot
    nodes: Integers  # (n,); of the graph
    starts: Integers  # (n + 1,); where the frontier cells of each begin in `seen`
    seen: NDArray[np.int32]  # positions in the frontiers

    def seen_by(self, view: int) -> NDArray[np.int32]:
        """Return the frontier cells that a view sees."""
        return self.seen[self.starts[view] : self.starts[view + 1]]


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """Which frontier cells were seen from where, in a map as it was."""

    states: States
    range_cells: float
    number: NDArray[np.int32]  # (rows, cols); of each view, -1 elsewhere
    starts: Integers  # (n + 1,); where the cells of each begin in `seen`
    seen: Integers  # positions of cells in the flat map


@dataclass(frozen=True, slots=True, eq=False)
class Tour:
    """Views that together see all frontiers."""

    candidates: Candidates
    frontiers: Frontiers
    graph: BlockGraph
    views: list[int]  # candidates, in the order of the tour
    lengths: Floats  # (n + 1, n + 1); cells between the robot and the views, in that order
    depths: Floats  # (n,); how far unknown space goes on behind each, in cells

    def own(self) -> NDArray[np.int32]:
        """Return the frontier cells that the first view sees, without those that another sees too."""
        counts = np.zeros(len(self.frontiers.cells), np.int64)
        for view in self.views:
            counts[self.candidates.seen_by(view)] += 1
        seen = self.candidates.seen_by(self.views[0])
        own = seen[counts[seen] == 1]
        return own if len(own) else seen


@dataclass(slots=True)
class ViewPlanner:
    """Chooses views of a map that becomes known, and remembers which frontiers cannot be resolved from where.

    A frontier of which a scan from a chosen view has shown nothing comes last from then on, and is looked at
    from nearer; after the third time it is none. So no drive ends with a frontier that it could resolve, or
    waits at one for ever.
    """

    shape: tuple[int, int]
    cell_m: float
    range_m: float
    fov_deg: float = 360.0
    clearance_m: float = 0.0
    tried: Uint8s = field(init=False)  # (rows, cols); how often a frontier was looked at in vain
    driven: Bools = field(init=False)  # (rows, cols); where the robot was, so that it can return
    sights: Sights = field(init=False)  # of the last choice

    def __post_init__(self) -> None:
        self.tried, self.driven = np.zeros(self.shape, np.uint8), np.zeros(self.shape, bool)
        nowhere, none = np.full(self.shape, -1, np.int32), np.empty(0, np.int64)
        self.sights = Sights(np.zeros(self.shape, np.uint8), 0.0, nowhere, np.zeros(1, np.int64), none)

    @property
    def side(self) -> int:
        """Return the cells along the blocks in each of which there is a candidate."""
        return max(round(_SPACING * self.range_m / self.cell_m), 1)

    def passable(self, states: States, at: Cell) -> Bools:
        """Return the cells on which the robot may stand: free, with its clearance, or where it is."""
        free = states == FREE
        if self.clearance_m > 0:
            radius = ceil(self.clearance_m / self.cell_m)
            top, left = max(at[0] - radius, 0), max(at[1] - radius, 0)
            here = np.s_[top : at[0] + radius + 1, left : at[1] + radius + 1]
            beside = free[here]
            free = is_at_least(clearance(free, self.cell_m, self.cell_m), self.clearance_m)
            free[here] |= beside  # where it stands, or it could never leave
        free[at] = True
        return np.asarray(free | self.driven)

    def tour(self, states: States, at: Cell) -> Tour | None:
        """Return views of the frontiers that were looked at least often; None if none is left."""
        frontiers = find_frontiers(states)
        graph = block_graph(self.passable(states, at), self.side)
        away = graph.distances(int(graph.node_of[at]))
        tried = self.tried[tuple(frontiers.cells.T)]
        narrow = frontiers.widths < max(2 * self.clearance_m / self.cell_m, 2)
        for times, reach in enumerate(_REACHES):
            wanted = np.maximum(tried, narrow) <= times
            range_cells = max(reach * self.range_m / self.cell_m, 2 + self.clearance_m / self.cell_m)
            # The nodes within the range of a frontier, and of each block one of its frontier cells.
            on = frontiers.cells[wanted]
            near = self._blocks_near(on, range_cells)
            is_near = near[tuple(graph.places.T // self.side)] & np.isfinite(away)
            node = graph.node_of[tuple(on.T)]
            _, first = np.unique(node, return_index=True)
            first = first[(node[first] >= 0) & np.isfinite(away[node[first]])]
            nodes = np.concatenate([np.flatnonzero(is_near), node[first].astype(np.int64)])
            cells = np.concatenate([graph.places[is_near], on[first]])
            starts, seen = self._seen(states, frontiers, cells, range_cells)
            kept = wanted[seen]
            starts = np.r_[0, np.cumsum(kept)][starts]
            candidates = Candidates(cells, away[nodes], nodes, starts, seen[kept])
            views = cover(candidates, wanted, _DISCOUNT * self.cell_m / self.range_m)
            if views:
                depths = self._depths(states, frontiers, candidates, views)
                return _ordered(candidates, frontiers, graph, int(graph.node_of[at]), views, depths)
        return None

    def _blocks_near(self, cells: Integers, distance: float) -> Bools:
        """Return the blocks with a place that is at most a distance in cells from some cells (n, 2)."""
        from scipy.ndimage import maximum_filter

        blocks = np.zeros(tuple(-(-length // self.side) for length in self.shape), np.uint8)
        blocks[tuple(cells.T // self.side)] = 1
        return np.asarray(maximum_filter(blocks, size=2 * ceil(distance / self.side) + 1) > 0)

    def _seen(
        self, states: States, frontiers: Frontiers, views: Integers, range_cells: float
    ) -> tuple[Integers, NDArray[np.int32]]:
        """Return what `seen_from` does, and look only from views in whose range something has changed."""
        last, count = self.sights, len(frontiers.cells)
        changed = self._blocks_near(np.argwhere(states != last.states), range_cells + 2)
        changed |= range_cells != last.range_cells
        number = np.where(changed[tuple(views.T // self.side)], -1, last.number[tuple(views.T)])
        fresh = number < 0
        number[fresh] = len(last.starts) - 1 + np.arange(np.count_nonzero(fresh))  # after those of the last
        starts, seen = seen_from(states, frontiers.index, count, views[fresh], range_cells)
        seen = np.concatenate([frontiers.index.ravel()[last.seen], seen])
        begins = np.concatenate([last.starts, last.starts[-1] + starts[1:]])
        lengths = np.diff(begins)[number]
        starts = np.r_[0, np.cumsum(lengths)]
        seen = seen[np.arange(starts[-1]) + np.repeat(begins[number] - starts[:-1], lengths)]
        numbers = np.full(self.shape, -1, np.int32)
        numbers[tuple(views.T)] = np.arange(len(views))
        at = np.ravel_multi_index(tuple(frontiers.cells[seen].T), self.shape)
        self.sights = Sights(states.copy(), range_cells, numbers, starts, at)
        return starts, seen

    def _depths(
        self, states: States, frontiers: Frontiers, candidates: Candidates, views: list[int]
    ) -> Floats:
        """Return how far unknown space goes on behind what each view sees, (n,) in cells."""
        unknown = block_graph(states == UNKNOWN, self.side)
        view_of = np.full(len(frontiers.cells), -1, np.int64)
        for k, view in reversed(list(enumerate(views))):
            view_of[candidates.seen_by(view)] = k
        cells, view_of = frontiers.cells[view_of >= 0], view_of[view_of >= 0]
        sources, view_of_source = [], []
        for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            beside = np.clip(cells + step, 0, np.array(self.shape) - 1)
            nodes = unknown.node_of[tuple(beside.T)]
            sources.append(nodes[nodes >= 0])
            view_of_source.append(view_of[nodes >= 0])
        away, owner = unknown.nearest(np.concatenate(sources))
        depths = np.zeros(len(views))
        reached = owner >= 0
        np.maximum.at(depths, np.concatenate(view_of_source)[owner[reached]], away[reached])
        return np.minimum(depths, _DEEP * self.range_m / self.cell_m)

    def choose(self, states: States, at: Cell) -> tuple[Cell, Integers] | None:
        """Return the next view, and the frontier cells (n, 2) that it is to resolve; None if all is known."""
        tour = self.tour(states, at)
        if tour is None:
            return None
        own = tour.own()
        row, col = tour.candidates.cells[self.place(tour, own)].tolist()
        return (row, col), tour.frontiers.cells[own]

    def place(self, tour: Tour, own: NDArray[np.int32]) -> int:
        """Return the candidate on the shortest way that sees what the first view of a tour alone sees."""
        found = tour.candidates
        mark = np.zeros(len(tour.frontiers.cells), np.uint8)
        mark[own] = 1
        counts = np.zeros(len(found.cells), np.int64)
        _count(found.starts, found.seen, mark, counts)
        way = found.away.copy()
        if len(tour.views) > 1:
            way += tour.graph.distances(int(found.nodes[tour.views[1]]))[found.nodes]
        return int(np.argmin(np.where(counts == len(own), way, np.inf)))

    def heading(self, at: Cell, cells: Integers) -> tuple[float, Integers]:
        """Return the direction in which most of some cells are in view, in radians, and these cells."""
        angles = np.arctan2(*(cells - at).T)
        turn = (angles[None, :] - angles[:, None]) % tau  # counted from each of the cells
        within = turn <= np.radians(self.fov_deg)
        first = int(np.argmax(within.sum(axis=1)))
        angle = float(angles[first] + turn[first][within[first]].max() / 2)
        return angle, cells[within[first]]


def _ordered(
    candidates: Candidates, frontiers: Frontiers, graph: BlockGraph, at: int, views: list[int], depths: Floats
) -> Tour:
    """Return views in the order of a short tour from a node, which ends rather where a depth is great."""
    nodes = [at, *candidates.nodes[views].tolist()]
    lengths = np.stack([graph.distances(node)[nodes] for node in nodes])
    lengths = np.minimum(lengths, lengths.T)  # the same to the last bit in both directions
    order = tour_from(lengths, depths)
    sequence = np.r_[0, np.array(order) + 1]
    lengths = lengths[np.ix_(sequence, sequence)]
    return Tour(candidates, frontiers, graph, [views[k] for k in order], lengths, depths[order])


def tour_from(lengths: Floats, depths: Floats) -> list[int]:
    """Return the order of views, counted from 0, for which the way less the depth of the last is short.

    `lengths` (n + 1, n + 1) are between the start and the views, `depths` are (n,).
    """
    stops = Stops.of([np.array([[k, k]]) for k in range(1, len(lengths))])
    to_end = np.pad(lengths, (0, 1))
    to_end[1:-1, -1] = to_end[-1, 1:-1] = depths.max() - depths
    return [stop for stop, _ in short_tour(stops, to_end, start=0, end=len(lengths), rounds=_ROUNDS)]


def cover(candidates: Candidates, wanted: Bools, discount: float) -> list[int]:
    """Choose few candidates that see all wanted frontier cells which any of them sees."""
    chosen = np.empty(len(candidates.cells), np.int64)
    weights = np.exp(-discount * candidates.away)
    counts = np.diff(candidates.starts)
    count = _choose(candidates.starts, candidates.seen, wanted.astype(np.uint8), weights, counts, chosen)
    return [int(view) for view in chosen[:count]]


@kernel("i8(i8[::1], i4[::1], u1[::1], f8[::1], i8[::1], i8[::1])")
def _choose(starts, seen, wanted, weights, counts, chosen):  # type: ignore[no-untyped-def]
    # `counts` are upper bounds of the wanted cells that a candidate sees, counted again where it matters.
    number = 0
    while True:
        best, most = -1, 0.0
        for k in range(counts.shape[0]):
            if counts[k] * weights[k] <= most:
                continue
            counts[k] = 0
            for j in range(starts[k], starts[k + 1]):
                counts[k] += wanted[seen[j]]
            if counts[k] * weights[k] > most:
                best, most = k, counts[k] * weights[k]
        if best < 0:
            return number
        chosen[number] = best
        number += 1
        for j in range(starts[best], starts[best + 1]):
            wanted[seen[j]] = 0


@kernel("void(i8[::1], i4[::1], u1[::1], i8[::1])")
def _count(starts, seen, mark, counts):  # type: ignore[no-untyped-def]
    for k in range(counts.shape[0]):
        for j in range(starts[k], starts[k + 1]):
            counts[k] += mark[seen[j]]
