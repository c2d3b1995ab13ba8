"""The local plane: distances compared with geodesics."""

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from pyproj import Geod

from uavseg.flight.mission.track import Plane, plane_around

GEOD = Geod(ellps="WGS84")
centres = st.builds(Plane, st.floats(-89, 89), st.floats(-180, 180))
near = st.tuples(st.floats(0, 360), st.floats(0, 50_000))


@given(centres, near, near)
@settings(max_examples=60)
def test_distances_in_the_plane_are_those_on_the_ground(
    plane: Plane, here: tuple[float, float], there: tuple[float, float]
) -> None:
    lon, lat, _ = GEOD.fwd(*[[plane.lon] * 2, [plane.lat] * 2], *zip(here, there, strict=True))
    x, y = plane.xy_from_lonlat(lon, lat)
    on_ground = GEOD.inv(lon[0], lat[0], lon[1], lat[1])[2]
    assert np.hypot(x[1] - x[0], y[1] - y[0]) == pytest.approx(on_ground, rel=1e-4, abs=1e-3)
    back_lon, back_lat = plane.lonlat_from_xy(x, y)
    assert (np.abs(GEOD.inv(lon, lat, back_lon, back_lat)[2]) < 1e-3).all()


def test_east_is_x_and_north_is_y() -> None:
    x, y = Plane(47, 8).xy_from_lonlat([8.01, 8], [47, 47.01])
    assert x[0] > 700 and abs(y[0]) < 1 and abs(x[1]) < 1e-6 and y[1] > 1000


def test_boxes_on_both_sides_of_the_antimeridian_are_neighbours() -> None:
    plane = plane_around(np.array([[179.99, 10, 180, 10.02], [-180, 10, -179.99, 10.02]]), 179.9)
    assert abs(abs(plane.lon) - 180) < 1e-9
    assert plane.lat == pytest.approx(10.01)


def test_an_edge_that_is_straight_in_degrees_stays_where_it_was() -> None:
    (flat,) = Plane(60, 8.25).project_polygons([shapely.box(8, 60, 8.5, 60.2)])
    x, y = Plane(60, 8.25).xy_from_lonlat(8.25, 60)
    assert flat.exterior.distance(shapely.Point(float(x), float(y))) < 0.02


def test_a_hole_that_touches_the_border_stays() -> None:
    """On a grid of 1e-7 degrees, GEOS makes this polygon valid by filling its hole, densified as a whole."""
    outer = [(-178.0022636, 52.9987725), (-178, 57), (-177, 57), (-177, 58), (-174, 58), (-174, 50)]
    outer += [(-177, 50), (-177.0022116, 51.9987902), (-178.0022128, 51.9987714)]
    hole = [(-176.0022605, 52.9988106), (-176.0022098, 51.998809), (-176, 51), (-175, 51), (-175, 57)]
    hole += [(-176, 57), (-176, 56), (-177, 56), (-177.0022624, 52.9987916), (-178.0022636, 52.9987725)]
    polygon = shapely.set_precision(shapely.Polygon(outer, [hole]), 1e-7)
    assert polygon.is_valid and shapely.segmentize(polygon, 0.05).area > 1.4 * polygon.area
    plane = Plane(54, -176)
    [flat] = plane.project_polygons([polygon])
    whole, inner = (plane.project_polygons([shapely.Polygon(ring)])[0].area for ring in (outer, hole))
    assert flat.area == pytest.approx(whole - inner, rel=1e-6)
    [pair] = plane.project_polygons([shapely.MultiPolygon([polygon, shapely.box(-179.5, 50, -179, 51)])])
    assert len(pair.geoms) == 2 and len(pair.geoms[0].interiors) == 1


def test_many_polygons_are_projected_as_one_is(monkeypatch: pytest.MonkeyPatch) -> None:
    one = shapely.box(8, 47, 8.01, 47.02) - shapely.box(8.002, 47.004, 8.004, 47.008)
    two = shapely.MultiPolygon([shapely.box(8.1, 47, 8.11, 47.01), shapely.box(8.2, 47, 8.21, 47.01)])
    polygons = [one, two, shapely.MultiPolygon([one]), shapely.force_3d(one, 5.0)]
    plane, calls = Plane(47.0, 8.0), []
    alone = [plane.project_polygons([polygon])[0] for polygon in polygons]
    project = Plane.xy_from_lonlat

    def counted(self: Plane, *lonlat: Any) -> Any:
        calls.append(1)
        return project(self, *lonlat)

    monkeypatch.setattr(Plane, "xy_from_lonlat", counted)
    together = plane.project_polygons(polygons)
    assert calls == [1] and not len(plane.project_polygons([]))
    assert all(shapely.equals_identical(a, b) for a, b in zip(together, alone, strict=True))
    assert [flat.geom_type for flat in together] == ["Polygon", "MultiPolygon", "Polygon", "Polygon"]
