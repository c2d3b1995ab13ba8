"""A mission as a simulator takes it: positions in metres, with what is done at each."""

from dataclasses import dataclass, field

from pyproj import Proj

from uavseg.flight.mission import Mission

_CAMERA = (195, 197, 205)  # what the camera looks at
_TAKEOFF, _WAYPOINT, _LOITER_TIME, _RETURN, _SPEED, _TRIGGER = 22, 16, 19, 20, 178, 206


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
    triggers : list of (metres, at once)
        Changes of the photographs' distance when it is reached.
    """

    place: tuple[float, float, float]
    speed: float
    hold_s: float = 0.0
    triggers: list[tuple[float, bool]] = field(default_factory=list)


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
        elif item.command in (_WAYPOINT, _LOITER_TIME) and item.frame == 3:
            x, y = flat(item.lon, item.lat)
            stops.append(Stop((float(x), float(y), item.altitude_m), speed, item.params[0] or 0.0))
        elif item.command == _SPEED:
            speed = item.params[1] or speed
        elif item.command == _TRIGGER and stops:
            stops[-1].triggers.append((item.params[0] or 0.0, item.params[2] == 1))
        elif item.command == _RETURN:
            return height, stops, True
        elif item.command not in _CAMERA:
            raise ValueError(f"command {item.command} in frame {item.frame} is not simulated")
    return height, stops, False
