"""Returns that start early: notes on straight ways through zones and on their height."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.small_regions import HOME, box, flights, planned
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import LimitParams, PlanParams, SafetyParams
from uavseg.flight.safety.keep_out import KeepOut, return_notes

PLANE = Plane(*HOME[:2])


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(-200, 200), st.floats(-200, 200)), min_size=1, max_size=5))
@settings(max_examples=50)
def test_a_way_through_a_zone_is_noted_where_points_along_the_flight_say_so(
    corners: list[tuple[float, float]],
) -> None:
    zone = shapely.box(40, -30, 60, 80)
    path = np.array([(0.0, 0.0), *corners, (0.0, 0.0)])
    notes = list(return_notes(path, KeepOut([zone], 5.0), PLANE, PlanParams(60)))
    line = shapely.LineString(path)
    places = [line.interpolate(share, normalized=True) for share in np.linspace(0, 1, 3000)]
    depth = [shapely.LineString([(0, 0), (at.x, at.y)]).intersection(zone).length for at in places]
    if max(depth) > 5 and np.mean(np.array(depth) > 0) > 0.01:
        assert len(notes) == 1 and "keep-out zone" in notes[0]
    if notes:
        assert any(shapely.LineString([(0, 0), (p.x, p.y)]).distance(zone) < 8 for p in places)


@pytest.mark.parametrize(
    ("autopilot", "most_m", "noted"),
    [
        ("px4", 50, True),
        ("generic", 50, True),
        ("ardupilot", 50, False),
        ("ardupilot", 12, True),
        ("px4", 60, False),
    ],
)
def test_a_return_above_the_allowed_height_is_noted(autopilot: str, most_m: float, noted: bool) -> None:
    mission = planned(
        [box(100, 50, 80, 60)], altitude_m=10, autopilot=autopilot, safety=SafetyParams(max_altitude_m=most_m)
    )
    assert any("--max-altitude" in note for note in mission.warnings) == noted
    near = planned([box(5, 5, 4, 4)], altitude_m=10, autopilot="px4", safety=SafetyParams(max_altitude_m=12))
    assert not any("--max-altitude" in note for note in near.warnings)  # within the cone it stays low


def test_rally_points_go_to_the_flights_whose_fence_holds_them() -> None:
    from uavseg.flight.mission.items import RallyPoint

    lon, lat = (float(v) for v in PLANE.lonlat_from_xy(600, 40))
    safety = SafetyParams(rally=(RallyPoint(lat, lon, 30),))
    regions = [box(-600, 0, 120, 90), box(500, 0, 120, 90)]
    found = flights(regions, spacing_m=10, pattern="survey", safety=safety, limits=LimitParams(max_items=26))
    with_it = [mission for mission in found if mission.rally]
    without = [mission for mission in found if not mission.rally]
    assert with_it and without
    for mission in without:
        assert any("rally point 1 lies outside of the fence" in note for note in mission.notes)
    assert not any("rally point" in note for mission in with_it for note in mission.notes)
