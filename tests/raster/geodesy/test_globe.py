"""Questions about a CRS against rasterio's answers; wrapped longitudes and densified lines by laws."""

from itertools import pairwise
from typing import Any

import numpy as np
import pyproj
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from rasterio.crs import CRS

from uavseg.errors import RasterError
from uavseg.raster.geodesy.globe import (
    crs_name,
    densify_line,
    densify_rings,
    ellipsoid_under,
    equatorial_radius,
    geod_of,
    geod_wgs84,
    is_geographic,
    is_in_metres,
    is_on_earth,
    lonlat_transform,
    parse_crs,
    split_at_antimeridian,
    transform_between,
    unit_factor,
    unit_name,
    unwrap_lon,
    wrap_lon,
    wrap_lon_beyond_180,
)

CODES = (32618, 2263, 4326, 4807, 5498)
UTM, FEET, LONLAT, GRADS, COMPOUND = (CRS.from_epsg(code).to_wkt() for code in CODES)
SITE = 'LOCAL_CS["site",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'
EUROPA = pyproj.CRS.from_proj4("+proj=eqc +R=1560800 +units=m +no_defs").to_wkt()
Floats = NDArray[np.float64]
longitudes = st.floats(-1000, 1000, width=32)
whole_turns = st.integers(-3, 3)


@pytest.mark.parametrize("wkt", [UTM, FEET, LONLAT, GRADS, COMPOUND, SITE, EUROPA])
def test_kind_and_unit_are_those_that_rasterio_finds(wkt: str) -> None:
    theirs = CRS.from_wkt(wkt)
    assert is_geographic(wkt) == theirs.is_geographic
    assert is_in_metres(wkt) == (theirs.is_projected and theirs.linear_units_factor[1] == 1)
    if theirs.is_projected:
        assert (unit_name(wkt), unit_factor(wkt)) == (theirs.linear_units, theirs.linear_units_factor[1])


def test_units_have_names() -> None:
    assert [unit_name(wkt) for wkt in (UTM, FEET, LONLAT, SITE, None)] == [
        *("metre", "US survey foot", "degrees", "unknown", "unknown"),
    ]
    assert unit_factor(FEET) == pytest.approx(1200 / 3937) and unit_factor(LONLAT) == np.pi / 180
    assert crs_name(UTM) == "WGS 84 / UTM zone 18N" and crs_name(None) is None


def test_local_coordinates_are_taken_for_metres() -> None:
    assert is_in_metres(None) and unit_factor(None) == 1 and not is_geographic(None)


@pytest.mark.slow
def test_a_text_that_is_not_a_crs_is_neither_geographic_nor_in_metres() -> None:
    assert not is_geographic("nonsense") and not is_in_metres("nonsense")
    with pytest.raises(RasterError, match="no transformation"):
        transform_between("nonsense", LONLAT)


def test_the_earth_is_distinguished_from_other_bodies_by_its_radius() -> None:
    assert is_on_earth(UTM) and is_on_earth(GRADS) and not is_on_earth(EUROPA)


@pytest.mark.parametrize("wkt", [None, "nonsense", SITE])
def test_what_has_no_longitude_and_latitude_is_refused(wkt: str | None) -> None:
    for question in (lonlat_transform, is_on_earth):
        with pytest.raises(RasterError, match="no transformation to longitude and latitude"):
            question(wkt)
    assert ellipsoid_under(wkt) is None


def test_longitude_comes_first_whatever_the_order_of_axes() -> None:
    assert lonlat_transform(LONLAT)(10.0, 50.0) == (10.0, 50.0)  # EPSG:4326 declares latitude first
    lon, lat = lonlat_transform(UTM)(500_000.0, 0.0)
    assert (lon, lat) == pytest.approx((-75, 0))
    assert transform_between(LONLAT, UTM)(lon, lat) == pytest.approx((500_000, 0))


def test_on_another_body_longitude_and_latitude_are_its_own() -> None:
    lon, lat = lonlat_transform(EUROPA)(1560800 * np.pi / 2, 1560800 * np.pi / 4)
    assert (lon, lat) == pytest.approx((90, 45))


def test_a_geographic_crs_needs_no_transformation_to_its_ellipsoid() -> None:
    under = ellipsoid_under(GRADS)
    assert under is not None and under.inverse is None and under.unit == pytest.approx(np.pi / 200)
    under = ellipsoid_under(UTM)
    assert under is not None and under.inverse is not None and under.unit == np.pi / 180


@pytest.mark.parametrize("code", [32601, 32610, 32660, 32701, 32733, 32760])
def test_a_utm_zone_is_what_pyproj_says_of_it(code: int) -> None:
    wkt = CRS.from_epsg(code).to_wkt(version="WKT2_2019")
    crs = parse_crs(wkt)
    axis, ellipsoid = crs.axis_info[0], crs.ellipsoid
    assert (crs_name(wkt), unit_name(wkt)) == (crs.name, axis.unit_name)
    assert (unit_factor(wkt), equatorial_radius(wkt)) == (1.0, ellipsoid.semi_major_metre)
    assert is_in_metres(wkt) and not is_geographic(wkt) and is_on_earth(wkt)
    under = ellipsoid_under(wkt)
    assert under is not None and under.radius == ellipsoid.semi_major_metre
    assert under.eccentricity2 == 1 - (ellipsoid.semi_minor_metre / ellipsoid.semi_major_metre) ** 2


@given(st.sampled_from([32601, 32618, 32660, 32701, 32735]), st.integers(0, 10**6), st.integers(1, 40))
def test_few_places_in_a_utm_zone_lie_where_pyproj_puts_them(code: int, seed: int, n: int) -> None:
    wkt = CRS.from_epsg(code).to_wkt(version="WKT2_2019")
    theirs = pyproj.Transformer.from_crs(parse_crs(wkt), "EPSG:4326", always_xy=True).transform
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-4e6, 5e6, (n, 2)), rng.uniform(-9e6, 1e7, (n, 2))
    ours = lonlat_transform(wkt)(x, y)
    for one, other in zip(ours, theirs(x, y), strict=True):
        assert one.shape == (n, 2) and np.abs(wrap_lon(one - other)).max() < 1e-12
    x[0, 0] = rng.choice([np.inf, 1e9, np.nan])  # where there is no such place
    for one, other in zip(lonlat_transform(wkt)(x, y), theirs(x, y), strict=True):
        assert np.array_equal(one, other, equal_nan=True)


def test_many_places_in_a_utm_zone_are_those_of_pyproj() -> None:
    wkt = CRS.from_epsg(32618).to_wkt(version="WKT2_2019")
    x, y = np.linspace(2e5, 8e5, 20_001), np.linspace(0, 9e6, 20_001)
    theirs = pyproj.Transformer.from_crs(parse_crs(wkt), "EPSG:4326", always_xy=True).transform(x, y)
    assert np.array_equal(lonlat_transform(wkt)(x, y), theirs)


@pytest.mark.parametrize(
    ("written", "changed", "lon"),
    [('origin",-75,', 'origin",-74.9999,', -74.9999), ('easting",500000,', 'easting",499999,', -74.999991)],
)
def test_a_changed_utm_zone_is_none(written: str, changed: str, lon: float) -> None:
    """Its code says one thing and its parameters another; the parameters hold."""
    wkt = CRS.from_epsg(32618).to_wkt(version="WKT2_2019").replace(written, changed)
    assert changed in wkt
    there, _ = lonlat_transform(wkt)(np.array([500_000.0]), np.array([0.0]))
    assert there == pytest.approx(lon, abs=1e-7)


def test_geodesics_are_those_of_the_ellipsoid() -> None:
    quarter = geod_wgs84().inv(0, 0, 0, 90)[2]
    assert quarter == pytest.approx(10_001_965.7, abs=0.1) == geod_of(UTM).inv(0, 0, 0, 90)[2]
    assert geod_of(EUROPA).inv(0, 0, 0, 90)[2] == pytest.approx(1560800 * np.pi / 2)


@given(longitudes, st.floats(-180, 180, width=32))
def test_wrapping_moves_by_whole_turns_into_half_a_turn_around(lon: float, around: float) -> None:
    wrapped = float(wrap_lon(lon, around))
    assert around - 180 - 1e-9 <= wrapped <= around + 180 + 1e-9
    assert (wrapped - lon) / 360 == pytest.approx(round((wrapped - lon) / 360), abs=1e-9)


@given(longitudes)
def test_longitudes_within_180_keep_their_bits(lon: float) -> None:
    [wrapped] = wrap_lon_beyond_180(np.array([lon]))
    assert -180 <= wrapped <= 180
    assert wrapped == lon if abs(lon) <= 180 else wrapped == wrap_lon(lon)


@given(st.lists(st.integers(-170, 170), min_size=1, max_size=9), st.integers(-180, 179))
def test_unwrapping_takes_back_wrapping(steps: list[int], start: int) -> None:
    track = np.cumsum([start, *steps]).astype(float)
    assert unwrap_lon(wrap_lon(track)).tolist() == track.tolist()


lines = arrays(np.float64, st.tuples(st.integers(1, 8), st.just(2)), elements=st.integers(-60, 60))


@given(lines, st.sampled_from([0, 170, -170]))
def test_a_split_line_is_the_whole_line_and_ends_at_the_antimeridian(line: Floats, shift: int) -> None:
    track = line + np.array([shift, 0])
    wrapped = np.stack([wrap_lon(track[:, 0]), track[:, 1]], axis=1)
    parts = split_at_antimeridian(wrapped)
    for before, after in pairwise(parts):
        assert abs(before[-1, 0]) == 180 and after[0].tolist() == [-before[-1, 0], before[-1, 1]]
    inner = [part[k > 0 : len(part) - (k < len(parts) - 1)] for k, part in enumerate(parts)]
    assert np.concatenate(inner).tolist() == wrapped.tolist()
    assert all((np.abs(np.diff(part[:, 0])) <= 180).all() for part in parts)
    assert _length(parts) == pytest.approx(_length([track]))


def _length(lines: list[Floats]) -> float:
    return float(sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in lines))


@st.composite
def lines_with_pieces(draw: st.DrawFn, closed: bool) -> tuple[Any, Any]:
    line = draw(arrays(np.float64, st.tuples(st.integers(2, 6), st.just(2)), elements=st.integers(-9, 9)))
    line = np.concatenate([line, line[:1]]) if closed else line
    return line, draw(arrays(np.int64, len(line) - 1, elements=st.integers(1, 4)))


@given(lines_with_pieces(closed=False))
def test_a_denser_line_is_the_same_line_in_equal_steps(drawn: tuple[Any, Any]) -> None:
    line, pieces = drawn
    dense = densify_line(line, pieces)
    ends = np.concatenate([[0], np.cumsum(pieces)])
    assert len(dense) == pieces.sum() + 1 and dense[ends].tolist() == line.tolist()
    expected = np.repeat(np.diff(line, axis=0) / pieces[:, None], pieces, axis=0)
    assert np.allclose(np.diff(dense, axis=0), expected)


@given(st.lists(lines_with_pieces(closed=True), min_size=1, max_size=3))
def test_rings_are_densified_one_by_one(drawn: list[tuple[Any, Any]]) -> None:
    starts = np.cumsum([0, *(len(ring) for ring, _ in drawn)])
    pieces = np.concatenate([np.append(each, 1) for _, each in drawn])
    dense, bounds = densify_rings(np.concatenate([ring for ring, _ in drawn]), starts, pieces)
    assert bounds[0] == 0 and bounds[-1] == len(dense)
    for k, (ring, each) in enumerate(drawn):
        assert np.allclose(dense[bounds[k] : bounds[k + 1]], densify_line(ring, each))
