"""Sweep lines: spacing, coverage and angle, compared with GEOS."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate

from uavseg.errors import MissionError, ParameterError
from uavseg.flight.sweep import best_angle, sweep

EPSILON = 1e-6
JOINED = 1 / 20  # of the spacing: gaps that are flown through
RING = shapely.Point(0, 0).buffer(90) - shapely.Point(10, 5).buffer(40)
SHAPES = {
    "box": shapely.box(0, 0, 120, 80),
    "U": shapely.box(0, 0, 200, 200) - shapely.box(60, 60, 140, 200),
    "ring": RING,
    "holes": shapely.box(0, 0, 300, 200) - shapely.box(60, 60, 110, 140) - shapely.Point(200, 100).buffer(30),
    "crescent": shapely.Point(0, 0).buffer(120) - shapely.Point(50, 0).buffer(100),
    "stairs": shapely.union_all([shapely.box(3 * n, n, 3 * n + 40, n + 30) for n in range(0, 60, 3)]),
}
shapes = st.sampled_from(sorted(SHAPES)).map(SHAPES.__getitem__)
spacings = st.floats(4, 60)
angles = st.floats(-400, 400)


@st.composite
def blobs(draw: st.DrawFn) -> shapely.Polygon:
    """Connected unions of boxes on a grid, some with holes and pinched places, turned by any angle."""
    cells = draw(
        st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=3, max_size=22, unique=True)
    )
    boxes = [shapely.box(20 * x, 20 * y, 20 * x + 20, 20 * y + 20) for x, y in cells]
    merged = shapely.union_all(boxes)
    largest = max(shapely.get_parts(merged), key=lambda part: part.area)
    return rotate(largest, draw(st.floats(0, 360)), origin=(0, 0))


@given(shapes | blobs(), spacings, angles)
@settings(max_examples=60, deadline=None)
def test_lines_lie_inside(region: shapely.Polygon, spacing_m: float, angle_deg: float) -> None:
    lines = sweep(region, spacing_m, angle_deg)
    assert lines.line.size > 0
    inside = region.buffer(spacing_m * JOINED / 2 + EPSILON)
    assert shapely.covers(inside, shapely.linestrings(lines.segments)).all()


@given(shapes | blobs(), spacings, angles)
@settings(max_examples=60, deadline=None)
def test_neighbouring_lines_are_one_spacing_apart_along_the_angle(
    region: shapely.Polygon, spacing_m: float, angle_deg: float
) -> None:
    lines = sweep(region, spacing_m, angle_deg)
    east, north = (lines.segments[:, 1] - lines.segments[:, 0]).T
    long = np.hypot(east, north) > 1
    turned = np.degrees(np.arctan2(east, north))[long] - angle_deg
    assert np.allclose((turned + 90) % 180 - 90, 0, atol=1e-6)
    azimuth = math.radians(angle_deg)
    across = lines.segments[:, 0] @ [math.cos(azimuth), -math.sin(azimuth)]
    steps = np.abs(across - across[0]) / spacing_m
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert np.allclose(np.abs(lines.line - lines.line[0]), steps, atol=1e-6)


@given(shapes | blobs(), spacings, angles)
@settings(max_examples=60, deadline=None)
def test_all_but_the_rim_is_within_half_a_spacing_of_a_line(
    region: shapely.Polygon, spacing_m: float, angle_deg: float
) -> None:
    lines = sweep(region, spacing_m, angle_deg)
    swaths = shapely.union_all(shapely.buffer(shapely.linestrings(lines.segments), spacing_m / 2 + EPSILON))
    assert shapely.difference(region.buffer(-0.51 * spacing_m), swaths.buffer(1e-3)).area < 1e-3


def runs_along_an_edge(segments: np.ndarray, region: shapely.Polygon, angle_deg: float) -> bool:
    """Whether a line runs along an edge of a region."""
    across = np.array([math.cos(math.radians(angle_deg)), -math.sin(math.radians(angle_deg))])
    rings = [shapely.get_coordinates(ring) @ across for ring in (region.exterior, *region.interiors)]
    near = [np.abs(np.subtract.outer(ring, segments[:, 0] @ across)) < 1e-6 for ring in rings]
    return any((corners[1:] & corners[:-1]).any() for corners in near)


@given(shapes | blobs(), spacings, st.floats(0, 180), st.floats(0, 360))
@settings(max_examples=40, deadline=None)
def test_a_turned_and_moved_region_has_as_many_lines(
    region: shapely.Polygon, spacing_m: float, angle_deg: float, turn_deg: float
) -> None:
    lines = sweep(region, spacing_m, angle_deg)
    moved = translate(rotate(region, -turn_deg, origin=(0, 0)), 500, -200)  # shapely turns the other way
    again = sweep(moved, spacing_m, angle_deg + turn_deg)
    assert again.count == lines.count
    assume(not runs_along_an_edge(lines.segments, region, angle_deg))  # which is in or out by rounding
    assert np.hypot(*np.diff(again.segments, axis=1).T).sum() == pytest.approx(
        np.hypot(*np.diff(lines.segments, axis=1).T).sum(), rel=1e-2
    )


@given(blobs().map(lambda region: region.convex_hull), spacings, st.floats(0, 360))
@settings(max_examples=40, deadline=None)
def test_no_angle_needs_fewer_lines_than_the_best(
    region: shapely.Polygon, spacing_m: float, angle_deg: float
) -> None:
    best = sweep(region, spacing_m, best_angle(region, spacing_m))
    assert best.count <= sweep(region, spacing_m, angle_deg).count
    turned = rotate(region, -33.3, origin=(0, 0))
    assert sweep(turned, spacing_m, best_angle(turned, spacing_m)).count == best.count


@pytest.mark.parametrize(("azimuth", "expected"), [(0, 0), (90, 90), (30, 30), (150, 150)])
def test_the_best_angle_of_a_strip_is_its_own(azimuth: float, expected: float) -> None:
    strip = rotate(shapely.box(-5, -200, 5, 200), -azimuth)  # runs north before it is turned
    assert best_angle(strip, 20) == pytest.approx(expected)


def test_a_strip_narrower_than_the_spacing_gets_one_line_in_its_middle() -> None:
    lines = sweep(shapely.box(0, 0, 400, 8), 25, 90)
    assert lines.count == 1
    assert lines.segments.round(9).tolist() == [[[0, 4], [400, 4]]]


def test_a_line_is_cut_at_a_hole_and_not_at_a_tiny_one() -> None:
    region = shapely.box(0, 0, 100, 10) - shapely.box(20, 4, 30, 6) - shapely.box(60, 4.9, 60.2, 5.1)
    lines = sweep(region, 10, 90)
    assert lines.segments[:, :, 0].round(6).tolist() == [[0, 20], [30, 100]]


def test_a_line_along_an_edge_is_not_lost_or_doubled() -> None:
    steps = shapely.box(0, 0, 100, 30) | shapely.box(0, 30, 50, 60)  # a line runs along y = 30
    lines = sweep(steps, 20, 90)
    assert lines.count == 3
    assert lines.segments[lines.line == 1].round(6).tolist() in (
        [[[0, 30], [50, 30]]],
        [[[0, 30], [100, 30]]],
    )


@pytest.mark.parametrize("spacing_m", [0.0, -1.0, math.nan, math.inf])
def test_an_invalid_spacing_is_refused(spacing_m: float) -> None:
    with pytest.raises(ParameterError, match="spacing"):
        sweep(SHAPES["box"], spacing_m, 0)


def test_an_invalid_angle_is_refused() -> None:
    with pytest.raises(ParameterError, match="azimuth"):
        sweep(SHAPES["box"], 10, math.nan)


def test_more_lines_than_a_mission_holds_are_refused() -> None:
    with pytest.raises(MissionError, match="wider spacing"):
        sweep(SHAPES["box"], 0.001, 0)


@given(st.lists(st.floats(5, 60), min_size=3, max_size=14), spacings, angles)
@settings(max_examples=40, deadline=None)
def test_lines_agree_with_an_intersection_by_geos(
    radii: list[float], spacing_m: float, angle_deg: float
) -> None:
    turns = np.arange(len(radii)) * 2 * np.pi / len(radii)
    region = shapely.Polygon(np.array(radii)[:, None] * np.column_stack((np.cos(turns), np.sin(turns))))
    lines = sweep(region, spacing_m, angle_deg)
    azimuth = math.radians(angle_deg)
    ahead = 500 * np.array([math.sin(azimuth), math.cos(azimuth)])
    for line in np.unique(lines.line):
        pieces = lines.segments[lines.line == line]
        theirs = shapely.LineString([pieces[0, 0] - ahead, pieces[0, 0] + ahead]).intersection(region)
        ours = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T).sum()
        assert abs(ours - theirs.length) <= len(radii) * spacing_m * JOINED
        assert len(pieces) <= len(shapely.get_parts(theirs))
