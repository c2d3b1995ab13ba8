"""Points and lines as areas: a width in metres on the ground, anywhere on Earth, in every format."""

import json
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from pyproj import Geod

from uavseg.errors import RegionError
from uavseg.regions.formats.read import Widths, read_regions, regions_of_frame
from uavseg.regions.table import Regions

GEOD = Geod(ellps="WGS84")
ZONES = Widths(10.0, 10.0, "kept out of")


def regions(*shapes: Any, widths: Widths = ZONES) -> Regions:
    frame = geopandas.GeoDataFrame(
        {"name": [str(k) for k in range(len(shapes))]}, geometry=list(shapes), crs=4326
    )
    return regions_of_frame(frame, widths=widths)


def inside(found: Regions, lon: Any, lat: Any) -> np.ndarray:
    wrapped = (np.asarray(lon) + 180) % 360 - 180
    return np.any([shapely.intersects_xy(polygon, wrapped, lat) for polygon in found.polygons], axis=0)


longitudes = st.sampled_from([-180.0, 179.99999, 0.0, 8.5]) | st.floats(-180, 180)


@pytest.mark.slow
@given(longitudes, st.floats(-89.5, 89.5), st.floats(0.5, 3000), st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_a_point_is_a_disc_of_its_diameter(lon: float, lat: float, width: float, seed: int) -> None:
    found = regions(shapely.Point(lon, lat), widths=Widths(width, None, "kept out of"))
    azimuths = np.random.default_rng(seed).uniform(0, 360, 64)
    for away, expected in ((0.4995 * width - 0.002, True), (0.503 * width + 0.002, False)):
        ends = GEOD.fwd(*(np.full(64, one) for one in (lon, lat)), azimuths, np.full(64, away))
        assert (inside(found, ends[0], ends[1]) == expected).all()


@pytest.mark.slow
@given(longitudes, st.floats(-80, 80), st.integers(0, 10**6), st.floats(10, 300))
@settings(max_examples=60, deadline=None)
def test_a_line_is_a_strip_of_its_width(lon: float, lat: float, seed: int, width: float) -> None:
    """The slow plain version: distances of random places to thousands of places on the line."""
    rng = np.random.default_rng(seed)
    corners = np.array([lon, lat]) + np.cumsum(rng.normal(0, [0.004, 0.002], (4, 2)), axis=0)
    line = shapely.LineString(np.column_stack([(corners[:, 0] + 180) % 360 - 180, corners[:, 1]]))
    found = regions(line, widths=Widths(None, width, "kept out of"))
    dense = shapely.get_coordinates(shapely.segmentize(shapely.LineString(corners), 1e-5))
    near = dense[rng.integers(0, len(dense), 40)]
    place = GEOD.fwd(*near.T, rng.uniform(0, 360, 40), rng.uniform(0, width, 40))
    for x, y, is_inside in zip(place[0], place[1], inside(found, place[0], place[1]), strict=True):
        away = GEOD.inv(np.full(len(dense), x), np.full(len(dense), y), *dense.T)[2].min()
        if abs(away - width / 2) > 0.01 * width + 0.05:
            assert is_inside == (away < width / 2)


@pytest.mark.parametrize("suffix", ["geojson", "gpkg", "kml", "fgb"])
def test_every_format_gives_the_same_areas_and_notes(tmp_path: Path, suffix: str) -> None:
    shapes = [
        shapely.Point(8, 47),
        shapely.MultiPoint([(8.01, 47), (8.02, 47)]),
        shapely.LineString([(8, 47.01), (8.01, 47.01)]),
        shapely.box(8.03, 47, 8.04, 47.01),
        shapely.MultiLineString([[(8, 47.02), (8.01, 47.02)], [(8, 47.03), (8.01, 47.03)]]),
    ]
    path = tmp_path / f"zones.{suffix}"
    frame = geopandas.GeoDataFrame({"name": list("abcde")}, geometry=shapes, crs=4326)
    frame.to_file(path, engine="pyogrio", driver={"kml": "KML", "fgb": "FlatGeobuf"}.get(suffix))
    found, expected = read_regions(path, widths=ZONES), regions(*shapes)
    assert shapely.equals_exact(
        shapely.normalize(shapely.multipolygons(found.polygons)),
        shapely.normalize(shapely.multipolygons(expected.polygons)),
        1e-9,
    )
    assert found.metadata["notes"] == [f"3 points and 3 lines of {path}: kept out of"]
    assert len(found) == 7 and shapely.is_valid(found.polygons).all()


def test_a_collection_is_taken_apart_and_what_is_left_out_is_said() -> None:
    square = shapely.box(8, 47, 8.01, 47.01)
    mixed = shapely.GeometryCollection([square, shapely.Point(8.1, 47), shapely.GeometryCollection([square])])
    found = regions(mixed, shapely.Point(8.2, 47), widths=Widths(None, 5.0, "flown", "not flown"))
    assert [polygon.equals(square) for polygon in found.polygons] == [True, True]
    assert found.columns["name"].tolist() == ["0", "0"]
    assert found.metadata["notes"] == ["2 points of the frame: not flown"]
    with pytest.raises(RegionError, match="1 point of the frame: not flown, and there is nothing else in it"):
        regions(shapely.Point(8.2, 47), widths=Widths(None, 5.0, "flown", "not flown"))


def test_polygons_alone_are_what_they_are_without_widths() -> None:
    parts = shapely.MultiPolygon([shapely.box(8, 47, 8.1, 47.1), shapely.box(9, 47, 9.1, 47.1)])
    frame = geopandas.GeoDataFrame({"id": [4]}, geometry=[parts], crs=4326)
    plain, found = regions_of_frame(frame), regions_of_frame(frame, widths=ZONES)
    assert found.polygons[0].equals_exact(plain.polygons[0]) and found.columns["id"] == plain.columns["id"]
    assert not found.metadata


@pytest.mark.parametrize("width", [None, ZONES])
@pytest.mark.parametrize("lon", ["NaN", "1e400"])
def test_places_that_are_no_numbers_are_refused(tmp_path: Path, lon: str, width: Widths | None) -> None:
    path = tmp_path / "odd.geojson"
    path.write_text(json.dumps({"type": "Point", "coordinates": [7, 47]}).replace("7,", f"{lon},"))
    with pytest.raises(RegionError):
        read_regions(path, widths=width)
