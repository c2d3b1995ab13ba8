"""Simulated flights: laws of the vehicles, and that estimates, photographs and tables agree with them."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from scipy.sparse.csgraph import minimum_spanning_tree

from benchmarks.flight import arducopter, px4
from benchmarks.flight.body import DT, Body
from benchmarks.flight.cases import Case, fly_cases
from benchmarks.flight.fields import HOME, Field, degrees, drawn, many
from benchmarks.flight.lengths import length_of
from benchmarks.flight.log import EVERY, Log
from benchmarks.flight.measured import covered, heights_m, least_distance_m, simulate
from benchmarks.flight.order import Tour, tours, ways_between
from benchmarks.flight.orders_section import orders_table
from benchmarks.flight.patterns_section import patterns_table
from benchmarks.flight.plans import Plan, planned
from benchmarks.flight.route import Look, Shutter, Stop, route
from benchmarks.flight.section import WINDS, Row, flights_table
from uavseg.flight.camera.camera import Camera, Photos
from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.vehicle import PX4
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.planner import plan_missions

pytestmark = pytest.mark.slow

SIMULATORS = pytest.mark.parametrize("fly", [arducopter.fly, px4.fly], ids=["ardupilot", "px4"])
CAMERA = "DJI Mavic 3 Enterprise"


def speeds(log: Log) -> np.ndarray:
    """Speeds over ground, every fifth of a second."""
    return np.hypot(*np.diff(np.array(log.track)[:, :2], axis=0).T) / 0.2


@SIMULATORS
def test_a_vehicle_passes_each_corner_and_comes_home(fly: type(arducopter.fly)) -> None:
    corners = [(100.0, 0.0, 40.0), (100.0, 80.0, 40.0), (60.0, 60.0, 55.0), (-20.0, 90.0, 30.0)]
    log = fly(40.0, [Stop(corner, 8.0) for corner in corners], True)
    track = np.array(log.track)
    for corner in corners:
        assert np.linalg.norm(track - corner, axis=1).min() < 2.6  # the radius of waypoints, and a step
    assert np.hypot(*track[-1, :2]) < 1 and track[-1, 2] < 0.2
    assert 7 < speeds(log).max() < 10.7  # ArduCopter returns at 10 m/s


@SIMULATORS
def test_wind_is_held_out_and_a_hold_lasts(fly: type(arducopter.fly)) -> None:
    stops = [Stop((60.0, 0.0, 30.0), 5.0), Stop((60.0, 60.0, 30.0), 5.0, hold_s=20.0)]
    out, held = fly(30.0, stops, False), fly(30.0, stops, False, (5.0, 3.0, 0.0))
    assert held.seconds == pytest.approx(out.seconds, rel=0.03)  # a return is faster than the air allows
    calm, windy = fly(30.0, stops, True), fly(30.0, stops, True, (5.0, 3.0, 0.0))
    away = np.hypot(*(np.array(windy.track)[:, :2] - (60, 60)).T)
    assert (away < 2.1).sum() * 0.2 > 19
    brief = fly(30.0, [stops[0], Stop((60.0, 60.0, 30.0), 5.0)], True)
    assert calm.seconds - brief.seconds == pytest.approx(20, abs=2)


def test_lean_angles_are_limited() -> None:
    body = Body()
    for _ in range(500):
        before = body.velocity
        body.step((1000.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        change = math.dist(before, body.velocity) / 0.02
        assert change <= 9.81 * math.tan(math.radians(30)) + 1e-6
    assert body.velocity[0] > 10


def test_a_ramp_is_integrated_to_its_speed() -> None:
    for speed in (0.05, 1.0, 5.0, 10.0):
        table = arducopter.ramp(speed, 2.5)
        assert table[-1][1] == pytest.approx(speed, rel=1e-3)
        assert table[-1][2] == pytest.approx(0, abs=1e-2)
        assert max(acceleration for _, _, acceleration in table) <= 2.5 + 1e-6


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize(("pattern", "speed"), [("survey", 5.0), ("perimeter", 10.0), ("visit", 5.0)])
def test_estimates_are_within_ten_per_cent(autopilot: str, pattern: str, speed: float) -> None:
    for field in drawn()[1:3]:
        missions = planned(
            field,
            pattern=pattern,
            camera=CAMERA if pattern == "survey" else None,
            height_m=50.0,
            speed=speed,
            autopilot=autopilot,
        )
        found = simulate(missions, field)
        assert abs(found.error) < 0.1
        assert found.photographs == pytest.approx(found.estimated_photographs, abs=3)
        assert found.covered >= 0.999 or pattern != "survey"


CIRCLES = st.tuples(st.integers(6, 60), st.floats(10, 120), st.floats(2, 12))


@given(circle=CIRCLES)
@settings(max_examples=15)
def test_circles_of_short_legs_take_as_long_as_px4_flies_them(circle: tuple[int, float, float]) -> None:
    sides, radius, speed = circle
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    path = np.column_stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), np.full(sides + 1, 40.0)])
    log = px4.fly(40.0, [Stop(tuple(place), speed) for place in path[1:].tolist()], False)
    flown_s = (len(log.track) - log.begin) * EVERY * DT
    assert leg_seconds(path, speed, PX4).sum() == pytest.approx(flown_s, rel=0.05, abs=0.5)


@pytest.mark.parametrize("speed", [5.0, 10.0, 12.0])
def test_short_lines_to_and_fro_take_as_long_as_px4_flies_them(speed: float) -> None:
    east, north = np.repeat(np.arange(12) * 25.0, 2), np.tile([0.0, 40.0, 40.0, 0.0], 6)
    path = np.column_stack([east, north, np.full(24, 40.0)])
    log = px4.fly(40.0, [Stop(tuple(place), speed) for place in path[1:].tolist()], False)
    flown_s = (len(log.track) - log.begin) * EVERY * DT
    assert leg_seconds(path, speed, PX4).sum() == pytest.approx(flown_s, rel=0.02)


@given(length=st.floats(3, 60), hold=st.integers(1, 4), turn=st.floats(0, np.pi), speed=st.floats(2, 12))
@settings(max_examples=15)
def test_legs_between_holds_take_as_long_as_px4_flies_them(
    length: float, hold: int, turn: float, speed: float
) -> None:
    heading = turn * (np.arange(8) % 2)
    steps = length * np.column_stack([np.cos(heading), np.sin(heading), np.zeros(8)])
    path = np.concatenate([[[0, 0, 40.0]], np.cumsum(steps, axis=0) + np.array([0, 0, 40.0])])
    log = px4.fly(40.0, [Stop(tuple(place), speed, float(hold)) for place in path[1:].tolist()], False)
    flown_s = (len(log.track) - log.begin) * EVERY * DT - 8 * hold
    holds = np.r_[0.0, np.full(8, float(hold))]
    legs_s = leg_seconds(path, speed, PX4, holds > 0, holds)
    behind_s = 0.12 * len(legs_s)  # by so much the vehicle follows its trajectory
    assert legs_s.sum() == pytest.approx(flown_s, rel=0.05, abs=behind_s)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_photographs_are_not_taken_faster_than_the_camera_allows(autopilot: str) -> None:
    field = drawn()[-1]
    camera = Camera("slow", (13.2, 8.8), (5472, 3648), 8.8, 2.5)
    photos = Photos(camera)
    params = PlanParams(
        50.0, "survey", photos.spacing_m(50.0), photos=photos, speed_m_s=12.0, autopilot=autopilot
    )
    [mission] = plan_missions(field.polygons, field.points, params, field.home)
    slowest, fastest = mission.speed_range_m_s
    assert slowest < 6 and fastest == 12
    height, stops, returns = route(mission)
    log = {"ardupilot": arducopter.fly, "px4": px4.fly}[autopilot](height, stops, returns)
    assert speeds(log).max() > 11  # between regions
    track, at = np.array(log.track)[:, :2], np.array(log.photographs)[:, :2]
    nearest = np.array([np.hypot(*(track - place).T).argmin() for place in at])
    taken = speeds(log)[np.minimum(nearest, len(track) - 2)]
    assert (taken <= camera.max_speed_m_s(50.0, photos.trigger_m(50.0), photos.shutter_s, 1.0) * 1.1).all()
    assert mission.duration_s == pytest.approx(log.seconds, rel=0.03)


def test_photographs_are_taken_by_distance() -> None:
    stops = [
        Stop((50.0, 0.0, 30.0), 5.0, actions=[Shutter(every_m=10.0, at_once=True)]),
        Stop((50.0, 95.0, 30.0), 5.0, actions=[Shutter()]),
    ]
    log = arducopter.fly(30.0, [*stops, Stop((0.0, 95.0, 30.0), 5.0)], True)
    places = np.array(log.photographs)[:, :2]
    apart = np.hypot(*np.diff(places, axis=0).T)
    assert len(places) == 10 and np.all(apart >= 10) and np.all(apart < 10.2)
    assert np.allclose([yaw for *_, yaw in log.photographs[1:]], 0, atol=1e-9)  # to the north
    assert log.photographs[0][3] == pytest.approx(math.pi / 2)  # it has not turned yet


def test_photographs_are_taken_by_time_and_in_hover() -> None:
    first = Stop((50.0, 0.0, 30.0), 5.0, actions=[Shutter(every_s=3.0, at_once=True)])
    then = Stop((50.0, 95.0, 30.0), 5.0, 4.0, actions=[Shutter(), Shutter(at_once=True, single=True)])
    log = arducopter.fly(30.0, [first, then, Stop((0.0, 95.0, 30.0), 5.0)], True)
    apart = np.hypot(*np.diff(np.array(log.photographs)[:, :2], axis=0).T)
    assert np.all(apart[3:-4] == pytest.approx(15, abs=0.3))  # 3 s at 5 m/s
    assert math.dist(log.photographs[-1][:2], (50, 95)) < 0.5


def test_the_camera_looks_at_a_place() -> None:
    stops = [
        Stop((50.0, -60.0, 30.0), 5.0, actions=[Look((0.0, 0.0)), Shutter(every_m=10.0)]),
        Stop((50.0, 60.0, 30.0), 5.0, actions=[Shutter(), Look(None)]),
    ]
    log = arducopter.fly(30.0, [*stops, Stop((0.0, 60.0, 30.0), 5.0)], True)
    for x, y, _, yaw in log.photographs[2:]:
        assert math.remainder(yaw - math.atan2(-x, -y), math.tau) == pytest.approx(0, abs=0.02)


def test_heights_above_the_terrain_follow_the_ground() -> None:
    stops = [Stop((x, 0.0, 40.0), 5.0, above_ground=True) for x in (50.0, 450.0)]
    log = arducopter.fly(40.0, stops, False, rise=lambda x, y: 0.1 * x + 5 * math.sin(x / 60))
    above = heights_m(log, lambda x, y: 0.1 * x + 5 * math.sin(x / 60))
    assert np.abs(above - 40).max() < 1.0
    assert np.ptp(heights_m(log, None)) > 30


def test_px4_climbs_before_it_flies_on() -> None:
    log = px4.fly(40.0, [Stop((30.0, 0.0, 40.0), 5.0), Stop((230.0, 0.0, 70.0), 5.0)], False)
    x, _, z = np.array(log.track).T
    assert np.interp(130, x, z) > 69  # and not half way


def test_px4_turns_back_to_a_target_that_it_passed() -> None:
    stops = [Stop((12.0 * k, 0.0, 40.0 + 8 * (k % 2)), 5.0, hold_s=1.0) for k in range(1, 8)]
    log = px4.fly(40.0, stops, True)
    assert log.seconds < 300 and np.abs(np.array(log.track)[:, 1]).max() < 5


def test_ground_that_is_not_photographed_is_seen() -> None:
    photos = Photos(Camera("test", (12.0, 8.0), (6000, 4000), 10.0))
    log = Log(photographs=[(0.0, 0.0, 100.0, 0.0)])  # shows 120 m east to west and 80 m north to south
    assert covered(log, shapely.box(-60, -40, 60, 40), photos) == pytest.approx(1)
    assert covered(log, shapely.box(-60, -40, 60, 120), photos) == pytest.approx(0.5)
    log.photographs[0] = (0.0, 0.0, 100.0, math.pi / 2)
    assert covered(log, shapely.box(-60, -40, 60, 40), photos) == pytest.approx(2 / 3)


def test_the_distance_to_zones_is_that_of_the_track() -> None:
    log = Log(track=[(0.0, 0.0, 9.0), (10.0, 0.0, 9.0)])
    assert least_distance_m(log, shapely.box(4, 3, 6, 5)) == 3
    assert least_distance_m(log, shapely.box(4, -3, 6, 5)) == 0


def test_regions_and_zones_do_not_touch_and_home_is_free() -> None:
    field = many(12, 5, seed=1)
    shapes = [*field.polygons, *field.zones]
    assert len(field.polygons) == 12 and len(field.zones) == 5 == len(set(field.zones))
    tree = shapely.STRtree(shapes)
    assert all(len(tree.query(shape, predicate="intersects")) == 1 for shape in shapes)
    assert not shapely.intersects(shapes, shapely.Point(HOME[1], HOME[0])).any()


def test_a_route_has_the_speed_and_the_triggers_of_the_items() -> None:
    field = Field("box", (degrees(shapely.box(30, 30, 130, 90)),))
    [mission] = planned(field, pattern="survey", camera=CAMERA, height_m=40.0, speed=6.0)
    height, stops, returns = route(mission)
    assert height == 40 and returns and {stop.speed for stop in stops} == {6.0}
    begun = [one.every_m for stop in stops for one in stop.actions if one.at_once]
    assert len(begun) == len(stops) / 2 and min(begun) > 0


def test_tours_lead_everywhere_and_uavseg_finds_a_short_one() -> None:
    found = list(tours((12,), long_s=1))
    assert found[0].method == "**uavseg**"
    assert found[0].length_m <= 1.02 * min(tour.length_m for tour in found)
    places = np.random.default_rng(12).uniform(0, 1000, (13, 2))  # no tour is shorter than its spanning tree
    tree = minimum_spanning_tree(np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))).sum()
    assert tree < found[0].length_m < 2 * tree


def test_the_tables_name_what_is_worst() -> None:
    field = drawn()[0]
    [mission] = missions = planned(field, pattern="visit", camera=None, height_m=50.0, speed=5.0)
    flown = simulate(missions, field)
    flights = {(autopilot, speed): flown for autopilot in ("ardupilot", "px4") for speed in (5.0, 10.0)}
    windy = {key: [simulate(missions, field, wind) for wind in WINDS] for key in flights}
    text = flights_table([Row("rectangle", "visit", len(mission.items), flights, windy)])
    assert f"off by {abs(flown.error):.1%}" in text and "| rectangle |" in text
    for one, wind in zip(windy["px4", 5.0], WINDS, strict=True):
        assert abs(one.error) < 0.07 and f"{abs(one.error):.1%} at {math.hypot(*wind):.1f} m/s" in text
    plan = Plan("9 regions", "visit", 1, 12, 9, 1234.0, 0.4, 0.5, float("nan"), 7.25)
    text = orders_table([Tour("9 places", "a", 100.0, 0.1), Tour("9 places", "b", 103.0, 0.2)], [plan])
    assert "+3.00%" in text and " 7.2 |" in text


def test_heights_over_hills_are_kept_by_both_autopilots() -> None:
    field = Field("box", (degrees(shapely.box(60, 60, 260, 110)),))
    case = Case(field, "survey", "distance", terrain="absolute")
    [row] = fly_cases([case], lambda line: None)
    for flown in row.calm.values():
        assert 44 < flown.lowest_m <= flown.highest_m < 56 and flown.covered >= 0.999
    length = length_of(field, 20.0, 5.0)
    text = patterns_table([row], [length])
    assert "ArduCopter" in text and "PX4" in text and f" {length.over_bound:.2f} |" in text


def test_a_square_of_whole_lines_is_at_its_lower_bound_but_for_its_legs() -> None:
    length = length_of(Field("box", (degrees(shapely.box(60, 60, 160, 160)),)), 20.0, 0.0)
    assert length.lines_m == pytest.approx(length.area_m, rel=0.01) and length.tour_m == 0
    assert length.legs_m == pytest.approx(80, rel=0.05)


def test_ways_between_regions_lead_around_zones() -> None:
    field = many(6, 3, seed=1)
    around, straight = ways_between(field), ways_between(Field("free", field.polygons))
    assert (around >= straight - 1e-6).all() and around.max() < 2000
