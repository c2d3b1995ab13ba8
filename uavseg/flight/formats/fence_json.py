"""Geofence and rally points as the `geoFence` and `rallyPoints` objects of a .plan file."""

from collections.abc import Iterable, Mapping
from typing import Any

from uavseg.errors import MissionError
from uavseg.flight.mission.fence import Fence, FenceCircle, FencePolygon, RallyPoint
from uavseg.plain_text import shown

_VERSION, _SHAPE_VERSION = 2, 1


def fence_to_json(fence: Iterable[Fence]) -> dict[str, Any]:
    """Fence polygons and circles as a `geoFence` object, with every key that QGroundControl requires."""
    polygons: list[dict[str, Any]] = []
    circles: list[dict[str, Any]] = []
    for shape in fence:
        known = {"version": _SHAPE_VERSION, "inclusion": shape.inclusion}
        if isinstance(shape, FencePolygon):
            polygons.append(known | {"polygon": [list(vertex) for vertex in shape.vertices]})
        else:
            circle = {"center": [shape.lat, shape.lon], "radius": shape.radius_m}
            circles.append(known | {"circle": circle})
    return {"version": _VERSION, "circles": circles, "polygons": polygons}


def rally_to_json(rally: Iterable[RallyPoint]) -> dict[str, Any]:
    """Rally points as a `rallyPoints` object: latitude, longitude and height above home of each."""
    return {"version": _VERSION, "points": [[point.lat, point.lon, point.altitude_m] for point in rally]}


def fence_from_json(geofence: Mapping[str, Any] | None) -> tuple[Fence, ...]:
    """The polygons, then the circles of a `geoFence` object; none of one that is missing.

    Raises
    ------
    MissionError
        If a shape is not on Earth, degenerate, or too large, or neither inclusion nor exclusion.
    KeyError, TypeError, ValueError
        If a key is missing or has another type.
    """
    geofence = geofence or {}
    polygons = [
        FencePolygon(tuple((float(lat), float(lon)) for lat, lon in shape["polygon"]), _inclusion(shape))
        for shape in geofence.get("polygons") or []
    ]
    circles = []
    for shape in geofence.get("circles") or []:
        lat, lon = shape["circle"]["center"]
        circles.append(
            FenceCircle(float(lat), float(lon), float(shape["circle"]["radius"]), _inclusion(shape))
        )
    return (*polygons, *circles)


def rally_from_json(rally: Mapping[str, Any] | None) -> tuple[RallyPoint, ...]:
    """The points of a `rallyPoints` object; none of one that is missing. Raises as `fence_from_json`."""
    points = (rally or {}).get("points") or []
    return tuple(RallyPoint(float(lat), float(lon), float(altitude_m)) for lat, lon, altitude_m in points)


def _inclusion(shape: Mapping[str, Any]) -> bool:
    """Whether a shape keeps the vehicle in; without the key, readers disagree about its meaning."""
    inclusion = shape["inclusion"]
    if not isinstance(inclusion, bool):
        raise MissionError(f"inclusion of a fence is true or false, not {shown(inclusion)}")
    return inclusion
