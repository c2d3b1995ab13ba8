"""Flight patterns and their notes for the pilot."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.small_regions import box, inside, planned, waypoints
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    MOUNT_CONTROL,
    RETURN,
    TAKEOFF,
    WAYPOINT,
)


def test_a_visit_goes_to_the_point_of_every_region_once() -> None:
    polygons = [box(x, y, 30, 30) for x, y in [(0, 900), (50, 0), (0, 300), (50, 600)]]
    found = np.array(sorted(waypoints(planned(polygons))))
    assert np.allclose(found, sorted(inside(polygons)), rtol=0, atol=1e-8)


def test_a_perimeter_is_the_outline_and_closed() -> None:
    polygons = [box(100, 100, 80, 60)]
    found = waypoints(planned(polygons, pattern="perimeter"))
    assert len(found) == 5 and found[0] == found[-1]
    assert shapely.Polygon(found).symmetric_difference(polygons[0]).area < 1e-3 * polygons[0].area
    assert "1 m" in planned(polygons, pattern="perimeter").warnings[0]


CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 2.0)


def test_a_survey_without_a_camera_says_that_it_takes_no_photographs() -> None:
    mission = planned([box(0, 0, 100, 100)], pattern="survey", spacing_m=20)
    assert mission.warnings == ("no photographs are taken; give a camera (--camera) for that",)
    assert not [item for item in mission.items if item.command == CAMERA_DISTANCE]


def test_photographs_begin_and_end_with_each_line() -> None:
    photos = Photos(CAMERA)
    mission = planned([box(0, 0, 300, 400)], pattern="survey", spacing_m=photos.spacing_m(60), photos=photos)
    classes = [item.command for item in mission.items]
    assert classes[:3] == [TAKEOFF, CHANGE_SPEED, MOUNT_CONTROL] and classes[-1] == RETURN
    flight = [(item.command, item.params[0]) for item in mission.items[3:-1]]
    lines = [flight[k : k + 4] for k in range(0, len(flight), 4)]
    for line in lines:
        commands, values = zip(*line, strict=True)
        assert commands == (WAYPOINT, CAMERA_DISTANCE, WAYPOINT, CAMERA_DISTANCE)
        assert 0 < values[1] <= photos.trigger_m(60) and values[3] == 0
    assert "1.64 cm per pixel, footprint 90 x 60 m" in mission.warnings[0]


@given(st.floats(1, 3000), st.floats(20, 200), st.floats(0, 90))
@settings(max_examples=100)
def test_photographs_of_a_line_overlap_and_show_it_to_its_ends(
    length: float, height: float, front: float
) -> None:
    photos = Photos(CAMERA, Overlap(front, 70))
    trigger = photos.line_trigger_m(length, height)
    last = math.floor(length / trigger + 1e-9) * trigger
    assert 0 < trigger <= photos.trigger_m(height) + 1e-9
    assert length - last <= photos.reach_m(height) + 1e-9
    if length >= photos.min_line_m(height):
        assert trigger >= min(photos.trigger_m(height), photos.reach_m(height)) / 2 - 1e-9


@pytest.mark.parametrize("size", [(300, 400), (37, 41), (61, 90)])
def test_the_camera_keeps_up_on_every_line_and_a_lower_speed_is_reported(size: tuple[float, float]) -> None:
    photos = Photos(CAMERA)
    flight = {"pattern": "survey", "spacing_m": photos.spacing_m(60), "photos": photos}
    fast, slow = (planned([box(0, 0, *size)], speed_m_s=speed, **flight) for speed in (15.0, 1.0))
    triggers = [i.params[0] for i in fast.items if i.command == CAMERA_DISTANCE and i.params[0]]
    speed = fast.speed_range_m_s[0]
    assert speed < 15 and min(triggers) / speed >= CAMERA.min_interval_s - 1e-3
    assert [note for note in fast.warnings if f"from 15 m/s to {speed:.2f} " in note]
    assert slow.speed_m_s == 1 and not [note for note in slow.warnings if "lowered" in note]
