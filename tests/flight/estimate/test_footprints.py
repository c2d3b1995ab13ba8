"""Footprints of photographs: their number, size, place and direction."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, strategies as st
from pyproj import Geod, Transformer

import uavseg
from uavseg.flight.camera.camera import Photos, camera_named
from uavseg.flight.mission.estimate import MAX_FOOTPRINTS, footprints
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    FRAME_MISSION,
    FRAME_RELATIVE,
    MOUNT_CONTROL,
    RETURN,
    ROI_LOCATION,
    TAKEOFF,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
CAMERA = camera_named("DJI Mavic 3")
HOME = HomePosition(47.0, 8.0)
GEOD = Geod(ellps="WGS84")


def place(north_m: float, east_m: float, height_m: float, command: int = 16) -> MissionItem:
    azimuth = np.degrees(np.arctan2(east_m, north_m))
    lon, lat, _ = GEOD.fwd(HOME.lon, HOME.lat, azimuth, float(np.hypot(north_m, east_m)))
    return MissionItem(command, FRAME_RELATIVE, lat=lat, lon=lon, altitude_m=height_m)


def line(
    *, every_m: float = 50.0, height_m: float = 60.0, azimuth_deg: float = 90.0
) -> tuple[MissionItem, ...]:
    """Items that photograph along a line of 200 m from 100 m on."""
    north, east = np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg))
    return (
        MissionItem(TAKEOFF, FRAME_RELATIVE, lat=HOME.lat, lon=HOME.lon, altitude_m=height_m),
        place(100 * north, 100 * east, height_m),
        MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (every_m, 0.0, 1.0, 0.0)),
        place(300 * north, 300 * east, height_m),
        MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (0.0, 0.0, 0.0, 0.0)),
        MissionItem(RETURN, FRAME_MISSION),
    )


def in_metres(lonlat: np.ndarray) -> np.ndarray:
    """Metres east and north of home."""
    there = Transformer.from_crs(4326, f"+proj=aeqd +lat_0={HOME.lat} +lon_0={HOME.lon}", always_xy=True)
    return np.stack(there.transform(lonlat[..., 0], lonlat[..., 1]), axis=-1)


@pytest.mark.slow
@given(st.floats(0, 360), st.floats(20, 120))
def test_each_shows_a_rectangle_along_the_flight(azimuth_deg: float, height_m: float) -> None:
    mission = Mission(HOME, line(azimuth_deg=azimuth_deg, height_m=height_m))
    found = in_metres(footprints(mission, Photos(CAMERA)).lonlat)
    assert len(found) == mission.estimate.photographs == 5
    wide, long = CAMERA.footprint_m(height_m)
    turn = np.radians(azimuth_deg)
    along, across = np.array([np.sin(turn), np.cos(turn)]), np.array([np.cos(turn), -np.sin(turn)])
    for at, corners in zip((100, 150, 200, 250, 300), found, strict=True):
        ends = [at - long / 2, at - long / 2, at + long / 2, at + long / 2]
        np.testing.assert_allclose(corners @ along, ends, atol=0.05)
        np.testing.assert_allclose(corners @ across, wide / 2 * np.array([-1, 1, 1, -1]), atol=0.05)


def test_the_gimbal_pitch_of_the_mission_comes_first() -> None:
    tilt = MissionItem(MOUNT_CONTROL, FRAME_MISSION, (-60.0, 0.0, 0.0, 0.0), altitude_m=2.0)
    found = in_metres(footprints(Mission(HOME, (tilt, *line())), Photos(CAMERA)).lonlat)
    near, far = CAMERA.ground_reach_m(60, -60)
    np.testing.assert_allclose(found[0, [1, 2], 0], [100 + near, 100 + far], atol=0.05)


def test_the_gimbal_pitch_changes_during_the_flight() -> None:
    """A second line to the north, with another pitch: each photograph has that of its line."""
    down, tilt = (
        MissionItem(MOUNT_CONTROL, FRAME_MISSION, (pitch, 0.0, 0.0, 0.0), altitude_m=2.0)
        for pitch in (-90.0, -60.0)
    )
    items = (line()[0], down, *line()[1:-1], tilt, *line(azimuth_deg=0.0)[1:])
    found = in_metres(footprints(Mission(HOME, items), Photos(CAMERA)).lonlat)
    assert len(found) == 10
    for shown, pitch, axis in ((found[0], -90, 0), (found[5], -60, 1)):
        near, far = CAMERA.ground_reach_m(60, pitch)
        np.testing.assert_allclose(shown[[1, 2], axis], [100 + near, 100 + far], atol=0.05)


@pytest.mark.slow
def test_a_survey_shows_its_regions() -> None:
    regions = uavseg.extract(SAMPLE, (0.55, 1), min_area=1000)
    with warnings.catch_warnings(action="ignore"):
        [mission] = uavseg.plan(
            regions, home="auto", altitude=60, angle=0, pattern="survey", camera="DJI Mavic 3"
        ).missions
    found = footprints(mission)
    assert len(found.lonlat) == mission.estimate.photographs > 50
    shown = shapely.union_all(shapely.polygons(found.lonlat))
    assert all(shown.contains(polygon) for polygon in regions.to_crs(4326).geometry)
    strips = mission.estimate.photographed_m2
    assert strips is not None
    assert abs(GEOD.geometry_area_perimeter(shown)[0]) == pytest.approx(strips, rel=0.05)


@pytest.mark.parametrize(
    ("items", "photos", "words"),
    [
        (line(), None, "does not say which camera"),
        ((line()[0], place(50, 50, 40)), Photos(CAMERA), "takes no photographs"),
        (
            (MissionItem(ROI_LOCATION, FRAME_RELATIVE, lat=47.0, lon=8.0), *line()),
            Photos(CAMERA),
            "at places",
        ),
        (line(every_m=200 / MAX_FOOTPRINTS), Photos(CAMERA), "more than 5,000"),
        (
            (MissionItem(MOUNT_CONTROL, FRAME_MISSION, (0.0, 0.0, 0.0, 0.0)), *line()),
            Photos(CAMERA),
            "-90",
        ),
    ],
)
def test_where_they_are_not_known_a_note_says_why(
    items: tuple[MissionItem, ...], photos: Photos | None, words: str
) -> None:
    found = footprints(Mission(HOME, items), photos)
    assert len(found.lonlat) == 0
    assert words in found.note


def test_a_mission_without_photographs_and_camera_needs_no_note() -> None:
    mission = Mission(HOME, (line()[0], place(50, 50, 40)))
    assert footprints(mission).note == ""
    assert len(footprints(replace(mission, photos=Photos(CAMERA))).lonlat) == 0
