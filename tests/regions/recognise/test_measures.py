"""Measures of shape and pixels: invariances, and comparison with slow plain versions."""

import math

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.features import geometry_mask
from skimage.measure import regionprops

from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.recognise.measures import (
    fourier_coefficients,
    local_metres,
    pixel_measures,
    shape_measures,
)
from uavseg.regions.table import Regions
from uavseg.segmentation.source import GreySource

UPRIGHT = Affine.identity()
ELL = shapely.Polygon([(0, 0), (5, 0), (5, 1), (1, 1), (1, 3), (0, 3)])


def moved(shape: shapely.Polygon, turn: float, size: float, x: float, y: float) -> shapely.Polygon:
    c, s = size * math.cos(turn), size * math.sin(turn)
    return shapely.affinity.affine_transform(shape, [c, -s, s, c, x, y])


@settings(max_examples=25, deadline=None)
@given(st.floats(0, math.tau), st.floats(0.1, 1e3), st.floats(-1e3, 1e3), st.integers(0, 5))
def test_fourier_coefficients_have_no_pose_and_no_start(
    turn: float, size: float, x: float, start: int
) -> None:
    corners = shapely.get_coordinates(moved(ELL, turn, size, x, -x).exterior)[:-1]
    ring = shapely.LinearRing(np.roll(corners, start, axis=0))
    expected = fourier_coefficients(ELL.exterior)
    assert np.allclose(expected[0, :3], (1, 0, 0))
    assert np.allclose(fourier_coefficients(ring), expected, atol=1e-6)
    assert np.allclose(fourier_coefficients(ring.reverse()), expected, atol=1e-6)


def test_fourier_coefficients_of_an_ellipse_are_its_axes() -> None:
    turn = np.linspace(0, math.tau, 2000, endpoint=False)
    found = fourier_coefficients(shapely.LinearRing(np.column_stack([1.02 * np.cos(turn), np.sin(turn)])))
    assert found[0, 3] == pytest.approx(1 / 1.02, abs=0.01)  # of arc length, not of the angle
    assert np.abs(found[1::2]).max() < 1e-6


@pytest.mark.slow
def test_fourier_coefficients_are_those_of_the_integral() -> None:
    """Compare harmonic 2 with a plain sum over a densely sampled contour, before normalisation."""
    ring = ELL.exterior
    t = (np.arange(200_000) + 0.5) / 200_000
    x, y = shapely.get_coordinates(ring.interpolate(t, normalized=True)).T
    plain = []
    for n in (1, 2):
        waves = np.cos(math.tau * n * t), np.sin(math.tau * n * t)
        plain.append(np.array([[2 * (z * wave).mean() for wave in waves] for z in (x, y)]))
    sizes = [np.linalg.norm(one) for one in plain]
    found = fourier_coefficients(ring)
    first, second = np.linalg.norm(found[:2], axis=1)
    assert second / first == pytest.approx(sizes[1] / sizes[0], rel=1e-3)


def measured(shape: shapely.Polygon) -> dict[str, float]:
    return {name: float(one) for name, (one,) in shape_measures(np.array([shape], object)).items()}


@pytest.mark.parametrize("turn_deg", [0, 30, 90, 147])
def test_angles_are_clockwise_from_north(turn_deg: float) -> None:
    bar = shapely.box(-1, -5, 1, 5)  # to the north
    found = measured(shapely.affinity.rotate(bar, -turn_deg))
    for name in ("angle_deg", "orientation_deg"):
        assert (found[name] - turn_deg + 90) % 180 - 90 == pytest.approx(0, abs=1e-6)
    assert (found["length_m"], found["width_m"]) == pytest.approx((10, 2))


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.floats(0, 180), st.booleans(), st.booleans())
def test_measures_are_those_of_regionprops_on_fine_pixels(turn: float, holed: bool, split: bool) -> None:
    shape = ELL.difference(shapely.box(0.2, 0.2, 0.7, 0.8)) if holed else ELL
    shape = shapely.MultiPolygon([shape, shapely.box(7, 2, 8, 4)]) if split else shape
    shape = shapely.affinity.rotate(shape, turn)
    x_min, y_min, x_max, y_max = shape.bounds
    cell = max(x_max - x_min, y_max - y_min) / 1000
    place = Affine(cell, 0, x_min, 0, -cell, y_max)
    mask = geometry_mask([shape], (1000, 1000), place, invert=True)
    expected, found = regionprops(mask.astype(np.uint8))[0], measured(shape)
    for name in ("eccentricity", "solidity", "extent", "euler_number"):
        assert found[name] == pytest.approx(getattr(expected, name), abs=0.01)
    assert [found[f"hu{k}"] for k in range(7)] == pytest.approx(expected.moments_hu, rel=0.03, abs=2e-3)
    up = math.degrees(math.atan2(math.sin(expected.orientation), -math.cos(expected.orientation)))
    assert (found["orientation_deg"] - up + 90) % 180 - 90 == pytest.approx(0, abs=0.5)


@settings(max_examples=25, deadline=None)
@given(st.floats(0, math.tau), st.floats(1e-2, 1e4), st.floats(-1e4, 1e4), st.booleans())
def test_measures_but_the_pose_do_not_depend_on_it(turn: float, size: float, x: float, back: bool) -> None:
    shape = moved(ELL.reverse() if back else ELL, turn, size, x, -x)
    one, other = measured(ELL), measured(shape)
    pose = {"length_m", "width_m", "angle_deg", "orientation_deg", "extent"}
    for name in one.keys() - pose:
        assert other[name] == pytest.approx(one[name], rel=1e-4, abs=1e-6)
    assert other["length_m"] == pytest.approx(size * one["length_m"])


def test_regions_are_measured_by_themselves() -> None:
    disc = shapely.Point(3, 4).buffer(2, quad_segs=64)
    shapes = np.array([disc, disc.difference(shapely.Point(3, 4).buffer(1)), ELL], object)
    together = shape_measures(shapes)
    for k, shape in enumerate(shapes):
        assert {name: one[k] for name, one in together.items()} == pytest.approx(measured(shape))
    assert together["euler_number"].tolist() == [1, 0, 1]
    assert together["eccentricity"][0] < 1e-4 and together["extent"][0] == pytest.approx(
        math.pi / 4, abs=1e-3
    )
    assert all(len(one) == 0 for one in shape_measures(np.empty(0, object)).values())


def test_local_metres_are_true_lengths() -> None:
    square = shapely.box(10, 60, 10.001, 60.001)
    regions = Regions({"id": np.array([1])}, np.array([square], object), "EPSG:4326")
    x, y = np.ptp(shapely.get_coordinates(local_metres(regions)[0]), axis=0)
    assert (x, y) == pytest.approx((55.80, 111.42), abs=0.02)


def source(values: np.ndarray, transform: Affine = UPRIGHT) -> GreySource:
    shape = values.shape[:2]
    dataset = Dataset.of_values(values, GeoBox(shape, transform, None), "drawn")
    return GreySource(dataset, Stretch(0.0, 255.0, "given"))


@pytest.mark.parametrize("slope_deg", [0, 20, 45, 90, 130])
def test_rows_have_their_direction_whatever_way_is_up(slope_deg: float) -> None:
    row, col = np.indices((96, 96))
    bearing = math.radians(slope_deg)  # of rows, from the top of the picture clockwise
    across = col * math.cos(bearing) + row * math.sin(bearing)
    picture = (127 + 100 * np.sin(across * 0.8)).astype(np.uint8)
    for up in (0.0, 12.0):
        c, s = math.cos(math.radians(up)), math.sin(math.radians(up))
        found = pixel_measures(source(picture, Affine(c, -s, 0, -s, -c, 0)), shapely.box(10, 10, 80, 80))
        assert (found["rows_deg"] - slope_deg - up + 90) % 180 - 90 == pytest.approx(0, abs=3)
    assert found["rows_strength"] > 0.9


def test_pixel_measures_are_those_of_the_pixels_inside() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (70, 90), np.uint8)
    found = pixel_measures(source(picture), shapely.box(5, 7, 60, 50))
    inside = picture[7:50, 5:60].astype(float)
    expected = {"b1_mean": inside.mean(), "b1_std": inside.std(), "b1_min": inside.min()}
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    counts = np.array(found["texture"].split(), int)
    assert len(counts) == 80 and counts.sum() == inside.size
    turned = pixel_measures(source(np.rot90(picture).copy()), shapely.box(7, 30, 50, 85))
    assert np.array_equal(np.array(turned["texture"].split(), int), counts)


def test_beside_the_raster_nothing_is_known() -> None:
    found = pixel_measures(source(np.zeros((50, 50), np.uint8)), shapely.box(200, 200, 220, 220))
    assert found["texture"] == "" and math.isnan(found["b1_mean"]) and math.isnan(found["contrast"])
