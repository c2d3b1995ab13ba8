"""Paths as GeoJSON: on the ground where they are planned, split at the antimeridian; and as waypoints."""

import json
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import yaml
from affine import Affine
from hypothesis import given, settings, strategies as st
from pyproj import Geod
from rasterio.crs import CRS

from uavseg.errors import OutputError
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.occupancy.paths.path_text import (
    check_path_crs,
    path_lonlat,
    path_to_geojson,
    path_to_waypoints,
)
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import line_length

WGS84 = CRS.from_epsg(4326)
CORNERS = st.lists(st.tuples(st.integers(0, 99), st.integers(0, 199)), min_size=2, max_size=6, unique=True)


def planned(corners: list[tuple[int, int]], geobox: GeoBox) -> PlannedPath:
    cells = np.array(corners, np.int64)
    length = line_length(geobox, *(cells + 0.5).T)
    return PlannedPath(cells, geobox, length, len(cells), 1, 0.0, 1, 0, ())


def geometry(path: PlannedPath) -> Any:
    collection = json.loads(path_to_geojson(path))
    assert collection["type"] == "FeatureCollection" and len(collection["features"]) == 1
    assert collection["features"][0]["properties"]["length_m"] == round(path.length_m, 6)
    return collection["features"][0]["geometry"]


def parts_of(shape: Any) -> list[np.ndarray]:
    lines = [shape["coordinates"]] if shape["type"] == "LineString" else shape["coordinates"]
    return [np.array(line) for line in lines]


@pytest.mark.parametrize("side, decimals", [(0.05, 9), (0.6, 7)])
def test_positions_have_the_decimals_that_cells_need(side: float, decimals: int) -> None:
    box = GeoBox((100, 200), Affine(side, 0, 4e5, 0, -side, 5e6), CRS.from_epsg(32633))
    [line] = parts_of(geometry(planned([(0, 0), (50, 77), (99, 199)], box)))
    assert max(len(repr(x).partition(".")[2]) for x in line.ravel().tolist()) == decimals


@pytest.mark.slow
@settings(max_examples=60)
@given(CORNERS, st.floats(-180, 180), st.floats(-60, 60))
def test_a_line_in_degrees_is_as_long_as_the_path_and_never_jumps(
    corners: list[tuple[int, int]], lon: float, lat: float
) -> None:
    path = planned(corners, GeoBox((100, 200), Affine(1e-3, 0, lon - 0.1, 0, -1e-3, lat), WGS84))
    parts = parts_of(geometry(path))
    for line in parts:
        assert (np.abs(line[:, 0]) <= 180).all() and (np.abs(np.diff(line[:, 0])) < 180).all()
    for before, after in pairwise(parts):
        assert abs(before[-1, 0]) == 180 and before[-1, 0] == -after[0, 0] and before[-1, 1] == after[0, 1]
    length = sum(Geod(ellps="WGS84").line_length(*line.T) for line in parts)
    assert length == pytest.approx(path.length_m, rel=1e-3, abs=0.1)
    lons, lats = path_lonlat(path)
    assert parts[0][0] == pytest.approx([lons[0], lats[0]], abs=1e-7)
    assert parts[-1][-1] == pytest.approx([lons[-1], lats[-1]], abs=1e-7)


@given(CORNERS)
def test_without_a_crs_the_line_has_the_coordinates_of_the_map(corners: list[tuple[int, int]]) -> None:
    path = planned(corners, GeoBox((100, 200), Affine(0.05, 0, -2, 0, -0.05, 7), None))
    assert geometry(path) == {"type": "LineString", "coordinates": path.xy.tolist()}


def test_long_legs_are_densified_where_they_bend() -> None:
    box = GeoBox((100, 200), Affine(100, 0, 4e5, 0, -100, 7e6), CRS.from_epsg(32618))
    [line] = parts_of(geometry(planned([(0, 0), (99, 199)], box)))
    steps = Geod(ellps="WGS84").line_lengths(*line.T)
    assert len(line) > 30 and max(steps) < 510


def test_a_path_of_one_cell_has_two_equal_positions() -> None:
    shape = geometry(planned([(3, 4)], GeoBox((9, 9), Affine(1e-3, 0, 8, 0, -1e-3, 47), WGS84)))
    first, second = shape["coordinates"]
    assert first == second


def test_a_map_of_the_moon_has_no_degrees_of_the_earth() -> None:
    moon = CRS.from_string("+proj=eqc +R=1737400 +units=m +no_defs")
    with pytest.raises(OutputError, match="no place on the Earth"):
        check_path_crs(GeoBox((9, 9), Affine(1, 0, 0, 0, -1, 9), moon))
    for crs in (None, WGS84):
        check_path_crs(GeoBox((9, 9), Affine(1, 0, 0, 0, -1, 9), crs))


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 199)), min_size=1, max_size=12, unique=True),
    st.floats(0.01, 2),
    st.floats(-3, 3),
)
def test_waypoints_lie_at_the_corners_and_head_for_the_next(
    corners: list[tuple[int, int]], side: float, turn: float
) -> None:
    place = Affine.rotation(np.degrees(turn)) @ Affine.translation(-3, 7) @ Affine.scale(side, -side)
    path = planned(corners, GeoBox((100, 200), place, None))
    poses = list(yaml.safe_load(path_to_waypoints(path))["waypoints"].items())
    assert [name for name, _ in poses] == [f"waypoint{n}" for n in range(len(corners))]
    positions = np.array([pose["pose"] for _, pose in poses])
    assert np.abs(positions[:, :2] - path.xy).max() < 1e-8 and not positions[:, 2].any()
    w, x, y, z = np.array([pose["orientation"] for _, pose in poses]).T
    assert not x.any() and not y.any()
    ahead = np.stack([w * w - z * z, 2 * w * z], axis=1)  # the axis x of the robot, turned by the quaternion
    legs = np.diff(path.xy, axis=0)
    expected = legs / np.hypot(*legs.T)[:, None] if len(legs) else np.array([[1.0, 0.0]])
    assert np.abs(ahead[: len(expected)] - expected).max() < 1e-6
    assert np.abs(ahead[-1] - expected[-1]).max() < 1e-6
