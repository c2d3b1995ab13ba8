"""Paths over drawn maps, compared with an independent labelling and Dijkstra's search."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse import csgraph

import uavseg
from uavseg.errors import PathError
from uavseg.jobs.source.open_source import open_probability_map
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.grid.tiling import Window

CELL = 0.1
RANGE = (0, 0.45)
Cell = tuple[int, int]


def grid(v: NDArray[Any]) -> OccupancyGrid:
    return OccupancyGrid.from_probabilities(v.astype(np.float32), local_geobox(v.shape, CELL, (0.0, 0.0)))


def place(shape: tuple[int, ...], cell: Cell) -> tuple[float, float]:
    return CELL * (cell[1] + 0.5), CELL * (shape[0] - cell[0] - 0.5)


def dijkstra(free: NDArray[np.bool_], start: Cell, goal: Cell) -> float:
    """The length in cells of the shortest path that cuts no corner; infinite where there is none."""
    number = np.arange(free.size).reshape(free.shape)
    edges = []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = np.zeros_like(free)
        cols = slice(max(-across, 0), free.shape[1] - max(across, 0))
        beside = slice(cols.start + across, cols.stop + across)
        rows, below = slice(0, free.shape[0] - down), slice(down, free.shape[0])
        open_ = free[rows, cols] & free[below, beside]
        if down and across:
            open_ &= free[rows, beside] & free[below, cols]
        here[rows, cols] = open_
        edges.append((number[here], number[here] + down * free.shape[1] + across, np.hypot(down, across)))
    one, other = (np.concatenate([edge[k] for edge in edges]) for k in (0, 1))
    length = np.concatenate([np.full(len(edge[0]), edge[2]) for edge in edges])
    graph = sparse.csr_array((length, (one, other)), shape=(free.size, free.size))
    return float(csgraph.dijkstra(graph, directed=False, indices=number[start])[number[goal]])


def clearances(free: NDArray[np.bool_]) -> NDArray[np.float64]:
    """From centres of cells to the nearest point of a wall or of the edge: of a lattice of half cells."""
    lattice = np.zeros((2 * free.shape[0] + 1, 2 * free.shape[1] + 1), bool)
    lattice[1:-1, 1:-1] = True
    for row, col in np.argwhere(~free).tolist():
        lattice[2 * row : 2 * row + 3, 2 * col : 2 * col + 3] = False
    return np.asarray(ndimage.distance_transform_edt(lattice)[1::2, 1::2] * CELL / 2)


def length_of(v: NDArray[Any], start: Cell, goal: Cell, **how: Any) -> float:
    """The length of the path in cells; infinite where none is found."""
    try:
        way = uavseg.path(grid(v), RANGE, place(v.shape, start), place(v.shape, goal), **how)
    except PathError:
        return np.inf
    return way.length_m / CELL


@pytest.mark.parametrize("offset", range(8))
@pytest.mark.parametrize("width", [1, 2, 3, 4, 5, 8])
def test_a_corridor_of_any_width_joins_two_halls(width: int, offset: int) -> None:
    v = np.full((64, 192), 0.9)
    v[8:56, 8:56] = v[8:56, 136:184] = 0.1
    v[24 + offset : 24 + offset + width, 56:136] = 0.1
    start, goal = (30, 20), (40, 170)
    assert length_of(v, start, goal) == pytest.approx(dijkstra(v < 0.45, start, goal))


@pytest.mark.slow
@given(seed=st.integers(0, 2**32), block=st.integers(1, 5), share=st.sampled_from([0.05, 0.2, 0.3]))
@settings(max_examples=60)
def test_wherever_the_cells_leave_a_way_the_path_is_as_short(seed: int, block: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    walls = rng.random((64, 96)) < share
    v = np.where(walls, rng.choice([0.5, 0.9], walls.shape), 0.1).repeat(block, 0).repeat(block, 1)[:80, :128]
    v = np.where(rng.random(v.shape) < 0.02, 0.5, v)
    start, goal = map(tuple, rng.choice(np.argwhere(v < 0.45), 2).tolist())
    expected = dijkstra(v < 0.45, start, goal)
    assert length_of(v, start, goal) == (expected if np.isinf(expected) else pytest.approx(expected))


@pytest.mark.slow
@given(seed=st.integers(0, 2**32), clearance=st.sampled_from([0.1, 0.15, 0.25, 0.4]))
@settings(max_examples=40)
def test_with_a_clearance_too(seed: int, clearance: float) -> None:
    rng = np.random.default_rng(seed)
    v = np.where(rng.random((16, 24)) < 0.2, 0.9, 0.1).repeat(6, 0).repeat(6, 1)
    free = clearances(v < 0.45) >= clearance - 1e-9
    if not free.any():
        return
    start, goal = map(tuple, rng.choice(np.argwhere(free), 2).tolist())
    expected = dijkstra(free, start, goal)
    found = length_of(v, start, goal, clearance=clearance)
    assert found == (expected if np.isinf(expected) else pytest.approx(expected))


def halls() -> NDArray[np.float32]:
    """Two halls with a wall of 10 cells between them, and a door of one cell in it."""
    v = np.full((64, 128), 0.1, np.float32)
    v[:, 60:70] = 0.95
    v[40, 60:70] = 0.1
    return v


WALLED = {  # what stands in a door, how the message says it, and the range that opens it
    "occupied": (0.9, "0.900", (0, 0.9)),
    "unknown": (0.5, "0.500", (0, 0.501)),
}


@pytest.mark.parametrize("name", WALLED)
def test_a_refusal_says_what_closes_the_way_and_what_opens_it(name: str) -> None:
    value, said, opened = WALLED[name]
    v = halls()
    v[40, 64:66] = value
    ends = {"start": place(v.shape, (5, 5)), "goal": place(v.shape, (5, 120))}
    message = (
        f"come nearest to each other at 6.5,2.35, where v is {said}; --range 0,{opened[1]} joins them there"
    )
    with pytest.raises(PathError, match=re.escape(message)):
        uavseg.path(grid(v), RANGE, **ends)
    assert uavseg.path(grid(v), opened, **ends).length_m > 11


def test_where_there_are_no_values_no_range_opens_a_way() -> None:
    v = halls()
    v[40, 64:66] = np.nan
    with pytest.raises(PathError, match=r"nearest to each other at 65,40\.5, where the map has no values"):
        uavseg.path(v, RANGE, (5.5, 5.5), (120.5, 5.5))


def test_a_refused_clearance_says_which_one_leaves_a_way() -> None:
    v = np.full((64, 128), 0.1)
    v[:, 60:70] = 0.9
    v[20:27, 60:70] = 0.1  # a door of 7 cells
    ends = {"start": place(v.shape, (32, 30)), "goal": place(v.shape, (32, 100))}
    with pytest.raises(PathError, match=r"too narrow for a clearance of 0\.4 m; .* at most 0\.35 m exists"):
        uavseg.path(grid(v), RANGE, **ends, clearance=0.4)
    assert uavseg.path(grid(v), RANGE, **ends, clearance=0.35).length_m > 7


def test_cells_that_touch_at_a_corner_alone_are_no_way() -> None:
    v = np.full((64, 64), 0.9)
    v[:32, :32] = v[32:, 32:] = 0.1
    ends = {"start": place(v.shape, (5, 5)), "goal": place(v.shape, (60, 60))}
    with pytest.raises(PathError, match=r"region 1 and .* region 2, .* at 3\.2,3\.2, where v is 0\.900"):
        uavseg.path(grid(v), RANGE, **ends)


def test_regions_of_the_paper_close_a_corridor_and_the_message_says_what_opens_it() -> None:
    v = np.full((64, 192), 0.9)
    v[8:56, 8:56] = v[8:56, 136:184] = 0.1
    v[26:29, 56:136] = 0.1
    ends = {"start": place(v.shape, (30, 20)), "goal": place(v.shape, (40, 170))}
    with pytest.raises(PathError, match=r"region 1 and .* region 2, .*belong to no region; --refine pixels"):
        uavseg.path(grid(v), RANGE, **ends, refine="scan")
    assert uavseg.path(grid(v), RANGE, **ends).region == 1


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*of grey 205:UserWarning")  # free_thresh 0.25, as this map is published
@pytest.mark.parametrize("name", ["depot.yaml", "tb3_sandbox.yaml"])
def test_on_real_maps(name: str, shared_data: Path) -> None:
    source: Any = open_probability_map(shared_data / "maps" / name)
    box = source.dataset.geobox
    values, _ = source.dataset.read(Window(0, 0, *box.shape))
    free = values[0] <= 0.45
    step = abs(box.transform.a)
    for pair in np.random.default_rng(3).choice(np.argwhere(free), (8, 2)):
        start, goal = (tuple(map(float, box.xy_from_pixel(*(cell + 0.5)))) for cell in pair)
        expected = dijkstra(free, *(tuple(cell.tolist()) for cell in pair)) * step
        try:
            found = uavseg.path(shared_data / "maps" / name, RANGE, start, goal).length_m
        except PathError:
            found = np.inf
        assert found == (expected if np.isinf(expected) else pytest.approx(expected))
