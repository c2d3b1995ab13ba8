"""Whether places on the Earth lie on valid pixels of a raster."""

import numpy as np

from uavseg.flight.safety.keep_out import IsGround
from uavseg.jobs.source.source import Blocks, Pixels, Source
from uavseg.raster.geodesy.globe import WGS84, transform_between
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.read.dataset import Dataset


def valid_ground(source: Source) -> IsGround | None:
    """Return a function that reads whether a place (lat, lon in degrees) lies on a valid pixel.

    None where the source has no pixels at hand, or no place on the Earth.
    """
    pixels = source.raster if isinstance(source, Blocks) else source
    if not isinstance(pixels, Pixels) or pixels.geobox.crs is None:
        return None
    dataset = pixels.cleaned(TilePass(()))
    to_xy = transform_between(WGS84, dataset.geobox.wkt)

    def is_ground(lat: float, lon: float) -> bool:
        x, y = to_xy(lon, lat)
        return bool(np.isfinite(x) and np.isfinite(y)) and _is_valid(dataset, float(x), float(y))

    return is_ground


def _is_valid(dataset: Dataset, x: float, y: float) -> bool:
    t = ~dataset.geobox.transform
    col, row = t.a * x + t.b * y + t.c, t.d * x + t.e * y + t.f
    rows, cols = dataset.geobox.shape
    if not (0 <= row < rows and 0 <= col < cols):
        return False
    _, mask = dataset.read(Window(int(row), int(col), 1, 1))
    return mask is None or bool(mask.all())
