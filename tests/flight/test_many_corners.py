"""Regions and zones of many thousand corners, as rasters give them, are planned like others."""

from typing import Any

import numpy as np
import pytest
import shapely

from tests.flight.pixel_regions import pixel_region
from tests.flight.small_regions import box, degrees, flights, inside, planned
from uavseg.errors import MissionError
from uavseg.flight.avoid import free_space
from uavseg.flight.avoid.enclosing import MANY_CORNERS
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.cover.corridor import corridor
from uavseg.flight.cover.survey import CoverParams, surveys
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PerimeterParams, SafetyParams, SurveyParams
from uavseg.flight.patterns.perimeter import offset_rings
from uavseg.flight.safety.keep_out import CLEARANCE_M, KeepOut, home_outside

PLANE = Plane(47.0, 8.0)


def largest(side: int, seed: int) -> Any:
    region = max(pixel_region(side, seed), key=shapely.get_num_coordinates)
    assert shapely.get_num_coordinates(region) > MANY_CORNERS
    return region


@pytest.mark.slow
def test_a_survey_covers_the_region_up_to_small_parts() -> None:
    region = largest(320, 3)
    flown = surveys(region, CoverParams(10.0))[0]
    strips = shapely.union_all(shapely.buffer(shapely.linestrings(flown.lines), 5.0, cap_style="flat"))
    assert shapely.difference(region, strips).area < 0.01 * region.area
    assert shapely.covers(shapely.buffer(region, 10.0), shapely.multilinestrings(list(flown.lines)))


@pytest.mark.parametrize("offset", [-3.0, 4.0, 10.0])
def test_a_perimeter_lies_at_the_offset_within_the_tolerance(offset: float) -> None:
    region, tolerance = largest(320, 4), 1.0
    for ring in offset_rings(region, PerimeterParams(offset), tolerance, 0.0).rings:
        dense = shapely.get_coordinates(shapely.segmentize(shapely.LineString(ring), 0.5))
        distance = shapely.distance(region.boundary, shapely.points(dense))
        assert np.abs(distance - abs(offset)).max() <= tolerance + 0.06


@pytest.mark.slow
def test_home_lies_outside_of_all_regions_with_the_usual_distance() -> None:
    regions = [degrees(polygon) for polygon in pixel_region(400, 5)]
    lat, lon = home_outside(regions, inside(regions))
    place = shapely.Point(*PLANE.xy_from_lonlat(lon, lat))
    distance = shapely.distance(shapely.union_all(PLANE.project_polygons(regions)), place)
    assert CLEARANCE_M - 0.1 <= distance <= 1.2 * CLEARANCE_M


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0.0, 10.0])
def test_no_leg_comes_nearer_to_a_zone_than_the_margin(margin: float) -> None:
    zones = [shapely.affinity.translate(polygon, 100, -80) for polygon in pixel_region(320, 6)]
    mission = planned(
        [box(350, -20, 60, 40)],
        zones=[degrees(zone) for zone in zones],
        safety=SafetyParams(margin),
        pattern="survey",
        spacing_m=20.0,
    )
    lat, lon, _ = mission.path
    legs = shapely.LineString(np.column_stack(PLANE.xy_from_lonlat(lon, lat)))
    nearest = shapely.distance(legs, shapely.union_all(zones))
    assert nearest >= margin - 0.01 and nearest > 0
    straight = 2 * 410
    assert legs.length < 2 * straight  # around the zones, not far away from them


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0.0, 10.0])
def test_grown_zones_hold_the_zones_with_their_margin(margin: float) -> None:
    zones = pixel_region(320, 6)
    grown, whole = KeepOut(zones, margin).grown, shapely.union_all(zones)
    assert shapely.covers(grown, whole)
    assert shapely.distance(grown.boundary, whole) >= margin


@pytest.mark.slow
def test_what_takes_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MissionError, match="more than 2000 corners at a spacing of 1 m"):
        corridor(largest(400, 7), 1.0)
    monkeypatch.setattr(free_space, "MAX_POINTS", 3)
    with pytest.raises(MissionError, match="between 4 ends of lines"):
        FreeSpace().paths(np.arange(8.0).reshape(4, 2))


@pytest.mark.slow
@pytest.mark.parametrize(
    "params",
    [
        {"pattern": "visit"},
        {"pattern": "orbit"},
        {"pattern": "perimeter"},
        {"pattern": "survey", "spacing_m": 30.0},
        pytest.param(
            {"pattern": "survey", "spacing_m": 30.0, "how": SurveyParams(margin_m=20.0)},
            marks=pytest.mark.thorough,
        ),
        {"pattern": "corridor", "spacing_m": 100.0},
    ],
)
def test_each_pattern_is_planned_over_a_region_of_a_hundred_thousand_corners(
    params: dict[str, Any],
) -> None:
    first = flights([degrees(largest(1600, 8))], **params)[0]
    covers = params["pattern"] in {"survey", "corridor"}
    assert any("1 of 1 regions have outlines of more than" in note for note in first.warnings) == covers
