"""Free space: shortest paths against a fine grid search, legs that stay free, and what has no way."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace

boxes = st.tuples(st.integers(1, 8), st.integers(1, 8), st.integers(1, 3), st.integers(1, 3)).map(
    lambda box: shapely.box(box[0], box[1], box[0] + box[2], box[1] + box[3])
)
START, END = (0.0, 0.0), (12.0, 12.0)


def length(path: np.ndarray) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def brute_force(space: FreeSpace, corners: list[tuple[float, float]]) -> float:
    """Bellman-Ford over all pairs of all corners: slow and plain."""
    nodes = [START, END, *corners]
    blocked = shapely.union_all(list(space.obstacles)).buffer(-1e-6)  # none may pass where two touch
    best = [math.inf] * len(nodes)
    best[0] = 0.0
    for _ in nodes:
        for k, here in enumerate(nodes):
            for m, there in enumerate(nodes):
                line = shapely.LineString([here, there])
                if k != m and line.intersection(blocked).length == 0:
                    best[m] = min(best[m], best[k] + math.dist(here, there))
    return best[1]


@pytest.mark.slow
@given(st.lists(boxes, min_size=1, max_size=3))
@settings(max_examples=30)
def test_a_path_is_as_short_as_any_over_all_corners(obstacles: list[shapely.Polygon]) -> None:
    space = FreeSpace(obstacles=obstacles)
    corners = [tuple(c) for box in obstacles for c in shapely.get_coordinates(box)[:-1].tolist()]
    path = space.path(START, END)
    assert length(path) == pytest.approx(brute_force(space, corners), abs=1e-6)
    inner = shapely.buffer(shapely.union_all(obstacles), -1e-3)
    assert not shapely.LineString(path).intersects(inner)
    assert path[0].tolist() == list(START) and path[-1].tolist() == list(END)


@given(st.lists(boxes, min_size=1, max_size=4))
@settings(max_examples=30)
def test_lengths_are_a_metric(obstacles: list[shapely.Polygon]) -> None:
    points = np.array([[0, 0], [12, 12], [0, 12], [12, 0], [6.5, 0.5]])
    found = FreeSpace(obstacles=obstacles).paths(points)
    assert np.allclose(found.lengths, found.lengths.T)
    straight = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    assert (found.lengths >= straight - 1e-9).all()
    through = found.lengths[:, :, None] + found.lengths[None]
    assert (found.lengths[:, None, :] <= through + 1e-9).all()
    for k in range(len(points)):
        for m in range(len(points)):
            assert length(found.path(k, m)) == pytest.approx(found.lengths[k, m])


@given(st.lists(boxes, min_size=1, max_size=3), st.integers(0, 10**6))
@settings(max_examples=20)
def test_paths_found_together_are_those_found_one_by_one(obstacles: list[shapely.Polygon], seed: int) -> None:
    space = FreeSpace(obstacles=obstacles)
    points = np.random.default_rng(seed).uniform(-2, 14, (20, 2))
    points = points[space.is_free(points)]
    starts, ends = points[:-1], points[1:]
    for path, start, end in zip(space.each_path(starts, ends), starts, ends, strict=True):
        assert np.array_equal(path, space.path(start, end))


def test_inside_a_u_the_path_goes_around_the_notch() -> None:
    u = shapely.Polygon([(0, 0), (10, 0), (10, 10), (7, 10), (7, 3), (3, 3), (3, 10), (0, 10)])
    path = FreeSpace(u).path((1, 9), (9, 9))
    assert path.tolist() == [[1, 9], [3, 3], [7, 3], [9, 9]]


def test_a_hole_is_flown_around() -> None:
    ring = shapely.box(0, 0, 10, 10) - shapely.box(4, 4, 6, 6)
    path = FreeSpace(ring).path((1, 4.5), (9, 4.5))
    assert path.tolist() == [[1, 4.5], [4, 4], [6, 4], [9, 4.5]]


def test_a_leg_may_run_along_an_edge_and_between_obstacles_that_touch_none_may_pass() -> None:
    walls = [shapely.box(4, -5, 6, 0), shapely.box(4, 0, 6, 5)]
    assert length(FreeSpace(obstacles=walls).path((0, 0), (10, 0))) > 10
    assert FreeSpace(obstacles=walls[:1]).path((0, 0), (10, 0)).tolist() == [[0, 0], [10, 0]]


def test_a_place_that_is_walled_in_cannot_be_reached() -> None:
    wall = shapely.box(-3, -3, 3, 3) - shapely.box(-2, -2, 2, 2)
    with pytest.raises(MissionError, match="no way"):
        FreeSpace(obstacles=[wall]).path((0, 0), (10, 0))


def test_points_in_obstacles_are_not_free_and_points_on_edges_are() -> None:
    space = FreeSpace(shapely.box(0, 0, 10, 10), [shapely.box(4, 4, 6, 6)])
    points = np.array([[5.0, 5], [4, 5], [1, 1], [0, 0], [11, 5]])
    assert space.is_free(points).tolist() == [False, True, True, True, False]


def test_too_many_corners_are_refused() -> None:
    teeth = [shapely.box(3 * k, 0, 3 * k + 1, 5) for k in range(400)]
    with pytest.raises(MissionError, match="1600 corners"):
        FreeSpace(obstacles=teeth).path((-1, 1), (1300, 1))
