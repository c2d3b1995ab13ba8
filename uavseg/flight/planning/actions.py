"""What the camera does along a track, as mission items: triggers, single photographs, where it looks.

ArduPilot refuses DO_SET_CAM_TRIGG_INTERVAL (214), so intervals and single photographs in hover are
IMAGE_START_CAPTURE (2000), which it and PX4 take.
"""

import numpy as np

from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    FRAME_MISSION,
    FRAME_RELATIVE,
    IMAGE_START,
    IMAGE_STOP,
    MOUNT_CONTROL,
    ROI_LOCATION,
    ROI_NONE,
    MissionItem,
)
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.leg_speeds import speeds_of

_DECIMALS = 8  # of degrees: a millimetre
_TARGETING = 2.0  # MAV_MOUNT_MODE_MAVLINK_TARGETING


def corner_actions(track: Track, params: PlanParams) -> list[list[MissionItem]]:
    """The items that follow the waypoint of each corner of a track, whose places are lon, lat."""
    triggers = [*np.round(track.trigger_m, 3).tolist(), 0.0]
    speeds = [*speeds_of(track, params)[1:].tolist(), params.speed_m_s]
    nowhere = np.full((1, 2), np.nan)
    places = np.round(np.concatenate([track.look_at, nowhere]), _DECIMALS)
    found = []
    before, seen = 0.0, nowhere[0]
    for trigger, speed, shot, place in zip(triggers, speeds, track.shots.tolist(), places, strict=True):
        items = []
        if not np.array_equal(place, seen, equal_nan=True):
            items.append(_look_at(place[0], place[1]))
        if shot:
            items += _one_photo(params)
        if trigger != before:  # each line has its own distance, and begins with a photograph
            items.append(_trigger(trigger, speed, params))
        before, seen = trigger, place
        found.append(items)
    return found


def gimbal_items(track: Track, params: PlanParams) -> list[MissionItem]:
    """The gimbal is turned to its pitch, and stays there; not where the camera looks at places."""
    if params.photos is None or np.isfinite(track.look_at).any():
        return []
    pitch = float(params.photos.pitch_deg)
    return [MissionItem(MOUNT_CONTROL, FRAME_MISSION, (pitch, 0.0, 0.0, 0.0), altitude_m=_TARGETING)]


def _look_at(lon: float, lat: float) -> MissionItem:
    """The camera looks at a place at the height of home, or ahead again."""
    if not np.isfinite(lon):
        return MissionItem(ROI_NONE, FRAME_MISSION)
    return MissionItem(ROI_LOCATION, FRAME_RELATIVE, lat=float(lat), lon=float(lon))


def _one_photo(params: PlanParams) -> list[MissionItem]:
    assert params.photos is not None
    if (
        params.photos.trigger == "distance"
    ):  # as on lines: the trigger is started, with a photograph, and stopped
        every = round(params.photos.trigger_m(params.altitude_m), 3)
        return [_distance(every), _distance(0.0)]
    return [MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 0.0, 1.0, 0.0))]


def _trigger(trigger_m: float, speed_m_s: float, params: PlanParams) -> MissionItem:
    """Photographs at a distance begin, or end where it is 0."""
    assert params.photos is not None
    if params.photos.trigger == "distance":
        return _distance(trigger_m)
    if not trigger_m:
        return MissionItem(IMAGE_STOP, FRAME_MISSION)
    interval = round(params.photos.interval_s(trigger_m, speed_m_s), 3)
    return MissionItem(IMAGE_START, FRAME_MISSION, (0.0, interval, 0.0, 0.0))


def _distance(trigger_m: float) -> MissionItem:
    return MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (trigger_m, 0.0, float(trigger_m > 0), 0.0))
