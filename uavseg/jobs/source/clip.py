"""Part of a raster that is read: what lies within bounds, and in the polygons of a file."""

from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.execution.executors import decided
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.geobox import GeoBox, pixels_inside
from uavseg.raster.grid.tiling import PixelMask, Window, tiles
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.sample.place import extent, polygons_on, to_pixels
from uavseg.warning_filters import changing_filters

_TILE = 2048  # pixels: side of the windows in which polygons are drawn


def clipped(dataset: Dataset, options: ReadOptions) -> Dataset:
    """Return the pixels of a raster whose centres lie within the bounds and the area of interest of options.

    The raster ends at the bounding box of these; further pixels beyond the area count as nodata. A
    ParameterError says that no pixel is left; errors of the file of polygons are those of `polygons_on`.
    """
    geobox, area = dataset.geobox, None
    window = Window(0, 0, *geobox.shape)
    if options.bounds is not None:
        box = to_pixels(np.array([shapely.box(*options.bounds)], object), geobox)
        window = _within(window, box, "--bounds", geobox)
        area = None if geobox.transform.b == 0 == geobox.transform.d else box
    warnings = dataset.warnings
    if options.aoi is not None:
        polygons, notes = polygons_on(geobox, options.aoi)
        warnings = (*warnings, *notes)
        window = _within(window, polygons, f"the area of interest {options.aoi}", geobox)
        area = polygons if area is None else shapely.intersection(polygons, area)
    decided("%d x %d pixels from row %d and column %d", window.rows, window.cols, window.row, window.col)
    outside = None if area is None else _outside(area, window)
    if outside is not None and outside.covers(Window(0, 0, window.rows, window.cols)):
        raise ParameterError("no pixel has its centre within --bounds and --aoi; give a larger area")
    return replace(dataset, mosaic=dataset.mosaic.cut(window), outside=outside, warnings=warnings)


def _within(window: Window, area: NDArray[np.object_], name: str, geobox: GeoBox) -> Window:
    """Return the smallest part of a window that has all of its pixels with a centre in an area's bounds."""
    with changing_filters():  # shapely changes them itself
        ends = shapely.total_bounds(area)
    if not np.isfinite(ends).all():
        raise ParameterError(f"{name} has no coordinates in the raster's CRS; give it in that")
    cols, rows, end_cols, end_rows = np.floor(np.clip(ends, -1, 2**40) + 0.5).astype(int).tolist()
    found = window.common(Window(rows, cols, end_rows - rows, end_cols - cols))
    if found.rows == 0 or found.cols == 0:
        raise ParameterError(
            f"{name} holds no pixel of what is read, which is {extent(geobox.window(window))}; give it in "
            "the raster's coordinates, or a larger one"
        )
    return found


def _outside(area: NDArray[np.object_], window: Window) -> PixelMask:
    """Return the pixels of a window, counted from its first one, whose centres are in no polygon."""
    shape, tree = (window.rows, window.cols), shapely.STRtree(area)
    found = []
    for part in tiles(shape, _TILE):
        placed = replace(part, row=part.row + window.row, col=part.col + window.col)
        corner = placed.col + placed.cols, placed.row + placed.rows
        box = shapely.box(placed.col, placed.row, *corner)
        near = area[tree.query(box, "intersects")]
        if len(tree.query(box, "within")) == 0:  # else no pixel is outside
            inside = pixels_inside(near, placed) if len(near) else np.zeros((part.rows, part.cols), bool)
            found.append((part, PixelMask.of(~inside)))
    return PixelMask.joined(shape, found)
