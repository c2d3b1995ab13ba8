"""Zones with a height are flown over from their height and margin on; a home in one is told a free place."""

import math
import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.mission_items import waypoint
from tests.flight.safety.test_keep_out import blob, path
from tests.flight.small_regions import HOME, box, degrees, planned
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    LAND,
    RETURN,
    TAKEOFF,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams, SafetyParams, TerrainParams
from uavseg.flight.safety.check import SafetyCheck

PLANE = Plane(47.0, 8.0)
REGIONS = [box(100, -100, 100, 200), box(260, 0, 60, 60)]
discs = st.lists(
    st.tuples(st.floats(-100, 300), st.floats(-200, 200), st.floats(10, 80)), min_size=1, max_size=4
)


@pytest.mark.slow
@given(discs, st.integers(20, 100), st.sampled_from([0.0, 3.0, 10.0, 30.0]), st.integers(0, 10**6))
@settings(max_examples=80, deadline=None)
def test_a_flight_leads_over_zones_or_around_them_and_never_near(
    zones: list[tuple[float, float, float]], height_m: int, margin_m: float, seed: int
) -> None:
    blobs = [shapely.make_valid(blob(*disc, seed + k)) for k, disc in enumerate(zones)]
    areas, safety = [degrees(zone) for zone in blobs], SafetyParams(margin_m, zone_height_m=float(height_m))
    over = height_m + max(margin_m, 5) <= 60
    try:
        mission = planned(REGIONS, zones=areas, safety=safety)
    except MissionError as error:
        assert "keep-out zone" in str(error) or "no way" in str(error)
        assert not over or "home lies in" in str(error)
        return
    kept = shapely.union_all(blobs)
    away_m = shapely.distance(shapely.LineString(path(mission)), kept)
    assert away_m >= margin_m - 0.01 or over
    assert shapely.distance(shapely.Point(0, 0), kept) >= margin_m
    SafetyCheck(safety, areas).check(mission)
    if over:
        assert mission.items == planned(REGIONS).items
        assert all(shape.inclusion for shape in mission.fence)  # its vehicle would breach an exclusion
    told = [text for text in mission.warnings if "--zone-height" in text]
    assert len(told) == 1 and told[0].endswith("this one may, at 60 m") == over


@pytest.mark.slow
@given(discs, st.integers(0, 10**6), st.sampled_from([30.0, None]), st.sampled_from([0.0, 10.0]))
@settings(max_examples=150, deadline=None)
def test_check_finds_what_a_slow_plain_check_finds(
    zones: list[tuple[float, float, float]], seed: int, height_m: float | None, margin_m: float
) -> None:
    rng = np.random.default_rng(seed)
    blobs = [shapely.make_valid(blob(*disc, seed + k)) for k, disc in enumerate(zones)]
    xyz = np.column_stack([rng.uniform(-300, 300, (4, 2)), rng.choice([20.0, 41.0, 80.0], 4)])
    lon, lat = PLANE.lonlat_from_xy(*xyz[:, :2].T)
    frames = rng.choice([FRAME_RELATIVE, FRAME_RELATIVE, FRAME_RELATIVE, FRAME_AMSL, FRAME_TERRAIN], 4)
    if seed % 2:
        frames[:] = FRAME_RELATIVE
    up = MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), 47.0, 8.0, 50.0)
    items = [
        waypoint(float(y), float(x), altitude_m=float(z), frame=int(frame))
        for x, y, z, frame in zip(lon, lat, xyz[:, 2], frames, strict=True)
    ]
    mission = Mission(HomePosition(47.0, 8.0, 0.0), (up, *items, MissionItem(RETURN, 2)))
    corners = np.vstack([[0, 0, 0], [0, 0, 50], xyz, [0, 0, xyz[-1, 2]]])
    over = math.inf if height_m is None or (frames != FRAME_RELATIVE).any() else height_m + max(margin_m, 5)
    kept, near = shapely.union_all(blobs), math.inf
    for start, end in pairwise(corners):
        places = start + np.linspace(0, 1, 400)[:, None] * (end - start)
        if min(start[2], end[2]) < over:
            near = min(near, shapely.distance(kept, shapely.points(places[:, :2])).min())
    if abs(near - margin_m) < 1 and near > 0:
        return
    check = SafetyCheck(SafetyParams(margin_m, zone_height_m=height_m), [degrees(zone) for zone in blobs])
    found = [text for text in check.problems(mission) if "keep-out zone" in text]
    assert bool(found) == (near < margin_m or near == 0)


@pytest.mark.parametrize(("altitude_m", "lands"), [(0.0, True), (80.0, False)])
def test_where_it_lands_the_vehicle_is_on_the_ground(altitude_m: float, lands: bool) -> None:
    zone = box(100, -10, 20, 20)
    there = PLANE.lonlat_from_xy(110.0, 0.0)
    landing = waypoint(float(there[1]), float(there[0]), command=LAND, altitude_m=altitude_m)
    up = MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), 47.0, 8.0, 80.0)
    check = SafetyCheck(SafetyParams(zone_height_m=30.0), [zone])
    assert list(check.problems(Mission(HomePosition(*HOME), (up, landing))))


@pytest.mark.slow
@given(discs, st.integers(0, 10**6), st.sampled_from([0.0, 5.0, 30.0]))
@settings(max_examples=80, deadline=None)
def test_the_place_that_is_named_in_place_of_home_is_free_and_near(
    zones: list[tuple[float, float, float]], seed: int, margin_m: float
) -> None:
    blobs = [shapely.make_valid(blob(*disc, seed + k)) for k, disc in enumerate(zones)]
    kept = shapely.union_all([*blobs, shapely.box(-30, -20, 10, 25)])
    how: dict[str, Any] = {"zones": [degrees(part) for part in shapely.get_parts(kept)]}
    how |= {"safety": SafetyParams(margin_m)}
    with pytest.raises(MissionError, match="home lies in a keep-out zone") as refused:
        planned([box(500, 500, 40, 40)], **how)
    lat, lon = map(
        float, re.findall(r"nearest free place is (-?\d+\.\d{7}),(-?\d+\.\d{7})", str(refused.value))[0]
    )
    x, y = (float(one) for one in PLANE.xy_from_lonlat(lon, lat))
    assert shapely.distance(kept, shapely.Point(x, y)) >= margin_m
    planned([box(500, 500, 40, 40)], home=(lat, lon, 430.0), **how)
    filled = shapely.union_all([shapely.Polygon(part.exterior) for part in shapely.get_parts(kept)])
    enough = shapely.buffer(filled, 1.5 * margin_m + 12).exterior if filled.geom_type == "Polygon" else None
    assert enough is None or math.hypot(x, y) <= shapely.distance(shapely.Point(0, 0), enough) + 1


def test_heights_above_the_ground_or_without_zones_are_refused() -> None:
    tall = SafetyParams(zone_height_m=30.0)
    with pytest.raises(ParameterError, match="--zone-height counts from home"):
        PlanParams(60.0, terrain=TerrainParams(None, "frame"), safety=tall)
    with pytest.raises(ParameterError, match="--zone-height is for keep-out zones"):
        SafetyCheck(tall)
    for height_m in (-1.0, 1001.0, math.nan):
        with pytest.raises(
            ParameterError, match=r"the height of keep-out zones \(--zone-height\) is 0 to 1000 m"
        ):
            SafetyParams(zone_height_m=height_m)
