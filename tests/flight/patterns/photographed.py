"""What a mission photographs over flat ground, flown on paper: where, in which direction, which ground."""

import math
from dataclasses import dataclass

import numpy as np
import shapely

from uavseg.flight.camera.camera import Photos
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    IMAGE_START,
    IMAGE_STOP,
    MOUNT_CONTROL,
    WAYPOINT,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane


@dataclass(frozen=True)
class Photograph:
    """Where it is taken, in metres, and the direction of flight as a unit vector."""

    x: float
    y: float
    ahead: tuple[float, float]
    pitch_deg: float = -90.0  # that the items set

    def footprint(self, photos: Photos, height_m: float) -> shapely.Polygon:
        corners = photos.camera.footprint_corners_m(height_m, photos.pitch_deg)
        ahead = np.array(self.ahead)
        right = np.array([ahead[1], -ahead[0]])
        return shapely.Polygon((self.x, self.y) + corners[:, :1] * right + corners[:, 1:] * ahead)


def photographs(mission: Mission, plane: Plane, angle_deg: float | None = None) -> list[Photograph]:
    """All photographs; a distance is measured from the last one, a time at the speed of the mission.

    Those in hover look along lines of an azimuth, if it is given.
    """
    turn = math.radians(angle_deg or 0.0)
    line = None if angle_deg is None else (math.sin(turn), math.cos(turn))
    found: list[Photograph] = []
    place, every, since, pitch = None, 0.0, 0.0, -90.0
    for number, item in enumerate(mission.items):
        if item.command == WAYPOINT:
            there = _xy(item, plane)
            if place is not None and every:
                length = math.dist(place, there)
                ahead = _unit(place, there)
                while since + 1e-6 >= 0 and every - since <= length + 1e-6:
                    length -= every - since
                    at = np.array(there) - length * np.array(ahead)
                    found.append(Photograph(float(at[0]), float(at[1]), ahead, pitch))
                    place, since = (float(at[0]), float(at[1])), 0.0
                since += length
            place = there
        elif item.command == MOUNT_CONTROL:
            pitch = float(item.params[0] or 0)
        elif item.command in {CAMERA_DISTANCE, IMAGE_START, IMAGE_STOP}:
            assert place is not None
            one = item.command == IMAGE_START and item.params[2] == 1
            if one or (item.params[2] == 1 and item.command == CAMERA_DISTANCE) or _starts(item):
                looks = line if one and line else _onward(mission, number, plane)
                found.append(Photograph(*place, looks, pitch))
            if not one:
                every, since = _every(item, mission), 0.0
    return found


def _starts(item: MissionItem) -> bool:
    return item.command == IMAGE_START and item.params[2] == 0


def _every(item: MissionItem, mission: Mission) -> float:
    if item.command == CAMERA_DISTANCE:
        return float(item.params[0] or 0)
    return float(item.params[1] or 0) * mission.speed_m_s if item.command == IMAGE_START else 0.0


def _onward(mission: Mission, number: int, plane: Plane) -> tuple[float, float]:
    """Direction of the leg on which an item is."""
    places = [k for k, item in enumerate(mission.items) if item.command == WAYPOINT]
    here = max(k for k in places if k < number)
    after = min((k for k in places if k > here), default=here)
    return _unit(_xy(mission.items[here], plane), _xy(mission.items[after], plane))


def _xy(item: MissionItem, plane: Plane) -> tuple[float, float]:
    x, y = plane.xy_from_lonlat(item.lon, item.lat)
    return float(x), float(y)


def _unit(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    length = math.dist(start, end)
    return ((end[0] - start[0]) / length, (end[1] - start[1]) / length) if length else (0.0, 1.0)
