"""Raster file: its metadata as a value, and windowed reads of its pixels.

GDAL reads it as a part of the raster, and does not say where its blocks lie; so it is opened by itself too.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from rasterio.io import DatasetReader

from uavseg.dataclass import dataclass
from uavseg.errors import MosaicError, ParameterError, RasterReadError, UnchosenBandsError, caused_errors
from uavseg.raster.access import opening
from uavseg.raster.access.opening import OpenFiles
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.array_source import ArraySource, RasterMetadata
from uavseg.raster.spectral.band_names import find_band, listed, names_of
from uavseg.raster.spectral.bands import (
    BandChoice,
    BandLayout,
    BandScale,
    Valid,
    Values,
    choose_bands,
    valid_pixels,
)
from uavseg.raster.spectral.formula import BandWords, bind_formula
from uavseg.raster.tiff.damaged_blocks import check_blocks
from uavseg.raster.tiff.directories import SparseBlocks, file_of, is_cut_off, mask_page, once_for_each_file


@once_for_each_file
def _open_mask(path: str, source: DatasetReader) -> tuple[str, DatasetReader] | None:
    """Return the mask of an open TIFF as a raster, and its name; None in an archive, or if it is remote."""
    if file_of(path) is None:
        return None
    page = None if path.upper().startswith("GTIFF_DIR:") else mask_page(path)
    name = f"{path}.msk" if page is None else f"GTIFF_DIR:{page}:{path}"
    if page is None and not opening.file_exists(name):
        return None
    mask = opening.quiet_open(name, driver="GTiff")
    return (name, mask) if mask.shape == source.shape else None


FileState = tuple[str, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterFile(RasterMetadata):
    """Metadata of a raster file; the pixels stay in the file."""

    masks: str  # "file" if all bands share a mask, "band" if each has its own, or ""
    white_is_zero: bool  # whether large values are dark
    online: bool  # whether reading it may make requests

    def __getstate__(self) -> list[Any]:
        # A relative path becomes absolute: another process may have another working directory.
        path, *others = (getattr(self, part.name) for part in fields(self))
        return [opening.absolute_path(path), *others]

    @property
    def name(self) -> str:
        """The last part of the path."""
        return Path(self.path).name

    def scale_of(self, band: int, bits: int) -> BandScale:
        """Return the scale of the numbers that are read of a band, counted from 1, of so many bits."""
        scale = self.scales[band - 1] if self.scales else BandScale()
        return scale.inverted((1 << bits) - 1) if self.white_is_zero else scale

    @property
    def fails_by_block(self) -> bool:
        """Whether a part of a block can be read if and only if the whole block can.

        False for drivers that read parts of blocks (VRT), and for masks with blocks of their own.
        """
        return self.driver == "GTiff" and not self.masks

    def fingerprint(self) -> tuple[tuple[FileState, ...], tuple[float | None, ...]]:
        """Return for a hash the state of each file that it consists of, and the nodata values."""
        added = () if self.added_nodata is None else (self.added_nodata,)
        return file_states(self.path, self.driver, self.online), (*self.nodatas, *added)

    def blocks_in(self, window: Window) -> Iterator[Window]:
        """Yield the blocks of the file that intersect a window, row by row, clipped to the raster."""
        (rows, cols), (down, across) = self.block, window.blocks(*self.block)
        for i in range(down.start, down.stop):
            for j in range(across.start, across.stop):
                yield Window(i * rows, j * cols, rows, cols).clipped(self.shape)

    def read(
        self, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int] | None = None
    ) -> tuple[Values, Valid | None]:
        """Read the chosen bands, and which pixels are valid (None: all).

        With `shape`, downsampled to that many rows and columns by nearest neighbour. A RasterReadError says
        that the file cannot be read inside the window.
        """
        with opening.gdal_read_errors(self.path, window, self.online):
            source = handles.open(self.path, self.located, self.driver, self.masks)
            part = opening.rasterio_window(window)
            options = {"window": part, "out_shape": shape or (window.rows, window.cols)}
            try:
                if opening.is_sequential(self.driver):
                    opening.read_rows_before(source, window)
                values, alpha = self._read_bands(source, choice, window, options)
                mask = self._read_mask(source, choice, window, options)
            except opening.GDAL_ERRORS:
                handles.close(self.path)  # a block that failed once is read as 0 the next time
                raise
        return self.decode(values, alpha, mask, choice)

    def decode(
        self, values: Values, alpha: Values | None, mask: Valid | None, choice: BandChoice
    ) -> tuple[Values, Valid | None]:
        """Return intensity and validity from stored numbers of the bands of `choice`, (bands, rows, cols).

        `mask` (rows, cols) is that of the file, and false where there are no pixels; `alpha` is (rows, cols)
        too.
        """
        nodatas = [self.nodatas[band - 1] for band in choice.bands]
        valid = valid_pixels(values, nodatas, alpha, mask, choice.by_band, self.added_nodata)
        if self.palette is not None and choice.expanded:
            table = np.array(self.palette, np.uint8)
            index = values[0].view(f"u{values.itemsize}")  # numbers of colours have no sign
            index = np.minimum(index, len(table) - 1)
            opaque = table[index, 3] != 0
            colors = np.ascontiguousarray(table[:, :3].T)[:, index]
            if opaque.all():
                return colors, valid
            return colors, opaque if valid is None else opaque & valid
        if self.white_is_zero:
            values = values.dtype.type((1 << choice.bits) - 1) - values
        return values.astype(choice.dtype, copy=False), valid

    def read_whole(self) -> Values:
        """Return the stored numbers of all bands but alpha, (bands, rows, cols); they have one type."""
        bands = tuple(band for band, role in enumerate(self.layout.roles, start=1) if role != "alpha")
        choice = choose_bands(self.layout, bands[0])
        return self.read(OpenFiles(), replace(choice, bands=bands), Window(0, 0, *self.shape))[0]

    def is_empty(self, handles: OpenFiles, choice: BandChoice, window: Window) -> bool:
        """Return whether a sparse file stores no block inside `window`, so that every pixel is invalid.

        False where that is not known without decoding.
        """
        if self.driver != "GTiff":
            return False
        with opening.gdal_read_errors(self.path, window, self.online):
            source = handles.open(self.path, self.located, self.driver, self.masks)
            known = [self.nodatas[band - 1] for band in choice.bands]
            if None in known or known != [source.nodatavals[band - 1] for band in choice.bands]:
                return False  # missing blocks have another value
            return SparseBlocks(source, self.path, choice.bands).is_empty(window)

    def cut_off_blocks(self, handles: OpenFiles, choice: BandChoice, window: Window) -> set[tuple[int, int]]:
        """Return first row and column of the blocks in a window that begin beyond the end of the file.

        They need not be tried. None where that is not known without trying.
        """
        rows, cols = self.block
        if self.driver != "GTiff" or not os.path.isfile(self.path):  # noqa: PTH113 - false for a long name
            return set()
        with opening.gdal_read_errors(self.path, window, self.online):
            source = handles.open(self.path, self.located, self.driver, self.masks)
            size = Path(self.path).stat().st_size
            return {
                (block.row, block.col)
                for block in self.blocks_in(window)
                if is_cut_off(source, choice.bands, size, block.row // rows, block.col // cols)
            }

    def _read_bands(
        self, source: DatasetReader, choice: BandChoice, window: Window, options: dict[str, Any]
    ) -> tuple[Values, Values | None]:
        """Return values of the chosen bands, and those of the alpha band."""

        def read(bands: Sequence[int]) -> Values:
            sparse = None
            if self.driver == "GTiff" and not self.masks:
                sparse = SparseBlocks(source, self.path, bands).read(window, options["out_shape"])
            if sparse is not None:
                return sparse
            values: Values = source.read(list(bands), **options)
            if self._is_checked(window, options):
                check_blocks(self.path, source, bands, window, values)
            return values

        bands, alpha = choice.bands, self.layout.alpha
        if alpha is None:
            return read(bands), None
        if self.layout.dtypes[alpha - 1] == self.layout.dtypes[bands[0] - 1]:
            pixels = read([*bands, alpha])
            return pixels[:-1], pixels[-1]
        return read(bands), read([alpha])[0]

    def _read_mask(
        self, source: DatasetReader, choice: BandChoice, window: Window, options: dict[str, Any]
    ) -> Valid | None:
        if not self.masks:
            return None
        bands = list(choice.bands[:1] if self.masks == "file" else choice.bands)
        mask: Valid = (source.read_masks(bands, **options) != 0).all(axis=0)
        named = _open_mask(self.path, source) if self._is_checked(window, options) else None
        if named is not None:
            name, image = named
            check_blocks(name, image, bands if image.count >= max(bands) else (1,), window)
        return mask

    def _is_checked(self, window: Window, options: dict[str, Any]) -> bool:
        """Return whether to look for damage that GDAL does not report: in TIFFs, if not downsampled."""
        return self.driver == "GTiff" and options["out_shape"] == (window.rows, window.cols)


def file_states(path: str, driver: str | None = None, online: bool = False) -> tuple[FileState, ...]:
    """Return path, size in bytes and modification time in ns of every file that a raster consists of.

    These are the file itself, its sidecar files (masks, overviews) and those that it refers to (a VRT). A
    file in an archive is represented by the archive; a remote file by its address, with -1 and -1. A
    RasterReadError says that the raster cannot be opened.
    """
    failing = caused_errors(f"{path} cannot be opened as a raster", RasterReadError, *opening.GDAL_ERRORS)
    with failing, opening.gdal_env(online), opening.quiet_open(path, driver=driver) as source:
        names = sorted({path, *source.files})
    return tuple(_state(name) for name in names)


def _state(name: str) -> FileState:
    """Return the state of a file, or for a name in an archive that of the archive."""
    paths = [Path(name)]
    if name.startswith("/vsi"):
        inner = Path(name.split("/", 2)[-1].replace("{", "").replace("}", ""))
        starts = inner, Path("/") / inner
        paths = [path for start in starts for path in (start, *start.parents) if path.name]
    for path in paths:
        try:
            found = path.stat()
        except OSError:
            continue
        return str(path.absolute()), found.st_size, found.st_mtime_ns
    return name, -1, -1


MOST_UNCHOSEN = 4  # bands beside alpha; of more, the user has to choose


def choose(
    layout: BandLayout,
    band: int | str | None,
    rgb: Sequence[int | str] | None,
    words: BandWords,
    palette: bool = False,
) -> BandChoice:
    """Choose bands, see `choose_bands`; each may be named.

    Errors are those of `choose_bands` and `bind_formula`; besides, a BandError says that a name is that of no
    band or of several, an UnchosenBandsError that nothing is chosen of more than four bands that are not
    alpha.
    """
    if words.is_formula and (band is not None or rgb is not None):
        raise ParameterError("give --band, --rgb, --index or --expr: one of them")
    count = sum(role != "alpha" for role in layout.roles)
    if count > MOST_UNCHOSEN and band is None and rgb is None and not words.is_formula:
        raise UnchosenBandsError(
            f"the raster has {count} bands; choose with --band, --rgb, --index or --expr; the bands are "
            f"{listed(layout)}"
        )
    number = find_band(layout, band) if isinstance(band, str) else band
    colors = None if rgb is None else [find_band(layout, n) if isinstance(n, str) else n for n in rgb]
    return choose_bands(layout, number, colors, palette, bind_formula(words, layout))


def check_reflectance(files: Sequence[RasterFile | ArraySource], choice: BandChoice) -> None:
    """Refuse integers without a scale for a formula of reflectance (ParameterError)."""
    formula = choice.formula
    if formula is None or not formula.of_reflectance or choice.dtype.kind not in "iu":
        return
    for band in choice.bands:
        scale = files[0].scale_of(band, choice.bits)
        if (scale.scale, scale.offset) == (1.0, 0.0):
            raise ParameterError(
                f"{formula.title} holds for reflectance from 0 to 1, and band {band} is {choice.dtype} "
                "without a scale; give the scale to the file (gdal_edit.py -scale), or divide in --expr"
            )


def check_names_agree(files: Sequence[RasterFile | ArraySource], bands: Sequence[int]) -> None:
    """Refuse files that give other names to the bands which are used (MosaicError)."""
    first = names_of(files[0].layout)
    for file in files[1:]:
        for ours, theirs in zip(first, names_of(file.layout), strict=True):
            if ours.number in bands and ours.keys and theirs.keys and ours.keys != theirs.keys:
                raise MosaicError(
                    f"{file.path} has another name of bands ({theirs.label} for band {theirs.number}, not "
                    f"{ours.label}) than {files[0].path}; the rasters of a mosaic must agree"
                )
