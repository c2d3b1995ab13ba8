"""A way as GeoJSON (RFC 7946): one LineString with what is known of it."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import OutputError, RasterError
from uavseg.occupancy.paths.find_path import Way
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.globe import densify_line, split_at_antimeridian, wrap_lon_beyond_180
from uavseg.regions.wgs84 import to_wgs84

Floats = NDArray[np.float64]

DECIMALS = 7  # of degrees: a centimetre
LONGEST_LEG_M = 500.0  # a leg that is straight on the map bends by less than a centimetre over it


def check_crs(geobox: GeoBox) -> None:
    """Whether a way over a map has a place where GeoJSON can say it: on the Earth, or on no globe at all.

    Raises
    ------
    OutputError
        If it has not.
    """
    if geobox.crs is None:
        return
    try:
        to_wgs84.check_on_earth(geobox.wkt)
    except OutputError:
        raise OutputError(
            "the map has no place on the Earth, which a path in degrees needs; "
            "remove its coordinate system (gdal_translate -a_srs none) for a path in local coordinates"
        ) from None


def lonlat(way: Way, corners: Floats | None = None) -> tuple[Floats, Floats]:
    """Longitudes (-180..180) and latitudes of the corners of a way, in degrees.

    Parameters
    ----------
    way : Way
    corners : (n, 2) float64 array, optional
        Other places: row and column, pixel corners are whole numbers.

    Raises
    ------
    RasterError
        If the map has no CRS, or the way leaves what its projection can express.
    """
    rows, cols = (way.corners + 0.5 if corners is None else corners).T
    lon, lat = way.geobox.lonlat_from_xy(*way.geobox.xy_from_pixel(rows, cols))
    if not (np.isfinite(lon).all() and np.isfinite(lat).all()):
        raise RasterError("the path leaves what the map's projection can express")
    return wrap_lon_beyond_180(lon), lat


def geojson(way: Way) -> str:
    """A FeatureCollection of one line; WGS 84 with seven decimals, local coordinates without a CRS.

    A line that crosses the antimeridian is cut there, a way from a place to itself has two equal positions.
    """
    properties = {
        "length_m": round(way.length_m, 6),
        "cells": way.cells,
        "expanded": way.expanded,
        "clearance": way.clearance_m,
        "region": way.region,
    }
    feature = {"type": "Feature", "properties": properties, "geometry": _geometry(way)}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}, indent=1) + "\n"


def _geometry(way: Way) -> dict[str, Any]:
    if way.geobox.crs is None:
        return _line(way.xy)
    degrees = np.stack(lonlat(way, _dense(way)), axis=1)
    parts = [np.round(part, DECIMALS) for part in split_at_antimeridian(degrees)]
    if len(parts) == 1:
        return _line(parts[0])
    return {"type": "MultiLineString", "coordinates": [part.tolist() for part in parts]}


def _line(places: Floats) -> dict[str, Any]:
    whole = places if len(places) > 1 else places.repeat(2, axis=0)
    return {"type": "LineString", "coordinates": whole.tolist()}


def _dense(way: Way) -> Floats:
    """The corners in pixels, with more places on legs so long that they bend on the globe."""
    corners: Floats = way.corners + np.float64(0.5)
    if len(corners) < 2:
        return corners
    legs = np.hypot(*np.diff(corners, axis=0).T)
    metres = way.length_m * legs / legs.sum()
    pieces = np.maximum(np.ceil(metres / LONGEST_LEG_M), 1).astype(np.int64)
    return densify_line(corners, pieces)
