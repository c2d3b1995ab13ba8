"""The raster under a plan: regions at its edge, which may go on beyond it or be a collar; valid places."""

from collections.abc import Collection
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools
from uavseg.errors import RegionError
from uavseg.flight.safety.keep_out import IsGround
from uavseg.jobs.source.source import Blocks, Pixels, Source
from uavseg.plain_text import first_of
from uavseg.raster.geodesy.globe import WGS84, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.select.choose import where
from uavseg.regions.table import Regions

REACH_PIXELS = 1.0  # outlines may be smoothed and simplified
MAX_LISTED = 10  # ids in a message


def without_edge_regions(
    regions: Regions, raster: Source, ids: Collection[int] | None, condition: str | None
) -> tuple[Regions, list[str]]:
    """Return regions that do not touch the edge of a raster, and a note of those that are left out.

    The regions are in degrees; those that were asked for by id are not left out: they are refused. The note
    is about regions that fulfil the condition. A RegionError says that a region that was asked for touches
    the edge, none is left, or the raster has no CRS.
    """
    if raster.geobox.wkt is None:
        raise RegionError(
            f"{raster.name} has no CRS, so which regions touch its edge is not known; give it one with "
            "gdal_edit.py -a_srs, or fly over them all the same (--allow-edge)"
        )
    touches = touches_edge(regions.polygons, raster.geobox)
    chosen = np.ones(len(regions), bool) if condition is None else where(regions.columns, condition)
    if ids is not None:
        chosen &= np.isin(regions.columns["id"], list(ids))
    found = regions.columns["id"][touches & chosen].tolist()
    if not found:
        return regions.select(np.flatnonzero(~touches)), []
    one = len(found) == 1
    what = (
        f"region{'s' * (not one)} {first_of(found, MAX_LISTED)} "
        f"touch{'es' * one} the edge of {raster.name}: {'it' if one else 'they'} may go on beyond it, or be "
        "a collar"
    )
    if ids is not None or not (chosen & ~touches).any():
        raise RegionError(f"{what}; choose others, or fly over them all the same (--allow-edge)")
    return regions.select(np.flatnonzero(~touches)), [
        f"{what}, so {'it is' if one else 'they are'} left out; --allow-edge flies over them"
    ]


def touches_edge(polygons: Any, geobox: GeoBox) -> Bools:
    """Return which polygons, in degrees (lon, lat; WGS 84), come nearer than a pixel to the edge of a raster.

    They do from either side. Edges of valid pixels inside of a raster do not count. The raster has a CRS.
    """
    lonlat, owner = shapely.get_coordinates(np.asarray(list(polygons), object), return_index=True)
    x, y = transform_between(WGS84, geobox.wkt)(*lonlat.T)
    t = ~geobox.transform
    row, col = t.d * x + t.e * y + t.f, t.a * x + t.b * y + t.c
    rows, cols = geobox.shape
    near_row, near_col = (np.minimum(abs(at), abs(at - size)) for at, size in ((row, rows), (col, cols)))
    beside = (near_row <= REACH_PIXELS) & (col >= -REACH_PIXELS) & (col <= cols + REACH_PIXELS)
    beside |= (near_col <= REACH_PIXELS) & (row >= -REACH_PIXELS) & (row <= rows + REACH_PIXELS)
    touches = np.zeros(len(polygons), bool)
    touches[owner[beside]] = True
    return touches


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
        (rows, cols), (col, row) = dataset.geobox.shape, ~dataset.geobox.transform * (float(x), float(y))
        if not (0 <= row < rows and 0 <= col < cols):  # nor where there is no such place
            return False
        _, mask = dataset.read(Window(int(row), int(col), 1, 1))
        return mask is None or bool(mask.all())

    return is_ground
