"""Polygons for pictures: empty ones are dropped, areas are kept, paths have their holes."""

import geopandas
import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, strategies as st

from tests.plot.pictures import UTM
from uavseg.errors import RegionError
from uavseg.plot.layers.region_layer import PolygonTable, polygon_paths
from uavseg.plot.page.page import Frame
from uavseg.raster.grid.geobox import GeoBox

RING = shapely.box(0, 0, 10, 10) - shapely.box(2, 3, 6, 7)
PAIR = shapely.MultiPolygon(
    [shapely.box(20, 0, 24, 4), shapely.box(30, 0, 34, 8) - shapely.box(31, 1, 33, 2)]
)
SHAPES = np.array([RING, PAIR, shapely.box(50, 0, 51, 1)], dtype=object)


@given(st.integers(0, 2), st.floats(0.05, 54.95), st.floats(0.05, 9.95))
def test_a_path_holds_the_points_of_its_polygon(number: int, x: float, y: float) -> None:
    paths = polygon_paths(SHAPES)
    assert len(paths) == len(SHAPES)
    crossings = sum(part.contains_point((x, y)) for part in _rings(paths[number]))
    if shapely.distance(SHAPES[number].boundary, shapely.Point(x, y)) > 1e-6:
        assert (crossings % 2 == 1) == shapely.contains_xy(SHAPES[number], x, y)  # even-odd over all rings


def _rings(path: object) -> list[object]:
    """The rings of a path, each as a path of its own."""
    from matplotlib.path import Path

    starts = np.flatnonzero(path.codes == Path.MOVETO)  # type: ignore[attr-defined]
    return [Path(xy) for xy in np.split(path.vertices, starts[1:])]  # type: ignore[attr-defined]


def test_missing_and_empty_polygons_are_dropped_with_their_attributes() -> None:
    table = geopandas.GeoDataFrame({"id": [1, 2, 3]}, geometry=[RING, None, shapely.Polygon()], crs=UTM)
    found = PolygonTable.of(table)
    assert found.polygons.tolist() == [RING] and found.columns["id"].tolist() == [1]


@pytest.mark.parametrize("crs", [UTM, None])
def test_areas_in_the_plot_are_those_of_the_map(crs: object) -> None:
    box = GeoBox((50, 60), Affine(2, 0, 4e5, 0, -2, 5e6), UTM)
    shapes = [shapely.box(4e5 + 10, 5e6 - 40, 4e5 + 60, 5e6 - 20), shapely.box(4e5, 5e6 - 9, 4e5 + 9, 5e6)]
    table = geopandas.GeoDataFrame({"id": [1, 2]}, geometry=shapes, crs=crs)
    drawn = PolygonTable.of(table).in_plot(Frame(box))
    assert shapely.area(drawn) == pytest.approx([1000, 81])
    assert shapely.bounds(drawn[1]).tolist() == pytest.approx([-60, 41, -51, 50])


def test_a_polygon_without_finite_coordinates_is_refused() -> None:
    far = geopandas.GeoDataFrame(geometry=[shapely.box(0, 0, 1e300, 1e300)])
    frame = Frame(GeoBox((4, 4), Affine(1, 0, 0, 0, -1, 4), None))
    with pytest.raises(RegionError, match="not finite"):
        PolygonTable.of(far).in_plot(frame)
