"""Dataset: one raster or a mosaic, with windowed reads that are thread-safe and picklable."""

import os
import threading
from collections.abc import Sequence
from dataclasses import field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.io import DatasetReader, MemoryFile
from rasterio.vrt import WarpedVRT

from uavseg.arguments import checked
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterReadError
from uavseg.plain_text import shown
from uavseg.raster.access.opening import OpenFiles
from uavseg.raster.grid.geobox import GeoBox, scaled
from uavseg.raster.grid.tiling import PixelMask, Window, in_panels, sample_positions, tile_side, tiles
from uavseg.raster.read.array_source import ArraySource, from_array, from_values, is_array_like
from uavseg.raster.read.data_array import from_data_array, is_data_array
from uavseg.raster.read.inspect_file import inspect_file, inspect_open
from uavseg.raster.read.mosaic import Mosaic, PartReader, RasterSource, align_rasters, warp_notes, with_nodata
from uavseg.raster.read.raster_file import RasterFile, check_names_agree, check_reflectance, choose
from uavseg.raster.spectral.band_names import renamed
from uavseg.raster.spectral.bands import BandChoice, BandScale, Valid, Values, choose_bands, without
from uavseg.raster.spectral.formula import BandWords


class Handle(OpenFiles):
    """An open raster in the place of a pool of open files; one thread at a time reads it."""

    def __init__(self, source: DatasetReader) -> None:
        super().__init__()
        self.source = source
        self.lock = threading.Lock()

    def open(self, path: str, _located: bool, _driver: str | None = None, _masks: str = "") -> DatasetReader:
        """Return the raster; RasterReadError if it was closed."""
        if self.source.closed:
            raise RasterReadError(f"{path} was closed; keep it open, or give its path")
        return self.source

    def close(self, _path: str) -> None:
        """Do nothing: it belongs to whoever opened it."""


@dataclass(frozen=True, slots=True)
class OpenRaster(RasterFile):
    """Metadata of an open raster, and its handle."""

    handle: Handle | None = None

    def __getstate__(self) -> list[Any]:
        raise ParameterError(f"{self.path} is an open raster, which no other process can read; give its path")

    def fingerprint(self) -> Any:
        """Raise ParameterError: what is open cannot be recognised in another run."""
        raise ParameterError(
            f"{self.path} is open, and cannot be checked for changes; to resume, give its path"
        )

    def read(
        self, _handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int] | None = None
    ) -> tuple[Values, Valid | None]:
        """As of `RasterFile`."""
        assert self.handle is not None, "given when it is made"
        with self.handle.lock:
            return RasterFile.read(self, self.handle, choice, window, shape)


def is_open_raster(source: object) -> bool:
    """Return whether a source is a raster that is open in rasterio."""
    kinds = rasterio.DatasetReader | WarpedVRT | MemoryFile
    return isinstance(source, kinds) or hasattr(source, "block_shapes")


def from_open_raster(source: Any) -> RasterFile:
    """Return the file that an open raster names, where that is the same raster; else the raster itself.

    A ParameterError says that it is closed, or open for writing; other errors are those of `inspect_file`.
    """
    if isinstance(source, MemoryFile):
        raise ParameterError("a MemoryFile is no raster yet; open it, and give what its open() returns")
    if source.closed:
        raise ParameterError(f"{source.name} is closed; give its path, or a raster that is open")
    if source.mode != "r":
        raise ParameterError(f"{source.name} is open for writing; close it, and give its path")
    found = inspect_open(source)
    if not isinstance(source, WarpedVRT) and Path(source.name).is_file():
        named = inspect_file(source.name)
        same = ("shape", "transform", "crs", "layout", "nodatas", "masks", "palette", "scales")
        if all(getattr(named, one) == getattr(found, one) for one in same):
            return named
    values = {one.name: getattr(found, one.name) for one in fields(found)} | {"driver": "rasterio"}
    return OpenRaster(**values, handle=Handle(source))


_NO_SCALE = (
    "its bands or files have different scales, offsets or units: stored numbers are compared as they are"
)


@dataclass(frozen=True, eq=False)
class Dataset:
    """Windowed reads of the intensity bands of one raster or of a mosaic.

    It holds paths and metadata, never pixels; each thread opens files when it first reads them. So it can be
    pickled, and read by many threads at once.

    Examples
    --------
    >>> dataset = Dataset.open("tile.tif")  # doctest: +SKIP
    >>> values, valid = dataset.read(Window(0, 0, 64, 64))  # doctest: +SKIP
    """

    mosaic: Mosaic
    choice: BandChoice
    warnings: tuple[str, ...]
    skip_bad_tiles: bool = False
    local_metres: bool = False  # without a CRS, coordinates are known to be metres
    collar: PixelMask | None = None  # pixels that count as nodata, see `raster.collar.find`
    outside: PixelMask | None = None  # pixels that count as nodata too: those beyond an area of interest
    nodata: float | str | None = None  # as it was named, for bands that are read by themselves
    _handles: OpenFiles = field(default_factory=OpenFiles, repr=False)

    @classmethod
    @checked
    def open(
        cls,
        sources: Any,
        band: int | str | None = None,
        rgb: Sequence[int | str] | None = None,
        nodata: float | str | None = None,
        skip_bad_tiles: bool = False,
        words: BandWords = BandWords(),
        warp: bool | None = False,
    ) -> "Dataset":
        """Open rasters as a dataset; no pixel is read.

        Parameters
        ----------
        sources : path, array, DataArray, open raster of rasterio, or sequence of these
            Several rasters make one mosaic; where they overlap, the first with a valid pixel wins. A path is
            anything that GDAL opens. A DataArray needs rioxarray. An array is (rows, cols), or has at most 16
            bands first or last; it has no place on the map, and is no part of a mosaic.
        band, rgb, skip_bad_tiles, warp
            As of `uavseg.extract`; with None for `warp`, errors do not propose it.
        nodata : float or str, optional
            A value that counts for nothing beside the nodata value of the files, NaN too; "only:V" takes its
            place, "none" leaves it out.
        words : BandWords
            An index or an expression to use in place of a band, and names for the bands.

        Raises
        ------
        RasterReadError
            If a file cannot be opened.
        RasterError
            If a raster is of an unsupported kind.
        MosaicError
            If the rasters do not fit together.
        ParameterError
            If a band does not exist, or an index or expression does not fit the bands.
        """
        files = [_inspected(source) for source in _listed(sources)]
        for file in files if len(files) > 1 else ():
            if isinstance(file, ArraySource) and not file.placed:
                raise ParameterError(
                    f"{file.name} does not say where it lies, so it is no part of a mosaic; give DataArrays "
                    "with coordinates, or files, or one array"
                )
        files = [replace(file, layout=renamed(file.layout, words.names)) for file in files]
        mosaic = align_rasters(files, warp)
        first = files[0]
        choice = choose(first.layout, band, rgb, words, first.palette is not None)
        check_names_agree(files, choice.bands)
        check_reflectance(files, choice)
        files_with_nodata, warnings = with_nodata(mosaic.files, choice, nodata)
        if choice.expanded:
            note = "the palette is expanded to luminance; name --band 1 to use its indices themselves"
            warnings = (*warnings, note)
        warnings = (*warnings, *warp_notes(mosaic))
        found = cls(replace(mosaic, files=files_with_nodata), choice, warnings, skip_bad_tiles, nodata=nodata)
        return found if found.scale is not None else replace(found, warnings=(*warnings, _NO_SCALE))

    @classmethod
    @checked
    def of_values(cls, values: Values, geobox: GeoBox, name: str, local_metres: bool = False) -> "Dataset":
        """Return a dataset of a (rows, cols) array in memory, which is not copied.

        With `local_metres`, its coordinates are metres without a CRS.
        """
        source = from_values(values, geobox, name)
        return cls(align_rasters([source]), choose_bands(source.layout), (), local_metres=local_metres)

    @checked
    def of_band(self, band: int | str, nodata: float | str | None = None) -> "Dataset":
        """Return the raster with one band, by default with its nodata; ParameterError if it has no such."""
        choice = choose(self.mosaic.files[0].layout, band, None, BandWords())
        check_names_agree(self.mosaic.files, choice.bands)
        files, warnings = with_nodata(self.mosaic.files, choice, self.nodata if nodata is None else nodata)
        return replace(self, mosaic=replace(self.mosaic, files=files), choice=choice, warnings=warnings)

    @property
    def in_metres(self) -> bool:
        """Whether lengths are metres (on the ground, where there is a CRS) rather than units of the map."""
        return self.local_metres or self.geobox.crs is not None

    @property
    def geobox(self) -> GeoBox:
        """The grid of the pixels."""
        return self.mosaic.geobox

    @property
    def dtype(self) -> np.dtype[np.generic]:
        """Type of the values that are read."""
        return self.choice.dtype if self.choice.formula is None else np.dtype(np.float32)

    @property
    def bits(self) -> int:
        """Number of bits of a value that are used."""
        return self.choice.bits if self.choice.formula is None else 32

    @property
    def limits(self) -> tuple[float, float] | None:
        """Between which all values lie, where a formula says it."""
        return None if self.choice.formula is None else self.choice.formula.limits

    @property
    def bands(self) -> tuple[int, ...]:
        """The bands that are used, counted from 1."""
        return self.choice.bands

    @property
    def band_names(self) -> str:
        """Description of the bands that are used, for messages."""
        return self.choice.name

    @property
    def scale(self) -> BandScale | None:
        """Scale, offset and unit of the bands that are used; None if bands or files have different ones."""
        if self.choice.expanded or self.choice.formula is not None:
            return BandScale()  # brightness of colours, or the value of the formula
        found = {file.scale_of(band, self.bits) for file in self.mosaic.files for band in self.bands}
        return found.pop() if len(found) == 1 else None

    @property
    def file_block(self) -> tuple[int, int]:
        """Rows and columns of one block of the first file."""
        return self.mosaic.files[0].block

    @checked
    def windows(self, tile: int | None = None) -> list[Window]:
        """Return the tiles in reading order: squares of this side in pixels, or a size that suits the files.

        A ParameterError says that the side is not a positive multiple of 64.
        """
        shape = self.geobox.shape
        return in_panels(tiles(shape, tile_side(shape, self.file_block) if tile is None else tile))

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the files, in the order given."""
        return tuple(file.path for file in self.mosaic.files)

    @property
    def source(self) -> str:
        """File name of the first raster."""
        return self.mosaic.files[0].name

    @property
    def masks(self) -> list[PixelMask]:
        """Pixels that count as nodata, whatever the files say: the collar, and what is beyond an area."""
        return [mask for mask in (self.collar, self.outside) if mask is not None]

    @property
    def _parts(self) -> PartReader:
        return PartReader(self.choice, self._handles, self.skip_bad_tiles)

    def without_formula(self) -> "Dataset":
        """Return the same raster with the stored values of its bands, not what a formula makes of them."""
        return replace(self, choice=replace(self.choice, formula=None))

    def fingerprint(self) -> tuple[object, ...]:
        """Content hash input: the files as they are now, and the options for reading them."""
        files = tuple(file.fingerprint() for file in self.mosaic.files)
        layout = self.mosaic.files[0].layout
        place = self.mosaic.boxes, self.mosaic.geobox.shape, self.collar, self.outside
        return files, *place, self.choice, layout, self.skip_bad_tiles

    @checked
    def is_empty(self, window: Window) -> bool:
        """Return whether no pixel of `window` is valid, as far as is known without decoding."""
        if any(mask.covers(window) for mask in self.masks):
            return True
        return all(
            warp is None and file.is_empty(self._handles, self.choice, part)
            for file, warp, part, _ in self.mosaic.parts(window)
        )

    @checked
    def read(self, window: Window) -> tuple[Values, Valid | None]:
        """Return values and validity of a window inside the raster.

        Returns
        -------
        values : (1 or 3, rows, cols) array of `dtype`
            Intensity or the value of a formula, or red, green and blue. Arbitrary where a pixel is invalid.
        valid : (rows, cols) bool array, or None if every pixel is valid

        Raises
        ------
        RasterReadError
            If a file is damaged inside the window, and `skip_bad_tiles` is false.
        """
        if len(self.mosaic.files) == 1:
            row, col = self.mosaic.boxes[0, :2].tolist()
            part = replace(window, row=window.row - row, col=window.col - col)
            values, valid = self._parts.read(self.mosaic.files[0], part)
        else:
            shape = (window.rows, window.cols)
            values, valid = self._parts.merge(shape, self.mosaic.parts(window), self.dtype)
        for mask in self.masks:
            if mask.touches(window):
                valid = without(valid, mask.read(window))
        return values, valid

    @checked
    def read_coarse(self, max_side: int) -> tuple[Values, Valid | None, GeoBox]:
        """Downsampled read of the whole for display: nearest pixels, from overviews where there are any.

        Parameters
        ----------
        max_side : int
            Maximum of rows and of columns.

        Returns
        -------
        values, valid
            As of `read`.
        geobox : GeoBox
            The grid of the reduced pixels; its extent is that of the dataset.
        """
        if max_side < 1:
            raise ParameterError(f"max_side is at least 1, not {max_side}")
        rows, cols = self.geobox.shape
        factor = max(rows, cols, max_side) / max_side
        shape = (max(int(rows / factor), 1), max(int(cols / factor), 1))
        transform = scaled(self.geobox.transform, rows / shape[0], cols / shape[1])
        values, valid = self._parts.merge(shape, self.mosaic.coarse_parts(shape), self.dtype)
        sampled = sample_positions(0, rows, shape[0]), sample_positions(0, cols, shape[1])
        for mask in self.masks:
            valid = without(valid, mask.sample(*sampled))
        return values, valid, GeoBox(shape, transform, self.geobox.crs)


def is_pixels(source: object) -> bool:
    """Return whether a source is itself an array of pixels or an open raster, not a name or a list."""
    return is_data_array(source) or is_array_like(source) or is_open_raster(source)


def _inspected(source: Any) -> RasterSource:
    if isinstance(source, RasterFile):
        return source
    if isinstance(source, str | os.PathLike):
        return inspect_file(source)
    if is_open_raster(source):
        return from_open_raster(source)
    return from_data_array(source) if is_data_array(source) else from_array(source)


def _listed(sources: Any) -> list[Any]:
    if isinstance(sources, str | os.PathLike) or is_pixels(sources):
        return [sources]
    if not isinstance(sources, Sequence) or isinstance(sources, bytes):
        raise ParameterError(
            f"sources is a path, an array, an open raster or a list of these, not {shown(sources)}"
        )
    if not sources:
        raise ParameterError("there is no raster to open; give at least one")
    for source in sources:
        if not (isinstance(source, str | os.PathLike | RasterFile) or is_pixels(source)):
            raise ParameterError(f"a source is a path, an array or an open raster, not {shown(source)}")
    return list(sources)


@dataclass(frozen=True, eq=False)
class DatasetOverview(Dataset):
    """A downsampled dataset in memory, with the interface of `Dataset`."""

    values: NDArray[Any] = field(kw_only=True)  # (1 or 3, rows, cols)
    valid: NDArray[np.bool_] | None = field(kw_only=True)  # (rows, cols)
    grid: GeoBox = field(kw_only=True)
    whole: Dataset = field(kw_only=True)  # what it is downsampled from

    @classmethod
    def of(cls, dataset: Dataset, max_side: int) -> "DatasetOverview":
        """Return a dataset downsampled to at most `max_side` rows and columns; it is never read whole."""
        values, valid, grid = dataset.read_coarse(max_side)
        unchanged = (dataset.mosaic, dataset.choice, dataset.warnings)
        return cls(*unchanged, values=values, valid=valid, grid=grid, whole=dataset)

    @property
    def geobox(self) -> GeoBox:
        """The grid of the downsampled pixels; its extent is that of the dataset."""
        return self.grid

    def without_formula(self) -> Dataset:
        """Return the same pixels with the stored values of the bands, for which they are read again."""
        if self.choice.formula is None:
            return self
        return DatasetOverview.of(self.whole.without_formula(), max(self.grid.shape))

    def is_empty(self, window: Window) -> bool:
        """Return whether no downsampled pixel of `window` is valid."""
        _, valid = self.read(window)
        return valid is not None and not valid.any()

    def read(self, window: Window) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        """Return values and validity of a window of downsampled pixels."""
        rows, cols = window.slices
        valid = None if self.valid is None else self.valid[rows, cols]
        if self.collar is not None:
            valid = without(valid, self.collar.read(window))
        return self.values[:, rows, cols], valid


def stacked(
    dataset: Dataset, bands: Sequence[int | str], nodata: float | str | None = None
) -> Dataset | None:
    """Return the same raster with the values of several bands; None if they are of several types."""
    files = dataset.mosaic.files
    choices = [choose(files[0].layout, band, None, BandWords()) for band in bands]
    if len({one.dtype for one in choices}) > 1:
        return None
    choice = replace(choices[0], bands=tuple(one.bands[0] for one in choices), stacked=True)
    check_names_agree(files, choice.bands)
    return replace(
        dataset, mosaic=replace(dataset.mosaic, files=with_nodata(files, choice, nodata)[0]), choice=choice
    )
