"""One raster file: what it says about itself, and its pixels by window."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.raster.bands import BandChoice, BandLayout
from uavseg.raster.file_state import FileState, file_states
from uavseg.raster.opening import OpenFiles, absolute_path, gdal_read_errors, rasterio_window
from uavseg.raster.tiling import Window
from uavseg.raster.validity import valid_pixels

Values = NDArray[Any]
Valid = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class RasterFile:
    """What a raster file says about itself; the pixels stay in the file.

    Parameters
    ----------
    path : str
    shape : (int, int)
    transform : affine.Affine
        The identity where the file has no place on the map.
    crs : rasterio.crs.CRS or None
    layout : BandLayout
    nodatas : tuple of float or None
        The nodata value of each band.
    block : (int, int)
        Rows and columns of one block of the file.
    masks : str
        "file" where all bands share a mask, "band" where each has its own, or "".
    white_is_zero : bool
        The numbers in the file grow with darkness.
    palette : tuple of (red, green, blue, alpha), or None
    driver : str
    overviews : tuple of int
        Factors of the reduced copies inside the file.
    warnings : tuple of str
    """

    path: str
    shape: tuple[int, int]
    transform: Affine
    crs: CRS | None
    located: bool
    layout: BandLayout
    nodatas: tuple[float | None, ...]
    block: tuple[int, int]
    masks: str
    white_is_zero: bool
    palette: tuple[tuple[int, int, int, int], ...] | None
    driver: str
    overviews: tuple[int, ...]
    warnings: tuple[str, ...]

    def __reduce__(self) -> tuple[Callable[..., "RasterFile"], tuple[Any, ...]]:
        values = (getattr(self, part.name) for part in fields(self))
        path, *others = values
        return RasterFile, (absolute_path(path), *others)  # who gets it may work in another folder

    @property
    def name(self) -> str:
        """The last part of the path."""
        return Path(self.path).name

    @property
    def fails_by_block(self) -> bool:
        """Whether any part of a block can be read exactly when the whole block can.

        Not so where a driver reads parts of blocks (VRT), and where masks have blocks of their own.
        """
        return self.driver == "GTiff" and not self.masks

    def fingerprint(self) -> tuple[tuple[FileState, ...], tuple[float | None, ...]]:
        """What its pixels depend on: the state of each file that it is made of, and what counts as nodata."""
        return file_states(self.path), self.nodatas

    def blocks_in(self, window: Window) -> Iterator[Window]:
        """The blocks of the file that a window touches, row by row, each as far as the raster goes."""
        tall, wide = self.block
        for i, j in self._blocks(window):
            yield Window(i * tall, j * wide, tall, wide).clipped(self.shape)

    def read(
        self,
        handles: OpenFiles,
        choice: BandChoice,
        window: Window,
        shape: tuple[int, int] | None = None,
    ) -> tuple[Values, Valid | None]:
        """Pixels of the chosen bands, and which of them are valid (None: all).

        With `shape`, the nearest pixels of a reduced picture of that many rows and columns.

        Raises
        ------
        RasterReadError
            If the file cannot be read there.
        """
        with gdal_read_errors(self.path, window):
            source = handles.open(self.path, self.located)
            how = {"window": rasterio_window(window), "out_shape": shape or (window.rows, window.cols)}
            values, alpha = self._pixels(source, choice, how)
            mask = self._mask(source, choice, how)
        valid = valid_pixels(values, [self.nodatas[band - 1] for band in choice.bands], alpha, mask)
        return self._meaning(values, valid, choice)

    def is_empty(self, handles: OpenFiles, choice: BandChoice, window: Window) -> bool:
        """Whether nothing was ever stored under `window` (a sparse file), so that every pixel is invalid.

        False where that cannot be told without decoding.
        """
        if self.driver != "GTiff":
            return False
        with gdal_read_errors(self.path, window):
            source = handles.open(self.path, self.located)
            filled = [source.nodatavals[band - 1] for band in choice.bands]  # what missing blocks read as
            if None in filled or filled != [self.nodatas[band - 1] for band in choice.bands]:
                return False
            blocks = ((band, i, j) for i, j in self._blocks(window) for band in choice.bands)
            return not any(_is_stored(source, *block) for block in blocks)

    def _blocks(self, window: Window) -> Iterator[tuple[int, int]]:
        tall, wide = self.block
        for i in range(window.row // tall, -(-(window.row + window.rows) // tall)):
            for j in range(window.col // wide, -(-(window.col + window.cols) // wide)):
                yield i, j

    def _pixels(
        self, source: DatasetReader, choice: BandChoice, how: dict[str, Any]
    ) -> tuple[Values, Values | None]:
        bands, alpha = list(choice.bands), self.layout.alpha
        if alpha is None:
            return source.read(bands, **how), None
        if self.layout.dtypes[alpha - 1] == self.layout.dtypes[bands[0] - 1]:
            pixels = source.read([*bands, alpha], **how)
            return pixels[:-1], pixels[-1]
        return source.read(bands, **how), source.read(alpha, **how)

    def _mask(self, source: DatasetReader, choice: BandChoice, how: dict[str, Any]) -> Valid | None:
        if not self.masks:
            return None
        bands = list(choice.bands[:1] if self.masks == "file" else choice.bands)
        mask: Valid = (source.read_masks(bands, **how) != 0).all(axis=0)
        return mask

    def _meaning(
        self, values: Values, valid: Valid | None, choice: BandChoice
    ) -> tuple[Values, Valid | None]:
        """Numbers as brightness: palettes looked up, and white bright where the file stores it as 0."""
        if self.palette is not None and choice.expanded:
            table = np.array(self.palette, np.uint8)
            seen = table[np.minimum(values[0], len(table) - 1), 3] != 0
            colors = np.ascontiguousarray(table[:, :3].T)[:, np.minimum(values[0], len(table) - 1)]
            if seen.all():
                return colors, valid
            return colors, seen if valid is None else seen & valid
        if self.white_is_zero:
            values = values.dtype.type((1 << choice.bits) - 1) - values
        return values.astype(choice.dtype, copy=False), valid


def _is_stored(source: DatasetReader, band: int, i: int, j: int) -> bool:
    try:
        return bool(source.block_size(band, i, j))
    except RasterBlockError:
        return False
