"""Reprojection of a picture to Web Mercator, encoded as WebP.

rasterio reprojects. Its `calculate_default_transform` is not used: it makes the quarry of the samples 640
pixels wide, here it is up to 850, and the picture would have other bytes.
"""

import warnings

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning
from rasterio.io import MemoryFile
from rasterio.warp import Resampling, reproject

from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env
from uavseg.raster.geodesy.globe import WGS84, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground_grid import GroundGrid
from uavseg.warning_filters import changing_filters

WEB_MERCATOR = "EPSG:3857"
QUALITY = 80


@dataclass(frozen=True)
class MercatorImage:
    """A picture that is north-up in Web Mercator: its WebP file, with transparency, and its rows and columns.

    `bounds` are west, south, east and north of its outer edges, in degrees.
    """

    webp: bytes
    shape: tuple[int, int]
    bounds: tuple[float, float, float, float]


def to_mercator(image: NDArray[np.uint8], geobox: GeoBox, ground: GroundGrid, size: int) -> MercatorImage:
    """Reproject an RGBA picture, (4, rows, cols), to Web Mercator.

    `geobox` is its grid, `ground` are places of the same extent. `size` is the longest side of the result in
    pixels, at most; the picture is not enlarged. RasterError is raised if it cannot be reprojected or
    encoded.
    """
    x, y = transform_between(WGS84, WEB_MERCATOR)(ground.lon, ground.lat)
    left, right, bottom, top = float(x.min()), float(x.max()), float(y.min()), float(y.max())
    longest = min(size, round(float(np.hypot(*image.shape[1:]))))
    step = max(right - left, top - bottom) / longest
    shape = (max(round((top - bottom) / step), 1), max(round((right - left) / step), 1))
    transform = Affine((right - left) / shape[1], 0, left, 0, -(top - bottom) / shape[0], top)
    placed = np.zeros((4, *shape), np.uint8)
    try:
        with gdal_env():
            for band, method in zip(range(4), [Resampling.bilinear] * 3 + [Resampling.nearest], strict=True):
                reproject(
                    image[band],
                    placed[band],
                    src_transform=geobox.transform,
                    src_crs=geobox.crs,
                    dst_transform=transform,
                    dst_crs=WEB_MERCATOR,
                    resampling=method,
                )
            content = webp_of(placed)
    except GDAL_ERRORS as error:
        raise RasterError(f"the picture cannot be drawn in Web Mercator ({cause_of(error)})") from error
    lon, lat = transform_between(WEB_MERCATOR, WGS84)(np.array([left, right]), np.array([bottom, top]))
    west, east, south, north = float(lon[0]), float(lon[1]), float(lat[0]), float(lat[1])
    return MercatorImage(content, shape, (west, south, east, north))


def webp_of(image: NDArray[np.uint8]) -> bytes:
    """Return a (4, rows, cols) picture of red, green, blue and alpha as the content of a WebP file."""
    bands, rows, cols = image.shape
    with MemoryFile(ext=".webp") as memory:
        how = {"driver": "WEBP", "height": rows, "width": cols, "count": bands, "dtype": "uint8"}
        with changing_filters():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with memory.open(**how, QUALITY=QUALITY) as file:
                file.write(image)
        return bytes(memory.read())
