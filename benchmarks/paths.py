"""Run time of shortest paths on large grids, compared with other libraries.

    python -m benchmarks.paths

One thread; the minimum of several runs, with the libraries in turn. Pure Python libraries run on small
grids only.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from math import sqrt
from typing import Any

from benchmarks.competitors import with_project

LARGE, SMALL = 4096, 512
RUNS = 3

Cell = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Search:
    """One row of the table.

    Parameters
    ----------
    field : str
        Title of the grid.
    library : str
    seconds : float
    cost : float
        Length of the path in cells.
    uavseg_s : float
        Seconds of uavseg on the same grid.
    """

    field: str
    library: str
    seconds: float
    cost: float
    uavseg_s: float


def searches() -> list[Search]:
    """All rows, measured in a child process so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.paths"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Search(*row) for row in json.loads(output)]


@dataclass(frozen=True, slots=True)
class Field:
    """A grid of free cells with a start and a goal."""

    title: str
    mask: Any
    start: Cell
    goal: Cell


def fields(side: int) -> Iterator[Field]:
    """An open field, mazes with narrow and wide corridors, a maze with loops, and random obstacles."""
    import numpy as np

    last = (side - 3) // 2 * 2 + 1
    yield Field(f"open field, {side}²", np.ones((side, side), bool), (0, 0), (side - 1, side - 1))
    narrow = maze(side)
    yield Field(f"maze, {side}²", narrow, (1, 1), (last, last))
    wide = np.kron(maze(side // 4), np.ones((4, 4), bool))
    end = 4 * ((side // 4 - 3) // 2 * 2 + 1)
    yield Field(f"maze of wide corridors, {side}²", wide, (4, 4), (end, end))
    rng = np.random.default_rng(1)
    loops = narrow.copy()
    odd = np.add.outer(np.arange(side), np.arange(side)) % 2 == 1
    inside = np.zeros_like(odd)
    inside[1 : last + 1, 1 : last + 1] = True
    loops |= odd & inside & (rng.random((side, side)) < 0.1)
    yield Field(f"maze with loops, {side}²", loops, (1, 1), (last, last))
    scattered = rng.random((side, side)) > 0.1
    scattered[0, 0] = scattered[-1, -1] = True
    yield Field(f"obstacles on a tenth of the cells, {side}²", scattered, (0, 0), (side - 1, side - 1))


def maze(side: int, seed: int = 0) -> Any:
    """A random maze without loops: corridors of one cell that connect all cells with odd coordinates."""
    import numpy as np
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import minimum_spanning_tree

    half = (side - 1) // 2
    cells = np.arange(half * half).reshape(half, half)
    ones = np.concatenate([cells[:, :-1].ravel(), cells[:-1].ravel()])
    others = np.concatenate([cells[:, 1:].ravel(), cells[1:].ravel()])
    weights = 1 + np.random.default_rng(seed).random(len(ones))
    tree = minimum_spanning_tree(coo_matrix((weights, (ones, others)), shape=(half * half,) * 2)).tocoo()
    mask = np.zeros((side, side), bool)
    mask[1 : 2 * half : 2, 1 : 2 * half : 2] = True
    (r, c), (down, right) = np.divmod(tree.row, half), np.divmod(tree.col, half)
    mask[r + down + 1, c + right + 1] = True
    return mask


def by_uavseg(field: Field) -> Callable[[], float]:
    """The search of uavseg."""
    from uavseg.occupancy.paths.astar import shortest_path

    return lambda: shortest_path(field.mask, field.start, field.goal).cost


def by_skimage(field: Field) -> Callable[[], float]:
    """scikit-image, 8-connected; it cuts corners."""
    import numpy as np
    from skimage.graph import route_through_array

    costs = np.where(field.mask, 1.0, -1.0)
    return lambda: float(route_through_array(costs, field.start, field.goal)[1])


def by_networkx(field: Field) -> Callable[[], float]:
    """A* of networkx with the octile distance, on a graph that is built before the measurement."""
    import networkx as nx

    rows, cols = field.mask.shape
    graph = nx.Graph()
    free = {(r, c) for r in range(rows) for c in range(cols) if field.mask[r, c]}
    for r, c in free:
        for cell in ((r, c + 1), (r + 1, c)):
            if cell in free:
                graph.add_edge((r, c), cell, weight=1.0)
        for side in (1, -1):
            if {(r, c + side), (r + 1, c), (r + 1, c + side)} <= free:
                graph.add_edge((r, c), (r + 1, c + side), weight=sqrt(2))

    def octile(one: Cell, other: Cell) -> float:
        down, right = abs(one[0] - other[0]), abs(one[1] - other[1])
        return max(down, right) + (sqrt(2) - 1) * min(down, right)

    return lambda: float(nx.astar_path_length(graph, field.start, field.goal, octile))


def by_pathfinding(field: Field) -> Callable[[], float]:
    """The package pathfinding, without cutting corners; its grid has to be reset after each search."""
    from pathfinding.core.diagonal_movement import DiagonalMovement
    from pathfinding.core.grid import Grid
    from pathfinding.finder.a_star import AStarFinder

    grid = Grid(matrix=field.mask.astype(int).tolist())
    finder = AStarFinder(diagonal_movement=DiagonalMovement.only_when_no_obstacle)

    def search() -> float:
        grid.cleanup()
        start, goal = (grid.node(cell[1], cell[0]) for cell in (field.start, field.goal))
        path = [(node.y, node.x) for node in finder.find_path(start, goal, grid)[0]]
        return sum(sqrt((a - c) ** 2 + (b - d) ** 2) for (a, b), (c, d) in pairwise(path))

    return search


SEARCHES = {
    "uavseg": by_uavseg,
    "scikit-image": by_skimage,
    "networkx": by_networkx,
    "pathfinding": by_pathfinding,
}


MODULES = {"scikit-image": "skimage", "networkx": "networkx", "pathfinding": "pathfinding"}


def installed(names: Iterable[str]) -> tuple[str, ...]:
    """The libraries that are installed."""
    return tuple(name for name in names if find_spec(MODULES.get(name, "uavseg")) is not None)


def measure(field: Field, names: tuple[str, ...], runs: int) -> Iterator[Search]:
    """All libraries on one grid."""
    fastest: dict[str, float] = dict.fromkeys(names, float("inf"))
    costs: dict[str, float] = {}
    calls = {name: SEARCHES[name](field) for name in names}
    for _ in range(runs):
        for name, call in calls.items():
            begun = time.perf_counter()
            costs[name] = call()
            fastest[name] = min(fastest[name], time.perf_counter() - begun)
    for name in names:
        yield Search(field.title, name, fastest[name], costs[name], fastest["uavseg"])


def _all() -> Iterator[Search]:
    for field in fields(LARGE):
        yield from measure(field, installed(("uavseg", "scikit-image")), RUNS)
    for field in fields(SMALL):
        yield from measure(field, installed(SEARCHES), RUNS)


if __name__ == "__main__":
    for absent in SEARCHES.keys() - installed(SEARCHES):
        print(f"paths: {absent} is skipped, it is not installed", file=sys.stderr)
    by_uavseg(next(fields(64)))()  # compiles the kernels
    print(json.dumps([(row.field, row.library, row.seconds, row.cost, row.uavseg_s) for row in _all()]))
