"""Warping by nearest neighbour: files of another grid or CRS are read on the pixel grid of a mosaic.

GDAL interpolates the transformation between the ends of what it warps at once, so that its pixels depend on
the window. Here positions are interpolated too, but those near an edge of a pixel are computed one by one.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MosaicError, RasterError
from uavseg.raster.geodesy.globe import transformer_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.raster.grid.tiling import Window, sample_positions
from uavseg.raster.read.bad_blocks import MissingPart
from uavseg.raster.spectral.bands import Valid, Values

ReadPart = tuple[Values, Valid | None, Sequence[MissingPart]]
"""Values (bands, rows, cols), validity (rows, cols), and the blocks that cannot be read."""
Reader = Callable[[Window, tuple[int, int]], ReadPart]
_SQUARE = 64  # pixels of the mosaic: side of the squares in which positions are interpolated
_TOLERANCE = 1 / 256  # of that, in pixels of the file; twice what it may be by the bends of squares
_TIE = 1e-3  # pixels of the file: a centre so near to an edge, as of grids half a pixel apart, lies beyond it
_PARTS = 32  # in which the sides of a file are divided to find its bounds
_ROUND_TRIP = 0.1  # pixels of the file
_MOST_READ = 2896  # pixels of the file: side of what is read at once
_SIDE = 512  # the same in pixels of the mosaic
_SKIPPING = 2  # pixels of the file in one of the mosaic: of more, most are never read


@dataclass(frozen=True)
class Warp:
    """Where the pixels of a grid lie in a file of another grid."""

    grid: GeoBox  # the part of the grid that contains the file
    file: GeoBox
    file_pixels: float = 1.0  # the side of a pixel of the grid, in pixels of the file
    loss: str = ""  # what of the file is lost, for a note

    def read(self, window: Window, shape: tuple[int, int], read: Reader, like: Values) -> ReadPart:
        """Read a window of the grid, downsampled to `shape`, by what reads the like of the file.

        Values have the number of bands and the type of others, (bands, ...).
        """
        values, valid = np.zeros((len(like), *shape), like.dtype), np.zeros(shape, bool)
        bad: list[MissingPart] = []
        rows = sample_positions(window.row, window.rows, shape[0])
        cols = sample_positions(window.col, window.cols, shape[1])
        sampled = shape != (window.rows, window.cols)
        side = _SIDE if sampled else int(np.clip(_MOST_READ / self.file_pixels, 1, _SIDE))
        for top, left in product(range(0, shape[0], side), range(0, shape[1], side)):
            place = slice(top, top + side), slice(left, left + side)
            row, col, inside = self.pixels(rows[place[0]], cols[place[1]], sampled)
            if not inside.any():
                continue
            low, first = (int(each.min(initial=1 << 62, where=inside)) for each in (row, col))
            box = Window(low, first, int(row.max()) + 1 - low, int(col.max()) + 1 - first)
            step = math.sqrt(box.rows * box.cols / np.count_nonzero(inside)) if sampled else 1.0
            size = math.ceil(box.rows / max(step, 1)), math.ceil(box.cols / max(step, 1))
            found, known, missing = read(box, size)
            row, col = np.maximum(row - low, 0), np.maximum(col - first, 0)
            if sampled:
                row, col = row * size[0] // box.rows, col * size[1] // box.cols
            at = row * size[1] + col
            values[:, *place] = found.reshape(len(found), -1).take(at, axis=1)
            valid[place] = inside if known is None else inside & known.take(at)
            for block, (down, across) in missing:
                lost = inside & (row >= down.start) & (row < down.stop)
                i, j = np.nonzero(lost & (col >= across.start) & (col < across.stop))
                bad += [(block, (i + top, j + left))] if len(i) else []
        return values, None if valid.all() else valid, bad

    def pixels(
        self, rows: Integers, cols: Integers, sampled: bool = False
    ) -> tuple[Integers, Integers, Valid]:
        """Return the pixel of the file that holds the centre of each pixel in rows and columns of the grid.

        These are (m,) and (n,), increasing, and `sampled` if not all of a window. The result is rows and
        columns of the file, (m, n), and whether the centre lies in it; they are 0 where it does not.
        """
        row, col = (np.floor(each, out=each) for each in self._positions(rows, cols, sampled))
        inside = (row >= 0) & (col >= 0) & (row < self.file.shape[0]) & (col < self.file.shape[1])
        return np.where(inside, row, 0).astype(np.int64), np.where(inside, col, 0).astype(np.int64), inside

    def _positions(self, rows: Integers, cols: Integers, sampled: bool) -> Floats:
        """Return centres in the file, off ties: bilinear, but exact where that may change their floor."""
        half, y, x = _SQUARE // 2, rows + 0.5, cols + 0.5
        square, across = rows // _SQUARE, cols // _SQUARE
        node_rows = np.arange(2 * square[0], 2 * square[-1] + 3)
        node_cols = np.arange(2 * across[0], 2 * across[-1] + 3)
        few = sampled and y.size * x.size < node_rows.size * node_cols.size
        if few or self.grid.crs == self.file.crs:
            return place_in(self.file, self.grid, y[:, None], x) + _TIE
        nodes = place_in(self.file, self.grid, half * node_rows[:, None], half * node_cols) + _TIE
        found = np.stack([bilinear(each, y / half - node_rows[0], x / half - node_cols[0]) for each in nodes])
        with np.errstate(invalid="ignore"):
            uncertain = (np.abs(found - np.rint(found)) < _TOLERANCE).any(axis=0)
        even = (bends(nodes[0]) < 2 * _TOLERANCE) & (bends(nodes[1]) < 2 * _TOLERANCE)
        i, j = np.nonzero(uncertain | ~even[square - square[0]][:, across - across[0]])
        found[:, i, j] = place_in(self.file, self.grid, y[i], x[j]) + _TIE
        return found


@np.errstate(over="ignore", invalid="ignore")
def place_in(target: GeoBox, source: GeoBox, row: Any, col: Any) -> Floats:
    """Return the places in a grid, rows and columns, of those in another; infinite where there are none."""
    x, y = source.xy_from_pixel(*np.broadcast_arrays(row, col))
    if source.crs != target.crs:
        x, y = _transformer(source.wkt, target.wkt).transform(x, y)
    t = ~target.transform
    return np.stack([t.d * x + t.e * y + t.f, t.a * x + t.b * y + t.c])


def place_on(grid: GeoBox, file: GeoBox, names: tuple[str, str]) -> tuple[Warp, tuple[int, int]]:
    """Return how a file is read on a grid, and the row and column of its part in that.

    A MosaicError says that it has no certain place there, with the names of the file of the grid and its own.
    """
    refusal = f"{names[1]} cannot be warped onto the pixel grid of {names[0]}"
    corners = np.stack(np.meshgrid(*(np.linspace(0, end, _PARTS + 1) for end in file.shape), indexing="ij"))
    try:
        place = place_in(grid, file, *corners)
        off = np.abs(place_in(file, grid, *place) - corners).max()
    except RasterError as error:
        raise MosaicError(
            f"{refusal}: {error}, or none whose error is known; give both a registered CRS (gdal_edit.py "
            "-a_srs), or warp it with gdalwarp"
        ) from error
    with np.errstate(invalid="ignore"):
        steps = [float(np.median(np.hypot(*np.diff(place, axis=axis)))) for axis in (1, 2)]
        bent = np.maximum(*(np.abs(np.diff(place, 2, axis=axis)).max(axis=(1, 2)) for axis in (1, 2)))
    if not (off < _ROUND_TRIP and bent.max() < min(steps)):
        raise MosaicError(
            f"{refusal}: a part of it has no certain place there, such as one beyond the domain of a "
            "projection, at a pole or across the antimeridian; warp the files to another CRS with gdalwarp"
        )
    row, col = np.ceil(place.min(axis=(1, 2)) - bent - 0.5 - _TIE).astype(int).tolist()
    end_row, end_col = np.floor(place.max(axis=(1, 2)) + bent + 0.5 + _TIE).astype(int).tolist()
    part = grid.window(Window(row, col, max(end_row - row, 1), max(end_col - col, 1)))
    ratio = max(end / _PARTS / step for end, step in zip(file.shape, steps, strict=True))
    loss = f", 1 of {ratio**2:,.0f} pixels" if ratio > _SKIPPING else ""
    error_m = 0.0
    if file.crs != grid.crs:
        used = _transformer(file.wkt, grid.wkt)
        error_m = used.accuracy if used.accuracy >= 0 else used.get_last_used_operation().accuracy
    loss += f", known to {error_m:g} m" if error_m > min(ground_resolution(grid)) else ""
    return Warp(part, file, ratio, loss), (row, col)


def bilinear(values: Floats, row: Floats, col: Floats) -> Floats:
    """Interpolate values at nodes, (m, n), at rows and columns of these that are not whole: (r,) and (c,)."""
    first, left = row.astype(np.int64), col.astype(np.int64)
    lines = values[first] + (values[first + 1] - values[first]) * (row - first)[:, None]
    found: Floats = lines[:, left] + np.diff(lines)[:, left] * (col - left)
    return found


@np.errstate(invalid="ignore")
def bends(values: Floats) -> Floats:
    """Return how far off bilinear interpolation is in squares of 2 x 2 nodes; with all nodes a quarter of it.

    The values are (2m + 1, 2n + 1), the result (m, n), NaN where they are not finite.
    """
    rows, cols = (length // 2 for length in values.shape)
    coarse = bilinear(values[::2, ::2], np.arange(2 * rows) / 2, np.arange(2 * cols) / 2)
    off: Floats = np.abs(coarse - values[:-1, :-1]).reshape(rows, 2, cols, 2).max(axis=(1, 3))
    return off


@lru_cache(maxsize=32)
def _transformer(source: str | None, target: str | None) -> Any:
    """Return the pyproj Transformer, without those that neglect a difference of datums."""
    return transformer_between(source, target, allow_ballpark=False)
