"""Laws of merged maps: nothing occupied is lost, the order does not matter, and places stay."""

import math

import numpy as np
import pytest
import rasterio.warp
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.crs import CRS

from uavseg.errors import MapError
from uavseg.occupancy.ros.ros_map import transform_of
from uavseg.occupancy.several_maps import PlacedMap, common_grid, cropped, merge
from uavseg.raster.grid.geobox import GeoBox

METRIC = CRS.from_epsg(32633)
YAWS = st.one_of(st.just(0.0), st.floats(-3.2, 3.2), st.sampled_from([k * math.pi / 2 for k in range(-2, 3)]))


@st.composite
def placed(draw: st.DrawFn, side: float | None = None) -> PlacedMap:
    shape = draw(st.integers(1, 25)), draw(st.integers(1, 25))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    values = rng.choice([0.0, 0.1, 0.5, 0.6, 0.9, 1.0], shape, p=[0.3, 0.2, 0.3, 0.05, 0.05, 0.1])
    place = draw(st.floats(-5, 5)), draw(st.floats(-5, 5)), draw(YAWS)
    cell = side or draw(st.sampled_from([0.1, 0.25, 0.05, 0.13]))
    transform = transform_of(place, cell, shape[0])
    if draw(st.booleans()):  # rows that run upwards
        transform = transform * Affine.translation(0, shape[0]) * Affine.scale(1, -1)
    return PlacedMap("map", values.astype(np.float32), GeoBox(shape, transform, None))


def centres(one: PlacedMap) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows, cols = np.indices(one.geobox.shape) + 0.5
    x, y = one.geobox.xy_from_pixel(rows.ravel(), cols.ravel())
    return np.asarray(x).reshape(one.geobox.shape), np.asarray(y).reshape(one.geobox.shape)


def values_at(found: NDArray[np.float32], box: GeoBox, x: object, y: object) -> NDArray[np.float32]:
    """Values of the cells at places, 0.5 beyond the edges, by the inverse of the transform."""
    t = ~box.transform
    cols = np.floor(t.a * np.asarray(x) + t.b * np.asarray(y) + t.c + 1e-9).astype(int)
    rows = np.floor(t.d * np.asarray(x) + t.e * np.asarray(y) + t.f + 1e-9).astype(int)
    inside = (rows >= 0) & (rows < box.shape[0]) & (cols >= 0) & (cols < box.shape[1])
    values = found[np.clip(rows, 0, box.shape[0] - 1), np.clip(cols, 0, box.shape[1] - 1)]
    return np.where(inside, values, np.float32(0.5))


@settings(max_examples=60)
@given(placed())
def test_a_map_alone_stays_as_it_is(one: PlacedMap) -> None:
    box = common_grid([one], unrotate=False, resolution=None)
    found, disputed = merge([one], box)
    assert disputed == 0 and sorted(found.shape) == sorted(one.geobox.shape)
    assert np.array_equal(values_at(found, box, *centres(one)), one.probabilities)


@settings(max_examples=60)
@given(st.lists(placed(), min_size=1, max_size=3), st.booleans(), st.sampled_from([None, 0.07, 0.3]))
def test_nothing_occupied_is_lost_and_nothing_is_free_that_no_map_calls_free(
    maps: list[PlacedMap], unrotate: bool, resolution: float | None
) -> None:
    box = common_grid(maps, unrotate, resolution)
    found, _ = merge(maps, box)
    for one in maps:
        here = values_at(found, box, *centres(one))
        wall = one.probabilities >= 0.65
        assert (here[wall] >= 0.65).all()
    x, y = centres(PlacedMap("merged", found, box))
    own = np.stack([values_at(one.probabilities, one.geobox, x, y) for one in maps])
    free = found < 0.5
    assert (own[:, free] < 0.5).any(axis=0).all()
    assert (own[:, free] < 0.65).all()
    assert (found == 0.5)[(own == 0.5).all(axis=0) & ~(found > 0.5)].all()


@settings(max_examples=40)
@given(st.lists(placed(), min_size=2, max_size=4), st.randoms())
def test_the_order_of_maps_does_not_matter(maps: list[PlacedMap], random: object) -> None:
    box = common_grid(maps, False, None)
    mixed = list(maps)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    (one, disputed), (other, disputed_too) = merge(maps, box), merge(mixed, box)
    assert np.array_equal(one, other) and disputed == disputed_too


@pytest.mark.slow
@settings(max_examples=40)
@given(placed(), st.sampled_from([None, 0.06, 0.2]))
def test_what_is_not_occupied_is_where_another_warper_puts_it(
    one: PlacedMap, resolution: float | None
) -> None:
    box = common_grid([one], True, resolution)
    found, _ = merge([one], box)
    expected = np.full(box.shape, 0.5, np.float32)
    rasterio.warp.reproject(
        one.probabilities,
        expected,
        src_transform=one.geobox.transform,
        src_crs=METRIC,
        dst_transform=box.transform,
        dst_crs=METRIC,
        resampling=rasterio.warp.Resampling.nearest,
        init_dest_nodata=False,
    )
    places = np.stack(~one.geobox.transform * centres(PlacedMap("merged", found, box)))
    on_edge = (np.abs(places - np.round(places)) < 1e-6).any(axis=0)  # rounding decides there
    assert np.array_equal(found[~on_edge & (found <= 0.5)], expected[~on_edge & (found <= 0.5)])


@settings(max_examples=40)
@given(placed())
def test_a_cropped_map_holds_all_that_is_known_and_ends_with_it(one: PlacedMap) -> None:
    known = one.probabilities != 0.5
    if not known.any():
        with pytest.raises(MapError, match="every cell of the map is unknown"):
            cropped(one.probabilities, one.geobox)
        return
    found, box = cropped(one.probabilities, one.geobox)
    assert np.array_equal(values_at(found, box, *centres(one)), one.probabilities)
    for line in (found[0], found[-1], found[:, 0], found[:, -1]):
        assert (line != 0.5).any()


def test_disputed_cells_are_occupied_and_counted() -> None:
    box = GeoBox((1, 5), Affine(0.1, 0, 0, 0, -0.1, 0), None)
    one = PlacedMap("a", np.array([[0.0, 0.0, 0.5, 0.3, 0.6]], np.float32), box)
    other = PlacedMap("b", np.array([[1.0, 0.5, 0.7, 0.4, 0.3]], np.float32), box)
    found, disputed = merge([one, other], box)
    assert found.tolist() == np.array([[1.0, 0.0, 0.7, 0.3, 0.3]], np.float32).tolist() and disputed == 1


def test_maps_that_do_not_fit_are_refused() -> None:
    box = GeoBox((2, 2), Affine(0.1, 0, 0, 0, -0.1, 0), None)
    values = np.zeros((2, 2), np.float32)
    far = GeoBox((2, 2), Affine(0.1, 0, 1e5, 0, -0.1, 1e5), None)
    with pytest.raises(MapError, match=r"merged map has .* cells; at most 100,000,000"):
        common_grid([PlacedMap("a", values, box), PlacedMap("b", values, far)], False, None)
    utm = GeoBox((2, 2), Affine(0.1, 0, 0, 0, -0.1, 0), METRIC)
    with pytest.raises(MapError, match="b has another coordinate system than a"):
        common_grid([PlacedMap("a", values, box), PlacedMap("b", values, utm)], False, None)
    flat = GeoBox((2, 2), Affine(0.1, 0, 0, 0, -0.2, 0), None)
    with pytest.raises(MapError, match="square cells"):
        common_grid([PlacedMap("a", values, flat)], False, None)
