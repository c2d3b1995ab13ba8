"""Seconds of shortest paths on large grids, beside other libraries.

    python -m benchmarks.paths

One thread; the least of several runs, of everybody in turn. Those written in Python run on small fields only.
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
        What is searched.
    who : str
    seconds : float
    cost : float
        Length of the path in cells.
    ours_s : float
        Seconds of uavseg on the same field in the same run.
    """

    field: str
    who: str
    seconds: float
    cost: float
    ours_s: float


def searches() -> list[Search]:
    """All rows, measured in a process of its own so that the caller stays small."""
    command = [sys.executable, "-m", "benchmarks.paths"]
    told = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Search(*row) for row in json.loads(told)]


@dataclass(frozen=True, slots=True)
class Field:
    """A mask to find a path over, from one cell to another."""

    title: str
    mask: Any
    start: Cell
    goal: Cell


def fields(side: int) -> Iterator[Field]:
    """An open field, mazes of narrow and of wide corridors and one with loops, and scattered obstacles."""
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
    yield Field(f"a tenth scattered, {side}²", scattered, (0, 0), (side - 1, side - 1))


def maze(side: int, seed: int = 0) -> Any:
    """A maze without loops: corridors of one cell between all cells of odd coordinates, drawn at random."""
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


def ours(field: Field) -> Callable[[], float]:
    """Our own search."""
    from uavseg.occupancy.paths.astar import shortest_path

    return lambda: shortest_path(field.mask, field.start, field.goal).cost


def by_skimage(field: Field) -> Callable[[], float]:
    """scikit-image, eight-connected; it cuts corners."""
    import numpy as np
    from skimage.graph import route_through_array

    costs = np.where(field.mask, 1.0, -1.0)
    return lambda: float(route_through_array(costs, field.start, field.goal)[1])


def by_networkx(field: Field) -> Callable[[], float]:
    """networkx's A* with our distance, on a graph made beforehand."""
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
    """The package pathfinding, with its rule that cuts no corners; its grid is used up by a search."""
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


EVERYBODY = {
    "uavseg": ours,
    "scikit-image": by_skimage,
    "networkx": by_networkx,
    "pathfinding": by_pathfinding,
}


MODULES = {"scikit-image": "skimage", "networkx": "networkx", "pathfinding": "pathfinding"}


def present(names: Iterable[str]) -> tuple[str, ...]:
    """Those of them that can run here."""
    return tuple(name for name in names if find_spec(MODULES.get(name, "uavseg")) is not None)


def measured(field: Field, names: tuple[str, ...], runs: int) -> Iterator[Search]:
    """Everybody on one field."""
    least: dict[str, float] = dict.fromkeys(names, float("inf"))
    costs: dict[str, float] = {}
    calls = {name: EVERYBODY[name](field) for name in names}
    for _ in range(runs):
        for name, call in calls.items():
            begun = time.perf_counter()
            costs[name] = call()
            least[name] = min(least[name], time.perf_counter() - begun)
    for name in names:
        yield Search(field.title, name, least[name], costs[name], least["uavseg"])


def _all() -> Iterator[Search]:
    for field in fields(LARGE):
        yield from measured(field, present(("uavseg", "scikit-image")), RUNS)
    for field in fields(SMALL):
        yield from measured(field, present(EVERYBODY), RUNS)


if __name__ == "__main__":
    for absent in EVERYBODY.keys() - present(EVERYBODY):
        print(f"paths: {absent} is left out, it is not installed", file=sys.stderr)
    ours(next(fields(64)))()  # what is compiled once for a machine is compiled now
    print(json.dumps([(row.field, row.who, row.seconds, row.cost, row.ours_s) for row in _all()]))
