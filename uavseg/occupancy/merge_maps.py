"""Merging of maps: each cell takes the most certain of their values, and obstacles win.

Cells of the result lie as those of the first map do, so maps on the same grid are copied as they are. Others
are resampled: a cell takes the value of the cell in which its centre lies. That may step over an obstacle of
one cell, so each occupied cell also marks the cell in which its centre lies; no obstacle is lost.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import MapError, RasterError
from uavseg.occupancy.map_file import FREE_UP_TO, OCCUPIED_FROM
from uavseg.occupancy.mapping.grid_io import check_cells
from uavseg.occupancy.ros.ros_map import placement, transform_of
from uavseg.raster.grid.geobox import GeoBox

Float32s = NDArray[np.float32]

_CHUNK = 1 << 20  # cells that are resampled at once
_ROUNDING = 1e-6  # of a cell: a smaller shift is a rounding error


@dataclass(frozen=True, slots=True, eq=False)
class PlacedMap:
    """The probabilities of a map, and their position."""

    name: str
    probabilities: Float32s  # (rows, cols) float32; exactly 0.5 where unknown
    geobox: GeoBox  # square cells in metres


def common_grid(maps: Sequence[PlacedMap], unrotate: bool, resolution: float | None) -> GeoBox:
    """Extend the grid of the first map to hold all maps.

    With `unrotate` its rows run along the x axis, a yaw of 0. `resolution` is the side of a cell in metres;
    by default that of the first map.
    """
    for other in maps:
        if other.geobox.crs != maps[0].geobox.crs:
            raise MapError(
                f"{other.name} has another coordinate system than {maps[0].name}; warp it first (gdalwarp)"
            )
    side, (x, y, yaw), _ = placement(maps[0].geobox)
    side = side if resolution is None else resolution
    yaw = 0.0 if unrotate else yaw
    along, up = math.cos(yaw), math.sin(yaw)
    corners = np.concatenate([_corners(one.geobox) for one in maps]) - (x, y)
    cells = np.column_stack([corners @ (along, up), corners @ (-up, along)]) / side
    left, bottom = np.floor(cells.min(axis=0) + _ROUNDING).tolist()
    right, top = np.ceil(cells.max(axis=0) - _ROUNDING).tolist()
    shape = int(top - bottom), int(right - left)
    check_cells(shape, "the merged map")
    origin = x + side * (left * along - bottom * up), y + side * (left * up + bottom * along), yaw
    try:
        return GeoBox(shape, transform_of(origin, side, shape[0]), maps[0].geobox.crs)
    except RasterError as error:
        raise MapError(f"the merged map: {error}") from error


def merge(maps: Sequence[PlacedMap], geobox: GeoBox) -> tuple[Float32s, int]:
    """Merge maps into the cells of a grid, and count disputed cells; the order of the maps does not matter.

    Each cell takes the value that is farthest from 0.5; the highest where one is occupied (0.65 or more).
    Cells that are free (0.25 or less) in one map and occupied in another are disputed.
    """
    lowest = np.full(geobox.shape, 0.5, np.float32)
    highest = lowest.copy()
    for one in maps:
        values = _resampled(one, geobox)
        np.minimum(lowest, values, out=lowest)
        np.maximum(highest, values, out=highest)
    occupied = highest >= OCCUPIED_FROM
    disputed = int((occupied & (lowest <= FREE_UP_TO)).sum())
    above = highest - np.float32(0.5) >= np.float32(0.5) - lowest  # the highest is farther from 0.5
    return np.where(occupied | above, highest, lowest), disputed


def cropped(probabilities: Float32s, geobox: GeoBox) -> tuple[Float32s, GeoBox]:
    """Crop a map (rows, cols) to its known cells; refuse one without any."""
    known = probabilities != 0.5
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        raise MapError("every cell of the map is unknown, so nothing is left when it is cropped")
    part = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
    inner = np.ascontiguousarray(probabilities[part])
    moved = geobox.transform * geobox.transform.translation(int(cols[0]), int(rows[0]))
    return inner, GeoBox(inner.shape, moved, geobox.crs)


def _corners(geobox: GeoBox) -> NDArray[np.float64]:
    placement(geobox)  # refuses cells that are not square or not in metres
    rows, cols = geobox.shape
    return np.column_stack(geobox.xy_from_pixel([0, 0, rows, rows], [0, cols, 0, cols]))


def _resampled(one: PlacedMap, geobox: GeoBox) -> Float32s:
    """Resample a map to the cells of a grid, 0.5 outside of the map."""
    resampled = np.full(geobox.shape, 0.5, np.float32)
    for row, rows, cols, inside in _cells_of(geobox, one.geobox):
        part = resampled[row : row + len(inside)]
        part[inside] = one.probabilities[rows, cols]
    for row, rows, cols, inside in _cells_of(one.geobox, geobox):
        values = one.probabilities[row : row + len(inside)][inside]
        occupied = values > 0.5
        np.maximum.at(resampled, (rows[occupied], cols[occupied]), values[occupied])
    return resampled


def _cells_of(
    inner: GeoBox, outer: GeoBox
) -> Iterator[tuple[int, NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]]:
    """Find the cells of `outer` in which the centres of those of `inner` lie, some rows at a time.

    Yields the first row, the rows and columns for the centres that lie in `outer`, and which these are.
    """
    transform = ~outer.transform * inner.transform
    count, width = inner.shape
    for row in range(0, count, max(_CHUNK // width, 1)):
        y, x = np.mgrid[row : min(row + max(_CHUNK // width, 1), count), :width] + 0.5
        cols = np.floor(transform.a * x + transform.b * y + transform.c + 1e-9).astype(np.int64)
        rows = np.floor(transform.d * x + transform.e * y + transform.f + 1e-9).astype(np.int64)
        inside = (rows >= 0) & (rows < outer.shape[0]) & (cols >= 0) & (cols < outer.shape[1])
        yield row, rows[inside], cols[inside], inside
