"""Simplified outlines keep their shared borders and stay valid."""

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.edit.small import simplify
from uavseg.regions.outline.trace import trace
from uavseg.regions.table import make_regions
from uavseg.segmentation.components import Sums

PLACES = {
    "utm": (32618, Affine(0.5, 0, 4e5, 0, -0.5, 5e6)),
    "rotated": (32618, Affine(0.3, 0.4, 4e5, 0.4, -0.3, 5e6)),
    "degrees": (4326, Affine(1e-5, 0, 10, 0, -1e-5, 60)),
    "feet, south-up": (2263, Affine(3, 0, 9e5, 0, 3, 2e5)),
    "nowhere": (None, Affine.identity()),
}
STAIRS = (np.add.outer(np.arange(12), np.arange(12)) < 12).astype(np.uint32)

FIRSTS = np.empty((0, 2), np.int64)  # no measure depends on first pixels


@st.composite
def pictures(draw):
    side, most, grain = draw(st.integers(2, 14)), draw(st.integers(1, 4)), draw(st.integers(1, 3))
    cells = draw(st.lists(st.integers(0, most), min_size=side**2, max_size=side**2))
    names = np.unique([0, *cells], return_inverse=True)[1][1:]
    return np.kron(names.reshape(side, side), np.ones((grain, grain), int)).astype(np.uint32)


def made(labels, place="utm"):
    crs, transform = PLACES[place]
    box = GeoBox(labels.shape, transform, None if crs is None else CRS.from_epsg(crs))
    rings, counts = trace(labels), np.bincount(labels.reshape(-1), minlength=1)[1:]
    return make_regions(rings, Sums(counts, counts, counts, FIRSTS), box, (0, 1), ""), box


@pytest.mark.slow
@given(pictures(), st.sampled_from(sorted(PLACES)), st.sampled_from([0.3, 1, 3, 10, 1e4]))
@settings(max_examples=100)
def test_no_region_vanishes_overlaps_or_becomes_invalid(labels, place, metres):
    regions, box = made(labels, place)
    simpler = simplify(regions, metres, box)
    assert len(simpler) == len(regions)
    assert shapely.is_valid(simpler.polygons).all()
    assert not shapely.is_empty(simpler.polygons).any()
    together = shapely.area(shapely.union_all(simpler.polygons))
    assert shapely.area(simpler.polygons).sum() == pytest.approx(together, rel=1e-9)


@pytest.mark.slow
@given(pictures(), st.sampled_from([0.3, 1, 3]))
@settings(max_examples=40)
def test_vertices_are_a_subset_of_the_original_ones(labels, metres):
    regions, box = made(labels)
    before = set(map(tuple, shapely.get_coordinates(regions.polygons)))
    after = set(map(tuple, shapely.get_coordinates(simplify(regions, metres, box).polygons)))
    assert after <= before


@given(pictures())
@settings(max_examples=20)
def test_no_gap_opens_between_neighbours(labels):
    names = np.unique(labels, return_inverse=True)[1].reshape(labels.shape)
    regions, box = made(names.astype(np.uint32) + 1)
    together = shapely.union_all(simplify(regions, 1, box).polygons)
    assert together.geom_type == "Polygon"
    assert len(together.interiors) == 0


@pytest.mark.parametrize("place", PLACES)
def test_stairs_become_a_slope_where_they_are_small_enough(place):
    regions, box = made(STAIRS, place)
    step = np.sqrt(regions.columns["area_m2"][0] / regions.columns["pixels"][0])
    as_it_was, smooth = simplify(regions, step / 4, box), simplify(regions, step * 2, box)
    assert shapely.equals(as_it_was.polygons, regions.polygons).all()
    assert (
        shapely.get_num_coordinates(smooth.polygons)[0] < shapely.get_num_coordinates(regions.polygons)[0] / 2
    )


def test_a_border_is_simplified_where_others_end_on_its_edges():
    rows, cols = np.mgrid[:24, :24]
    labels = np.where(rows // 4 * 4 > cols, 1, 2 + (rows // 2 + 1) // 2).astype(
        np.uint32
    )  # strips end on steps
    labels = np.unique(labels, return_inverse=True)[1].reshape(labels.shape).astype(np.uint32) + 1
    regions, box = made(labels)
    simpler = simplify(regions, 3, box).polygons
    corners = shapely.get_num_coordinates(regions.polygons)[0], shapely.get_num_coordinates(simpler)[0]
    assert corners == (18, 9)  # a slope through the points where strips end


def test_attributes_stay_those_of_the_pixels():
    regions, box = made(STAIRS)
    assert simplify(regions, 100, box).columns is regions.columns


def test_zero_tolerance_returns_the_same_regions():
    regions, box = made(STAIRS)
    assert simplify(regions, 0, box) is regions
    empty, box = made(np.zeros((2, 2), np.uint32))
    assert simplify(empty, 1, box) is empty


@pytest.mark.parametrize("metres", [-1, float("nan"), float("inf")])
def test_a_length_that_is_negative_or_not_finite_is_refused(metres):
    with pytest.raises(ParameterError, match="0 or more metres"):
        simplify(*made(STAIRS)[:1], metres, made(STAIRS)[1])
