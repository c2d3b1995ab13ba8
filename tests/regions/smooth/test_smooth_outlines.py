"""Smooth outlines: valid, with shared borders, near the pixel edges, with the same pixels and areas."""

import numpy as np
import pytest
import rasterio.features
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.crs import CRS

from uavseg.errors import ParameterError
from uavseg.jobs.result.result import Drawing
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import trace
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.smooth.smooth_outlines import smooth_outlines
from uavseg.regions.table import make_regions
from uavseg.segmentation.components import Sums

Labels = NDArray[np.uint32]
FIRSTS = np.empty((0, 2), np.int64)  # no measure depends on first pixels
STEPS = 256  # to a pixel
FULL = 9.0  # metres; half a pixel counts


def box(shape: tuple[int, int]) -> GeoBox:
    return GeoBox(shape, Affine.identity(), None)


def smooth(labels: Labels, metres: float = FULL) -> tuple[Rings, NDArray[np.object_]]:
    """Smooth rings in steps, and their polygons in (col, row) pixels."""
    rings, fine = smooth_outlines(trace(labels), metres, box(labels.shape))
    return rings, np.asarray(LazyPolygons(rings, fine.transform))


def pixelwise(labels: Labels) -> NDArray[np.object_]:
    return np.asarray(LazyPolygons(trace(labels), Affine.identity()))


def named(image: NDArray[np.integer]) -> Labels:
    """Labels 1..n for the values of an image that are above 0."""
    values = np.unique(image[image > 0])
    return np.where(image > 0, np.searchsorted(values, image) + 1, 0).astype(np.uint32)


@st.composite
def pictures(draw: st.DrawFn) -> Labels:
    """Noise, blocks and blobs of several labels; with nothing between them or without."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    shape = tuple(rng.integers(1, 40, 2))
    kind = draw(st.sampled_from(["noise", "blocks", "blobs", "lines"]))
    if kind == "noise":
        image = rng.integers(0, rng.integers(2, 6), shape)
    elif kind == "blocks":
        grain = rng.integers(2, 9)
        image = np.kron(rng.integers(0, 4, (9, 9)), np.ones((grain, grain), int))[: shape[0], : shape[1]]
    else:
        row, col = np.indices(shape)
        image = np.zeros(shape, int)
        for k in range(1, rng.integers(2, 6)):
            r, c, a, b = rng.uniform(-5, 40, 4)
            inside = (row - r) ** 2 + (col - c) ** 2 < (1 + a / 3) ** 2
            image[inside if kind == "blobs" else (row - r) * a < (col - c) * b] = k
    return named(image + draw(st.integers(0, 1)))


@pytest.mark.slow
@given(pictures())
@settings(max_examples=60)
def test_outlines_are_valid_and_separate_the_same_pixels(labels: Labels) -> None:
    _, polygons = smooth(labels)
    assert shapely.is_valid(polygons).all()
    pairs = [(polygon, k) for k, polygon in enumerate(polygons, 1)]
    burnt = rasterio.features.rasterize(pairs, labels.shape, dtype="uint32") if pairs else 0 * labels
    assert np.array_equal(burnt, labels)


@pytest.mark.slow
@given(pictures())
@settings(max_examples=60)
def test_neighbours_share_every_border(labels: Labels) -> None:
    _, polygons = smooth(labels)
    assert shapely.coverage_is_valid(polygons)
    _, everything = smooth(named(labels + 1))
    together = shapely.union_all(everything)
    assert together.equals(shapely.box(0, 0, *labels.shape[::-1]))
    assert shapely.area(everything).sum() == pytest.approx(labels.size)


@given(pictures())
@settings(max_examples=60)
def test_areas_are_kept_within_a_hundredth(labels: Labels) -> None:
    _, polygons = smooth(labels)
    pixels = np.bincount(labels.reshape(-1), minlength=1)[1:]
    assert np.abs(shapely.area(polygons) / np.maximum(pixels, 1) - 1).max(initial=0) <= 0.01


@pytest.mark.slow
@given(pictures(), st.sampled_from([0.05, 0.2, 0.4, FULL]))
@settings(max_examples=60)
def test_outlines_stay_within_the_distance_of_the_pixel_edges(labels: Labels, metres: float) -> None:
    _, polygons = smooth(labels, metres)
    lines = shapely.segmentize(shapely.boundary(polygons), 0.1)
    points = shapely.points(shapely.get_coordinates(lines))
    edges = shapely.union_all(shapely.boundary(pixelwise(labels)))
    assert shapely.distance(points, edges).max(initial=0) <= min(metres, 0.5)
    assert shapely.is_valid(polygons).all() and shapely.coverage_is_valid(polygons)


@pytest.mark.slow
@given(pictures(), st.integers(0, 3), st.integers(0, 3))
@settings(max_examples=60)
def test_a_moved_picture_has_moved_outlines(labels: Labels, down: int, across: int) -> None:
    here, _ = smooth(np.pad(labels, 1))
    there, _ = smooth(np.pad(labels, ((1 + down, 2), (1 + across, 3))))
    assert np.array_equal(here.vertices + np.array([down, across]) * STEPS, there.vertices)
    assert np.array_equal(here.starts, there.starts)


@pytest.mark.slow
@given(pictures())
@settings(max_examples=60)
def test_an_outline_is_the_same_from_both_sides(labels: Labels) -> None:
    """Whether what lies beyond is another region or nothing changes no point of a region's outline."""
    padded = np.pad((labels == 1).astype(np.uint32), 1)
    _, alone = smooth(padded)
    _, among = smooth(padded + np.uint32(1))
    assert shapely.equals(among[1:], alone).all()


def by_force(labels: Labels) -> list[int]:
    """Corners at which three or four of the edges between adjacent pixels differ."""
    framed = np.pad(labels, 1)
    a, b, c, d = framed[:-1, :-1], framed[:-1, 1:], framed[1:, :-1], framed[1:, 1:]
    edges = (a != b).astype(int) + (c != d) + (a != c) + (b != d)
    return np.flatnonzero(edges > 2).tolist()


@given(pictures())
@settings(max_examples=60)
def test_nodes_stay_where_they_are(labels: Labels) -> None:
    rings, _ = smooth(labels)
    corners, rest = np.divmod(rings.vertices.astype(np.int64), STEPS)
    whole = (rest == 0).all(axis=1)
    keys = corners[whole, 0] * (labels.shape[1] + 1) + corners[whole, 1]
    assert set(by_force(labels)) <= set(keys.tolist())


def disc(radius: float) -> Labels:
    side = int(2 * radius) + 9
    row, col = np.indices((side, side)) + 0.5
    return ((row - side / 2 + 0.2) ** 2 + (col - side / 2 - 0.3) ** 2 < radius**2).astype(np.uint32)


@pytest.mark.parametrize("radius", [4, 10, 25, 60, 150])
def test_a_disc_is_round(radius: float) -> None:
    labels = disc(radius)
    [polygon] = smooth(labels)[1]
    assert pixelwise(labels)[0].length > 7.7 * radius
    assert polygon.length == pytest.approx(2 * np.pi * radius, rel=0.02)
    assert polygon.area == pytest.approx(labels.sum(), rel=0.002)
    away = np.hypot(*(shapely.get_coordinates(polygon) - polygon.centroid.coords[0]).T) - radius
    assert np.abs(away).max() < 0.5


@pytest.mark.parametrize("run", [1, 2, 3, 5, 8])
def test_stairs_become_a_straight_line(run: int) -> None:
    row, col = np.indices((30, 30 * run))
    [polygon] = smooth(((col // run) < row).astype(np.uint32))[1]
    col, row = shapely.get_coordinates(shapely.segmentize(polygon.exterior, 0.1)).T
    middle = (row > 9) & (row < 21) & (col > 0)
    away = (col - run * (row - 0.5)) / np.hypot(run, 1)
    assert middle.sum() > 100 * run and np.abs(away[middle]).max() < 0.06


def test_a_pixel_alone_is_a_square_on_its_corner() -> None:
    labels = np.zeros((3, 3), np.uint32)
    labels[1, 1] = 1
    [polygon] = smooth(labels)[1]
    assert polygon.area == pytest.approx(1, abs=0.01)
    assert len(polygon.exterior.coords) == 5 and polygon.distance(shapely.Point(1, 1)) > 0


def test_a_region_whose_area_would_change_stays_on_its_pixel_edges() -> None:
    labels = np.zeros((6, 6), np.uint32)
    labels[2, 2] = 1
    for metres, stays in ((0.1, True), (FULL, False)):
        assert shapely.equals(smooth(labels, metres)[1], pixelwise(labels)).all() == stays


def test_zero_metres_leave_outlines_unchanged() -> None:
    labels = disc(9)
    assert shapely.equals(smooth(labels, 0)[1], pixelwise(labels)).all()
    assert len(smooth(np.zeros((3, 4), np.uint32))[1]) == 0


PLACES = {
    "utm": (32618, Affine(0.5, 0, 4e5, 0, -0.5, 5e6), 0.25),
    "mercator at 60 degrees": (3857, Affine(2, 0, 0, 0, -2, 8_399_738), 0.5),
    "feet": (2263, Affine(3, 0, 9e5, 0, -3, 2e5), 3 * 0.3048 / 2),
    "nowhere": (None, Affine.scale(4, -4), 2),
}


@pytest.mark.parametrize("place", PLACES)
def test_metres_are_metres_on_the_ground(place: str) -> None:
    epsg, transform, half = PLACES[place]
    labels = disc(20)
    here = GeoBox(labels.shape, transform, None if epsg is None else CRS.from_epsg(epsg))
    drawn = {m: smooth_outlines(trace(labels), m * half, here)[0].vertices.tolist() for m in (0.98, 1.02, 3)}
    assert drawn[1.02] == drawn[3] != drawn[0.98]


@pytest.mark.parametrize("metres", [-1, float("nan"), float("inf")])
def test_a_length_that_is_negative_or_not_finite_is_refused(metres: float) -> None:
    with pytest.raises(ParameterError, match="0 or more metres"):
        smooth(disc(4), metres)


def test_a_raster_too_large_for_whole_steps_is_refused() -> None:
    with pytest.raises(ParameterError, match="more than 8,388,606 rows or columns are drawn on pixel edges"):
        smooth_outlines(trace(disc(4)), 1, box((10, 2**23)))


@pytest.mark.slow
@given(pictures(), st.sampled_from([0.2, 1, 4]))
@settings(max_examples=40)
def test_smooth_outlines_can_be_simplified(labels: Labels, metres: float) -> None:
    """First smoothed, then simplified: still valid, no overlap, no gap, no region gone."""
    pixels = np.bincount(labels.reshape(-1), minlength=1)[1:]
    sums = Sums(pixels, pixels, pixels, FIRSTS)
    regions = make_regions(trace(labels), sums, box(labels.shape), (0, 1), "")
    drawn, _ = Drawing(FULL, metres).drawn(regions, trace(labels), box(labels.shape))
    polygons = np.asarray(drawn.polygons)
    assert drawn.columns is regions.columns
    assert shapely.is_valid(polygons).all() and not shapely.is_empty(polygons).any()
    assert shapely.coverage_is_valid(polygons)
