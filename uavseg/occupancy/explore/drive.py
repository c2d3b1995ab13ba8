"""A robot that drives through a scene until nothing that it can see is unknown."""

import math
import time
from collections.abc import Callable
from dataclasses import field
from itertools import pairwise

import numpy as np

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import PathError, SceneError
from uavseg.occupancy.explore.block_graph import block_graph
from uavseg.occupancy.explore.frontiers import States, visible_cells
from uavseg.occupancy.explore.next_view import Cell, ViewPlanner
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.paths.any_angle import pull_string
from uavseg.occupancy.paths.astar import shortest_path
from uavseg.occupancy.simulation.simulate import CellScene, RangeFinder, Scene
from uavseg.segmentation.params.segment import StateLimits
from uavseg.units import FREE, OCCUPIED, UNKNOWN

Choose = Callable[[States, Cell], tuple[Cell, Integers] | None]

_SCAN_EVERY_M = 0.25
_MAX_CHOICES = 100_000
_MAX_WAYS = 5  # to a view, while what the scans show blocks them
_LIMITS = StateLimits()


@dataclass(slots=True)
class Drive:
    """What a robot did, and the map that it made."""

    scene: Scene | CellScene
    sensor: RangeFinder
    seed: int  # of the noise
    grid: OccupancyGrid
    poses: list[Pose] = field(default_factory=list)  # of the scans
    metres: list[float] = field(default_factory=list)  # driven before each scan
    known: list[int] = field(default_factory=list)  # cells that are not unknown, after each scan
    views: list[int] = field(default_factory=list)  # scans that were taken at a chosen view
    seconds: list[float] = field(default_factory=list)  # of each choice

    @property
    def xy(self) -> Floats:
        """Return the places of the scans, (n, 2) in metres."""
        return np.array([(pose.x, pose.y) for pose in self.poses])

    def scan(self, number: int) -> Scan:
        """Take a scan, which is the same each time."""
        return self.sensor.scan(self.scene, self.poses[number], np.random.default_rng([self.seed, number]))


class Explorer:
    """A robot in a scene, and the map that it makes, whose cells are square.

    `clearance_m` is the distance that its centre keeps from everything that is not free; `seed` is of the
    noise.
    """

    def __init__(
        self,
        scene: Scene | CellScene,
        sensor: RangeFinder,
        grid: OccupancyGrid,
        clearance_m: float = 0.0,
        seed: int = 0,
    ) -> None:
        self.scene, self.sensor, self.grid = scene, sensor, grid
        self.cell_m = math.hypot(grid.geobox.transform.a, grid.geobox.transform.d)
        self.planner = ViewPlanner(
            grid.geobox.shape, self.cell_m, sensor.max_range_m, sensor.fov_deg, clearance_m
        )
        self.drive = Drive(scene, sensor, seed, grid)
        self.states = _LIMITS.of(grid.probabilities)
        self.place = np.zeros(2)  # row and column, as floats

    def run(
        self, start: Pose, choose: Choose | None = None, enough: Callable[[States], bool] | None = None
    ) -> Drive:
        """Drive from a pose until all is known, or enough; `choose` are the planner's views by default."""
        if self.scene.contains([start.x], [start.y]).any():
            raise SceneError(
                f"the start ({start.x:g}, {start.y:g}) stands inside something solid; move it out"
            )
        col, row = ~self.grid.geobox.transform * (start.x, start.y)
        if not (0 <= row < self.states.shape[0] and 0 <= col < self.states.shape[1]):
            raise SceneError(f"the start ({start.x:g}, {start.y:g}) lies outside of the map")
        self.place = np.array([float(row), float(col)])
        self.planner.driven[self.at] = True
        turns = math.ceil(360 / self.sensor.fov_deg)  # it looks around first
        for k in range(turns):
            self._scan(0.0, start.heading_rad + k * math.tau / turns)
        choose = choose or self.planner.choose
        for _ in range(_MAX_CHOICES):
            if enough is not None and enough(self.states):
                break
            began = time.perf_counter()
            chosen = choose(self.states, self.at)
            self.drive.seconds.append(time.perf_counter() - began)
            if chosen is None:
                break
            self._go(*chosen, enough)
        return self.drive

    @property
    def at(self) -> Cell:
        """Return the cell in which the robot stands."""
        return int(self.place[0]), int(self.place[1])

    def _scan(self, metres: float, heading: float) -> None:
        x, y = self.grid.geobox.xy_from_pixel(*self.place)
        self.drive.poses.append(Pose(float(x), float(y), heading_rad=heading))
        window = self.grid.merge(self.drive.scan(len(self.drive.poses) - 1))
        here = np.s_[window.row : window.row + window.rows, window.col : window.col + window.cols]
        self.states[here] = _LIMITS.of(self.grid.probabilities[here])
        driven = self.drive.metres[-1] if self.drive.metres else 0.0
        self.drive.metres.append(driven + metres)
        self.drive.known.append(int(np.count_nonzero(self.states != UNKNOWN)))

    def _go(self, view: Cell, cells: Integers, enough: Callable[[States], bool] | None) -> None:
        """Drive towards a view until what it is to see is known; note what was looked at in vain."""
        aimed = cells
        if self._drive_to(view, cells, enough):
            angle, aimed = self.planner.heading(self.at, self._left(cells))
            ahead = np.array([math.sin(angle), math.cos(angle)])
            self._scan(0.0, self._heading(self.place, self.place + ahead))
            self.drive.views.append(len(self.drive.poses) - 1)
        left = self._left(aimed)
        if len(left) == len(aimed):
            self.planner.tried[tuple(left.T)] += 1

    def _drive_to(self, view: Cell, cells: Integers, enough: Callable[[States], bool] | None) -> bool:
        """Scan on the way to a view; return whether it was reached, or left for what the scans have shown."""
        for _ in range(_MAX_WAYS):
            try:
                way = self._way(view)
            except PathError:  # what the scans have shown lies between
                return False
            if self._follow(way, cells, enough):
                return bool(len(self._left(cells))) and not (enough is not None and enough(self.states))
        return False

    def _follow(self, way: Floats, cells: Integers, enough: Callable[[States], bool] | None) -> bool:
        """Scan along a way until its end, or nothing is left to do there; False where it is blocked."""
        for begin, end in pairwise(way):
            span = float(np.hypot(*(end - begin))) * self.cell_m
            line = _cells_between(begin, end)
            line = line[self._is_open(line)]
            heading = self._heading(begin, end)
            for share in np.linspace(0, 1, max(math.ceil(span / _SCAN_EVERY_M), 1) + 1)[1:]:
                step = float(np.hypot(*(begin + share * (end - begin) - self.place))) * self.cell_m
                reached = begin + share * (end - begin)
                rows, cols = _cells_between(self.place, reached).T
                self.planner.driven[rows, cols] = self.planner.driven[rows[:-1], cols[1:]] = True
                self.place = reached
                self._scan(step, heading)
                if (enough is not None and enough(self.states)) or not len(self._left(cells)):
                    return True
                if not self._is_open(line).all():
                    return False
        return True

    def _heading(self, begin: Floats, end: Floats) -> float:
        """Return the direction on the map of a step in cells, in radians."""
        (x0, x1), (y0, y1) = self.grid.geobox.xy_from_pixel(*np.stack([begin, end]).T)
        return math.atan2(y1 - y0, x1 - x0)

    def _left(self, cells: Integers) -> Integers:
        """Return which of some cells are frontiers still."""
        return cells[is_frontier(self.states, cells)]

    def _is_open(self, cells: Integers) -> Bools:
        """Return which cells (n, 2) are free, or were driven over, (n,)."""
        at = tuple(cells.T)
        return np.asarray((self.states[at] == FREE) | self.planner.driven[at])

    def _way(self, view: Cell) -> Floats:
        """Return the corners of the way to a cell, (n, 2) rows and columns, from where the robot stands."""
        passable = self.planner.passable(self.states, self.at)
        corners = pull_string(passable, shortest_path(passable, self.at, view).cells) + 0.5
        if np.array_equal(corners[0], self.place):
            return np.asarray(corners)
        if len(corners) > 1 and self._is_open(_cells_between(self.place, corners[1])).all():
            corners = corners[1:]
        return np.vstack([self.place, corners])


def _cells_between(begin: Floats, end: Floats) -> Integers:
    """Return the cells (n, 2) that a straight line leads over."""
    return np.linspace(begin, end, int(4 * np.abs(end - begin).max()) + 2).astype(np.int64)


def is_frontier(states: States, cells: Integers) -> Bools:
    """Return which cells (n, 2) are free beside an unknown one, (n,)."""
    rows, cols = states.shape
    beside = np.zeros(len(cells), bool)
    for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        r, c = np.clip(cells[:, 0] + down, 0, rows - 1), np.clip(cells[:, 1] + right, 0, cols - 1)
        beside |= states[r, c] == UNKNOWN
    return np.asarray(beside & (states[tuple(cells.T)] == FREE))


def knowable_cells(solid: Bools, at: Cell, cell_m: float, range_m: float, clearance_m: float = 0.0) -> Bools:
    """Return the cells that some place sees which the robot can reach, if it knew the map; (rows, cols)."""
    states = np.where(solid, np.uint8(OCCUPIED), np.uint8(FREE))
    planner = ViewPlanner(solid.shape, cell_m, range_m, clearance_m=clearance_m)
    graph = block_graph(planner.passable(states, at), max(round(0.2 / cell_m), 1))
    reached = np.isfinite(graph.distances(int(graph.node_of[at])))
    return visible_cells(solid, graph.places[reached], range_m / cell_m)
