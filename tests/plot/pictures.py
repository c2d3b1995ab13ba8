"""Rasters, regions and pictures for the tests of plots."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import rasterio
import shapely
from affine import Affine
from PIL import Image

from uavseg.flight.mission.items import HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission

UTM = rasterio.crs.CRS.from_epsg(32618)


NORTH_UP = Affine(1, 0, 380_000, 0, -1, 4_897_000)


def write(path: Path, pixels: np.ndarray, transform: Affine = NORTH_UP, crs: Any = UTM, **more: Any) -> Path:
    pixels = pixels if pixels.ndim == 3 else pixels[None]
    shape = {"count": pixels.shape[0], "height": pixels.shape[1], "width": pixels.shape[2]}
    with rasterio.open(
        path, "w", driver="GTiff", dtype=pixels.dtype, transform=transform, crs=crs, **shape, **more
    ) as file:
        file.write(pixels)
    return path


def box_of(transform: Affine, top: float, left: float, bottom: float, right: float) -> shapely.Polygon:
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return shapely.Polygon([transform * corner for corner in corners])


def table(shapes: list[Any], crs: Any = UTM) -> geopandas.GeoDataFrame:
    return geopandas.GeoDataFrame({"id": range(1, len(shapes) + 1)}, geometry=shapes, crs=crs)


def colored(path: Path) -> np.ndarray:
    """Mask of the coloured pixels of a picture."""
    rgb = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return np.ptp(rgb, axis=2) > 40


def middle_of(mask: np.ndarray) -> tuple[float, float]:
    """Mean row and column as fractions of the picture."""
    rows, cols = np.nonzero(mask)
    return rows.mean() / mask.shape[0], cols.mean() / mask.shape[1]


def a_mission(lonlats: list[tuple[float, float]]) -> Mission:
    places = tuple(MissionItem(16, 3, (0.0, 0.0, 0.0, None), lat, lon, 50.0) for lon, lat in lonlats)
    home = HomePosition(places[0].lat, places[0].lon)
    return Mission(
        home, (MissionItem(22, 3, (0.0, 0.0, 0.0, None), 0.0, 0.0, 50.0), *places, MissionItem(20, 2))
    )
