"""A planned path as text: GeoJSON (RFC 7946), split at the antimeridian, and waypoints of Nav2."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from uavseg.arrays import Floats
from uavseg.errors import OutputError, RasterError
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.occupancy.ros.ros_map import ros_yaml_text
from uavseg.raster.geodesy.globe import decimals_for, densify_line, split_at_antimeridian, wrap_lon_beyond_180
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.regions.wgs84 import to_wgs84

_LONGEST_LEG_M = 500.0  # a straight leg on the map bends by less than a centimetre over it


def check_path_crs(geobox: GeoBox) -> None:
    """Refuse a map whose CRS is not on the Earth: paths are in degrees, or local without a CRS."""
    if geobox.crs is None:
        return
    try:
        to_wgs84.check_on_earth(geobox.wkt)
    except OutputError:
        raise OutputError(
            "the map has no place on the Earth, which a path in degrees needs; "
            "remove its coordinate system (gdal_translate -a_srs none) for a path in local coordinates"
        ) from None


def path_lonlat(path: PlannedPath, corners: Floats | None = None) -> tuple[Floats, Floats]:
    """Compute longitude (-180..180) and latitude of the corners of a path, in degrees (WGS 84).

    `corners` (n, 2) are other positions: row and column, pixel corners are whole numbers.
    """
    rows, cols = (path.corners + 0.5 if corners is None else corners).T
    lon, lat = path.geobox.lonlat_from_xy(*path.geobox.xy_from_pixel(rows, cols))
    if not (np.isfinite(lon).all() and np.isfinite(lat).all()):
        raise RasterError("the path leaves the area in which the map's projection is defined")
    return wrap_lon_beyond_180(lon), lat


def path_to_geojson(path: PlannedPath) -> str:
    """Write a FeatureCollection of one line: WGS 84 with decimals as the cells need, or local without a CRS.

    A line that crosses the antimeridian is split there. A path of one cell has two equal positions.
    """
    properties = {
        "length_m": round(path.length_m, 6),
        "cells": path.cells,
        "expanded": path.expanded,
        "clearance": path.clearance_m,
        "region": path.region,
    }
    return feature_collection([(properties, line_geometry(path))])


def path_to_waypoints(path: PlannedPath) -> str:
    """Write the corners as the YAML file of waypoints that Nav2's panel in RViz loads and follows.

    Positions are metres in the frame "map"; orientations are quaternions w, x, y, z. Each heads for the next
    corner, the last as the leg before. The format is that of ``nav2_rviz_plugins/src/nav2_panel.cpp`` in
    ros-navigation/navigation2.
    """
    headings = np.arctan2(*np.diff(path.xy, axis=0).T[::-1])
    halves = np.append(headings, headings[-1:] if len(headings) else 0.0) / 2
    turns = np.stack([np.cos(halves), np.sin(halves)], axis=1).round(9).tolist()
    poses = [
        {"pose": [x, y, 0.0], "orientation": [w, 0.0, 0.0, z]}
        for (x, y), (w, z) in zip(path.xy.round(9).tolist(), turns, strict=True)
    ]
    return ros_yaml_text({"waypoints": {f"waypoint{n}": pose for n, pose in enumerate(poses)}})


def feature_collection(features: Iterable[tuple[dict[str, Any], dict[str, Any]]]) -> str:
    """Write features, their properties and geometries, as GeoJSON."""
    written = [{"type": "Feature", "properties": about, "geometry": shape} for about, shape in features]
    return json.dumps({"type": "FeatureCollection", "features": written}, indent=1) + "\n"


def point_geometry(path: PlannedPath) -> dict[str, Any]:
    """Return where a path ends, as `line_geometry`."""
    positions = path.xy if path.geobox.crs is None else np.stack(path_lonlat(path), axis=1)
    decimals = 9 if path.geobox.crs is None else decimals_for(min(ground_resolution(path.geobox)))
    return {"type": "Point", "coordinates": np.round(positions[-1], decimals).tolist()}


def line_geometry(path: PlannedPath) -> dict[str, Any]:
    """Return the line of a path in degrees, or local without a CRS."""
    if path.geobox.crs is None:
        return _line(path.xy)
    degrees = np.stack(path_lonlat(path, _densify(path)), axis=1)
    decimals = decimals_for(min(ground_resolution(path.geobox)))
    parts = [np.round(part, decimals) for part in split_at_antimeridian(degrees)]
    if len(parts) == 1:
        return _line(parts[0])
    return {"type": "MultiLineString", "coordinates": [part.tolist() for part in parts]}


def _line(positions: Floats) -> dict[str, Any]:
    whole = positions if len(positions) > 1 else positions.repeat(2, axis=0)
    return {"type": "LineString", "coordinates": whole.tolist()}


def _densify(path: PlannedPath) -> Floats:
    """Return the corners in pixels, with points added on legs that are long enough to bend on the globe."""
    corners: Floats = path.corners + np.float64(0.5)
    if len(corners) < 2:
        return corners
    legs = np.hypot(*np.diff(corners, axis=0).T)
    metres = path.length_m * legs / legs.sum()
    pieces = np.maximum(np.ceil(metres / _LONGEST_LEG_M), 1).astype(np.int64)
    return densify_line(corners, pieces)
