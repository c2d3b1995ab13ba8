"""Ray casting in a scene, compared with closed forms and shapely."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from uavseg.errors import SceneError
from uavseg.occupancy.simulation.simulate import Scene

PLACES = st.integers(-600, 1400).map(lambda n: n / 100 + 0.003)  # never on a corner


STAR = [(0, 0), (4, 1), (8, 0), (7, 4), (8, 8), (4, 6), (0, 8), (1, 4)]


@given(st.floats(0.1, 5), st.floats(1.01, 4), st.floats(-math.pi, math.pi))
def test_a_circle_is_hit_where_the_closed_form_says(radius: float, times: float, bearing: float) -> None:
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


def test_from_inside_a_circle_every_beam_hits_it() -> None:
    np.testing.assert_allclose(Scene(circles=[(0, 0, 2)]).cast(0, 0, np.linspace(-3, 3, 9)), 2)


@pytest.mark.slow
@given(PLACES, PLACES, st.integers(0, 360))
@settings(max_examples=60)
def test_polygons_are_hit_where_shapely_says(x: float, y: float, first: int) -> None:
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
@settings(max_examples=30)
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


@pytest.mark.parametrize(
    ("polygons", "circles", "message"),
    [
        ([[(0, 0), (2, 2), (2, 0), (0, 2)]], [], "polygon 1 crosses or touches itself"),
        ([STAR, [(0, 0), (1, 1), (2, 2)]], [], "polygon 2"),
        ([[(0, 0), (1, 1)]], [], "three or more corners"),
        ([[(0, 0), (1, math.nan), (2, 0)]], [], "polygon 1 has a corner that is not finite"),
        ([], [(0, 0, 1), (1, 1, -0.5)], "circle 2 has a radius of -0.5"),
        ([], [(0, 0, 0)], "circle 1 has a radius of 0"),
        (
            [[(0, 0), (1, 0), (0, -1e300)]],
            [],
            "polygon 1 lies within 1e\\+09 m of the origin, not at -1e\\+300",
        ),
        ([], [(2e9, 0, 1)], "circle 1 lies within 1e\\+09 m of the origin, not at 2e\\+09"),
        ([], [(0, 0, 1e160)], "the radius of circle 1 is at most 1e\\+09 m, not 1e\\+160"),
        ([], [(0, math.inf, 1)], "circle 1 needs finite"),
    ],
)
def test_a_scene_checks_itself(polygons: list, circles: list, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scene(polygons, circles)


@given(PLACES, PLACES, st.floats(0, math.tau))
@settings(max_examples=60)
def test_a_beam_ends_on_a_surface_and_is_free_before_it(x: float, y: float, angle: float) -> None:
    scene = Scene(polygons=[STAR], circles=[(12, 4, 1.5)])
    [distance] = scene.cast(x, y, [angle])
    if math.isinf(distance):
        return
    solid = shapely.Polygon(STAR).boundary.union(shapely.Point(12, 4).buffer(1.5, quad_segs=2000).boundary)
    end = shapely.Point(x + distance * math.cos(angle), y + distance * math.sin(angle))
    assert end.distance(solid) < 1e-5
    share = np.linspace(0.01, 0.99, 9) * distance
    inside = scene.contains(x + share * math.cos(angle), y + share * math.sin(angle))
    assert (inside == inside[0]).all()  # no surface in between
