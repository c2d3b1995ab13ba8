"""Mission: the flight as values, what it will take, and the checks that keep it from harm."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.items import (
    AMSL,
    CHANGE_SPEED,
    FARTHEST_M,
    FIRMWARES,
    HIGHEST_M,
    LANDINGS,
    LOITER_TIME,
    MOST_ITEMS,
    RETURN,
    TAKEOFF,
    TAKEOFFS,
    VTOL_TAKEOFF,
    WAYPOINT,
    Home,
    Item,
    check_firmware,
    check_near,
)
from uavseg.raster.geodesy.globe import geod_wgs84

__all__ = ["LANDINGS", "RETURN", "TAKEOFF", "VTOL_TAKEOFF", "Home", "Item", "Mission"]

CAPACITY = {"ardupilot": 650, "px4": 500}  # items that common boards hold
USUAL_HIGHEST_M = 120.0  # what most countries allow without a permit
LONG_FLIGHT_S = 30 * 60.0
CRUISE_M_S, CLIMB_M_S, DESCENT_M_S = 5.0, 2.5, 1.5

Floats = NDArray[np.float64]


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
            check_firmware(item, self.firmware)
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


def _check_distances(mission: Mission) -> None:
    home, (lat, lon, height) = mission.home, mission.path
    first = next(
        (i for i in mission.items if i.is_place and i.command not in TAKEOFFS and not i.is_here), None
    )
    if first is not None:
        check_near(home, first.lat, first.lon)
    home_lon, home_lat = np.full_like(lon, home.lon), np.full_like(lat, home.lat)
    farthest = float(geod_wgs84().inv(home_lon, home_lat, lon, lat)[2].max())
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


def _lengths(lat: Floats, lon: Floats) -> Floats:
    lengths: Floats = geod_wgs84().inv(lon[:-1], lat[:-1], lon[1:], lat[1:])[2]
    return np.asarray(lengths, dtype=np.float64)
