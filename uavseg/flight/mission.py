"""Mission: the flight as values, what it will take, and the checks that keep it from harm."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError

# MAV_CMD
WAYPOINT, LOITER_TURNS, LOITER_TIME, RETURN, LAND, TAKEOFF = 16, 18, 19, 20, 21, 22
VTOL_TAKEOFF, VTOL_LAND, CHANGE_SPEED = 84, 85, 178
PLACES = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 84, 85})  # commands the vehicle flies to
HEADINGS = frozenset({16, 17, 21, 22, 84})  # places whose param4 is a heading that may be left open
TAKEOFFS = frozenset({TAKEOFF, VTOL_TAKEOFF})
LANDINGS = frozenset({LAND, VTOL_LAND})
# MAV_FRAME
AMSL, NO_PLACE, RELATIVE, TERRAIN = 0, 2, 3, 10

FIRMWARES = {"ardupilot": 3, "px4": 12}  # MAV_AUTOPILOT
CAPACITY = {"ardupilot": 650, "px4": 500}  # items that common boards hold
MOST_ITEMS = 65534  # the link counts in 16 bits, and the home of ArduPilot takes one
HIGHEST_M = 1000.0  # above home: more is nearly always a height above the sea, or feet
USUAL_HIGHEST_M = 120.0  # what most countries allow without a permit
FIRST_LEG_M = 20_000.0
FARTHEST_M = 100_000.0
LONG_FLIGHT_S = 30 * 60.0
CRUISE_M_S, CLIMB_M_S, DESCENT_M_S = 5.0, 2.5, 1.5

Floats = NDArray[np.float64]
Params = tuple[float | None, float | None, float | None, float | None]


@dataclass(frozen=True, slots=True)
class Home:
    """Where the vehicle starts and returns to: degrees (WGS 84), and metres above the sea."""

    lat: float
    lon: float
    altitude_m: float = 0.0

    def __post_init__(self) -> None:
        check_position(self.lat, self.lon, "home")
        if not -500 <= self.altitude_m <= 9000:
            raise MissionError(f"home lies at {self.altitude_m:g} m above the sea; expected -500 to 9000 m")


@dataclass(frozen=True, slots=True)
class Item:
    """One MAVLink mission item.

    Parameters
    ----------
    command, frame : int
        MAV_CMD and MAV_FRAME: 3 relative to home, 0 above the sea, 10 above the terrain, 2 no place.
    params : four floats or None
        param1 to param4; None means "not set" (NaN on the link).
    lat, lon : float
        Degrees, WGS 84. Nothing of a command that is no place.
    altitude_m : float
        Metres in the sense of `frame`.
    """

    command: int
    frame: int
    params: Params = (0.0, 0.0, 0.0, 0.0)
    lat: float = 0.0
    lon: float = 0.0
    altitude_m: float = 0.0

    def __post_init__(self) -> None:
        if len(self.params) != 4 or not all(p is None or math.isfinite(p) for p in self.params):
            raise MissionError(f"an item has four parameters, finite numbers or None, not {self.params}")
        if not all(map(math.isfinite, (self.lat, self.lon, self.altitude_m))):
            raise MissionError(
                f"an item of command {self.command} lies at lat {self.lat}, lon {self.lon}, "
                f"altitude {self.altitude_m}; these must be finite numbers"
            )
        if self.is_place:
            _check_place(self)

    @property
    def is_place(self) -> bool:
        """Whether the vehicle flies to where this item says."""
        return self.command in PLACES

    @property
    def is_here(self) -> bool:
        """Whether the item means "where the vehicle is": a takeoff or landing at 0, 0."""
        return self.command in {TAKEOFF, VTOL_TAKEOFF, *LANDINGS} and self.lat == 0 and self.lon == 0


@dataclass(frozen=True, slots=True)
class Mission:
    """A flight that was checked: home, then the items in order.

    A mission that would not be safe cannot be made: see Raises.

    Parameters
    ----------
    home : Home
    items : tuple of Item
        Without home; takeoff first.
    firmware : "ardupilot" or "px4"
        The autopilot the mission is for.
    name : str
        For people; not part of what makes two missions equal, and in no file.
    notes : tuple of str
        What the person who flies it should be told, from whoever made the mission; not compared.

    Raises
    ------
    MissionError
        Without items or with more than a link can count, with a place that does not exist, lies more than
        20 km (the first) or 100 km (any) from home, lies at or below the ground or above 1000 m over home,
        or with an item that the firmware is known to refuse.
    """

    home: Home
    items: tuple[Item, ...]
    firmware: str = "ardupilot"
    name: str = field(default="", compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if self.firmware not in FIRMWARES:
            raise MissionError(f"a mission is for ardupilot or px4, not for {self.firmware!r}")
        if not any(item.is_place and item.command not in TAKEOFFS for item in self.items):
            raise MissionError("a mission needs an item to fly to; this one has none")
        if len(self.items) > MOST_ITEMS:
            raise MissionError(
                f"the mission has {len(self.items)} items and a link carries {MOST_ITEMS}; "
                "choose fewer regions, a wider spacing or a larger tolerance"
            )
        for item in self.items:
            _check_firmware(item, self.firmware)
        _check_distances(self)

    @property
    def speed_m_s(self) -> float:
        """Speed over ground, from the first item that sets it, or else 5 m/s."""
        return next(
            (i.params[1] for i in self.items if i.command == CHANGE_SPEED and i.params[1]), CRUISE_M_S
        )

    @property
    def path(self) -> tuple[Floats, Floats, Floats]:
        """Where the flight leads: lat and lon (degrees) and height above home (metres), home first.

        A return adds home, at the height it is flown at. Heights above the terrain are taken as above home.
        """
        places = [(self.home.lat, self.home.lon, 0.0)]
        for item in self.items:
            if item.is_place:
                lat, lon = places[-1][:2] if item.is_here else (item.lat, item.lon)
                sea_m = self.home.altitude_m if item.frame == AMSL else 0.0
                places.append((lat, lon, item.altitude_m - sea_m))
            elif item.command == RETURN:
                places.append((self.home.lat, self.home.lon, places[-1][2]))
        lat_, lon_, height = np.array(places, dtype=np.float64).T
        return lat_, lon_, height

    @property
    def distance_m(self) -> float:
        """Length of the flight over ground, with the return where there is one."""
        lat, lon, _ = self.path
        return float(_lengths(lat, lon).sum())

    @property
    def duration_s(self) -> float:
        """Least time of the flight: at constant speed, climbing at 2.5 and descending at 1.5 m/s.

        Slowing down for turns comes on top of it.
        """
        lat, lon, height = self.path
        climb = np.diff(height)
        vertical = np.where(climb > 0, climb / CLIMB_M_S, -climb / DESCENT_M_S)
        legs = np.maximum(_lengths(lat, lon) / self.speed_m_s, vertical)
        holds = sum(i.params[0] or 0.0 for i in self.items if i.command in {WAYPOINT, LOITER_TIME})
        returns = any(i.command == RETURN for i in self.items)
        return float(legs.sum() + holds + (max(height[-1], 0.0) / DESCENT_M_S if returns else 0.0))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the person who flies this should know first: the notes, and what the numbers say."""
        found = list(self.notes)
        if len(self.items) > CAPACITY[self.firmware]:
            found.append(
                f"{len(self.items)} items: many boards with {self.firmware} hold {CAPACITY[self.firmware]}; "
                "split the mission or choose fewer regions"
            )
        highest = float(self.path[2].max())
        if highest > USUAL_HIGHEST_M:
            found.append(
                f"{highest:g} m above home is more than most countries allow without a permit (120 m)"
            )
        if self.duration_s > LONG_FLIGHT_S:
            found.append(
                f"at least {self.duration_s / 60:.0f} min in the air: few multirotors fly 30 min on a battery"
            )
        return tuple(found)


def check_position(lat: float, lon: float, what: str) -> None:
    """Raise MissionError unless this is a place on Earth."""
    if not (math.isfinite(lat) and math.isfinite(lon)):
        raise MissionError(f"{what} lies at lat {lat}, lon {lon}; both must be finite numbers")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        swapped = "; latitude and longitude look swapped" if -90 <= lon <= 90 and -180 <= lat <= 180 else ""
        raise MissionError(
            f"{what} lies at lat {lat:g}, lon {lon:g}; expected -90..90 and -180..180{swapped}"
        )


def distance_m(lat: float, lon: float, other_lat: float, other_lon: float) -> float:
    """Geodesic distance over ground between two places, in metres."""
    return float(_geod().inv(lon, lat, other_lon, other_lat)[2])


def _check_place(item: Item) -> None:
    check_position(item.lat, item.lon, f"an item of command {item.command}")
    if item.frame not in {AMSL, RELATIVE, TERRAIN}:
        raise MissionError(
            f"a place is in frame 3 (above home), 0 (the sea) or 10 (the terrain), not in {item.frame}"
        )
    if item.frame == AMSL:
        return
    if item.altitude_m < 0 or (item.altitude_m == 0 and item.command not in LANDINGS):
        raise MissionError(
            f"altitude is {item.altitude_m:g} m; the flight must be above home: give more than 0"
        )
    if item.altitude_m > HIGHEST_M:
        raise MissionError(
            f"altitude is {item.altitude_m:g} m above home, more than {HIGHEST_M:g} m: "
            "is it above the sea, or in feet? Give metres above home"
        )


def _check_firmware(item: Item, firmware: str) -> None:
    """Refuse what the autopilot is known to refuse, or to fly otherwise than it says."""
    unset = {number for number, value in enumerate(item.params, start=1) if value is None}
    if firmware == "ardupilot":
        may_be_unset = {VTOL_LAND: {3, 4}}.get(item.command, {4} if item.command in HEADINGS else set())
        if unset - may_be_unset:
            raise MissionError(
                f"ArduPilot refuses command {item.command} with param{min(unset - may_be_unset)} unset"
            )
        if item.command in {214, 4501}:
            raise MissionError(f"ArduPilot does not know command {item.command}")
        return
    if item.frame == TERRAIN:
        raise MissionError("PX4 has no heights above the terrain (frame 10); give them above home")
    if item.command == LOITER_TURNS:
        raise MissionError("PX4 does not fly LOITER_TURNS (18) in a mission")
    if item.command in {RETURN, CHANGE_SPEED, 206} and item.frame != NO_PLACE:
        raise MissionError(f"PX4 takes command {item.command} in frame 2 only, not {item.frame}")


def _check_distances(mission: Mission) -> None:
    home, (lat, lon, height) = mission.home, mission.path
    first = next(
        (i for i in mission.items if i.is_place and i.command not in TAKEOFFS and not i.is_here), None
    )
    if first is not None:
        check_near(home, first.lat, first.lon)
    farthest = float(_geod().inv(np.full_like(lon, home.lon), np.full_like(lat, home.lat), lon, lat)[2].max())
    if farthest > FARTHEST_M:
        raise MissionError(
            f"an item lies {farthest / 1000:.0f} km from home; at most {FARTHEST_M / 1000:.0f} km are flown"
        )
    extreme = float(height[np.abs(height).argmax()])
    if abs(extreme) > HIGHEST_M:
        raise MissionError(
            f"an item lies {extreme:g} m above home, which is not within {HIGHEST_M:g} m: "
            "check the altitude of home above the sea"
        )


def check_near(home: Home, lat: float, lon: float) -> None:
    """Raise MissionError if the first place to fly to is more than 20 km from home."""
    away = distance_m(home.lat, home.lon, lat, lon)
    if away <= FIRST_LEG_M:
        return
    swapped = abs(home.lon) <= 90 and distance_m(home.lon, home.lat, lat, lon) <= FARTHEST_M
    hint = (
        "home's latitude and longitude look swapped"
        if swapped
        else "is its latitude first, then its longitude?"
    )
    raise MissionError(
        f"home ({home.lat:.6f},{home.lon:.6f}) is {away / 1000:.0f} km from the first place to fly to "
        f"({lat:.6f},{lon:.6f}), farther than {FIRST_LEG_M / 1000:.0f} km: {hint}"
    )


def _lengths(lat: Floats, lon: Floats) -> Floats:
    lengths: Floats = _geod().inv(lon[:-1], lat[:-1], lon[1:], lat[1:])[2]
    return np.asarray(lengths, dtype=np.float64)


@lru_cache(maxsize=1)
def _geod() -> Any:
    from pyproj import Geod

    return Geod(ellps="WGS84")
