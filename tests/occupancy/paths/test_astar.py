"""A*: costs compared with Dijkstra's algorithm and scikit-image; no corner is cut."""

import heapq
from itertools import pairwise
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from skimage.graph import MCP, route_through_array

from uavseg.errors import PathError
from uavseg.occupancy.paths.astar import DIAGONAL, STRAIGHT, CellPath, shortest_path

Cell = tuple[int, int]
STEPS = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c]


def picture(text: str) -> np.ndarray:
    """# is impassable."""
    return np.array([[c != "#" for c in row] for row in text.split()])


def steps_from(mask: np.ndarray, cell: Cell) -> list[Cell]:
    """The neighbours that may be entered, by definition."""
    rows, cols = mask.shape
    found = []
    for down, right in STEPS:
        row, col = cell[0] + down, cell[1] + right
        if (
            0 <= row < rows
            and 0 <= col < cols
            and mask[row, col]
            and mask[cell[0], col]
            and mask[row, cell[1]]
        ):
            found.append((row, col))
    return found


def dijkstra(mask: np.ndarray, start: Cell, goal: Cell) -> tuple[int, int] | None:
    """Straight and diagonal steps of a shortest path, by Dijkstra's algorithm."""
    best = {start: 0.0}
    queue: list[tuple[float, int, int, Cell]] = [(0.0, 0, 0, start)]
    while queue:
        cost, straight, diagonal, cell = heapq.heappop(queue)
        if cell == goal:
            return straight, diagonal
        if cost > best[cell]:
            continue
        for there in steps_from(mask, cell):
            slant = there[0] != cell[0] and there[1] != cell[1]
            a, b = straight + (not slant), diagonal + slant
            if a + b * sqrt(2) < best.get(there, np.inf):
                best[there] = a + b * sqrt(2)
                heapq.heappush(queue, (a + b * sqrt(2), a, b, there))
    return None


def by_skimage(mask: np.ndarray, start: Cell, goal: Cell) -> float:
    """The smallest cost as scikit-image finds it in a graph that has no cut corners.

    Its own eight-connected metric cuts them. So each step of ours becomes two of its steps in space: from a
    cell (level 1, both coordinates even) down to the middle of an edge (level 0), or up to the middle of four
    cells (level 2) that is there only where all four are passable, and back to level 1.
    """
    rows, cols = mask.shape
    costs = np.full((3, 2 * rows - 1, 2 * cols - 1), -1.0)
    costs[1, ::2, ::2][mask] = 0
    costs[0, ::2, 1::2][mask[:, 1:] & mask[:, :-1]] = 1
    costs[0, 1::2, ::2][mask[1:] & mask[:-1]] = 1
    costs[2, 1::2, 1::2][mask[1:, 1:] & mask[1:, :-1] & mask[:-1, 1:] & mask[:-1, :-1]] = sqrt(2)
    straight = [(level, r, c) for level in (-1, 1) for r, c in STEPS if r == 0 or c == 0]
    diagonal = [(level, r, c) for level in (-1, 1) for r, c in STEPS if r and c]
    search = MCP(costs, offsets=straight + diagonal)
    end = (1, 2 * goal[0], 2 * goal[1])
    return float(search.find_costs([(1, 2 * start[0], 2 * start[1])], [end])[0][end])


def found(mask: np.ndarray, start: Cell, goal: Cell) -> CellPath | None:
    """The path, or None; checks every step."""
    try:
        path = shortest_path(mask, start, goal)
    except PathError:
        return None
    cells = [tuple(cell) for cell in path.cells.tolist()]
    assert cells[0] == start and cells[-1] == goal
    assert all(there in steps_from(mask, here) for here, there in pairwise(cells))
    slants = np.abs(np.diff(path.cells, axis=0)).sum(axis=1) == 2
    assert (path.straight, path.diagonal) == ((~slants).sum(), slants.sum())
    return path


def agreed(mask: np.ndarray, start: Cell, goal: Cell) -> CellPath | None:
    """The path, whose steps are as many of either kind as Dijkstra's, and whose cost is skimage's."""
    path, expected = found(mask, start, goal), dijkstra(mask, start, goal)
    assert (None if path is None else (path.straight, path.diagonal)) == expected
    assert (np.inf if path is None else path.cost) == pytest.approx(by_skimage(mask, start, goal), rel=1e-12)
    return path


def maze(side: int, seed: int) -> np.ndarray:
    """Corridors of one cell between all cells of odd coordinates, without a loop."""
    rng = np.random.default_rng(seed)
    mask = np.zeros((side, side), bool)
    mask[1, 1] = True
    trail = [(1, 1)]
    while trail:
        row, col = trail[-1]
        ways = [
            (r, c) for r, c in ((-2, 0), (2, 0), (0, -2), (0, 2)) if 0 < row + r < side and 0 < col + c < side
        ]
        ways = [(r, c) for r, c in ways if not mask[row + r, col + c]]
        if not ways:
            trail.pop()
            continue
        down, right = ways[rng.integers(len(ways))]
        mask[row + down // 2, col + right // 2] = mask[row + down, col + right] = True
        trail.append((row + down, col + right))
    return mask


def test_the_shortest_path_goes_round_a_wall_without_touching_its_corner() -> None:
    path = agreed(picture("..... ..#.. ..#.. ..#.. ....."), (2, 0), (2, 4))
    assert path is not None and (path.straight, path.diagonal) == (4, 2)


def test_no_path_leads_between_two_corners() -> None:
    assert agreed(picture(".# #."), (0, 0), (1, 1)) is None
    assert agreed(picture(".# .."), (0, 0), (1, 1)).cost == 2  # type: ignore[union-attr]


def test_a_path_to_its_start_has_one_cell() -> None:
    path = agreed(picture("#.#"), (0, 1), (0, 1))
    assert path is not None and path.cells.tolist() == [[0, 1]] and path.cost == 0


def test_on_an_open_field_only_the_start_is_expanded() -> None:
    path = shortest_path(np.ones((700, 900), bool), (3, 5), (650, 890))
    assert path.cost == 238 + 647 * sqrt(2) and path.expanded == 1


@pytest.mark.parametrize("first", range(0, 200, 20))
def test_random_maps(first: int) -> None:
    for seed in range(first, first + 20):
        rng = np.random.default_rng(seed)
        shape = tuple(rng.integers(1, 100, 2))
        mask = rng.random(shape) < rng.choice([0.6, 0.75, 0.9, 0.97])
        if seed % 3 == 0:  # rooms and furniture of several cells
            mask = np.repeat(np.repeat(mask, 3, 0), 2, 1)[: shape[0], : shape[1]]
        free = np.argwhere(mask)
        if len(free):
            start, goal = (tuple(free[k].tolist()) for k in rng.integers(0, len(free), 2))
            agreed(mask, start, goal)


@pytest.mark.slow
@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12)), st.data())
@settings(max_examples=300)
def test_any_small_map(mask: np.ndarray, data: st.DataObject) -> None:
    free = [tuple(cell) for cell in np.argwhere(mask).tolist()]
    if free:
        agreed(mask, data.draw(st.sampled_from(free)), data.draw(st.sampled_from(free)))


@pytest.mark.parametrize("seed", range(5))
def test_mazes_where_no_corner_can_be_cut_cost_what_skimage_says_of_the_mask_itself(seed: int) -> None:
    mask = maze(101, seed)
    path = found(mask, (1, 1), (99, 99))
    assert path is not None and path.diagonal == 0
    _, cost = route_through_array(np.where(mask, 1.0, -1.0), (1, 1), (99, 99), fully_connected=False)
    assert path.cost == cost


@pytest.mark.parametrize("seed", range(10))
def test_a_path_costs_no_less_than_with_corners_cut_and_no_more_than_along_edges(seed: int) -> None:
    mask = np.random.default_rng(seed).random((40, 60)) < 0.92
    mask[0, 0] = mask[-1, -1] = True
    path, costs = found(mask, (0, 0), (39, 59)), np.where(mask, 1.0, -1.0)
    assert path is not None
    _, cutting = route_through_array(costs, (0, 0), (39, 59))
    _, square = route_through_array(costs, (0, 0), (39, 59), fully_connected=False)
    assert cutting <= path.cost + 1e-9 and path.cost <= square
    _, nothing_to_cut = route_through_array(np.ones_like(costs), (0, 0), (39, 59))
    assert shortest_path(np.ones_like(mask), (0, 0), (39, 59)).cost == pytest.approx(nothing_to_cut)


@given(arrays(bool, (9, 14), elements=st.sampled_from([True, True, False])))
@settings(max_examples=100)
def test_a_turned_or_mirrored_map_has_a_path_of_the_same_cost(mask: np.ndarray) -> None:
    mask[0, 0] = mask[8, 13] = True
    costs = set()
    for turn, start, goal in (
        (mask, (0, 0), (8, 13)),
        (mask[::-1], (8, 0), (0, 13)),
        (mask[:, ::-1], (0, 13), (8, 0)),
        (mask.T, (0, 0), (13, 8)),
        (mask, (8, 13), (0, 0)),
    ):
        path = found(turn, start, goal)
        costs.add(None if path is None else (path.straight, path.diagonal))
    assert len(costs) == 1


@pytest.mark.parametrize("width", [62, 63, 64, 65, 126, 127, 128, 129])
def test_words_of_the_bitmap_leave_no_seam(width: int) -> None:
    rng = np.random.default_rng(width)
    for mask in (rng.random((width, 5)) < 0.85, rng.random((5, width)) < 0.85):
        mask[0, 0] = mask[-1, -1] = True
        agreed(mask, (0, 0), (mask.shape[0] - 1, mask.shape[1] - 1))


@pytest.mark.slow
def test_pools_grow_and_change_nothing() -> None:
    rng = np.random.default_rng(9)
    mask = rng.random((150, 150)) < 0.9
    mask[0, 0] = mask[-1, -1] = True
    whole = np.zeros((700, 700), bool)  # the same in a map that needs larger pools
    whole[:150, :150] = mask
    tiled = np.tile(mask, (3, 3))
    small, large = found(mask, (0, 0), (149, 149)), found(whole, (0, 0), (149, 149))
    assert small is not None and large is not None and small.cost == large.cost
    path = found(tiled, (0, 0), (449, 449))
    assert path is not None
    assert path.cost == pytest.approx(by_skimage(tiled, (0, 0), (449, 449)), rel=1e-12)


def test_costs_are_compared_as_real_numbers_are() -> None:
    """a + b sqrt 2 < 0 exactly where a < 0 and a^2 > 2 b^2, or so; the integers say the same."""
    rng = np.random.default_rng(0)
    for a, b in rng.integers(-(1 << 24), 1 << 24, (2000, 2)).tolist():
        near = round(-b * sqrt(2))  # as near to 0 as it gets
        for whole in (a, near, near + 1, near - 1):
            value = whole * abs(whole) + 2 * b * abs(b)  # has the sign of whole + b sqrt 2
            cost = STRAIGHT * whole + DIAGONAL * b
            assert (value > 0) == (cost > 0) and (value < 0) == (cost < 0)


@pytest.mark.parametrize("cell", [(-1, 0), (0, -1), (2, 0), (0, 3), (1, 1)])
def test_a_start_or_goal_that_is_not_passable_is_refused(cell: Cell) -> None:
    mask = picture("... .#.")
    with pytest.raises(PathError, match="start"):
        shortest_path(mask, cell, (0, 0))
    with pytest.raises(PathError, match="goal"):
        shortest_path(mask, (0, 0), cell)


def test_no_path_is_an_error_in_one_line() -> None:
    with pytest.raises(PathError, match="no path leads"):
        shortest_path(picture(".#."), (0, 0), (0, 2))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "turtlebot3_map.pgm",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("willow-full.pgm", "depot.pgm")),
    ],
)
def test_real_maps(name: str, shared_data: Path) -> None:
    from skimage.io import imread

    mask = imread(shared_data / "maps" / name) > 250
    free = np.argwhere(mask)
    rng = np.random.default_rng(1)
    for pair in rng.integers(0, len(free), (3, 2)):
        start, goal = (tuple(free[k].tolist()) for k in pair)
        path = found(mask, start, goal)
        cost = by_skimage(mask, start, goal)
        assert (np.inf if path is None else path.cost) == pytest.approx(cost, rel=1e-12)
