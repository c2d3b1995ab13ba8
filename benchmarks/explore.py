"""Length of drives until a scene is known: our views beside published planners, on the same scans and paths.

Six scenes (`rooms`, `loop`, `office`, `clutter` are drawn here, `depot` and `willow` are maps), five starts
each, a scan every 0.25 m. The number is the metres driven until 99 % of what can be known is known.
"""

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.occupancy.explore.block_graph import BlockGraph, block_graph
from uavseg.occupancy.explore.drive import Choose, Drive, Explorer, knowable_cells
from uavseg.occupancy.explore.frontiers import States, find_frontiers, rays_for, visible_cells
from uavseg.occupancy.explore.next_view import Candidates, Cell, ViewPlanner, cover, tour_from
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.simulate import CellScene, RangeFinder
from uavseg.raster.grid.geobox import local_geobox
from uavseg.units import FREE, OCCUPIED, UNKNOWN

MAPS = Path(__file__).parents[2] / "shared" / "data" / "maps"
DONE = 0.99


def rooms(cell: float = 0.1) -> Bools:
    """Eight rooms along a corridor, 20 m x 14 m."""
    solid = np.ones((int(14 / cell), int(20 / cell)), bool)

    def clear(x0: float, y0: float, x1: float, y1: float) -> None:
        solid[int(y0 / cell) : int(y1 / cell), int(x0 / cell) : int(x1 / cell)] = False

    clear(0.2, 6.2, 19.8, 7.8)
    for k in range(4):
        left = 0.2 + k * 4.95
        clear(left, 0.2, left + 4.7, 6.0)
        clear(left, 8.0, left + 4.7, 13.8)
        door = left + 1 + (k * 1.7) % 2.5
        clear(door, 5.9, door + 0.9, 6.3)
        door = left + 1 + (k * 2.3 + 0.8) % 2.5
        clear(door, 7.7, door + 0.9, 8.1)
    return solid


def loop(cell: float = 0.1) -> Bools:
    """Corridors around four blocks with niches, 24 m x 16 m."""
    solid = np.zeros((int(16 / cell), int(24 / cell)), bool)
    solid[:2] = solid[-2:] = True
    solid[:, :2] = solid[:, -2:] = True
    for x0, y0, x1, y1 in ((2, 2, 11, 7), (13, 2, 22, 7), (2, 9, 11, 14), (13, 9, 22, 14)):
        solid[int(y0 / cell) : int(y1 / cell), int(x0 / cell) : int(x1 / cell)] = True
    for x in (4, 8, 15, 19):
        solid[int(5 / cell) : int(7 / cell), int(x / cell) : int((x + 1.5) / cell)] = False
        solid[int(9 / cell) : int(11 / cell), int(x / cell) : int((x + 1.5) / cell)] = False
    return solid


def clutter(cell: float = 0.1) -> Bools:
    """One hall with 26 boxes, 20 m x 15 m."""
    random = np.random.default_rng(3)
    solid = np.zeros((int(15 / cell), int(20 / cell)), bool)
    solid[:2] = solid[-2:] = True
    solid[:, :2] = solid[:, -2:] = True
    for _ in range(26):
        high, wide = random.uniform(0.4, 1.8, 2) / cell
        y, x = random.uniform(1, 14) / cell, random.uniform(1, 19) / cell
        solid[int(y - high / 2) : int(y + high / 2), int(x - wide / 2) : int(x + wide / 2)] = True
    return solid


def office(cell: float = 0.25, seed: int = 1, leaf: float = 4.0) -> Bools:
    """Corridors two by two, and between them rooms with a door each, 60 m x 40 m."""
    random = np.random.default_rng(seed)
    cols, rows = int(60 / cell), int(40 / cell)
    solid = np.zeros((rows, cols), bool)
    solid[:1] = solid[-1:] = True
    solid[:, :1] = solid[:, -1:] = True
    half = int(2 / cell) // 2
    ys, xs = [0, int(13 / cell), int(27 / cell), rows - 1], [0, int(20 / cell), int(40 / cell), cols - 1]
    for i in range(3):
        for j in range(3):
            y0, y1 = ys[i] + half * (i > 0), ys[i + 1] - half * (i < 2)
            x0, x1 = xs[j] + half * (j > 0), xs[j + 1] - half * (j < 2)
            solid[y0 : y1 + 1, [x0, x1]] = True
            solid[[y0, y1], x0 : x1 + 1] = True
            middle = (y0 + y1) // 2
            solid[middle, x0 : x1 + 1] = True
            for top, bottom, is_lower in ((y0, middle, False), (middle, y1, True)):
                cuts = [x0]
                while x1 - cuts[-1] > int(2 * leaf / cell):
                    cuts.append(cuts[-1] + int(random.uniform(leaf * 0.7, leaf * 1.5) / cell))
                    solid[top : bottom + 1, cuts[-1]] = True
                is_outer = i == (2 if is_lower else 0)
                wall = middle if is_outer else (bottom if is_lower else top)
                width = max(int(0.9 / cell), 3)
                for left, right in zip(cuts, [*cuts[1:], x1], strict=True):
                    door = int(random.integers(left + 2, max(right - width - 1, left + 3)))
                    solid[wall, door : door + width] = False
    return solid


def of_map(name: str) -> Bools:
    """The free cells of a map of ours that hang together; everything else is solid."""
    import rasterio
    from skimage.measure import label

    with rasterio.open(MAPS / name) as file:
        free = file.read(1) >= 250
    labels = label(free, connectivity=1)
    free = labels == np.argmax(np.bincount(labels[labels > 0]))
    rows, cols = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    return ~np.pad(free, 2)[rows[0] : rows[-1] + 5, cols[0] : cols[-1] + 5]


# drawing, side of a cell and range of the sensor in metres
SCENES: dict[str, tuple[Callable[[], Bools], float, float]] = {
    "rooms": (rooms, 0.1, 3.0),
    "loop": (loop, 0.1, 3.0),
    "office": (office, 0.25, 4.5),
    "office2": (lambda: office(seed=7, leaf=7.0), 0.25, 4.5),
    "clutter": (clutter, 0.1, 3.0),
    "depot": (lambda: of_map("depot.pgm"), 0.05, 3.0),
    "willow": (lambda: of_map("willow-full.pgm"), 0.1, 4.5),
}


@dataclass(frozen=True)
class Pieces:
    """Groups of frontiers, in pieces no longer than the range, where a robot is."""

    cells: list[Integers]  # of each piece, (n, 2)
    middles: Integers  # (n, 2); the cell of each that is nearest to its mean
    nodes: Integers  # (n,); of the graph
    graph: BlockGraph
    reach: Floats  # of each node from the robot, in cells
    here: int  # the node of the robot


@dataclass(frozen=True)
class Baseline:
    """A published planner over pieces of frontiers."""

    name: str
    planner: ViewPlanner  # what it knows of the robot, and what was looked at in vain

    def __call__(self, states: States, at: Cell) -> tuple[Cell, Integers] | None:
        """Return the place that scores highest, and the cells that are looked at from there."""
        pieces = self._pieces(states, at)
        if pieces is None:
            return None
        best = int(np.argmax(self._scores(states, pieces)))
        row, col = pieces.middles[best].tolist()
        return (row, col), pieces.middles[best : best + 1] if self.name == "nearest" else pieces.cells[best]

    def _pieces(self, states: States, at: Cell) -> Pieces | None:
        frontiers = find_frontiers(states)
        graph = block_graph(self.planner.passable(states, at), self.planner.side)
        here = int(graph.node_of[at])
        reach = graph.distances(here)
        cells = frontiers.cells[frontiers.widths >= 2]
        cells = cells if len(cells) else frontiers.cells
        node = graph.node_of[tuple(cells.T)]
        tried = np.where((node >= 0) & np.isfinite(reach[node]), self.planner.tried[tuple(cells.T)], 255)
        if tried.min(initial=255) >= 4:
            return None
        cells = cells[tried == tried.min()]
        gaps = np.abs(np.diff(cells, axis=0)).max(axis=1) > 1
        longest = self.planner.range_m / self.planner.cell_m
        pieces: list[Integers] = []
        for group in np.split(cells, np.flatnonzero(gaps) + 1):
            span = np.ptp(group, axis=0)
            ordered = group[np.argsort(group[:, int(np.argmax(span))], kind="stable")]
            pieces += np.array_split(ordered, max(math.ceil(span.max() / longest), 1))
        pieces = [piece for piece in pieces if len(piece)]
        from_mean = [((piece - piece.mean(axis=0)) ** 2).sum(axis=1) for piece in pieces]
        middles = np.array([piece[np.argmin(away)] for piece, away in zip(pieces, from_mean, strict=True)])
        return Pieces(pieces, middles, graph.node_of[tuple(middles.T)].astype(np.int64), graph, reach, here)

    def _scores(self, states: States, pieces: Pieces) -> Floats:
        graph, away = pieces.graph, pieces.reach[pieces.nodes]
        metres, range_m = away * self.planner.cell_m, self.planner.range_m
        if self.name == "nearest":
            return -away
        if self.name == "tour":
            every = np.r_[pieces.here, pieces.nodes]
            lengths = np.stack([graph.distances(int(node))[every] for node in every])
            order = tour_from(np.minimum(lengths, lengths.T), np.zeros(len(pieces.nodes)))
            return -np.argsort(order).astype(np.float64)
        if (
            self.name == "advantage"
        ):  # arXiv 2504.01980: farther from the free cells within 15 m than from here
            near = np.isfinite(pieces.reach) & (pieces.reach * self.planner.cell_m <= 15)
            return np.array([graph.distances(int(node))[near].mean() for node in pieces.nodes]) - away
        solid, unknown = states == OCCUPIED, states == UNKNOWN
        seen = [visible_cells(solid, place[None], range_m / self.planner.cell_m) for place in pieces.middles]
        gains = np.array([np.count_nonzero(cells & unknown) for cells in seen], np.float64)
        scores: dict[str, Floats] = {
            "greedy": gains,
            "gain/cost": gains / np.maximum(metres, self.planner.cell_m),
            "discounted": gains * np.exp(-metres / range_m),
            "root": np.sqrt(gains) * np.exp(-metres / (0.3 * range_m)),
        }
        return scores[self.name]


BASELINES = ("nearest", "gain/cost", "discounted", "root", "greedy", "tour", "advantage")


class KnownMap(ViewPlanner):
    """Tours of few views through all that is not seen yet, by a robot that has the map: a bound."""

    def learn(self, solid: Bools, known: Bools) -> None:
        """Take what is solid, and the cells that are to be seen."""
        self.solid, range_cells = solid, self.range_m / self.cell_m
        self.graph = block_graph(~solid, self.side)
        number = np.where(known, 0, -1)
        number[::2] = number[:, ::2] = -1  # every fourth cell, which is as good
        number[number == 0] = np.arange(np.count_nonzero(number == 0))
        self.targets = np.argwhere(number >= 0)
        seen = [number[visible_cells(solid, place[None], 0.95 * range_cells)] for place in self.graph.places]
        seen = [cells[cells >= 0].astype(np.int32) for cells in seen]
        self.begins = np.r_[0, np.cumsum([len(cells) for cells in seen])]
        self.seen = np.concatenate(seen)
        self.looked = np.zeros(len(self.targets), bool)  # at, from a place that was to show them

    def passable(self, states: States, at: Cell) -> Bools:
        return ~self.solid

    def choose(self, states: States, at: Cell) -> tuple[Cell, Integers] | None:
        node = int(self.graph.node_of[at])
        if at == tuple(self.graph.places[node]):
            self.looked[self.seen[self.begins[node] : self.begins[node + 1]]] = True
        wanted = (states[tuple(self.targets.T)] == UNKNOWN) & ~self.looked
        away = self.graph.distances(node)
        candidates = Candidates(self.graph.places, away, np.arange(len(away)), self.begins, self.seen)
        reached = np.isfinite(away)[np.repeat(np.arange(len(away)), np.diff(self.begins))]
        wanted &= np.isin(np.arange(len(wanted)), self.seen[reached])
        views = cover(candidates, wanted, 0.6 * self.cell_m / self.range_m)
        if not views:
            return None
        nodes = [node, *views]
        lengths = np.stack([self.graph.distances(k)[nodes] for k in nodes])
        first = views[tour_from(np.minimum(lengths, lengths.T), np.zeros(len(views)))[0]]
        row, col = self.graph.places[first].tolist()
        return (row, col), self.targets[:0]


def starts(solid: Bools, count: int) -> list[Cell]:
    """Random cells of the largest free component."""
    from skimage.measure import label

    labels = label(~solid, connectivity=1)
    cells = np.argwhere(labels == np.argmax(np.bincount(labels[labels > 0])))
    chosen = np.random.default_rng(0).choice(len(cells), count, replace=False)
    return [(int(row), int(col)) for row, col in cells[chosen]]


def drive(scene: str, planner: str, start: Cell, fov: float, known: Bools) -> tuple[Drive, float]:
    """Explore a scene until 99 % of the cells that can be known are; the drive, and their share."""
    draw, cell, range_m = SCENES[scene]
    solid = draw()
    geobox = local_geobox(solid.shape, cell, (0.0, 0.0))
    sensor = RangeFinder(0.03, range_m, fov, min(0.5, math.degrees(0.7 * cell / range_m)))
    explorer = Explorer(CellScene(solid, geobox), sensor, OccupancyGrid(geobox))
    x, y = geobox.xy_from_pixel(start[0] + 0.5, start[1] + 0.5)
    choose: Choose | None = None if planner == "ours" else Baseline(planner, explorer.planner)
    if planner == "known map":
        choose = None
        explorer.planner = KnownMap(solid.shape, cell, range_m)
        explorer.planner.learn(solid, known)
    count = np.count_nonzero(known)

    def share(states: States) -> float:
        return float(np.count_nonzero(known & (states != UNKNOWN)) / count)

    done = explorer.run(Pose(float(x), float(y)), choose, lambda states: share(states) >= DONE)
    return done, share(explorer.states)


def seen_by_numpy(states: States, views: Integers, range_cells: float) -> int:
    """Unknown cells that rays from the views enter, in plain numpy: what a choice has to know at least."""
    rays, count = rays_for(range_cells), 0
    steps = np.arange(0.0, range_cells, 0.7)[:, None, None] * rays
    padded = np.pad(states, math.ceil(range_cells) + 2)
    for view in views:
        rows, cols = np.moveaxis((view + math.ceil(range_cells) + 2.5 + steps).astype(np.int64), -1, 0)
        on_ray = padded[rows, cols]
        last = (on_ray != FREE).argmax(axis=0), np.arange(len(rays))
        unknown = on_ray[last] == UNKNOWN
        count += len(np.unique(rows[last][unknown] * padded.shape[1] + cols[last][unknown]))
    return count


def time_choices(count: int = 100) -> None:
    """Print the time of choices on an office of 800 x 1200 cells, beside rays in plain numpy."""
    solid = office(0.05)
    geobox = local_geobox(solid.shape, 0.05, (0.0, 0.0))
    explorer = Explorer(CellScene(solid, geobox), RangeFinder(0.03, 4.5, 360.0, 0.5), OccupancyGrid(geobox))
    row, col = starts(solid, 1)[0]
    x, y = geobox.xy_from_pixel(row + 0.5, col + 0.5)
    seconds = explorer.drive.seconds
    explorer.run(Pose(float(x), float(y)), enough=lambda _: len(seconds) >= count)
    fresh = ViewPlanner(solid.shape, 0.05, 4.5)
    fresh.driven = explorer.planner.driven
    began = time.perf_counter()
    tour = fresh.tour(explorer.states, explorer.at)
    first = time.perf_counter() - began
    assert tour is not None
    began = time.perf_counter()
    seen_by_numpy(explorer.states, tour.candidates.cells, 0.9 * 4.5 / 0.05)
    plain = time.perf_counter() - began
    print(
        f"{solid.shape}: {len(tour.candidates.cells)} candidates; median of {count} choices "
        f"{np.median(seconds) * 1e3:.0f} ms, of a map that is new {first * 1e3:.0f} ms; "
        f"rays in plain numpy {plain * 1e3:.0f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", default="rooms,loop,office,clutter,depot,willow")
    parser.add_argument("--planners", default=",".join([*BASELINES, "ours"]))
    parser.add_argument("--starts", type=int, default=5)
    parser.add_argument("--fov", type=float, default=360.0)
    parser.add_argument("--speed", action="store_true", help="time choices on a large map instead")
    options = parser.parse_args()
    if options.speed:
        time_choices()
        return
    for scene in options.scenes.split(","):
        draw, cell, range_m = SCENES[scene]
        solid = draw()
        places = starts(solid, options.starts)
        known = knowable_cells(solid, places[0], cell, range_m)
        print(scene, solid.shape, np.count_nonzero(known), flush=True)
        for planner in options.planners.split(","):
            done = [drive(scene, planner, place, options.fov, known) for place in places]
            metres = [d.metres[-1] for d, _ in done]
            times = np.concatenate([d.seconds for d, _ in done]) * 1e3
            choices = np.mean([len(d.seconds) for d, _ in done])
            scans = np.mean([len(d.poses) for d, _ in done])
            known_of_all = min(share for _, share in done)
            print(
                f"  {planner:10s} {np.mean(metres):7.1f} m  known {known_of_all:.4f}  {choices:.0f} "
                f"choices of {np.median(times):.1f} ms, {scans:.0f} scans",
                flush=True,
            )


if __name__ == "__main__":
    main()
