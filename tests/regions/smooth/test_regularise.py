"""Regularised outlines: right angles within a distance, with shared borders, holes and validity kept."""

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from tests.regions.smooth.test_smooth_outlines import box, disc, named, pictures, pixelwise
from uavseg.errors import ParameterError
from uavseg.jobs.result.result import Drawing
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.outline.trace import trace
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.smooth.regularise import regularise_outlines

Labels = NDArray[np.uint32]
ROOFS = {
    "rectangle": [(-30, -15), (30, -15), (30, 15), (-30, 15)],
    "L": [(-30, -20), (30, -20), (30, 0), (0, 0), (0, 25), (-30, 25)],
    "U": [(-30, -20), (30, -20), (30, 25), (12, 25), (12, 0), (-12, 0), (-12, 25), (-30, 25)],
}


def regular(labels: Labels, metres: float, geobox: GeoBox | None = None) -> tuple[NDArray[np.object_], int]:
    """Polygons in (col, row) pixels, and the number of those that stay."""
    rings, _, kept = regularise_outlines(trace(labels), metres, geobox or box(labels.shape))
    return np.asarray(LazyPolygons(rings, Affine.scale(1 / 256))), kept


def drawn(polygon: shapely.Polygon, side: int = 120) -> Labels:
    """Pixels whose centre lies in a polygon."""
    row, col = np.indices((side, side)) + 0.5
    inside = shapely.contains_xy(polygon, col.reshape(-1), row.reshape(-1))
    return inside.reshape(side, side).astype(np.uint32)


def roof(name: str, degrees: float, x: float = 60.3, y: float = 60.7) -> shapely.Polygon:
    turned = shapely.affinity.rotate(shapely.Polygon(ROOFS[name]), degrees, origin=(0, 0))
    return shapely.affinity.translate(turned, x, y)


def off_right(polygon: shapely.Polygon, across: float = 1, down: float = 1) -> float:
    """Largest difference of an angle from a right one, in degrees, for pixels of some size."""
    col, row = np.diff(shapely.get_coordinates(polygon), axis=0).T
    heading = np.degrees(np.arctan2(row * down, col * across))
    turn = np.abs((np.diff(heading, append=heading[0]) + 180) % 360 - 180)
    return float(np.abs(turn - 90).max())


def apart(one: shapely.Polygon, other: shapely.Polygon) -> float:
    """Hausdorff distance of two outlines, at points a fifth of a pixel apart."""
    lines = shapely.boundary(np.array([one, other]))
    points = [shapely.points(shapely.get_coordinates(shapely.segmentize(line, 0.2))) for line in lines]
    return max(float(shapely.distance(points[k], lines[1 - k]).max()) for k in (0, 1))


@pytest.mark.parametrize("degrees", [0, 5, 17, 30, 45, 61, 80])
@pytest.mark.parametrize("name", ROOFS)
def test_a_roof_has_its_corners_and_right_angles(name: str, degrees: float) -> None:
    labels = drawn(roof(name, degrees))
    for metres in (2, 3):
        [polygon], kept = regular(labels, metres)
        assert len(polygon.exterior.coords) == len(ROOFS[name]) + 1 and kept == 0
        assert off_right(polygon) < 0.1
        assert apart(polygon, pixelwise(labels)[0]) <= metres
        truth = roof(name, degrees)
        assert polygon.intersection(truth).area / polygon.union(truth).area > 0.96


@pytest.mark.parametrize("radius", [10, 25, 60])
@pytest.mark.parametrize("metres", [0.6, 1, 2, 4])
def test_a_disc_keeps_its_outline(radius: float, metres: float) -> None:
    labels = disc(radius)
    polygons, kept = regular(labels, metres)
    assert kept == 1 and shapely.equals(polygons, pixelwise(labels)).all()


@pytest.mark.parametrize("metres", [0, 1e-9, 0.4])
def test_less_than_half_a_pixel_leaves_outlines_unchanged(metres: float) -> None:
    for labels in (drawn(roof("L", 17)), named(np.arange(6).reshape(2, 3))):
        polygons, kept = regular(labels, metres)
        assert shapely.equals(polygons, pixelwise(labels)).all() and kept == len(polygons)


@pytest.mark.slow
@given(pictures(), st.sampled_from([0.7, 1.5, 2, 3, 6]))
@settings(max_examples=20, deadline=None)
def test_outlines_stay_near_valid_and_shared(labels: Labels, metres: float) -> None:
    """With nothing between the regions, and as a coverage of all pixels."""
    for image in (labels, named(labels + 1)):
        polygons, kept = regular(image, metres)
        before = pixelwise(image)
        assert shapely.is_valid(polygons).all() and shapely.coverage_is_valid(polygons)
        assert len(polygons) == len(before) and 0 <= kept <= len(before)
        holes = [
            shapely.get_num_interior_rings(shapely.get_parts(one)).tolist() for one in (before, polygons)
        ]
        assert holes[0] == holes[1]
        assert all(apart(one, other) <= metres for one, other in zip(before, polygons, strict=True))
    assert shapely.area(polygons).sum() == pytest.approx(labels.size)
    assert shapely.union_all(polygons).equals(shapely.box(0, 0, *labels.shape[::-1]))


@pytest.mark.slow
@given(pictures(), st.sampled_from([1.5, 3]))
@settings(max_examples=20, deadline=None)
def test_each_arc_stays_near_and_ends_at_its_nodes(labels: Labels, metres: float) -> None:
    """Outlines are joined from arcs, so the bound holds for each border between two regions."""
    image = named(labels + 1)
    polygons, before = regular(image, metres)[0], pixelwise(image)
    lines, old = shapely.boundary(polygons), shapely.boundary(before)
    for one in range(min(len(old), 4)):
        for other in range(one):
            border, was = lines[one].intersection(lines[other]), old[one].intersection(old[other])
            assert border.is_empty == was.is_empty
            assert was.is_empty or shapely.hausdorff_distance(border, was) <= metres + 1e-9


def test_adjacent_fields_share_straight_borders_and_a_direction() -> None:
    """Three fields in a row, turned: four lines across, and two along, with nodes between."""
    left, middle, right = (
        shapely.affinity.rotate(shapely.box(x, 20, x + 40, 100), 12, origin=(75, 60)) for x in (15, 55, 95)
    )
    image = drawn(left, 150) + 2 * drawn(middle, 150) + 3 * drawn(right, 150)
    polygons, kept = regular(image.astype(np.uint32), 2)
    assert kept == 0 and shapely.coverage_is_valid(polygons)
    for polygon, truth in zip(polygons, (left, middle, right), strict=True):
        assert len(polygon.exterior.coords) == 5 and off_right(polygon) < 2
        assert polygon.intersection(truth).area / polygon.union(truth).area > 0.97


@pytest.mark.slow
def test_a_hole_that_would_lie_outside_stays_inside() -> None:
    """A speck one pixel from the outline, which would move over it."""
    labels = drawn(roof("rectangle", 12))
    rows, cols = np.nonzero(labels)
    for k in range(0, len(rows), 37):
        one = labels.copy()
        one[rows[k], cols[k]] = 0
        if pixelwise(one)[0].geom_type != "Polygon":
            continue
        [polygon] = regular(one, 4)[0]
        assert polygon.is_valid and len(polygon.interiors) == len(pixelwise(one)[0].interiors)


@pytest.mark.parametrize("across", [0.5, 1, 2])
def test_angles_are_right_on_the_ground(across: float) -> None:
    """With pixels that are not square, a rectangle of the map is one on the map, not in pixels."""
    labels = drawn(shapely.affinity.scale(roof("rectangle", 25, 100.3), 1 / across, 1, origin=(100, 60)), 200)
    [polygon], _ = regular(labels, 4, GeoBox(labels.shape, Affine.scale(across, -1), None))
    assert len(polygon.exterior.coords) == 5 and off_right(polygon, across) < 0.2


def test_it_is_in_place_of_smoothing() -> None:
    with pytest.raises(ParameterError, match="smoothed or regularized, not both"):
        Drawing(smooth_m=1, regularize_m=1)
    for metres in (-1, float("nan"), 1e9):
        with pytest.raises(ParameterError, match="regularized by"):
            Drawing(regularize_m=metres)
    with pytest.raises(ParameterError, match="leave --regularize out"):
        regularise_outlines(trace(disc(4)), 1, box((10, 2**23)))
