"""Keep-out zones: no leg comes nearer than the margin, what is left is flown, what is enclosed is refused."""

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.small_regions import HOME, box, degrees, flights, planned, waypoints
from uavseg.errors import MissionError
from uavseg.flight.mission.items import CAMERA_DISTANCE
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane, Track
from uavseg.flight.params.plan import LimitParams, SafetyParams
from uavseg.flight.safety.check import fence_around
from uavseg.flight.safety.keep_out import KeepOut

PLANE = Plane(47.0, 8.0)
WALL = box(150, -500, 20, 1000)  # between home and what lies east of it


def path(mission: Mission) -> np.ndarray:
    lat, lon, _ = mission.path
    return np.column_stack(PLANE.xy_from_lonlat(lon, lat))


def nearest(mission: Mission, zones: list[Any]) -> float:
    legs = shapely.LineString(path(mission))
    return float(shapely.distance(legs, shapely.union_all(PLANE.project_polygons(zones))))


def blob(x: float, y: float, radius: float, seed: int) -> shapely.Polygon:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 9))
    reach = radius * rng.uniform(0.4, 1, 9)
    ring = np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])
    return shapely.convex_hull(shapely.multipoints(ring)) if seed % 2 else shapely.Polygon(ring)


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(st.floats(-300, 300), st.floats(-300, 300), st.floats(10, 120)), min_size=1, max_size=4
    ),
    st.sampled_from([0.0, 5.0, 30.0]),
    st.sampled_from(["visit", "perimeter", "survey"]),
    st.integers(0, 10**6),
)
@settings(max_examples=30)
def test_no_leg_comes_nearer_to_a_zone_than_the_margin(
    discs: list[tuple[float, float, float]], margin: float, pattern: str, seed: int
) -> None:
    zones = [shapely.make_valid(blob(*disc, seed + k)) for k, disc in enumerate(discs)]
    regions = [box(-250, -250, 120, 140), box(100, -200, 150, 90), box(-60, 120, 180, 130)]
    flown = {"pattern": pattern} | ({"spacing_m": 25.0} if pattern == "survey" else {})
    try:
        mission = planned(
            regions, zones=[degrees(zone) for zone in zones], safety=SafetyParams(margin), **flown
        )
    except MissionError as error:
        assert "keep-out zone" in str(error) or "no way" in str(error)
        return
    assert shapely.distance(shapely.LineString(path(mission)), shapely.union_all(zones)) >= margin - 0.01


def test_the_way_around_is_the_shortest_one_and_the_way_home_is_planned_as_well() -> None:
    mission = planned([box(300, -20, 60, 40)], zones=[WALL], safety=SafetyParams(10))
    assert nearest(mission, [WALL]) >= 10
    around = 2 * (np.hypot(140, 510) + 40 + np.hypot(150, 510))  # over the nearer end of the wall
    assert mission.distance_m == pytest.approx(around, rel=0.03)
    assert waypoints(mission)[-1] == pytest.approx((8.0, 47.0), abs=1e-7)  # then the return needs no way


def test_without_a_zone_in_the_way_nothing_changes() -> None:
    regions = [box(0, 100, 90, 60), box(200, 0, 40, 80)]
    aside = planned(regions, zones=[box(-900, -900, 50, 50)], pattern="survey", spacing_m=15)
    without = planned(regions, pattern="survey", spacing_m=15)
    assert aside.items == without.items
    assert len(aside.fence) == len(without.fence) == 1  # a zone outside of the fence is not written


def test_a_region_is_flown_as_far_as_zones_leave_it_and_a_note_says_how_much_is_not() -> None:
    mission = planned(
        [box(100, 0, 100, 100)], zones=[box(160, -50, 200, 200)], pattern="survey", spacing_m=10
    )
    (note,) = [text for text in mission.warnings if "keep-out" in text]
    assert "5,4" in note and "(55 %)" in note
    assert path(mission)[1:-1, 0].max() < 150
    assert path(mission)[1:-1, 0].max() > 140


def test_lines_are_cut_at_zones_and_photographed_up_to_them() -> None:
    track = Track(
        np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 10.0], [0.0, 10.0]]),
        np.array([5.0, 0, 5]),
        np.array([True, False, True]),
    )
    keep_out = KeepOut([shapely.box(40, -5, 60, 20)], 0.0)
    cut = keep_out.clear(track)
    lines = [cut.xy[first : last + 1].round().tolist() for first, last in cut.line_runs()]
    assert lines == [[[0, 0], [39, 0]], [[61, 0], [100, 0]], [[100, 10], [61, 10]], [[39, 10], [0, 10]]]
    assert cut.trigger_m[cut.is_line].tolist() == [5] * 4 and not cut.trigger_m[~cut.is_line].any()


def test_the_fence_excludes_zones_with_a_part_of_their_margin() -> None:
    zone = box(60, 60, 80, 80)
    mission = planned([box(0, 0, 40, 200), box(160, 0, 40, 200)], zones=[zone], pattern="perimeter")
    hull, keep_out = mission.fence
    assert hull.inclusion and not keep_out.inclusion
    lat, lon = np.array(keep_out.vertices).T
    ring = shapely.Polygon(np.column_stack(PLANE.xy_from_lonlat(lon, lat)))
    raw = PLANE.project_polygons([zone])[0]
    assert shapely.covers(ring, raw)
    assert shapely.distance(ring, shapely.LineString(path(mission))) > 0


@pytest.mark.parametrize(
    ("zone", "words"),
    [
        (box(-20, -20, 40, 40), "home lies in a keep-out zone"),
        (box(90, -10, 80, 120), r"the region at 47\.\d+,8\.\d+ lies in a keep-out zone"),
        (degrees(shapely.box(60, -60, 240, 160) - shapely.box(70, -50, 230, 150)), "cannot be reached"),
    ],
)
def test_what_zones_make_impossible_is_refused(zone: Any, words: str) -> None:
    with pytest.raises(MissionError, match=words):
        planned([box(110, 10, 40, 60)], zones=[zone], safety=SafetyParams(5))


@pytest.mark.slow
def test_each_of_several_flights_keeps_away() -> None:
    regions = [box(300 * k, 200 + 90 * (k % 2), 200, 150) for k in range(1, 5)]
    zones = [box(300 * k - 60, 150, 40, 300) for k in range(1, 5)]
    flown = flights(
        regions, zones=zones, pattern="survey", spacing_m=20, limits=LimitParams(12, 20), speed_m_s=8
    )
    assert len(flown) > 2
    assert all(nearest(mission, zones) >= 10 for mission in flown)
    assert all(mission.duration_s <= 12 * 60 * 0.8 for mission in flown)
    assert not any(item.command == CAMERA_DISTANCE for mission in flown for item in mission.items)
    assert all((mission.home.lat, mission.home.lon) == HOME[:2] for mission in flown)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(0, 40))
@settings(max_examples=30)
def test_grown_zones_hold_their_margin_and_few_corners(seed: int, margin: int) -> None:
    rng = np.random.default_rng(seed)
    stairs = shapely.union_all([shapely.box(*place, *(place + 9)) for place in rng.integers(0, 60, (40, 2))])
    keep_out = KeepOut([stairs], margin)
    inner = shapely.buffer(stairs, margin, quad_segs=64)
    assert shapely.difference(inner, keep_out.grown).area < 1e-6
    assert shapely.covers(shapely.buffer(inner, 3 + 0.6 * margin), keep_out.grown)
    for fenced in keep_out.fence_zones:
        assert shapely.covers(keep_out.grown, fenced)
    assert shapely.difference(stairs, shapely.union_all(keep_out.fence_zones)).area < 1e-6


def shore(pixel_m: float = 5.0) -> Any:
    """Lakes with hundreds of steps of a pixel along their shores."""
    y, x = np.mgrid[:150, :150] / 150
    wet = np.sin(9 * x + 3 * y) * np.cos(7 * y - 2 * x) + 0.2 * np.sin(31 * x) * np.sin(37 * y) > 0.35
    rows, cols = np.nonzero(wet)
    left, low = cols * pixel_m, rows * pixel_m
    return shapely.union_all(shapely.box(left, low, left + pixel_m, low + pixel_m))


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0, 5, 20, 40])
def test_shores_of_many_steps_keep_few_corners_and_their_margin(margin: int) -> None:
    lakes = shore()
    assert shapely.get_num_coordinates(lakes) > 800
    keep_out = KeepOut([lakes], margin)
    inner = shapely.buffer(lakes, margin, quad_segs=64)
    assert shapely.get_num_coordinates(keep_out.grown) <= 800
    assert shapely.difference(inner, keep_out.grown).area < 1e-6
    assert shapely.covers(shapely.buffer(inner, 12), keep_out.grown)
    half, most = shapely.union_all(keep_out.fence_zones), shapely.union_all(keep_out.simpler_fence_zones)
    if margin >= 5:
        assert shapely.get_num_coordinates(most) < shapely.get_num_coordinates(half)
        assert shapely.get_num_coordinates(half) < shapely.get_num_coordinates(lakes) / 2
    for fenced, share in ((half, 1 / 2), (most, 3 / 4)):
        assert shapely.difference(lakes, fenced).area < 1e-6
        assert shapely.covers(shapely.buffer(lakes, share * margin + 1e-6), fenced)


def test_a_fence_of_many_vertices_ends_at_its_hull() -> None:
    path = np.array([[0, 0], [600, 0], [300, 20]], float)
    x = np.arange(-5000, 5001, 50)
    for height, cut in ((0, False), (40, True)):  # a straight wall, and one that zigzags
        wall = shapely.buffer(
            shapely.LineString(np.column_stack([x, 50 + height * (np.arange(len(x)) % 2)])), 1
        )
        fence, notes = fence_around(path, KeepOut([wall], 8), 50, PLANE)
        lat, lon = np.array(fence[1].vertices).T
        east, _ = PLANE.xy_from_lonlat(lon, lat)
        assert (east.min() > -300 and east.max() < 900) == cut and (east.min() < -5000) != cut
        assert len(fence) == 2 and notes == []
