"""Mission items along a track: takeoff, waypoints, photographs, gimbal, return.

ArduPilot refuses DO_SET_CAM_TRIGG_INTERVAL (214), so intervals and single photographs in hover are
IMAGE_START_CAPTURE (2000), which it and PX4 take.
"""

import numpy as np

from uavseg.arrays import Floats
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.follow import WaypointHeights, constant_height, speeds_of


def fly_along(lon: Floats, lat: Floats, params: PlanParams, home: tuple[float, ...]) -> Mission:
    """Return the mission that flies along a line.

    `lon` and `lat` (n,) are degrees, WGS 84, with a waypoint for each; `home` may have a third number, metres
    above the sea. Of `params` the pattern is not used. A MissionError says that the line is not near home, or
    that the mission would not be safe.
    """
    start = HomePosition(*home)
    return Mission(
        home=start,
        items=items_along(Track.of_path(np.column_stack([lon, lat])), start, params),
        autopilot=params.autopilot,
        name=params.name,
        notes=tuple(home_notes(home)),
        vehicle=params.vehicle,
    )


def items_along(
    track: Track, home: HomePosition, params: PlanParams, heights: WaypointHeights | None = None
) -> tuple[MissionItem, ...]:
    """Return the items of a flight along a track: takeoff, speed, waypoints with their actions, return.

    The places of the track are longitude and latitude in degrees; the heights are by default that of
    `params`, above home.
    """
    heights = constant_height(track, params) if heights is None else heights
    places = np.round(track.xy, mav.DEGREE_DECIMALS).tolist()
    height_m, speed_m_s, hold_s = (
        one.tolist() for one in (heights.height_m, heights.speed_m_s, track.hold_s)
    )
    corners = zip(places, height_m, speed_m_s, hold_s, _corner_actions(track, params), strict=True)
    flight = []
    speed = begin = float(speeds_of(track, params)[0])
    for (lon, lat), height, leg_speed, hold, actions in corners:
        if leg_speed != speed:
            flight.append(_speed_item(leg_speed))
        flight.append(MissionItem(mav.WAYPOINT, heights.frame, (hold, 0.0, 0.0, None), lat, lon, height))
        flight += actions
        speed = leg_speed
    if speed != begin:
        flight.append(_speed_item(begin))
    up = round(heights.takeoff_m, 3)
    return (
        MissionItem(mav.TAKEOFF, mav.FRAME_RELATIVE, (0.0, 0.0, 0.0, None), home.lat, home.lon, up),
        _speed_item(begin),
        *_gimbal_items(track, params),
        *flight,
        MissionItem(mav.RETURN, mav.FRAME_MISSION),
    )


def _speed_item(speed_m_s: float) -> MissionItem:
    return MissionItem(mav.CHANGE_SPEED, mav.FRAME_MISSION, (1.0, speed_m_s, -1.0, 0.0))


def home_notes(home: tuple[float, ...]) -> list[str]:
    """Return a note that the altitude of home is missing, if it is."""
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]


def _corner_actions(track: Track, params: PlanParams) -> list[list[MissionItem]]:
    """Return the items that follow the waypoint of each corner of a track, whose places are lon, lat."""
    triggers = [*np.round(track.trigger_m, 3).tolist(), 0.0]
    speeds = [*speeds_of(track, params)[1:].tolist(), params.speed_m_s]
    nowhere = np.full((1, 2), np.nan)
    places = np.round(np.concatenate([track.look_at, nowhere]), mav.DEGREE_DECIMALS)
    actions = []
    before, seen = 0.0, nowhere[0]
    turned = {two: float(track.pitch_deg[two]) for _, two in track.pitch_changes}
    corners = zip(triggers, speeds, track.shots.tolist(), places, strict=True)
    for leg, (trigger, speed, shot, place) in enumerate(corners):
        items = [_gimbal(turned[leg])] if leg in turned else []
        if not np.array_equal(place, seen, equal_nan=True):
            lon, lat = place.tolist()
            ahead = MissionItem(mav.ROI_NONE, mav.FRAME_MISSION)
            items.append(
                ahead
                if not np.isfinite(lon)
                else MissionItem(mav.ROI_LOCATION, mav.FRAME_RELATIVE, lat=lat, lon=lon)
            )
        if shot:
            items += _one_photo(params)
        if trigger != before:  # the distance is that of the line, which begins with a photograph
            items.append(_trigger(trigger, speed, params))
        before, seen = trigger, place
        actions.append(items)
    return actions


def _gimbal_items(track: Track, params: PlanParams) -> list[MissionItem]:
    """Turn the gimbal to its first pitch; not where the camera looks at places."""
    if params.photos is None or np.isfinite(track.look_at).any():
        return []
    pitches = track.pitch_deg[np.isfinite(track.pitch_deg)].tolist()
    return [_gimbal(float([*pitches, params.photos.pitch_deg][0]))]


def _gimbal(pitch: float) -> MissionItem:
    targeting = 2.0  # MAV_MOUNT_MODE_MAVLINK_TARGETING
    return MissionItem(mav.MOUNT_CONTROL, mav.FRAME_MISSION, (pitch, 0.0, 0.0, 0.0), altitude_m=targeting)


def _one_photo(params: PlanParams) -> list[MissionItem]:
    assert params.photos is not None
    if params.photos.trigger == "distance":  # as on lines: to start the trigger takes a photograph
        every = round(params.photos.trigger_m(params.altitude_m), 3)
        return [_distance(every), _distance(0.0)]
    return [MissionItem(mav.IMAGE_START, mav.FRAME_MISSION, (0.0, 0.0, 1.0, 0.0))]


def _trigger(trigger_m: float, speed_m_s: float, params: PlanParams) -> MissionItem:
    """Start photographs at a distance, or stop them where it is 0."""
    assert params.photos is not None
    if params.photos.trigger == "distance":
        return _distance(trigger_m)
    if not trigger_m:
        return MissionItem(mav.IMAGE_STOP, mav.FRAME_MISSION)
    interval = round(params.photos.interval_s(trigger_m, speed_m_s), 3)
    return MissionItem(mav.IMAGE_START, mav.FRAME_MISSION, (0.0, interval, 0.0, 0.0))


def _distance(trigger_m: float) -> MissionItem:
    return MissionItem(mav.CAMERA_DISTANCE, mav.FRAME_MISSION, (trigger_m, 0.0, float(trigger_m > 0), 0.0))
