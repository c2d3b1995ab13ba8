"""A mission as a simulator takes it: positions in metres, with what is done at each."""

from dataclasses import dataclass, field

from pyproj import Proj

from uavseg.flight.mission.items import MissionItem
from uavseg.flight.mission.mission import Mission

_GIMBAL = 205
_TAKEOFF, _WAYPOINT, _LOITER_TIME, _RETURN, _SPEED, _TRIGGER = 22, 16, 19, 20, 178, 206
_LOOK_AT, _LOOK_AHEAD, _IMAGE_START, _IMAGE_STOP = 195, 197, 2000, 2001
_ABOVE_SEA, _ABOVE_HOME, _ABOVE_GROUND = 0, 3, 10


@dataclass(frozen=True, slots=True)
class Shutter:
    """A change of what the camera does.

    Parameters
    ----------
    every_m, every_s : float
        Photographs at a distance or a time from now on; none with 0.
    at_once : bool
        Whether one is taken now.
    single : bool
        Whether that is all, and what went on before goes on.
    """

    every_m: float = 0.0
    every_s: float = 0.0
    at_once: bool = False
    single: bool = False


@dataclass(frozen=True, slots=True)
class Look:
    """The vehicle and its camera turn to a place in metres, or look ahead again."""

    at: tuple[float, float] | None


@dataclass(slots=True)
class Stop:
    """A position to fly to, and what is done there.

    Parameters
    ----------
    place : (x, y, z)
        Metres east, north and above home.
    speed : float
        Of the leg to it, m/s.
    hold_s : float
    actions : list of Shutter and Look
        What the camera does when it is reached.
    above_ground : bool
        Whether the height is above the ground at each place instead of above home.
    """

    place: tuple[float, float, float]
    speed: float
    hold_s: float = 0.0
    actions: list[Shutter | Look] = field(default_factory=list)
    above_ground: bool = False


def route(mission: Mission) -> tuple[float, list[Stop], bool]:
    """Height of the takeoff, the positions after it, and whether the mission ends with a return.

    Raises
    ------
    ValueError
        If the mission has an item that the simulators do not fly.
    """
    flat = Proj(proj="aeqd", lat_0=mission.home.lat, lon_0=mission.home.lon, datum="WGS84")
    height, speed = 0.0, 5.0
    stops: list[Stop] = []
    for item in mission.items:
        if item.command == _TAKEOFF:
            height = item.altitude_m
        elif item.command in (_WAYPOINT, _LOITER_TIME):
            x, y = flat(item.lon, item.lat)
            up = item.altitude_m - (mission.home.altitude_m if item.frame == _ABOVE_SEA else 0.0)
            place = (float(x), float(y), up)
            stops.append(Stop(place, speed, item.params[0] or 0.0, [], item.frame == _ABOVE_GROUND))
        elif item.command == _SPEED:
            speed = item.params[1] or speed
        elif item.command in (_LOOK_AT, _LOOK_AHEAD) and stops:
            x, y = flat(item.lon, item.lat)
            stops[-1].actions.append(Look((float(x), float(y)) if item.command == _LOOK_AT else None))
        elif item.command in (_TRIGGER, _IMAGE_START, _IMAGE_STOP) and stops:
            stops[-1].actions.append(_shutter(item))
        elif item.command == _RETURN:
            return height, stops, True
        elif item.command != _GIMBAL:
            raise ValueError(f"command {item.command} in frame {item.frame} is not simulated")
    return height, stops, False


def _shutter(item: MissionItem) -> Shutter:
    """DO_SET_CAM_TRIGG_DIST, IMAGE_START_CAPTURE or IMAGE_STOP_CAPTURE."""
    first, second, third = (value or 0.0 for value in item.params[:3])
    if item.command == _TRIGGER:
        return Shutter(every_m=first, at_once=first > 0 and third == 1)
    if item.command == _IMAGE_START:
        return Shutter(every_s=0.0 if third == 1 else second, at_once=True, single=third == 1)
    return Shutter()
