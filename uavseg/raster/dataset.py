"""Dataset: one raster, or many that together make one; read by window, anywhere, by anyone."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.raster.array_source import from_array, from_values, is_array
from uavseg.raster.bad_blocks import (
    MissingPart,
    read_naming_bad_block,
    read_skipping_bad_blocks,
    record_bad_block,
)
from uavseg.raster.bands import BandChoice, choose_bands
from uavseg.raster.geobox import GeoBox, scaled
from uavseg.raster.inspect_file import inspect_file
from uavseg.raster.mosaic import Mosaic, RasterSource, align_rasters
from uavseg.raster.opening import OpenFiles
from uavseg.raster.raster_file import RasterFile
from uavseg.raster.tiling import Window, in_panels, tile_side, tiles
from uavseg.raster.validity import usable_nodata

Values = NDArray[Any]
Valid = NDArray[np.bool_]
Part = tuple[RasterSource, Window, tuple[slice, slice]]


@dataclass(frozen=True, eq=False)
class Dataset:
    """Intensity of one raster or of a mosaic, by window.

    It holds paths and what the files say about themselves, never pixels; files are opened when they are first
    read, by each thread for itself. So it may be pickled, and read by many threads at once.

    Examples
    --------
    >>> dataset = Dataset.open("tile.tif")  # doctest: +SKIP
    >>> values, valid = dataset.read(Window(0, 0, 64, 64))  # doctest: +SKIP
    """

    mosaic: Mosaic
    choice: BandChoice
    warnings: tuple[str, ...]
    skip_bad_tiles: bool = False
    _handles: OpenFiles = field(default_factory=OpenFiles, repr=False)

    @classmethod
    def open(
        cls,
        sources: Any,
        band: int | None = None,
        rgb: Sequence[int] | None = None,
        nodata: float | None = None,
        skip_bad_tiles: bool = False,
    ) -> "Dataset":
        """A dataset of what `sources` names; no pixel is read.

        Parameters
        ----------
        sources : path, sequence of paths, or DataArray
            Many rasters are one mosaic; where they overlap, the first that has a valid pixel wins. Anything
            that GDAL opens may be named. A DataArray wants rioxarray's `.rio`.
        band : int, optional
            The band to use, counted from 1.
        rgb : three ints, optional
            The bands of red, green and blue, to use their luminance.
        nodata : float, optional
            Takes the place of the nodata value in the files; NaN is allowed.
        skip_bad_tiles : bool
            Whether pixels of blocks of a file that cannot be read count as nodata, instead of being an error;
            see `raster.skipping` for which those are.

        Raises
        ------
        RasterReadError
            If a file cannot be opened.
        RasterError
            If a raster is of a kind that cannot be answered rightly.
        MosaicError
            If rasters do not fit together.
        ParameterError
            If a band is not there.
        """
        files = [
            from_array(source) if is_array(source) else inspect_file(source) for source in _listed(sources)
        ]
        mosaic = align_rasters(files)
        first = files[0]
        choice = choose_bands(first.layout, band, rgb, first.palette is not None)
        known, told = _with_nodata(mosaic.files, choice, nodata)
        if choice.expanded:
            told = (
                *told,
                "the palette is expanded to luminance; name --band 1 to use its indices themselves",
            )
        return cls(replace(mosaic, files=known), choice, told, skip_bad_tiles)

    @classmethod
    def of_values(cls, values: Values, geobox: GeoBox, name: str) -> "Dataset":
        """A dataset of numbers in memory, (rows, cols); it looks at the array and does not copy it."""
        source = from_values(values, geobox, name)
        return cls(align_rasters([source]), choose_bands(source.layout), ())

    @property
    def geobox(self) -> GeoBox:
        """Where the pixels lie."""
        return self.mosaic.geobox

    @property
    def dtype(self) -> np.dtype[np.generic]:
        """Type of the values that are read."""
        return self.choice.dtype

    @property
    def bits(self) -> int:
        """Bits of a value that are used."""
        return self.choice.bits

    @property
    def bands(self) -> tuple[int, ...]:
        """The bands that are used, counted from 1."""
        return self.choice.bands

    @property
    def band_names(self) -> str:
        """The bands that are used, for people."""
        return self.choice.name

    @property
    def file_block(self) -> tuple[int, int]:
        """Rows and columns of one block of the first file."""
        return self.mosaic.files[0].block

    @property
    def paths(self) -> tuple[str, ...]:
        """The files, in the order given."""
        return tuple(file.path for file in self.mosaic.files)

    @property
    def source(self) -> str:
        """Name of the first raster, without folder."""
        return self.mosaic.files[0].name

    def fingerprint(self) -> tuple[object, ...]:
        """What everything read from here depends on: the files as they are now, and how they are read."""
        files = tuple(file.fingerprint() for file in self.mosaic.files)
        return files, self.mosaic.boxes, self.choice, self.skip_bad_tiles

    def is_empty(self, window: Window) -> bool:
        """Whether it is known without decoding that no pixel of `window` is valid."""
        return all(
            file.is_empty(self._handles, self.choice, part) for file, part, _ in self.mosaic.parts(window)
        )

    def read(self, window: Window) -> tuple[Values, Valid | None]:
        """Values and validity of a window inside the raster.

        Returns
        -------
        values : (1 or 3, rows, cols) array of `dtype`
            What invalid pixels hold is of no meaning.
        valid : (rows, cols) bool array, or None if every pixel is valid

        Raises
        ------
        RasterReadError
            If a file is damaged there, and `skip_bad_tiles` is false.
        """
        if len(self.mosaic.files) == 1:
            [file], shape = self.mosaic.files, (window.rows, window.cols)
            values, valid, bad = self._read_part(file, window, shape)
            for block, _ in bad:
                record_bad_block(block)
            return values, valid
        return self._fill((window.rows, window.cols), self.mosaic.parts(window))

    def read_coarse(self, max_side: int) -> tuple[Values, Valid | None, GeoBox]:
        """A reduced picture of the whole, for the eye: nearest pixels, from overviews where there are some.

        Parameters
        ----------
        max_side : int
            Neither rows nor columns are more than this.

        Returns
        -------
        values, valid
            As `read` gives them.
        geobox : GeoBox
            Where the reduced pixels lie; together they cover what the dataset covers.
        """
        rows, cols = self.geobox.shape
        factor = max(rows, cols, max_side) / max_side
        shape = (max(int(rows / factor), 1), max(int(cols / factor), 1))
        transform = scaled(self.geobox.transform, rows / shape[0], cols / shape[1])
        values, valid = self._fill(shape, self.mosaic.coarse_parts(shape))
        return values, valid, GeoBox(shape, transform, self.geobox.crs)

    def describe(self) -> dict[str, Any]:
        """Facts about the files, for people: plain words and numbers by name."""
        first, box = self.mosaic.files[0], self.geobox
        return {
            "files": len(self.mosaic.files),
            "driver": first.driver,
            "rows": box.shape[0],
            "cols": box.shape[1],
            "bands": len(first.layout.dtypes),
            "dtypes": first.layout.dtypes,
            "bits": first.layout.bits,
            "colors": first.layout.roles,
            "used": self.band_names,
            "nodata": first.nodatas[self.bands[0] - 1],
            "block": first.block,
            "overviews": first.overviews,
            "crs": None if box.crs is None else str(box.crs.to_string()),
        }

    def _fill(self, shape: tuple[int, int], parts: Iterable[Part]) -> tuple[Values, Valid | None]:
        """The parts put together; the first that is valid wins."""
        values = np.zeros((self.choice.planes, *shape), self.dtype)
        filled = np.zeros(shape, bool)
        for file, part, (rows, cols) in parts:
            missing = ~filled[rows, cols]
            if not missing.any():
                continue
            pixels, valid, bad = self._read_part(file, part, missing.shape)
            for block, place in bad:
                if missing[place].any():  # no file before it has these pixels
                    record_bad_block(block)
            if valid is not None:
                missing &= valid
            np.copyto(values[:, rows, cols], pixels, where=missing)
            filled[rows, cols] |= missing
        return values, None if filled.all() else filled

    def _read_part(
        self, file: RasterSource, part: Window, shape: tuple[int, int]
    ) -> tuple[Values, Valid | None, Sequence[MissingPart]]:
        """Values and validity of a part of a file, and what of it cannot be read."""
        if file.is_empty(self._handles, self.choice, part):
            return np.zeros((self.choice.planes, *shape), self.dtype), np.zeros(shape, bool), ()
        if not isinstance(file, RasterFile):
            return *file.read(self._handles, self.choice, part, shape), ()
        if self.skip_bad_tiles:
            return read_skipping_bad_blocks(file, self._handles, self.choice, part, shape)
        return *read_naming_bad_block(file, self._handles, self.choice, part, shape), ()


def _listed(sources: Any) -> list[Any]:
    """The sources one by one; a lone one is a list of one."""
    if isinstance(sources, str | os.PathLike) or is_array(sources):
        return [sources]
    if not sources:
        raise ParameterError("there is no raster to open; name at least one")
    return list(sources)


def _with_nodata(
    files: Sequence[RasterSource], choice: BandChoice, nodata: float | None
) -> tuple[tuple[RasterSource, ...], tuple[str, ...]]:
    """The files with the nodata values that count, and everything there is to tell."""
    known: list[RasterSource] = []
    told: list[str] = []
    for file in files:
        told += file.warnings
        values = list(file.nodatas)
        for band in choice.bands:
            wanted = values[band - 1] if nodata is None else nodata
            values[band - 1], warning = usable_nodata(wanted, np.dtype(file.layout.dtypes[band - 1]))
            if warning:
                told.append(f"{file.name}: {warning}")
        known.append(replace(file, nodatas=tuple(values)))
    return tuple(known), tuple(dict.fromkeys(told))


def windows_of(dataset: Dataset, tile: int | None) -> list[Window]:
    """The tiles of a dataset, in the order of reading: squares of this side, else what suits its files."""
    shape = dataset.geobox.shape
    return in_panels(tiles(shape, tile_side(shape, dataset.file_block) if tile is None else tile))
