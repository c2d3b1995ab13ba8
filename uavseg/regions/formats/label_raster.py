"""Regions painted back as a label raster: one GeoTIFF, or tiles under a VRT."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.atomic import check_target
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.jobs.result import Extraction
from uavseg.raster.formats import geotiff
from uavseg.raster.formats.vrt_tiles import check_label_tiles, label_windows, write_label_tiles
from uavseg.raster.tiling import BLOCK, Window, tiles
from uavseg.regions.outline.rasterise import Sketch, Sketches

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


def write_labels(path: Path_, found: Extraction, map: Map = serial, overwrite: bool = False) -> None:
    """Write the labels of regions: one GeoTIFF, or for a .vrt tiles that whoever runs the work writes.

    The pixels are the same, and neither depends on how the work was cut.

    Raises
    ------
    OutputExistsError, OutputError
        If they may not or cannot be written.
    """
    if is_tiled(path):
        parts = Sketches(found.rings, label_windows(found.geobox.shape))
        write_label_tiles(path, parts, found.geobox, overwrite, map)
    else:
        geotiff.write_labels(path, painted(found, map), found.geobox, overwrite)


def painted(found: Extraction, map: Map = serial) -> Iterator[tuple[Window, NDArray[np.uint32]]]:
    """The labels of regions, window by window from the top, as their outlines enclose them."""
    rows, cols = found.geobox.shape
    stripe = max((1 << 24) // cols // BLOCK, 1) * BLOCK
    windows = tiles((rows, cols), (stripe, -(-cols // BLOCK) * BLOCK))
    return zip(windows, map(Sketch.paint, Sketches(found.rings, windows)), strict=True)
