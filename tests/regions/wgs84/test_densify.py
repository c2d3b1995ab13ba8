"""Densified edges stay close to their true course, and keep the vertices that they had."""

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import OutputError
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.wgs84.to_wgs84 import densify_edges

RADIUS = 6378137.0
to_map = pyproj.Transformer.from_crs(4326, 32633, always_xy=True).transform
to_lonlat = pyproj.Transformer.from_crs(32633, 4326, always_xy=True).transform


def degrees(xy: np.ndarray) -> np.ndarray:
    return np.stack(to_lonlat(*xy.T), axis=1)


def ring(xy: list[tuple[float, float]]) -> RaggedPolygons:
    vertices = np.array([*xy, xy[0]], float)
    ends = [np.array([0, n]) for n in (len(vertices), 1, 1)]
    return RaggedPolygons(vertices, *ends)


@given(st.floats(10, 80), st.floats(1_000, 400_000), st.sampled_from([100.0, 1_000.0, 10_000.0]))
@settings(max_examples=40)
def test_edges_stay_close_to_their_course(lat: float, length: float, side: float) -> None:
    x, y = to_map(14.0, lat)
    flat = ring([(x, y), (x + length, y), (x, y - length / 2)])
    dense = densify_edges(flat, degrees(flat.vertices), side, RADIUS, degrees)
    middles = (dense.vertices[1:] + dense.vertices[:-1]) / 2
    on_map = np.stack(to_map(*dense.vertices.T), axis=1)
    true_middles = (on_map[1:] + on_map[:-1]) / 2
    away = np.hypot(*(np.stack(to_map(*middles.T), axis=1) - true_middles).T)
    assert away.max() < side / 100


@given(st.floats(10, 80), st.floats(1_000, 400_000))
@settings(max_examples=40)
def test_vertices_stay_and_new_ones_lie_on_the_edges(lat: float, length: float) -> None:
    x, y = to_map(14.0, lat)
    flat = ring([(x, y), (x + length, y), (x, y - length / 2)])
    dense = densify_edges(flat, degrees(flat.vertices), 1_000.0, RADIUS, degrees)
    kept = {tuple(vertex) for vertex in np.round(dense.vertices, 9).tolist()}
    assert {tuple(vertex) for vertex in np.round(degrees(flat.vertices), 9).tolist()} <= kept
    assert dense.rings.tolist() == [0, len(dense.vertices)]
    area = np.stack(to_map(*dense.vertices.T), axis=1)
    x, y = area.T
    assert abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2) - length**2 / 4 < 1e-6 * length**2


def test_short_edges_are_left_alone() -> None:
    x, y = to_map(14.0, 50.0)
    flat = ring([(x, y), (x + 10, y), (x, y - 10)])
    dense = densify_edges(flat, degrees(flat.vertices), 1.0, RADIUS, degrees)
    assert np.array_equal(dense.vertices, degrees(flat.vertices))


def test_edges_that_are_far_too_long_are_refused_before_they_are_divided() -> None:
    flat = ring([(0.0, 5e6), (1e13, 5e6), (0.0, 5.1e6)])
    with pytest.raises(OutputError, match=r"edges of up to 1e\+13 map units, which is too long"):
        densify_edges(flat, np.zeros((len(flat.vertices), 2)) + 45, 0.1, RADIUS, degrees)
