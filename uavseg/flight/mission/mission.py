"""Missions: home and items, their length and duration, safety checks and warnings."""

import math
from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from uavseg.arrays import Floats, GeoDataFrame
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.camera.camera import Photos
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import Fence, FenceCircle, HomePosition, MissionItem, Position, RallyPoint
from uavseg.flight.mission.vehicle import Vehicle, Wind
from uavseg.raster.geodesy.globe import geod_wgs84

if TYPE_CHECKING:
    from uavseg.flight.mission.estimate import Estimate


NEARLY_CONVEX = 0.9  # of the area of its convex hull
BOARD_CAPACITY = {"ardupilot": 650, "px4": 500, "generic": 500}  # items that common boards store
USUAL_MAX_HEIGHT_M = 120.0  # what most countries allow without a permit
LONG_FLIGHT_S = 30 * 60.0
FULL_BATTERY = 0.8  # share that is usually flown, the rest is a reserve
CRUISE_M_S = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Heights of the ground below a mission, from an elevation model."""

    # height of the ground at (lat, lon) of items and home, above one and the same zero
    below_m: Mapping[tuple[float, float], float]
    lowest_m: float  # minimum height of the flight above the ground; takeoff and landing aside
    highest_m: float  # maximum

    def rise_m(self, home: tuple[float, float], place: tuple[float, float]) -> float:
        """Return the height of the ground at a place above that at home; 0 where one is not known."""
        if home not in self.below_m or place not in self.below_m:
            return 0.0
        return self.below_m[place] - self.below_m[home]


@dataclass(frozen=True, slots=True)
class SurveyBlock:
    """A cell of a survey that a ground station could plan again, and the waypoints of the lines over it."""

    outline: tuple[Position, ...]  # of the cell, first vertex not repeated; empty if it has holes
    # ends of its lines in the order of flight, or in reverse; empty if it is not flown line by line
    waypoints: tuple[Position, ...]
    angle_deg: float  # azimuth of the lines, clockwise from north
    spacing_m: float
    height_m: float  # above home
    photos: Photos | None = None

    @property
    def is_editable(self) -> bool:
        """Whether the cell is nearly convex, so that lines of any azimuth cross its outline twice."""
        if len(self.outline) < 3 or len(self.waypoints) < 2:
            return False
        cell = shapely.Polygon([(lon, lat) for lat, lon in self.outline])
        return bool(cell.is_valid and cell.area >= NEARLY_CONVEX * cell.convex_hull.area)


@dataclass(frozen=True, slots=True)
class Mission:
    """A checked flight: home, then the items in order.

    A mission that would not be safe cannot be made, see Raises.

    Parameters
    ----------
    home : HomePosition
    items : tuple of MissionItem
        Without home; takeoff first.
    autopilot : "ardupilot", "px4" or "generic"
        The autopilot the mission is for; "generic" for any, with only what ArduPilot and PX4 both accept.
    name : str
        Not compared, and not written to files.
    notes : tuple of str
        Warnings from the planner for the pilot; not compared.
    fence : tuple of FencePolygon and FenceCircle
        Areas that the vehicle must stay inside or outside of; stored polygons first, as in files.
    rally : tuple of RallyPoint
        Places to which it may return instead of home.
    blocks : tuple of SurveyBlock
        Not compared.
    vehicle : Vehicle, optional
        For estimates; by default a multirotor with the parameters of the autopilot. Neither compared nor
        written to files, like those that follow.
    photos : Photos, optional
        For estimates.
    ground : Ground, optional
        The ground below it, where the planner knows it.
    endurance_s : float, optional
        Time in the air on a full battery, where the planner knows it.
    wind : Wind, optional
        For estimates; by default the air is calm.

    Raises
    ------
    MissionError
        If no item has a position, or there are more items than a link can count; if a position is not on
        Earth, is more than 20 km (the first) or 100 km (any) from home, or more than 1000 m above it; if
        the fence or a rally point is more than 100 km from home; or if the autopilot is known to refuse an
        item.
    """

    home: HomePosition
    items: tuple[MissionItem, ...]
    autopilot: str = "ardupilot"
    name: str = field(default="", compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)
    fence: tuple[Fence, ...] = ()
    rally: tuple[RallyPoint, ...] = ()
    blocks: tuple[SurveyBlock, ...] = field(default=(), compare=False)
    vehicle: Vehicle | None = field(default=None, compare=False)
    photos: Photos | None = field(default=None, compare=False)
    ground: Ground | None = field(default=None, compare=False)
    endurance_s: float | None = field(default=None, compare=False)
    wind: Wind | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.autopilot not in mav.AUTOPILOTS:
            raise MissionError(f"a mission is for {', '.join(mav.AUTOPILOTS)}, not for {self.autopilot!r}")
        if not any(item.has_position for item in self.items):
            raise MissionError("a mission needs an item to fly to; this one has none")
        if len(self.items) > mav.MAX_ITEMS:
            raise MissionError(
                f"the mission has {len(self.items)} items and a link carries {mav.MAX_ITEMS}; "
                "choose fewer regions, a wider spacing or a larger tolerance"
            )
        if self.endurance_s is not None and not 0 < self.endurance_s < math.inf:
            raise MissionError(f"an endurance is a number of seconds above 0, not {self.endurance_s:g}")
        for number, item in enumerate(self.items, start=1):
            mav.check_accepted(item, self.autopilot, number)
        _check_distances(self)
        _check_fence(self)
        polygons_first = sorted(self.fence, key=lambda shape: isinstance(shape, FenceCircle))
        object.__setattr__(self, "fence", tuple(polygons_first))

    @property
    def speed_m_s(self) -> float:
        """Speed over ground, from the first item that sets it, or else 5 m/s."""
        speeds = (item.params[1] or 0.0 for item in self.items if item.command == mav.CHANGE_SPEED)
        return next((speed for speed in speeds if speed > 0), CRUISE_M_S)

    @property
    def speed_range_m_s(self) -> tuple[float, float]:
        """Minimum and maximum requested speed over ground on legs to items, takeoff aside."""
        legs = zip((item for item in self.items if item.has_position), self.leg_speeds_m_s, strict=True)
        speeds = [speed for item, speed in legs if item.command not in mav.TAKEOFFS]
        return min(speeds, default=self.speed_m_s), max(speeds, default=self.speed_m_s)

    @property
    def leg_speeds_m_s(self) -> tuple[float, ...]:
        """Requested speed over ground on the leg to each item with a position.

        Before the first item that sets a speed, it is that one.
        """
        speed, speeds = self.speed_m_s, []
        for item in self.items:
            if item.command == mav.CHANGE_SPEED and (item.params[0] or 0) <= 1 and (item.params[1] or 0) > 0:
                speed = float(item.params[1] or speed)
            elif item.has_position:
                speeds.append(speed)
        return tuple(speeds)

    @property
    def path(self) -> tuple[Floats, Floats, Floats]:
        """Positions of the flight, home first: lat and lon in degrees, height above home in metres.

        A return adds home, at the height of the return. Heights above the terrain count as above home where
        the ground is not known.
        """
        places = [(self.home.lat, self.home.lon, 0.0)]
        for item in self.items:
            if item.has_position:
                lat, lon = places[-1][:2] if item.is_at_vehicle else (item.lat, item.lon)
                places.append((lat, lon, self.height_above_home_m(item)))
            elif item.command == mav.RETURN:
                places.append((self.home.lat, self.home.lon, places[-1][2]))
        lat_, lon_, height = np.array(places, dtype=np.float64).T
        return lat_, lon_, height

    def height_above_home_m(self, item: MissionItem) -> float:
        """Return the height of an item above home; one above the terrain needs `ground`, see `path`."""
        if item.frame == mav.FRAME_AMSL:
            return item.altitude_m - self.home.altitude_m
        if item.frame != mav.FRAME_TERRAIN or self.ground is None:
            return item.altitude_m
        return item.altitude_m + self.ground.rise_m((self.home.lat, self.home.lon), (item.lat, item.lon))

    @property
    def distance_m(self) -> float:
        """Length of the flight over ground in metres, including a return."""
        lat, lon, _ = self.path
        return float(np.sum(geod_wgs84().inv(lon[:-1], lat[:-1], lon[1:], lat[1:])[2]))

    @property
    def estimate(self) -> "Estimate":
        """Time with turns and acceleration, photographs, ground they show, energy."""
        from uavseg.flight.mission.estimate import estimate

        return estimate(self)

    @property
    def duration_s(self) -> float:
        """Estimated duration of the flight in seconds, see `estimate`."""
        return self.estimate.duration_s

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the pilot: the notes, too many items, great height, long duration."""
        warnings = list(self.notes)
        capacity = BOARD_CAPACITY[self.autopilot]
        with_autopilot = "" if self.autopilot == "generic" else f" with {self.autopilot}"
        if len(self.items) > capacity:
            warnings.append(
                f"{len(self.items)} items: many boards{with_autopilot} hold {capacity}; "
                "split the mission or choose fewer regions"
            )
        zero, highest = "home", float(self.path[2].max())
        if self.ground is not None:
            zero, highest = "the ground", round(self.ground.highest_m, 1)
        if highest > USUAL_MAX_HEIGHT_M:
            warnings.append(
                f"{highest:g} m above {zero} is more than most countries allow without a permit (120 m)"
            )
        warnings += self._endurance_warnings()
        waiting = [number for number, item in enumerate(self.items, start=1) if not item.autocontinue]
        if waiting:
            more = f" (and {len(waiting) - 1} more)" if len(waiting) > 1 else ""
            waits = "ArduPilot does not wait there, but goes on"
            if self.autopilot != "ardupilot":
                waits = "the vehicle waits there until it is sent on, for which no time is estimated"
            warnings.append(f"item {waiting[0]}{more} has autocontinue 0: {waits}")
        return tuple(warnings)

    def to_geodataframe(self) -> "GeoDataFrame":
        """Return the mission as map features in WGS 84, as its .geojson file has them.

        Returns
        -------
        GeoDataFrame
            Rows for home, items (some without geometry), fence and rally points, and of `kind`
            "flight" and "photographs" for the path. `height_above` is the zero of heights.
        """
        from uavseg.flight.mission.features import to_geodataframe

        return to_geodataframe(self)

    def explore(self, **options: Any) -> Any:
        """Draw the mission on an interactive map (folium.Map), for notebooks.

        Parameters
        ----------
        **options
            Of `geopandas.GeoDataFrame.explore`, such as `tiles` or `m`, a map to draw on.

        Raises
        ------
        MissingLibraryError
            If folium or mapclassify is not installed.
        """
        from uavseg.flight.mission.features import explore

        return explore(self, **options)

    def _repr_html_(self) -> str:
        from uavseg.flight.mission.features import as_html

        return as_html(self)

    def _endurance_warnings(self) -> list[str]:
        flight = self.estimate
        if flight.battery is not None:
            if flight.battery <= FULL_BATTERY:
                return []
            share = f"{100 * flight.battery:.0f} %"
            air = "without wind" if self.wind is None else f"in a wind of {self.wind}"
            return [f"the flight takes {share} of a battery {air}: split the mission"]
        if flight.duration_s <= (LONG_FLIGHT_S if self.endurance_s is None else self.endurance_s):
            return []
        return [f"about {flight.duration_s / 60:.0f} min in the air: few multirotors fly 30 min on a battery"]


def _check_distances(mission: Mission) -> None:
    home, (lat, lon, height) = mission.home, mission.path
    flown = (item for item in mission.items if item.has_position and item.command not in mav.TAKEOFFS)
    first = next((item for item in flown if not item.is_at_vehicle), None)
    if first is not None:
        mav.check_near(home, first.lat, first.lon)
    home_lon, home_lat = np.full_like(lon, home.lon), np.full_like(lat, home.lat)
    farthest = float(geod_wgs84().inv(home_lon, home_lat, lon, lat)[2].max())
    if farthest > mav.MAX_DISTANCE_M:
        raise MissionError(
            f"an item lies {farthest / 1000:.0f} km from home; "
            f"at most {mav.MAX_DISTANCE_M / 1000:.0f} km are allowed"
        )
    extreme = float(height[np.abs(height).argmax()])
    if abs(extreme) > mav.MAX_HEIGHT_M:
        raise MissionError(
            f"an item lies {extreme:g} m above home, which is not within {mav.MAX_HEIGHT_M:g} m: "
            "check the altitude of home above the sea"
        )


def _check_fence(mission: Mission) -> None:
    home = mission.home
    for what, shapes in (("the fence", mission.fence), ("a rally point", mission.rally)):
        for lat, lon in (position for shape in shapes for position in shape.positions):
            away = mav.distance_m(home.lat, home.lon, lat, lon)
            if away > mav.MAX_DISTANCE_M:
                raise MissionError(
                    f"{what} lies {away / 1000:.0f} km from home; "
                    f"at most {mav.MAX_DISTANCE_M / 1000:.0f} km are allowed"
                )
