"""Flights on paper: what a written mission must not do, drawn by hand."""

import re

import numpy as np
import pytest
import shapely

from tests.flight.small_regions import HOME, box, degrees, planned
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.mission.items import (
    FRAME_RELATIVE,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
    RallyPoint,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.safety.check import SafetyCheck
from uavseg.flight.safety.keep_out import CLEARANCE_M, home_outside


def flight(*places: tuple[float, float], height: float = 60, **words: object) -> Mission:
    lonlat = [shapely.get_coordinates(degrees(shapely.Point(place)))[0].tolist() for place in places]
    items = [MissionItem(TAKEOFF, FRAME_RELATIVE, lat=HOME[0], lon=HOME[1], altitude_m=height)]
    items += [
        MissionItem(WAYPOINT, FRAME_RELATIVE, lat=lat, lon=lon, altitude_m=height) for lon, lat in lonlat
    ]
    return Mission(HomePosition(*HOME), (*items, MissionItem(RETURN, 2)), **words)  # type: ignore[arg-type]


AROUND = ((300.0, 300.0), (300.0, -300.0), (-50.0, -300.0), (-50.0, 300.0))


def polygon(places: tuple[tuple[float, float], ...], inclusion: bool = True) -> FencePolygon:
    lonlat = shapely.get_coordinates(degrees(shapely.LineString(places)))
    return FencePolygon(tuple((lat, lon) for lon, lat in lonlat.tolist()), inclusion)


@pytest.mark.parametrize(
    ("mission", "safety", "zones", "words"),
    [
        (flight((100, 0)), SafetyParams(10), [box(40, 5, 20, 20)], r"comes within 5\.0 m of a keep-out zone"),
        (flight((100, 0), (100, 100)), SafetyParams(0), [box(40, 40, 20, 20)], "comes within 0.0 m"),
        (flight((100, 0), height=121), SafetyParams(), [], r"121\.0 m high.*--max-altitude"),
        (flight((100, 0)), SafetyParams(max_distance_m=99.0), [], "100 m from home.*--max-distance"),
        (flight((400, 0), fence=(polygon(AROUND),)), SafetyParams(), [], "leaves the fence"),
        (flight((100, 0), fence=(FenceCircle(47, 8, 90),)), SafetyParams(), [], "leaves the fence"),
        (
            flight((100, 0), fence=(polygon(((40, -9), (60, -9), (50, 9)), False),)),
            SafetyParams(),
            [],
            "enters the zone to keep out of",
        ),
    ],
)
def test_what_is_not_safe_is_refused_and_says_where(
    mission: Mission, safety: SafetyParams, zones: list[shapely.Polygon], words: str
) -> None:
    with pytest.raises(MissionError, match=words):
        SafetyCheck(safety, zones).check(mission)
    SafetyCheck(SafetyParams(0, max_altitude_m=500), []).check(flight((100, 0)))


def rally(east: float, north: float, height: float = 30) -> RallyPoint:
    lon, lat = shapely.get_coordinates(degrees(shapely.Point(east, north)))[0].tolist()
    return RallyPoint(lat, lon, height)


@pytest.mark.parametrize(
    ("mission", "safety", "words"),
    [
        (
            flight((100, 0), rally=(rally(45, 12),)),
            SafetyParams(2),
            "rally point 1 .* within 0.0 m of a keep-out",
        ),
        (
            flight((100, 0), rally=(rally(0, 9), rally(0, 9, 121))),
            SafetyParams(2),
            "rally point 2 .* 121.0 m high",
        ),
        (
            flight((100, 0), rally=(rally(0, 150),)),
            SafetyParams(2, max_distance_m=120.0),
            "rally .* 150 m from home",
        ),
        (
            flight((100, 0), fence=(polygon(AROUND),), rally=(rally(0, 301),)),
            SafetyParams(2),
            r"rally point 1 .* outside of the fence \(shape 1\)",
        ),
        (
            flight((100, 0), fence=(polygon(AROUND), FenceCircle(47, 8, 90))),
            SafetyParams(2),
            r"leaves the fence \(shape 2\)",  # each inclusion holds, not their union
        ),
    ],
)
def test_rally_points_and_every_inclusion_are_checked(
    mission: Mission, safety: SafetyParams, words: str
) -> None:
    found = list(SafetyCheck(safety, [box(40, 5, 20, 20)]).problems(mission))
    assert len(found) == 1 and re.search(words, found[0])
    good = flight((100, 0), fence=(polygon(AROUND),), rally=(rally(0, 40), rally(-20, -20, 60)))
    assert not list(SafetyCheck(SafetyParams(2), [box(40, 5, 20, 20)]).problems(good))


def test_the_fence_leads_around_the_flight_and_is_left_out_on_request() -> None:
    mission = planned([box(100, 50, 80, 60)], pattern="perimeter", safety=SafetyParams(fence_margin_m=30.0))
    (fence,) = mission.fence
    lat, lon, _ = mission.path
    plane = Plane(*HOME[:2])
    path = shapely.LineString(np.column_stack(plane.xy_from_lonlat(lon, lat)))
    lat, lon = np.array(fence.vertices).T
    hull = shapely.LinearRing(np.column_stack(plane.xy_from_lonlat(lon, lat)))
    assert 30 <= shapely.distance(path, hull) <= 36
    assert not planned([box(100, 50, 80, 60)], safety=SafetyParams(fence_margin_m=None)).fence
    rally = (RallyPoint(47.0005, 8.0, 30),)
    assert planned([box(100, 50, 80, 60)], safety=SafetyParams(rally=rally)).rally == rally


def test_a_flight_above_the_allowed_height_is_refused_unless_it_is_asked_for() -> None:
    with pytest.raises(ParameterError, match="--max-altitude"):
        planned([box(100, 50, 80, 60)], altitude_m=121.0)
    high = planned([box(100, 50, 80, 60)], altitude_m=150.0, safety=SafetyParams(max_altitude_m=150.0))
    assert high.items[0].altitude_m == 150


def test_home_is_outside_of_regions_zones_and_islands() -> None:
    pond = shapely.box(0, 0, 400, 300) - shapely.box(180, 130, 220, 170)
    zone = shapely.box(-100, -200, 500, -20)
    lat, lon = home_outside([degrees(pond)], [(8.0026, 47.0004)], [degrees(zone)], 10.0)
    home = shapely.Point(*(float(v) for v in Plane(47.0, 8.0).xy_from_lonlat(lon, lat)))
    assert (
        shapely.distance(home, shapely.union_all([pond, shapely.Polygon(pond.exterior)]))
        >= CLEARANCE_M * 0.95
    )
    assert shapely.distance(home, zone) >= 10 + CLEARANCE_M * 0.95
    with pytest.raises(MissionError, match="no region"):
        home_outside([], [])
