"""Label rasters: region outlines rasterised to one GeoTIFF, or to tiles under a VRT."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Path_
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.output.atomic import check_target
from uavseg.raster.formats import geotiff
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import check_label_tiles, label_windows, write_label_tiles
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.regions.outline.rings import EdgeTable, Rings, edge_tables
from uavseg.units import BLOCK


def check_labels(path: Path_, overwrite: bool = False) -> None:
    """Refuse a path where labels cannot be written; call it before computing them.

    A ParameterError says that the name ends neither in .tif nor in .vrt, an OutputExistsError or OutputError
    that a file exists that may not be replaced, or that the folder cannot be written to.
    """
    if is_vrt(path):
        check_label_tiles(path, overwrite)
        return
    check_target(path, overwrite)
    if Path(path).suffix.lower() not in (".tif", ".tiff"):
        raise ParameterError(
            f"labels are written as GeoTIFF; name a .tif, or a .vrt for many tiles, not {path}"
        )


def is_vrt(path: Path_) -> bool:
    """Check whether labels of that name are written as tiles under a VRT."""
    return Path(path).suffix.lower() == ".vrt"


def write_label_raster(
    path: Path_,
    rings: Rings,
    geobox: GeoBox,
    map: Map = serial,
    overwrite: bool = False,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write the labels of regions: one GeoTIFF, or for a .vrt tiles that the executor's workers write.

    The pixels of both are the same, and depend on neither tiles nor workers. For the path see `check_labels`.
    """
    if is_vrt(path):
        parts = edge_tables(rings, label_windows(geobox.shape))
        write_label_tiles(path, parts, geobox, overwrite, map, creation)
    else:
        strips = label_strips(rings, geobox.shape, map)
        geotiff.write_label_geotiff(path, strips, geobox, overwrite, creation=creation)


def label_strips(
    rings: Rings, shape: tuple[int, int], map: Map = serial
) -> Iterator[tuple[Window, NDArray[np.uint32]]]:
    """Rasterise labels in windows of full width, from top to bottom; `shape` is rows and columns."""
    rows, cols = shape
    strip = max((1 << 24) // cols // BLOCK, 1) * BLOCK
    windows = tiles((rows, cols), (strip, -(-cols // BLOCK) * BLOCK))
    return zip(windows, map(EdgeTable.rasterise, edge_tables(rings, windows)), strict=True)
