"""Regions that touch at corners of pixels are joined: 8-connectivity, with polygons that stay as they are."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import example, given, settings, strategies as st
from numpy.typing import NDArray
from skimage.measure import label

from tests.regions.edit.test_small import box, drawn, dropped, outlined, painted, picture
from uavseg.jobs.result.result import Drawing
from uavseg.regions.edit.small import Area, drop_small_regions, join_at_corners
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.trace import trace
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.table import make_regions

Labels = NDArray[np.uint32]
CHECKERBOARD = np.indices((6, 7)).sum(axis=0) % 2
RING = picture("..1.. .1.1. 1.1.1 .1.1. ..1..")  # of single pixels, around one that touches four of them
CROSS = picture(
    "1111111 1.....1 1.1.1.1 1..1..1 1.1.1.1 1.....1 1111111"
)  # in a frame that it does not touch
HOOK = picture("1111111 11....1 1.1...1 1.111.1 1.....1 1111111")  # in the hole of a frame that it touches


def by_size(image: NDArray[Any], connectivity: int) -> Labels:
    """Components of equal values above 0, numbered by size, then in raster order."""
    labels = label(image, background=0, connectivity=connectivity)
    names, firsts, counts = np.unique(labels, return_index=True, return_counts=True)
    order = np.lexsort((firsts, -counts))
    numbers = np.zeros(len(names), np.uint32)
    numbers[order[names[order] > 0]] = np.arange(1, (names > 0).sum() + 1)
    return numbers[np.searchsorted(names, labels)]


def joined(image: NDArray[Any]) -> tuple[RegionOutlines, RegionOutlines, NDArray[np.int64]]:
    """Outlines of the 4-connected components of equal values above 0, those that are joined, their values."""
    four = by_size(image, 1)
    values = np.array([image[four == k][0] for k in range(1, four.max() + 1)], np.int64)
    before = outlined(four)
    return before, *join_at_corners(before, values)


def same(one: Any, other: Any) -> bool:
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))


def polygons(found: RegionOutlines) -> NDArray[np.object_]:
    return np.asarray(LazyPolygons(found.rings, Affine.identity()))


@st.composite
def images(draw: st.DrawFn, classes: int = 4) -> NDArray[np.int64]:
    """Noise of some classes, of pixels or of blocks, with or without pixels of none."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    shape, grain = rng.integers(1, 28, 2), draw(st.sampled_from([1, 1, 2, 3]))
    small = rng.integers(draw(st.integers(0, 1)), draw(st.integers(1, classes)) + 1, shape)
    return small.repeat(grain, 0).repeat(grain, 1)


@pytest.mark.slow
@example(CHECKERBOARD)
@example(CHECKERBOARD + 1)  # both colours are joined, across each other
@example(RING.astype(np.int64))
@example(CROSS.astype(np.int64))
@example(HOOK.astype(np.int64))
@given(images())
def test_joined_regions_are_traced_components_of_eight_neighbours(image: NDArray[np.int64]) -> None:
    before, found, values = joined(image)
    eight = by_size(image, 2)
    expected = outlined(eight)
    assert same(found.rings, trace(eight)) and np.array_equal(painted(found, eight), eight)
    assert all(
        np.array_equal(getattr(found.sums, name), getattr(expected.sums, name))
        for name in ("counts", "greys", "squares", "firsts")
    )
    assert values.tolist() == [image[eight == k][0] for k in range(1, eight.max() + 1)]
    areas = (shapely.area(polygons(one)).sum() for one in (before, found))
    assert len(set(areas)) == 1 and shapely.is_valid(polygons(found)).all()
    parts = [shapely.get_parts(polygons(one)) for one in (before, found)]
    assert sorted(one.wkb for one in parts[0]) == sorted(one.wkb for one in parts[1])


@pytest.mark.slow
@given(images())
def test_without_a_contact_nothing_is_made_again(image: NDArray[np.int64]) -> None:
    apart = image.repeat(2, 0).repeat(2, 1)
    apart[1::2] = apart[:, 1::2] = 0
    before, found, _ = joined(apart)
    assert found is before
    assert join_at_corners(found, np.zeros(len(found.sums.counts), np.int64))[0] is found
    again, _ = join_at_corners(*joined(image)[1:])
    assert same(again.rings, joined(image)[1].rings)


def test_pictures_that_can_be_checked_by_eye() -> None:
    [ring] = polygons(joined(RING)[1])
    assert len(ring.geoms) == 9 and ring.area == 9
    frame, cross = polygons(joined(CROSS)[1])
    assert frame.geom_type == "Polygon" and len(frame.interiors) == 1 and len(cross.geoms) == 5
    [region] = polygons(joined(HOOK)[1])
    frame, hook = region.geoms
    assert shapely.Polygon(frame.interiors[0]).contains(hook) and contacts(region) == {(2.0, 2.0)}
    assert len(polygons(joined(CHECKERBOARD)[1])) == 1
    assert [len(one.geoms) for one in polygons(joined(CHECKERBOARD + 1)[1])] == [21, 21]


def test_small_regions_are_those_that_are_small_once_joined() -> None:
    text = "11..2. 1..3.. ....44 .5...."
    labels = picture(text)
    found, _ = join_at_corners(outlined(labels), np.zeros(5, np.int64))
    kept = drop_small_regions(found, box(labels), Area(2, True))
    assert drawn(painted(kept, labels)) == ["22..1.", "2..1..", "....11", "......"]
    assert dropped(text, 2) == ["11....", "1.....", "....22", "......"]


@pytest.mark.slow
@pytest.mark.parametrize("drawing", [Drawing(smooth_m=9), Drawing(regularize_m=3), Drawing(simplify_m=2)])
@settings(max_examples=15)
@given(image=images())
def test_outlines_as_drawn_keep_the_contacts(drawing: Drawing, image: NDArray[np.int64]) -> None:
    """Corners where parts touch are vertices of both, and stay; nothing overlaps, no part vanishes."""
    image = image.repeat(3, 0).repeat(3, 1)
    labels = by_size(image, 2)
    before, found, _ = joined(image)
    geobox = box(labels, 1.0)
    regions = make_regions(found.rings, found.sums, geobox, (0, 1), "")
    shapes = np.asarray(drawing.drawn(regions, found.rings, geobox)[0].polygons)
    plain = np.asarray(regions.polygons)
    assert shapely.is_valid(shapes).all() and shapely.coverage_is_valid(shapes)
    assert shapely.get_num_geometries(shapes).tolist() == shapely.get_num_geometries(plain).tolist()
    for one, other in zip(plain, shapes, strict=True):
        assert contacts(one) <= contacts(other)
    assert len(before.sums.counts) == sum(shapely.get_num_geometries(shapes))


def contacts(region: Any) -> set[tuple[float, float]]:
    """Vertices that several polygons of a region have in common."""
    parts = [np.unique(shapely.get_coordinates(part), axis=0) for part in shapely.get_parts(region)]
    points, counts = np.unique(np.concatenate(parts), axis=0, return_counts=True)
    return set(map(tuple, points[counts > 1].tolist()))
