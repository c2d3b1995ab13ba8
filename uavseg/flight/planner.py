"""Polygons become a mission: read this first."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError, ParameterError
from uavseg.flight import route
from uavseg.flight.legs import between, leaving_hull, outside_m
from uavseg.flight.mission import (
    CHANGE_SPEED,
    CRUISE_M_S,
    FARTHEST_M,
    FIRMWARES,
    HIGHEST_M,
    NO_PLACE,
    RELATIVE,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    Home,
    Item,
    Mission,
    check_near,
    check_position,
    distance_m,
)
from uavseg.flight.perimeter import default_tolerance_m, perimeter
from uavseg.flight.plane import Plane, plane_around
from uavseg.flight.survey import backwards, survey

Floats = NDArray[np.float64]

PATTERNS = ("visit", "perimeter", "survey")
FASTEST_M_S = 50.0
MOST_STARTS = 16  # corners of a perimeter where it may begin
DECIMALS = 8  # of degrees: a millimetre
UNCOVERED = 0.01  # of the area, that nobody needs to be told


@dataclass(frozen=True, slots=True)
class PlanParams:
    """How to fly regions.

    Parameters
    ----------
    altitude_m : float
        Height of the whole flight above home, above 0 and at most 1000.
    pattern : "visit", "perimeter" or "survey"
        Fly to a point inside each region, along its outline, or to and fro over it.
    spacing_m : float, optional
        Distance between the lines of a survey, which needs it.
    angle_deg : float, optional
        Azimuth of the lines of a survey, clockwise from north; by default, for each region, the one that
        needs the fewest.
    speed_m_s : float
        Over ground, above 0 and at most 50.
    firmware : "ardupilot" or "px4"
    tolerance_m : float, optional
        How far an outline may be moved to have fewer corners; by default a metre, or a pixel where the
        pixels of a region are larger.
    name : str
        Of the mission, for people.

    Raises
    ------
    ParameterError
        If a value is outside of these.
    """

    altitude_m: float
    pattern: str = "visit"
    spacing_m: float | None = None
    angle_deg: float | None = None
    speed_m_s: float = CRUISE_M_S
    firmware: str = "ardupilot"
    tolerance_m: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        _check_number("altitude", self.altitude_m, HIGHEST_M, "m above home")
        _check_number("speed", self.speed_m_s, FASTEST_M_S, "m/s")
        if self.pattern not in PATTERNS:
            raise ParameterError(f"a pattern is one of {', '.join(PATTERNS)}, not {self.pattern!r}")
        if self.firmware not in FIRMWARES:
            raise ParameterError(f"a firmware is one of {', '.join(FIRMWARES)}, not {self.firmware!r}")
        if self.pattern == "survey" and self.spacing_m is None:
            raise ParameterError("a survey needs the spacing of its lines in metres")
        if self.pattern != "survey" and (self.spacing_m, self.angle_deg) != (None, None):
            raise ParameterError(f"spacing and angle are for a survey, not for the pattern {self.pattern}")
        if self.spacing_m is not None:
            _check_number("spacing", self.spacing_m, FARTHEST_M, "m")
        if self.angle_deg is not None and not math.isfinite(self.angle_deg):
            raise ParameterError(f"the angle of lines is a number of degrees, not {self.angle_deg}")
        if self.tolerance_m is not None:
            _check_number("tolerance", self.tolerance_m, FARTHEST_M, "m")


def plan(
    polygons: Sequence[Any],
    points: Sequence[tuple[float, float]],
    params: PlanParams,
    home: tuple[float, ...],
) -> Mission:
    """Plan a mission over regions: take off, fly their pattern in a short order, return.

    Parameters
    ----------
    polygons : sequence of shapely Polygon or MultiPolygon
        The regions in degrees (lon, lat; WGS 84). The parts of a region are flown one by one; parts that
        touch, as at the antimeridian, are one.
    points : sequence of (lon, lat)
        A point inside each region.
    params : PlanParams
    home : (lat, lon) or (lat, lon, altitude_m)
        Where the vehicle starts; its altitude is above the sea, in metres.

    Raises
    ------
    MissionError
        If there are no regions, if they are not near home, or if the mission would not be safe.
    """
    if len(polygons) == 0:
        raise MissionError("there is no region to fly to; choose at least one")
    start = Home(*home)
    plane = _plane(polygons, points, start)
    parts = _parts(plane.flattened(polygons), plane, points)
    ways, notes = _PATTERNS[params.pattern](parts, params)
    paths = _ordered(ways, plane, start)
    notes = [*_home_notes(home), *notes]
    return Mission(start, _items(paths, plane, start, params), params.firmware, params.name, tuple(notes))


@dataclass(frozen=True, slots=True)
class _Part:
    """One connected region in metres, and a point (x, y) inside it."""

    polygon: Any
    point: tuple[float, float]


def _plane(polygons: Sequence[Any], points: Sequence[tuple[float, float]], home: Home) -> Plane:
    """The plane of regions that are on Earth and near home."""
    bounds = shapely.bounds(shapely.get_parts(np.array(polygons, dtype=object)))
    (west, south), (east, north) = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    check_position(south, west, "a region")
    check_position(north, east, "a region")
    lon, lat = min(points, key=lambda point: distance_m(home.lat, home.lon, point[1], point[0]))
    check_near(home, lat, lon)
    plane = plane_around(bounds, home.lon)
    x, y = plane.xy_from_lonlat(bounds[:, [0, 2, 0, 2]], bounds[:, [1, 1, 3, 3]])
    home_x, home_y = plane.xy_from_lonlat(home.lon, home.lat)
    farthest = float(np.hypot(x - home_x, y - home_y).max())
    if not farthest <= FARTHEST_M:
        raise MissionError(
            f"the regions reach {farthest / 1000:.0f} km from home and at most {FARTHEST_M / 1000:.0f} km "
            "are flown: choose regions that are nearer"
        )
    return plane


def _parts(regions: Iterable[Any], plane: Plane, points: Sequence[tuple[float, float]]) -> list[_Part]:
    """The connected parts of regions; the point of a part is the one given, if that is in it."""
    parts = []
    for region, lonlat in zip(regions, points, strict=True):
        x, y = map(float, plane.xy_from_lonlat(*lonlat))
        for polygon in _connected(region):
            inside = shapely.contains_xy(polygon, x, y)
            own = shapely.get_coordinates(shapely.point_on_surface(polygon))[0]
            parts.append(_Part(polygon, (x, y) if inside else (float(own[0]), float(own[1]))))
    return parts


def _connected(region: Any) -> list[Any]:
    if region.geom_type == "MultiPolygon":
        region = shapely.union_all(shapely.get_parts(region), grid_size=1e-3)
    if not shapely.is_valid(region):
        region = shapely.make_valid(region, method="structure", keep_collapsed=False)
    return [part for part in shapely.get_parts(region) if part.geom_type == "Polygon" and part.area > 0]


def _visits(parts: Sequence[_Part], params: PlanParams) -> tuple[list[list[Floats]], list[str]]:
    return [[np.array([part.point])] for part in parts], []


def _perimeters(parts: Sequence[_Part], params: PlanParams) -> tuple[list[list[Floats]], list[str]]:
    """Each outline, begun at any of some of its corners."""
    tolerances = [params.tolerance_m or default_tolerance_m(part.polygon) for part in parts]
    ways = []
    for part, tolerance_m in zip(parts, tolerances, strict=True):
        ring = perimeter(part.polygon, tolerance_m)[:-1]
        starts = range(0, len(ring), -(-len(ring) // MOST_STARTS))
        ways.append([np.roll(ring, -start, axis=0)[[*range(len(ring)), 0]] for start in starts])
    return ways, [f"outlines are simplified by up to {max(tolerances):.3g} m (--tolerance)"]


def _surveys(parts: Sequence[_Part], params: PlanParams) -> tuple[list[list[Floats]], list[str]]:
    """Sweep lines over each region, in either direction, and what to say about the legs between them."""
    assert params.spacing_m is not None
    ways, outside, uncovered, leaving = [], 0.0, 0.0, 0
    for part in parts:
        flown = survey(part.polygon, params.spacing_m, params.angle_deg)
        ways.append([way.reshape(-1, 2) for path in flown.paths for way in (path, backwards(path))])
        legs = between(flown.paths[0])
        outside += float(outside_m(part.polygon, legs).sum())
        uncovered += _uncovered_m2(part.polygon, flown.paths[0], params.spacing_m)
        leaving += len(leaving_hull(part.polygon, legs, params.spacing_m))
    return ways, _survey_notes(outside, uncovered / sum(part.polygon.area for part in parts), leaving)


def _uncovered_m2(region: Any, path: Floats, spacing_m: float) -> float:
    """Area of a region that is farther than half a spacing from every line."""
    swaths = shapely.buffer(shapely.linestrings(path), spacing_m / 2, quad_segs=4)
    return float(shapely.difference(region, shapely.union_all(swaths)).area)


def _survey_notes(outside: float, uncovered: float, leaving: int) -> list[str]:
    notes = []
    if leaving:
        notes.append(
            f"{leaving} legs between survey lines leave the hull of their region by more than a spacing"
        )
    if outside >= 1:
        notes.append(
            f"legs between survey lines lie outside of their regions, inside their hulls, for {outside:.0f} m"
        )
    if uncovered > UNCOVERED:
        notes.append(
            f"{uncovered:.0%} of the area lies farther than half a spacing from every line; "
            "a narrower spacing or another angle reaches it"
        )
    return notes


_PATTERNS = {"visit": _visits, "perimeter": _perimeters, "survey": _surveys}


def _ordered(ways: Sequence[Sequence[Floats]], plane: Plane, home: Home) -> list[Floats]:
    """The path through each region, in a short order from home and back."""
    ends = np.concatenate([[way[[0, -1]] for way in region] for region in ways])
    points = np.concatenate(
        (np.column_stack(plane.xy_from_lonlat([home.lon], [home.lat])), ends.reshape(-1, 2))
    )
    pairs = np.arange(1, len(points)).reshape(-1, 2)
    options = np.split(pairs, np.cumsum([len(region) for region in ways])[:-1])
    tour = route.order(options, route.distances(points), home=0)
    return [ways[region][way] for region, way in tour]


def _items(paths: Sequence[Floats], plane: Plane, home: Home, params: PlanParams) -> tuple[Item, ...]:
    xy = np.concatenate(paths)
    moved = np.r_[True, np.hypot(*np.diff(xy, axis=0).T) > 1e-3]
    lon, lat = (np.round(degrees, DECIMALS).tolist() for degrees in plane.lonlat_from_xy(*xy[moved].T))
    any_heading = (0.0, 0.0, 0.0, None)
    high = float(params.altitude_m)
    return (
        Item(TAKEOFF, RELATIVE, any_heading, home.lat, home.lon, high),
        Item(CHANGE_SPEED, NO_PLACE, (1.0, float(params.speed_m_s), -1.0, 0.0)),
        *(Item(WAYPOINT, RELATIVE, any_heading, *place, high) for place in zip(lat, lon, strict=True)),
        Item(RETURN, NO_PLACE),
    )


def _home_notes(home: tuple[float, ...]) -> list[str]:
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]


def _check_number(what: str, value: float, most: float, unit: str) -> None:
    if not 0 < value <= most:
        raise ParameterError(f"the {what} is above 0 and at most {most:g} {unit}, not {value:g}")
