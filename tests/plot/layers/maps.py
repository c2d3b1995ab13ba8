"""Maps of states and probabilities, and their pictures, for the tests of layers."""

from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from PIL import Image

from uavseg.raster.formats.geotiff import Page, write_geotiff_pages
from uavseg.raster.grid.geobox import GeoBox

UTM = rasterio.crs.CRS.from_epsg(32618)


BOX = GeoBox((128, 192), Affine(0.5, 0, 4e5, 0, -0.5, 5e6), UTM)


LOCAL = GeoBox((128, 192), Affine(0.5, 0, 0, 0, -0.5, 64), None)


MOST = 1000


def write(path: Path, values: np.ndarray, box: GeoBox = BOX, nodata: float | None = None) -> Path:
    write_geotiff_pages(path, [Page([values], box, [""], nodata)], overwrite=True)
    return path


def states() -> np.ndarray:
    """Free left, unknown in the middle, occupied right, no data below."""
    found = np.zeros((128, 192), np.uint8)
    found[:96] = np.repeat([1, 2, 3], 64)
    return found


def beliefs() -> np.ndarray:
    return np.array([0.5, 0.1, 0.5, 0.9], np.float32)[states()]


def rgb(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def of_raster(path: Path, row: float, col: float) -> np.ndarray:
    """Colour in a picture of a 128 x 192 raster, at a fraction of its rows and columns."""
    picture = rgb(path)
    page, height = picture.shape[1] / 9.0, picture.shape[0]  # pixels per inch
    width = page * (9.0 - 0.3)
    side = width / 1.04  # the raster is framed by 2 % of its longer side
    left, top = page * 0.15 + 0.02 * side, height - page * 0.34 - (128 / 192 + 0.02) * side
    return picture[round(top + row * side * 128 / 192), round(left + col * side)]
