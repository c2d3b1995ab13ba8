"""What a range finder sees: against closed forms and shapely."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.range_finder import RangeFinder
from uavseg.occupancy.simulation.scene import Scene

PLACES = st.integers(-600, 1400).map(lambda n: n / 100 + 0.003)  # never on a corner
STAR = [(0, 0), (4, 1), (8, 0), (7, 4), (8, 8), (4, 6), (0, 8), (1, 4)]


@given(st.floats(0.1, 5), st.floats(1.01, 4), st.floats(-math.pi, math.pi))
@settings(deadline=None)
def test_a_circle_is_met_where_the_closed_form_says(radius: float, times: float, bearing: float) -> None:
    distance = radius * times
    center = (3 + distance * math.cos(bearing), -2 + distance * math.sin(bearing))
    aside = np.linspace(-0.999, 0.999, 21) * math.asin(1 / times)
    met = Scene(circles=[(*center, radius)]).cast(3, -2, bearing + aside)
    closed = distance * np.cos(aside) - np.sqrt(radius**2 - (distance * np.sin(aside)) ** 2)
    np.testing.assert_allclose(met, closed, rtol=1e-7)
    away = Scene(circles=[(*center, radius)]).cast(
        3, -2, bearing + np.array([1.001, -1.001]) * math.asin(1 / times)
    )
    assert np.isinf(away).all()


def test_from_inside_a_circle_every_beam_meets_it() -> None:
    np.testing.assert_allclose(Scene(circles=[(0, 0, 2)]).cast(0, 0, np.linspace(-3, 3, 9)), 2)


@given(PLACES, PLACES, st.integers(0, 360))
@settings(max_examples=60, deadline=None)
def test_polygons_are_met_where_shapely_says(x: float, y: float, first: int) -> None:
    angles = np.radians(first + np.arange(0, 360, 17.3))
    met = Scene(polygons=[STAR, [(10, 2), (12, 2), (11, 5)]]).cast(x, y, angles)
    outlines = shapely.MultiLineString([[*STAR, STAR[0]], [(10, 2), (12, 2), (11, 5), (10, 2)]])
    for angle, distance in zip(angles, met, strict=True):
        ray = shapely.LineString([(x, y), (x + 99 * math.cos(angle), y + 99 * math.sin(angle))])
        hit = ray.intersection(outlines)
        expected = math.inf if hit.is_empty else shapely.Point(x, y).distance(hit)
        assert distance == pytest.approx(expected, abs=1e-6)


def test_no_beam_slips_through_a_corner() -> None:
    corner = np.array([4.1, 1.3])
    scene = Scene(polygons=[[corner, (9, -3), (9, 5)]])
    for place in np.random.default_rng(0).uniform(-2, 3, (500, 2)):
        angle = math.atan2(corner[1] - place[1], corner[0] - place[0])
        assert scene.cast(*place, [angle])[0] <= math.hypot(*(corner - place)) + 6


@given(st.floats(-180, 180), st.floats(-9, 9))
@settings(max_examples=30, deadline=None)
def test_turning_scene_and_sensor_together_changes_no_range(turn: float, shift: float) -> None:
    def moved(points: object) -> np.ndarray:
        xy, a = np.asarray(points, float), math.radians(turn)
        return xy @ np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]) + shift

    angles = np.radians(np.arange(0, 360, 7.0)) + 0.01
    plain = Scene(polygons=[STAR], circles=[(12, 4, 1.5)]).cast(10, -1, angles)
    (x, y), circle = moved([(10, -1)])[0], moved([(12, 4)])[0]
    turned = Scene(polygons=[moved(STAR)], circles=[(*circle, 1.5)]).cast(x, y, angles + math.radians(turn))
    np.testing.assert_allclose(plain, turned, rtol=1e-6)


def test_contains_is_what_shapely_says() -> None:
    scene = Scene(polygons=[STAR], circles=[(12, 4, 1.5)])
    x, y = np.random.default_rng(1).uniform(-2, 15, (2, 4000))
    solid = shapely.Polygon(STAR).union(shapely.Point(12, 4).buffer(1.5, quad_segs=2000))
    assert (scene.contains(x, y) == shapely.contains_xy(solid, x, y)).all()


def test_noise_has_the_deviation_asked_for_and_a_seed() -> None:
    sensor = RangeFinder(sigma_m=0.05, max_range_m=5, fov_deg=360, step_deg=0.01)
    ring = Scene(circles=[(0, 0, 3)])
    scans = [sensor.scan(ring, Pose(0, 0), np.random.default_rng(seed)) for seed in (7, 7, 8)]
    assert len(scans[0].ranges) == 36000
    assert scans[0].ranges.mean() == pytest.approx(3, abs=0.002)
    assert scans[0].ranges.std() == pytest.approx(0.05, rel=0.02)
    assert (scans[0].ranges == scans[1].ranges).all() and (scans[0].ranges != scans[2].ranges).any()


def test_beams_are_spread_evenly_around_the_heading() -> None:
    half = np.degrees(RangeFinder(fov_deg=180, step_deg=0.5).angles)
    assert len(half) == 361 and half[0] == pytest.approx(-90) and half[-1] == pytest.approx(90)
    whole = np.degrees(RangeFinder(fov_deg=360, step_deg=0.5).angles)
    assert len(whole) == 720 and np.diff(whole) == pytest.approx(0.5)
    assert (whole[0] + 360) - whole[-1] == pytest.approx(0.5)  # no beam twice
    rest = np.degrees(RangeFinder(fov_deg=10, step_deg=3).angles)
    assert rest == pytest.approx([-4.5, -1.5, 1.5, 4.5])


def test_what_lies_beyond_the_range_returns_nothing() -> None:
    sensor = RangeFinder(sigma_m=0.01, max_range_m=2, fov_deg=1, step_deg=1)
    random = np.random.default_rng(0)
    assert np.isinf(sensor.scan(Scene(circles=[(5, 0, 2.9)]), Pose(0, 0), random).ranges).all()
    assert np.isfinite(sensor.scan(Scene(circles=[(5, 0, 3.1)]), Pose(0, 0), random).ranges).all()


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ({"sigma_m": -1.0}, "deviation of ranges is a number above 0, not -1"),
        ({"sigma_m": 0.0}, "deviation of ranges is a number above 0, not 0"),
        ({"max_range_m": math.nan}, "maximal range is a number above 0, not nan"),
        ({"step_deg": 0.0}, "angular step"),
        ({"fov_deg": 361.0}, "field of view is more than 0 and at most 360"),
        ({"fov_deg": math.nan}, "field of view"),
        ({"step_deg": 1e-9}, "beams; at most"),
    ],
)
def test_a_range_finder_checks_itself(how: dict[str, float], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        RangeFinder(**how)


@pytest.mark.parametrize(
    ("polygons", "circles", "told"),
    [
        ([[(0, 0), (2, 2), (2, 0), (0, 2)]], [], "polygon 1 crosses or touches itself"),
        ([STAR, [(0, 0), (1, 1), (2, 2)]], [], "polygon 2"),
        ([[(0, 0), (1, 1)]], [], "three or more corners"),
        ([[(0, 0), (1, math.nan), (2, 0)]], [], "polygon 1 has a corner that is not finite"),
        ([], [(0, 0, 1), (1, 1, -0.5)], "circle 2 has a radius of -0.5"),
        ([], [(0, 0, 0)], "circle 1 has a radius of 0"),
        ([], [(0, math.inf, 1)], "circle 1 wants finite"),
    ],
)
def test_a_scene_checks_itself(polygons: list, circles: list, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        Scene(polygons, circles)
