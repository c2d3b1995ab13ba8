"""Mission planner: polygons to a mission. Read this first."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight import patterns
from uavseg.flight.along import home_notes, items_along
from uavseg.flight.items import (
    MAX_DISTANCE_M,
    HomePosition,
    MissionItem,
    check_near,
    check_position,
    distance_m,
)
from uavseg.flight.mission import Mission
from uavseg.flight.order.stops import Stops
from uavseg.flight.order.tour import short_tour
from uavseg.flight.params import PlanParams
from uavseg.flight.patterns import RegionPart
from uavseg.flight.plane import Plane, plane_around
from uavseg.flight.track import Track
from uavseg.flight.track_blocks import blocks_of_tracks

Floats = NDArray[np.float64]

MAX_REGIONS = 4000  # far more than any vehicle stores
_PATTERN_FUNCTIONS = {"visit": patterns.visits, "perimeter": patterns.perimeters, "survey": patterns.surveys}


def plan_mission(
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
        touch, as at the antimeridian, are merged.
    points : sequence of (lon, lat)
        A point inside each region.
    params : PlanParams
    home : (lat, lon) or (lat, lon, altitude_m)
        Where the vehicle starts; its altitude is in metres above the sea.

    Raises
    ------
    MissionError
        If there are no regions, if they are not near home, or if the mission would not be safe.
    """
    if len(polygons) == 0:
        raise MissionError("there is no region to fly to; choose at least one")
    start = HomePosition(*home)
    plane = _plane(polygons, points, start)
    parts = _parts(plane.project_polygons(polygons), plane, points)
    candidates, notes = _PATTERN_FUNCTIONS[params.pattern](parts, params)
    tracks = _order_tracks(candidates, plane, start)
    params, slower = _lower_speed(params, tracks)
    notes = [*home_notes(home), *notes, *slower]
    items = _items(tracks, plane, start, params)
    blocks = blocks_of_tracks(tracks, plane, params)
    return Mission(start, items, params.autopilot, params.name, tuple(notes), blocks=blocks)


def _plane(polygons: Sequence[Any], points: Sequence[tuple[float, float]], home: HomePosition) -> Plane:
    """The local plane of regions; checks that they are on Earth and near home."""
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
    if not farthest <= MAX_DISTANCE_M:
        raise MissionError(
            f"the regions reach {farthest / 1000:.0f} km from home; "
            f"at most {MAX_DISTANCE_M / 1000:.0f} km are allowed: choose regions that are nearer"
        )
    return plane


def _parts(regions: Iterable[Any], plane: Plane, points: Sequence[tuple[float, float]]) -> list[RegionPart]:
    """The connected parts of regions, with the given point if it lies inside, else another one."""
    parts = []
    for region, lonlat in zip(regions, points, strict=True):
        x, y = map(float, plane.xy_from_lonlat(*lonlat))
        for polygon in _connected_parts(region):
            inside = shapely.contains_xy(polygon, x, y)
            own = shapely.get_coordinates(shapely.point_on_surface(polygon))[0]
            parts.append(RegionPart(polygon, (x, y) if inside else (float(own[0]), float(own[1]))))
    return parts


def _connected_parts(region: Any) -> list[Any]:
    if region.geom_type == "MultiPolygon":
        region = shapely.union_all(shapely.get_parts(region), grid_size=1e-3)
    if not shapely.is_valid(region):
        region = shapely.make_valid(region, method="structure", keep_collapsed=False)
    return [part for part in shapely.get_parts(region) if part.geom_type == "Polygon" and part.area > 0]


def _order_tracks(candidates: Sequence[Sequence[Track]], plane: Plane, home: HomePosition) -> list[Track]:
    """One track for each region, in an order that makes a short tour from home and back."""
    if len(candidates) > MAX_REGIONS:
        raise MissionError(
            f"there are {len(candidates):,} regions, and at most {MAX_REGIONS:,} are ordered; choose fewer"
        )
    ends = np.concatenate([[track.xy[[0, -1]] for track in tracks] for tracks in candidates])
    start = np.column_stack(plane.xy_from_lonlat([home.lon], [home.lat]))
    points, index = np.unique(np.concatenate([start, ends.reshape(-1, 2)]), axis=0, return_inverse=True)
    pairs = index.ravel()[1:].reshape(-1, 2)
    options, costs, flown = [], [], []
    first = 0
    for tracks in candidates:
        own = pairs[first : first + len(tracks)]
        first += len(tracks)
        both = [*tracks, *(track.reversed() for track in tracks)]
        flown.append(both)
        options.append(np.concatenate([own, own[:, ::-1]]))
        costs.append(np.array([track.length_m for track in tracks] * 2))
    steps = points[:, None] - points[None]
    tour = short_tour(Stops.of(options, costs), np.hypot(steps[..., 0], steps[..., 1]), index[0], index[0])
    return [flown[region][option] for region, option in tour]


def _lower_speed(params: PlanParams, tracks: Sequence[Track]) -> tuple[PlanParams, list[str]]:
    """The speed lowered to what the camera allows where photographs are closest, and a note of it."""
    triggers = np.concatenate([track.trigger_m for track in tracks])
    if params.photos is None or not triggers.any():
        return params, []
    limit = params.photos.max_speed_m_s(params.altitude_m, float(triggers[triggers > 0].min()))
    if params.speed_m_s <= limit:
        return params, []
    camera = params.photos.camera
    note = (
        f"speed lowered from {params.speed_m_s:g} to {limit:.2f} m/s: {camera.name} needs "
        f"{camera.min_interval_s:g} s between photographs, and more speed would blur them"
    )
    return replace(params, speed_m_s=limit), [note]


def _items(
    tracks: Sequence[Track], plane: Plane, home: HomePosition, params: PlanParams
) -> tuple[MissionItem, ...]:
    xy = np.concatenate([track.xy for track in tracks])
    trigger = np.concatenate([np.append(track.trigger_m, 0.0) for track in tracks])[:-1]
    moved = np.r_[True, np.hypot(*np.diff(xy, axis=0).T) > 1e-3]
    lon, lat = plane.lonlat_from_xy(*xy[moved].T)
    return items_along(lon, lat, home, params, trigger[moved[1:]])
