"""Several gimbal pitches in one flight: straight down, and tilted from four sides."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.cover.cover_fields import fields
from tests.flight.patterns.photographed import Photograph, photographs
from tests.flight.small_regions import box, degrees, flights, planned
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.formats.files import read_mission, write_mission
from uavseg.flight.mission.estimate import estimate, flown_path, footprints
from uavseg.flight.mission.items import CAMERA_DISTANCE, MOUNT_CONTROL, WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane, Track
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import LimitParams, PlanParams, SurveyParams
from uavseg.flight.planning.split import with_pitch_points

CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 0.5)
PLANE = Plane(47.0, 8.0)
FIELD = box(100, 100, 200, 150)


def survey(pitches: tuple[float, ...] = (-90, -60), height: float = 60, **more: Any) -> dict[str, Any]:
    photos = Photos(CAMERA, more.pop("overlap", Overlap(70, 60)), pitches[0], flatter_deg=pitches[1:])
    photos = replace(photos, trigger=more.pop("trigger", "distance"))
    spacing = photos.spacing_m(height)
    return {"pattern": "survey", "altitude_m": height, "spacing_m": spacing, "photos": photos} | {
        "limits": LimitParams(max_items=65_000),
        **more,
    }


def side(one: Photograph, angle_deg: float) -> int:
    """Which of four directions, clockwise from the azimuth of lines, a photograph looks in; within 50 deg."""
    turn = (math.degrees(math.atan2(*one.ahead)) - angle_deg) % 360
    nearest = round(turn / 90)
    assert abs(turn - 90 * nearest) < 50
    return nearest % 4


def points_in(field: shapely.Polygon, step: float = 7.0) -> Any:
    west, south, east, north = field.bounds
    x, y = np.meshgrid(np.arange(west, east, step), np.arange(south, north, step))
    points = shapely.points(x.ravel(), y.ravel())
    corners = shapely.points(shapely.get_coordinates(field.buffer(-0.05)))
    return np.concatenate([points[shapely.contains(field, points)], corners])


@pytest.mark.slow
@given(
    fields(),
    st.sampled_from([(-90.0, -60.0), (-90.0, -75.0, -45.0), (-70.0, -50.0), (-88.0, -80.0)]),
    st.sampled_from(["distance", "interval"]),
    st.sampled_from([(75, 70), (20, 10)]),
    st.sampled_from([25.0, 60.0]),
    st.sampled_from([0.0, 30.0, 107.0]),
    st.sampled_from([0.0, 15.0]),
)
@settings(max_examples=25)
def test_every_place_is_seen_from_four_sides(
    field: shapely.Polygon,
    pitches: tuple[float, ...],
    trigger: str,
    overlap: tuple[int, int],
    height: float,
    angle: float,
    turnaround: float,
) -> None:
    more: dict[str, Any] = {"angle_deg": angle, "how": SurveyParams(turnaround_m=turnaround)}
    params = survey(pitches, height, trigger=trigger, overlap=Overlap(*overlap), **more)
    taken = photographs(planned([degrees(field)], **params), PLANE)
    assert {one.pitch_deg for one in taken} == set(pitches)
    places = points_in(field)
    for photos in params["photos"].passes:
        shown: dict[int, list[Any]] = {}
        for one in taken:
            if one.pitch_deg == photos.pitch_deg:
                which = 0 if photos.pitch_deg == -90 else side(one, angle)
                shown.setdefault(which, []).append(one.footprint(photos, height))
        assert sorted(shown) == ([0] if photos.pitch_deg == -90 else [0, 1, 2, 3])
        for footprint in shown.values():
            missed = ~shapely.intersects(shapely.union_all(footprint).buffer(1e-3), places)
            assert not missed.any()
