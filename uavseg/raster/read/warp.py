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
from affine import Affine
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MosaicError, RasterError
from uavseg.raster.geodesy.globe import transformer_between
from uavseg.raster.grid.geobox import GeoBox, shifted
from uavseg.raster.grid.tiling import Window, sample_positions
from uavseg.raster.read.array_source import ArraySource
from uavseg.raster.read.bad_blocks import MissingPart
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.spectral.bands import Valid, Values

ReadPart = tuple[Values, Valid | None, Sequence[MissingPart]]
"""Values (bands, rows, cols), validity (rows, cols), and the blocks that cannot be read."""
Indices = NDArray[np.int64]
_SQUARE = 64  # pixels of the mosaic: side of the squares in which positions are interpolated
_TOLERANCE = 1 / 256  # of that, in pixels of the file; twice what it may be by the bends of squares
_TIE = 1e-3  # pixels of the file: a centre so near to an edge, as of grids half a pixel apart, lies beyond it
_PARTS = 32  # in which the sides of a file are divided to find its bounds
_ROUND_TRIP = 0.1  # pixels of the file
_MOST_READ = 2896  # pixels of the file: side of what is read at once
_SIDE = 1024  # the same in pixels of the mosaic


@dataclass(frozen=True)
class Warp:
    """Where the pixels of a grid lie in a file of another grid."""

    shape: tuple[int, int]  # of the part of the grid that contains the file
    grid: Affine  # of that part
    file_shape: tuple[int, int]
    file_grid: Affine
    crs: tuple[str, str] | None = None  # WKT of the grid and of the file; None if both have the same, or none
    file_pixels: float = 1.0  # the side of a pixel of the grid, in pixels of the file
    error_m: float = 0.0  # of the transformation between the CRS

    def read(
        self,
        window: Window,
        shape: tuple[int, int],
        read: Callable[[Window, tuple[int, int]], ReadPart],
        empty: Values,
    ) -> ReadPart:
        """Read a window of the grid, downsampled to `shape`, by what reads such of the file.

        `empty` has the number of bands and the type of its values.
        """
        values, valid = np.zeros((len(empty), *shape), empty.dtype), np.zeros(shape, bool)
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
            box = _bounding(row[inside], col[inside])
            step = math.sqrt(box.rows * box.cols / np.count_nonzero(inside)) if sampled else 1.0
            size = math.ceil(box.rows / max(step, 1)), math.ceil(box.cols / max(step, 1))
            found, known, missing = read(box, size)
            row = np.where(inside, row - box.row, 0) * size[0] // box.rows
            col = np.where(inside, col - box.col, 0) * size[1] // box.cols
            values[:, *place] = found[:, row, col]
            valid[place] = inside if known is None else inside & known[row, col]
            for block, (down, across) in missing:
                lost = inside & (row >= down.start) & (row < down.stop)
                i, j = np.nonzero(lost & (col >= across.start) & (col < across.stop))
                if len(i):
                    bad.append((block, (i + top, j + left)))
        return values, None if valid.all() else valid, bad

    def pixels(self, rows: Indices, cols: Indices, sampled: bool = False) -> tuple[Indices, Indices, Valid]:
        """Return the pixel of the file that holds the centre of each pixel in rows and columns of the grid.

        These are (m,) and (n,), increasing, and `sampled` if not all of a window. The result is rows and
        columns of the file, (m, n), and whether the centre lies in it; they are arbitrary where it does not.
        """
        row, col = (np.floor(each, out=each) for each in self._positions(rows, cols, sampled))
        inside = (row >= 0) & (col >= 0) & (row < self.file_shape[0]) & (col < self.file_shape[1])
        return np.where(inside, row, 0).astype(np.int64), np.where(inside, col, 0).astype(np.int64), inside

    def _positions(self, rows: Indices, cols: Indices, sampled: bool) -> tuple[Floats, Floats]:
        """Return centres in the file, off ties: bilinear, but exact where that may change their floor."""
        half, y, x = _SQUARE // 2, rows + 0.5, cols + 0.5
        square, across = rows // _SQUARE, cols // _SQUARE
        node_rows = np.arange(2 * square[0], 2 * square[-1] + 3)
        node_cols = np.arange(2 * across[0], 2 * across[-1] + 3)
        if self.crs is None or (sampled and y.size * x.size < node_rows.size * node_cols.size):
            row, col = self.exact(y[:, None], x[None])
            return row + _TIE, col + _TIE
        nodes = self.exact(half * node_rows[:, None], half * node_cols[None])
        y_node, x_node = y / half - node_rows[0], x / half - node_cols[0]
        row, col = (bilinear(each + _TIE, y_node, x_node) for each in nodes)
        even = (bends(nodes[0]) < 2 * _TOLERANCE) & (bends(nodes[1]) < 2 * _TOLERANCE)
        uncertain = ~even[square - square[0]][:, across - across[0]] | _is_near_edge(row) | _is_near_edge(col)
        i, j = np.nonzero(uncertain)
        exact = self.exact(y[i], x[j])
        row[i, j], col[i, j] = exact[0] + _TIE, exact[1] + _TIE
        return row, col

    @np.errstate(over="ignore", invalid="ignore")
    def exact(self, row: Any, col: Any) -> tuple[Floats, Floats]:
        """Return the place in the file of places (row, col) in the grid; infinite where there is none."""
        x, y = _applied(self.grid, col, row)
        if self.crs is not None:
            x, y = _transformer(*self.crs).transform(x, y)
        col, row = _applied(~self.file_grid, x, y)
        return row, col


def place_on(geobox: GeoBox, file: RasterFile | ArraySource, first: str) -> tuple[Warp, tuple[int, int]]:
    """Return how a file is read on a grid, and the row and column of its part in that.

    A MosaicError says that it has no certain place there; `first` is the path of the file of that grid.
    """
    refusal = f"{file.path} cannot be warped onto the pixel grid of {first}"
    own = GeoBox(file.shape, file.transform, file.crs)
    crs = None if file.crs == geobox.crs else (str(own.wkt), str(geobox.wkt))
    ahead = Warp(file.shape, file.transform, geobox.shape, geobox.transform, crs)
    back = Warp(geobox.shape, geobox.transform, file.shape, file.transform, crs and crs[::-1])
    rows, cols = (np.linspace(0, length, _PARTS + 1) for length in file.shape)
    try:
        place = ahead.exact(rows[:, None], cols[None])
        again = back.exact(*place)
    except RasterError as error:
        raise MosaicError(
            f"{refusal}: {error}, or none whose error is known; give both a registered CRS (gdal_edit.py "
            "-a_srs), or warp it with gdalwarp"
        ) from error
    with np.errstate(invalid="ignore"):
        off = max(np.abs(again[0] - rows[:, None]).max(), np.abs(again[1] - cols[None]).max())
        steps = [float(np.median(np.hypot(*(np.diff(each, axis=k) for each in place)))) for k in (0, 1)]
        bent = [max(np.abs(np.diff(each, 2, axis=k)).max() for k in (0, 1)) for each in place]
    if not (off < _ROUND_TRIP and max(bent) < min(steps)):
        raise MosaicError(
            f"{refusal}: a part of it has no certain place there, such as one beyond the domain of a "
            "projection, at a pole or across the antimeridian; warp the files to another CRS with gdalwarp"
        )
    pairs = list(zip(place, bent, strict=True))
    row, col = (math.ceil(each.min() - more - 0.5 - _TIE) for each, more in pairs)
    end_row, end_col = (math.floor(each.max() + more + 0.5 + _TIE) for each, more in pairs)
    warp = Warp(
        shape=(max(end_row - row, 1), max(end_col - col, 1)),
        grid=shifted(geobox.transform, row, col),
        file_shape=file.shape,
        file_grid=file.transform,
        crs=back.crs,
        file_pixels=max(length / _PARTS / step for length, step in zip(file.shape, steps, strict=True)),
        error_m=0.0 if back.crs is None else _error_m(*back.crs),
    )
    return warp, (row, col)


def bilinear(values: Floats, row: Floats, col: Floats) -> Floats:
    """Interpolate values at nodes, (m, n), at rows and columns of these that are not whole: (r,) and (c,)."""
    first, left = row.astype(np.int64), col.astype(np.int64)
    down, across = (row - first)[:, None], col - left
    lines = values[first] * (1 - down) + values[first + 1] * down
    found = lines[:, left]
    found += np.diff(lines)[:, left] * across
    return found


@np.errstate(invalid="ignore")
def bends(values: Floats) -> Floats:
    """Return how far off bilinear interpolation is in squares of 2 x 2 nodes; with all nodes a quarter of it.

    The values are (2m + 1, 2n + 1), the result (m, n), NaN where they are not finite.
    """
    across = np.abs(values[:, 1::2] - (values[:, :-2:2] + values[:, 2::2]) / 2)
    down = np.abs(values[1::2] - (values[:-2:2] + values[2::2]) / 2)
    rows = np.maximum(np.maximum(across[:-2:2], across[1::2]), across[2::2])
    return rows + np.maximum(np.maximum(down[:, :-2:2], down[:, 1::2]), down[:, 2::2])


def _is_near_edge(values: Floats) -> NDArray[np.bool_]:
    """Return whether interpolation leaves open in which pixel of the file a place lies."""
    with np.errstate(invalid="ignore"):
        off = values - np.rint(values)
        return np.abs(off, out=off) < _TOLERANCE


def _bounding(rows: Indices, cols: Indices) -> Window:
    row, col = int(rows.min()), int(cols.min())
    return Window(row, col, int(rows.max()) + 1 - row, int(cols.max()) + 1 - col)


def _applied(transform: Affine, col: Any, row: Any) -> tuple[Floats, Floats]:
    t = transform
    return t.a * col + t.b * row + t.c, t.d * col + t.e * row + t.f


@lru_cache(maxsize=32)
def _transformer(source: str, target: str) -> Any:
    """Return the pyproj Transformer, without those that neglect a difference of datums."""
    return transformer_between(source, target, allow_ballpark=False)


def _error_m(source: str, target: str) -> float:
    """Return the error of a transformation as PROJ states it; it was used in this thread."""
    transformer = _transformer(source, target)
    known = transformer.accuracy
    return float(known if known >= 0 else transformer.get_last_used_operation().accuracy)
