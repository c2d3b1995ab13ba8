"""Mosaic: several rasters on a common pixel grid; where they overlap, the first valid pixel wins."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import MosaicError
from uavseg.plain_text import first_of
from uavseg.raster.access.opening import OpenFiles
from uavseg.raster.grid.geobox import GeoBox, shifted
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read import bad_blocks
from uavseg.raster.read.array_source import ArraySource
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.warp import Warp, place_on
from uavseg.raster.spectral.bands import BandChoice, Valid, Values, nodata_in_place, usable_nodata

GRID_TOLERANCE = 1e-3  # pixels: largest offset of a corner from the common grid
_NAMED = 8  # files in a note
_HINTS = {None: "", False: ", or give --warp (warp=True), which reads it on that grid"}

Boxes = NDArray[np.int64]
RasterSource = RasterFile | ArraySource
Part = tuple[RasterSource, Warp | None, Window, tuple[slice, slice]]
"""A file, how it is warped, a window of what that gives, and the index of that in an array."""


@dataclass(frozen=True, eq=False)
class Mosaic:
    """Rasters on a common grid."""

    files: tuple[RasterSource, ...]  # the first wins where they overlap
    boxes: Boxes  # (files, 4): first row, first column, end row and end column, in pixels of `geobox`
    geobox: GeoBox  # the smallest grid that contains all of them
    warps: tuple[Warp | None, ...]  # of files that lie on another grid

    def parts(self, window: Window) -> Iterator[Part]:
        """Yield the files that intersect `window`, the part of each, and its index in an array of that."""
        top, left, bottom, right = self.boxes.T
        end_row, end_col = window.row + window.rows, window.col + window.cols
        touched = (top < end_row) & (bottom > window.row) & (left < end_col) & (right > window.col)
        for index in np.flatnonzero(touched):
            file = self.files[index]
            row, col, end_row, end_col = self.boxes[index].tolist()
            whole = Window(row, col, end_row - row, end_col - col)
            part = window.common(whole)
            yield file, self.warps[index], part.relative_to(whole), part.relative_to(window).slices

    def coarse_parts(self, shape: tuple[int, int]) -> Iterator[Part]:
        """Yield every file whole, with its index in an array of the mosaic downsampled to `shape`.

        A file smaller than a pixel of that array may be left out.
        """
        scale = np.tile(np.array(shape) / np.array(self.geobox.shape), 2)
        inside = np.clip(self.boxes, 0, np.tile(self.geobox.shape, 2))
        places = np.ceil(inside * scale - 0.5).astype(np.int64)  # coarse pixels with their centres inside
        firsts, sizes = inside[:, :2] - self.boxes[:, :2], inside[:, 2:] - inside[:, :2]
        parts = np.hstack([firsts, sizes]).tolist()
        files = zip(self.files, self.warps, parts, places.tolist(), strict=True)
        for file, warp, part, (row, col, end_row, end_col) in files:
            if row < end_row and col < end_col:
                yield file, warp, Window(*part), (slice(row, end_row), slice(col, end_col))

    def cut(self, window: Window) -> "Mosaic":
        """Return the part inside a window."""
        boxes = self.boxes - np.tile([window.row, window.col], 2)
        return replace(self, boxes=boxes, geobox=self.geobox.window(window))


def align_rasters(files: Sequence[RasterSource], warp: bool | None = False) -> Mosaic:
    """Return the grid that contains all files, and the position of each file on it.

    With `warp`, files of another CRS or resolution, or that are not aligned with the pixel grid of the first,
    are read on that. A MosaicError says that one differs from the first otherwise, or without `warp` in
    these; where that is None, it does not name `warp`.
    """
    first = files[0]
    if len(files) == 1:
        return Mosaic((first,), np.array([[0, 0, *first.shape]]), _geobox(first), (None,))
    warps, corners = zip(*(_placed(file, first, warp) for file in files), strict=True)
    grids = [_geobox(file) if one is None else one.grid for file, one in zip(files, warps, strict=True)]
    boxes = np.hstack([corners, np.array(corners) + [grid.shape for grid in grids]])
    boxes -= np.tile(boxes[:, :2].min(axis=0), 2)
    rows, cols = boxes[:, 2:].max(axis=0).tolist()
    return Mosaic(tuple(files), boxes, GeoBox((rows, cols), _origin(grids, boxes), first.crs), warps)


def warp_notes(mosaic: Mosaic) -> tuple[str, ...]:
    """Return a note of which files are read on the grid of the first one, and what that loses."""
    first = mosaic.files[0]
    pairs = zip(mosaic.files, mosaic.warps, strict=True)
    names = [f"{file.name} ({_grid_name(file)}{warp.loss})" for file, warp in pairs if warp is not None]
    grid = f"read by nearest neighbour on the pixel grid of {first.name} ({_grid_name(first)})"
    return (f"{grid}: {first_of(names, _NAMED)}",) if names else ()


def with_nodata(
    files: Sequence[RasterSource], choice: BandChoice, nodata: float | str | None
) -> tuple[tuple[RasterSource, ...], tuple[str, ...]]:
    """Return the files with the nodata values in effect, and all warnings.

    A number that the user names counts beside that of a file; "only:V" takes its place, "none" leaves it out.
    """
    named, in_place = nodata_in_place(nodata)
    found: list[RasterSource] = []
    warnings: list[str] = []
    beside: set[str] = set()
    for file in files:
        warnings += file.warnings
        values, added = list(file.nodatas), None
        dtypes = [np.dtype(file.layout.dtypes[band - 1]) for band in choice.bands]
        for band, dtype in zip(choice.bands, dtypes, strict=True):
            number, warning = usable_nodata(None if in_place else values[band - 1], dtype)
            values[band - 1] = number
            if warning:
                warnings.append(f"{file.name}: {warning}")
        usable, warning = usable_nodata(named, dtypes[0])
        if warning:
            warnings.append(f"{file.name}: {warning}")
        own = [values[band - 1] for band in choice.bands]
        if usable is not None and not any(number is not None for number in own):
            for band in choice.bands:
                values[band - 1] = usable
        elif usable is not None and not all(_are_same(number, usable, dtypes[0]) for number in own):
            added = usable
            beside |= {f"{number:.12g}" for number in own if number is not None}
        found.append(replace(file, nodatas=tuple(values), added_nodata=added))
    if beside:
        warnings.append(
            f"nodata {named:.12g} counts beside that of the file, {' and '.join(sorted(beside))}; for "
            f"{named:.12g} alone, give --nodata only:{named:.12g} (nodata='only:{named:.12g}')"
        )
    return tuple(found), tuple(dict.fromkeys(warnings))


def _are_same(number: float | None, other: float, dtype: np.dtype[np.generic]) -> bool:
    """Return whether two nodata values are one for pixels of a type."""
    if number is None:
        return False
    first, second = np.array([number, other]).astype(dtype) if dtype.kind == "f" else (number, other)
    return bool(first == second or (first != first and second != second))


def _geobox(file: RasterSource) -> GeoBox:
    return GeoBox(file.shape, file.transform, file.crs)


def _origin(grids: Sequence[GeoBox], boxes: Boxes) -> Affine:
    """Return the transform of the common grid, by files at its edges: neither order nor rounding moves it."""
    t = Affine(*min(tuple(grid.transform)[:6] for grid in grids))
    if t.b == 0 == t.d:
        c = min(grid.transform.c for grid, box in zip(grids, boxes, strict=True) if box[1] == 0)
        f = min(grid.transform.f for grid, box in zip(grids, boxes, strict=True) if box[0] == 0)
        return Affine(t.a, t.b, c, t.d, t.e, f)
    first = int(np.lexsort(boxes.T[::-1])[0])
    row, col = boxes[first, :2].tolist()
    return shifted(grids[first].transform, -row, -col)


def _placed(
    file: RasterSource, first: RasterSource, warp: bool | None
) -> tuple[Warp | None, tuple[int, int]]:
    """Return how `file` is warped, and the row and column of its first pixel on the grid of `first`."""
    _check_traits(file, first, warp)
    rows, cols = file.shape
    (row, col), (low_row, low_col), (right_row, right_col) = (
        _on_grid(first.transform, shifted(file.transform, *corner))
        for corner in ((0, 0), (rows, 0), (0, cols))
    )
    drifts = (low_row - row - rows, low_col - col, right_row - row, right_col - col - cols)
    off = max(abs(col - round(col)), abs(row - round(row)))
    if warp and (file.crs != first.crs or max(*map(abs, drifts), off) > GRID_TOLERANCE):
        return place_on(_geobox(first), _geobox(file), (first.path, file.path))
    if max(map(abs, drifts)) > GRID_TOLERANCE:
        raise MosaicError(
            f"{file.path} has pixels of {_pixel(file.transform)}, and {first.path} of "
            f"{_pixel(first.transform)}; the rasters of a mosaic must agree{_HINTS[warp]}"
        )
    if off > GRID_TOLERANCE:
        raise MosaicError(
            f"{file.path} lies {off:.3f} pixels off the pixel grid of {first.path}; "
            f"resample it with gdalwarp -tap{_HINTS[warp]}"
        )
    return None, (round(row), round(col))


def _on_grid(grid: Affine, transform: Affine) -> tuple[float, float]:
    """Return row and column on a grid of the first corner of another transform."""
    x, y = transform.c - grid.c, transform.f - grid.f
    size = grid.a * grid.e - grid.b * grid.d
    return (grid.a * y - grid.d * x) / size, (grid.e * x - grid.b * y) / size


def _check_traits(file: RasterSource, first: RasterSource, warp: bool | None) -> None:
    for name, value, reference in (
        ("CRS", _crs_name(first if file.crs == first.crs else file), _crs_name(first)),
        ("georeferencing", file.located, first.located),
        ("number of bands", len(file.layout.dtypes), len(first.layout.dtypes)),
        ("type of bands", ",".join(file.layout.dtypes), ",".join(first.layout.dtypes)),
        ("bits of bands", file.layout.bits, first.layout.bits),
        ("colours of bands", _roles(file, first), _roles(first, file)),
    ):
        may_warp = name == "CRS" and file.crs is not None and first.crs is not None
        if value != reference and not (warp and may_warp):
            raise MosaicError(
                f"{file.path} has another {name} ({value}) than {first.path} ({reference}); "
                f"the rasters of a mosaic must agree{_HINTS[warp] if may_warp else ''}"
            )


def _roles(file: RasterSource, other: RasterSource) -> str:
    """Return the colour interpretation of bands; empty if one of the two is an array, which has none."""
    both_known = isinstance(file, RasterFile) and isinstance(other, RasterFile)
    return ",".join(file.layout.roles) if both_known else ""


def _crs_name(file: RasterSource) -> str:
    return "none" if file.crs is None else str(file.crs.to_string())


def _grid_name(file: RasterSource) -> str:
    return f"pixels of {_pixel(file.transform)}, CRS {_crs_name(file)}"


def _pixel(transform: Affine) -> str:
    return f"{np.hypot(transform.a, transform.d):.9g} x {np.hypot(transform.b, transform.e):.9g}"


@dataclass(frozen=True, slots=True)
class PartReader:
    """Reader of the intensity bands of parts of files."""

    choice: BandChoice
    handles: OpenFiles
    skip_bad_tiles: bool  # whether blocks that cannot be read count as nodata

    def read(self, file: RasterSource, part: Window) -> tuple[Values, Valid | None]:
        """Return values and validity of a window of a file."""
        values, valid, bad = self._read_part(file, part, (part.rows, part.cols))
        for block, _ in bad:
            bad_blocks.record_bad_block(block)
        return values, valid

    def merge(
        self, shape: tuple[int, int], parts: Iterable[Part], dtype: np.dtype[np.generic]
    ) -> tuple[Values, Valid | None]:
        """Merge values and validity of parts of files in a window, in the order of their rank."""
        planes = self.choice.planes if self.choice.formula is None else 1
        values = np.zeros((planes, *shape), dtype)
        filled = np.zeros(shape, bool)
        for file, warp, part, (rows, cols) in parts:
            missing = ~filled[rows, cols]
            if not missing.any():
                continue
            read = partial(self._read_part, file)
            if warp is None:
                pixels, valid, bad = read(part, missing.shape)
            else:
                pixels, valid, bad = warp.read(part, missing.shape, read, values)
            for block, place in bad:
                if missing[place].any():  # no earlier file has these pixels
                    bad_blocks.record_bad_block(block)
            if valid is not None:
                missing &= valid
            np.copyto(values[:, rows, cols], pixels, where=missing)
            filled[rows, cols] |= missing
        return values, None if filled.all() else filled

    def _read_part(
        self, file: RasterSource, part: Window, shape: tuple[int, int]
    ) -> tuple[Values, Valid | None, Sequence[bad_blocks.MissingPart]]:
        """Return values and validity of a part of a file, and which blocks of it cannot be read."""
        bad: Sequence[bad_blocks.MissingPart] = ()
        if not isinstance(file, RasterFile):
            values, valid = file.read(self.handles, self.choice, part, shape)
        elif self.skip_bad_tiles:
            values, valid, bad = bad_blocks.read_skipping_bad_blocks(
                file, self.handles, self.choice, part, shape
            )
        else:
            values, valid = bad_blocks.read_naming_bad_block(file, self.handles, self.choice, part, shape)
        return *with_formula(file, self.choice, values, valid), bad


def with_formula(
    file: RasterSource, choice: BandChoice, values: Values, valid: Valid | None
) -> tuple[Values, Valid | None]:
    """Return what the formula of a choice makes of the bands of a file; without one, the same."""
    if choice.formula is None:
        return values, valid
    return choice.formula.apply(values, valid, [file.scale_of(band, choice.bits) for band in choice.bands])
