"""Regions painted back as a label raster: one GeoTIFF, or tiles under a VRT."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.atomic import check_target
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.raster.formats import geotiff
from uavseg.raster.formats.vrt_tiles import check_label_tiles, label_windows, write_label_tiles
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tiling import Window, tiles
from uavseg.regions.outline.rasterise import EdgeTable, edge_tables
from uavseg.regions.outline.rings import Rings
from uavseg.units import BLOCK

Path_ = str | os.PathLike[str]


def check_labels(path: Path_, overwrite: bool = False) -> None:
    """See that labels may be written there; call it before the work.

    Raises
    ------
    ParameterError
        If the name ends neither in .tif nor in .vrt.
    OutputExistsError, OutputError
        If something is there that may not be replaced, or there is no place.
    """
    if is_tiled(path):
        check_label_tiles(path, overwrite)
        return
    check_target(path, overwrite)
    if Path(path).suffix.lower() not in (".tif", ".tiff"):
        raise ParameterError(
            f"labels are written as GeoTIFF; name a .tif, or a .vrt for many tiles, not {path}"
        )


def is_tiled(path: Path_) -> bool:
    """Whether labels of that name are tiles under a VRT."""
    return Path(path).suffix.lower() == ".vrt"


def write_labels(
    path: Path_, rings: Rings, geobox: GeoBox, map: Map = serial, overwrite: bool = False
) -> None:
    """Write the labels of regions: one GeoTIFF, or for a .vrt tiles that the executor's workers write.

    The pixels are the same, and neither depends on how the work was cut.

    Raises
    ------
    OutputExistsError, OutputError
        If they may not or cannot be written.
    """
    if is_tiled(path):
        parts = edge_tables(rings, label_windows(geobox.shape))
        write_label_tiles(path, parts, geobox, overwrite, map)
    else:
        geotiff.write_labels(path, painted(rings, geobox.shape, map), geobox, overwrite)


def painted(
    rings: Rings, shape: tuple[int, int], map: Map = serial
) -> Iterator[tuple[Window, NDArray[np.uint32]]]:
    """The labels of regions, window by window from the top, as their outlines enclose them."""
    rows, cols = shape
    stripe = max((1 << 24) // cols // BLOCK, 1) * BLOCK
    windows = tiles((rows, cols), (stripe, -(-cols // BLOCK) * BLOCK))
    return zip(windows, map(EdgeTable.rasterise, edge_tables(rings, windows)), strict=True)
