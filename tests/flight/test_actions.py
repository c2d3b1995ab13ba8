"""Camera actions as items, for each trigger and pattern, and the speed that a camera allows."""

import math

import numpy as np
import pytest

from tests.flight.small_regions import box, planned
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Camera, Photos
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CAMERA_INTERVAL,
    CHANGE_SPEED,
    IMAGE_START,
    IMAGE_STOP,
    MOUNT_CONTROL,
    ROI_LOCATION,
    ROI_NONE,
    WAYPOINT,
)
from uavseg.flight.params.plan import OrbitParams, PerimeterParams, VisitParams

CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 2.0)
FIELD = box(100, 100, 200, 150)


def line_speeds(mission):  # type: ignore[no-untyped-def]
    """Speeds of photographed legs, or the lowest where the pilot triggers the camera."""
    speed, every, found, rest = 0.0, 0.0, [], []
    for item in mission.items:
        if item.command == CHANGE_SPEED:
            speed = item.params[1]
        elif item.command in {CAMERA_DISTANCE, IMAGE_START, IMAGE_STOP}:
            every = item.params[0] or item.params[1]
        elif item.command == WAYPOINT:
            (found if every else rest).append(speed)
    return np.array(found or [min(rest)])


def survey(trigger: str, **more: object):  # type: ignore[no-untyped-def]
    photos = Photos(CAMERA, trigger=trigger)
    return planned(
        [FIELD], **{"pattern": "survey", "spacing_m": photos.spacing_m(60), "photos": photos} | more
    )


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "generic"])
def test_an_interval_starts_and_stops_with_each_line(autopilot: str) -> None:
    mission = survey("interval", autopilot=autopilot)
    commands = [item.command for item in mission.items[3:-1]]
    assert commands == [WAYPOINT, IMAGE_START, WAYPOINT, IMAGE_STOP] * (len(commands) // 4)
    intervals = {item.params for item in mission.items if item.command == IMAGE_START}
    [(camera, interval, count, _)] = intervals
    assert camera == count == 0 and interval * mission.speed_m_s <= Photos(CAMERA).trigger_m(60) + 1e-6
    assert interval >= CAMERA.min_interval_s
    assert not [item for item in mission.items if item.command in {CAMERA_DISTANCE, CAMERA_INTERVAL}]


def test_hovering_takes_one_photograph_at_each_stop_and_may_be_fast() -> None:
    mission = survey("hover", speed_m_s=15.0)
    flight = mission.items[3:-1]
    assert [item.command for item in flight] == [WAYPOINT, IMAGE_START] * (len(flight) // 2)
    assert {item.params[0] for item in flight[::2]} == {1.0} and {item.params for item in flight[1::2]} == {
        (0.0, 0.0, 1.0, 0.0)
    }
    assert mission.speed_m_s == 15
    assert mission.estimate.photographs == len(flight) // 2


def test_without_a_trigger_the_lines_are_the_same_and_the_pilot_is_warned() -> None:
    silent, triggered = survey("none"), survey("distance")
    assert not {item.command for item in silent.items} & {CAMERA_DISTANCE, IMAGE_START}
    places = [[(i.lat, i.lon) for i in m.items if i.command == WAYPOINT] for m in (silent, triggered)]
    assert np.allclose(*map(sorted, places), atol=1e-5) or len(places[0]) == len(places[1])
    assert [note for note in silent.notes if "does not trigger the camera" in note and "15.0 m" in note]


@pytest.mark.parametrize("trigger", ["distance", "interval", "none"])
def test_a_slow_camera_and_blur_limit_the_speed(trigger: str) -> None:
    mission = survey(trigger, speed_m_s=20.0)
    assert line_speeds(mission).max() <= Photos(CAMERA).trigger_m(60) / CAMERA.min_interval_s + 1e-6
    assert [note for note in mission.notes if "lowered from 20 m/s" in note]
    slow = Photos(CAMERA, trigger=trigger, shutter_s=1 / 50)
    blurred = planned([FIELD], pattern="survey", spacing_m=27.0, photos=slow)
    assert line_speeds(blurred).max() == pytest.approx(CAMERA.gsd_m(60) * 50)
    assert [note for note in blurred.notes if "1/50 s" in note]


def test_an_orbit_looks_at_the_region_and_then_ahead_again() -> None:
    mission = planned(
        [FIELD, box(600, 0, 80, 80)], pattern="orbit", photos=Photos(CAMERA), how=OrbitParams(20.0)
    )
    looks = [item for item in mission.items if item.command in {ROI_LOCATION, ROI_NONE}]
    assert [item.command for item in looks] == [ROI_LOCATION, ROI_NONE] * 2
    east, north = sorted((item.lon, item.lat) for item in looks if item.command == ROI_LOCATION)[0]
    centre = FIELD.centroid
    assert math.isclose(east, centre.x, abs_tol=1e-6) and math.isclose(north, centre.y, abs_tol=1e-6)
    assert all(item.frame == 3 and item.altitude_m == 0 for item in looks if item.command == ROI_LOCATION)
    assert MOUNT_CONTROL not in {item.command for item in mission.items}
    classes = [item.command for item in mission.items if item.command != WAYPOINT][2:-1]
    assert classes == [ROI_LOCATION, CAMERA_DISTANCE, ROI_NONE, CAMERA_DISTANCE] * 2


def test_a_visit_holds_and_takes_one_photograph() -> None:
    held = planned([FIELD], pattern="visit", how=VisitParams(7.0))
    assert [item.params[0] for item in held.items if item.command == WAYPOINT] == [7.0]
    shown = planned([FIELD], pattern="visit", photos=Photos(CAMERA, trigger="hover"))
    assert [item.command for item in shown.items[3:-1]] == [WAYPOINT, IMAGE_START]


def test_a_perimeter_is_photographed_along_one_line() -> None:
    mission = planned([FIELD], pattern="perimeter", photos=Photos(CAMERA), how=PerimeterParams(10.0))
    starts = [item for item in mission.items if item.command == CAMERA_DISTANCE]
    assert [item.params[2] for item in starts] == [1.0, 0.0]
    assert 0 < starts[0].params[0] <= Photos(CAMERA).trigger_m(60)


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"pattern": "visit", "photos": Photos(CAMERA)}, "hover or none"),
        ({"pattern": "orbit", "photos": Photos(CAMERA, pitch_deg=-60)}, "gimbal pitch"),
        ({"pattern": "corridor"}, "--spacing or --camera"),
        ({"pattern": "orbit", "spacing_m": 10.0}, "a spacing is for"),
        ({"pattern": "corridor", "spacing_m": 10.0, "angle_deg": 5.0}, "an angle is for"),
        ({"pattern": "visit", "how": PerimeterParams()}, "not for the pattern visit"),
    ],
)
def test_what_does_not_go_together_is_refused(params: dict[str, object], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        planned([FIELD], **params)
