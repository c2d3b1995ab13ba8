"""Arrays as raster sources: numpy's, masked or not, and what can be sliced like them, read by window."""

from typing import Any

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterReadError, UavsegError
from uavseg.plain_text import cause_of
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, sample_positions
from uavseg.raster.spectral.bands import BandChoice, BandLayout, BandScale, Valid, Values, valid_pixels

MAX_BANDS = 16  # of a plain array: a longer first or last axis is one of pixels
_ALPHA_LAST = (2, 4)  # bands of a picture with transparency


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RasterMetadata:
    """What is known of a raster source without its pixels."""

    path: str
    shape: tuple[int, int]
    transform: Affine  # the identity if it is not georeferenced
    crs: CRS | None
    located: bool = True
    layout: BandLayout
    nodatas: tuple[float | None, ...]  # the nodata value of each band
    block: tuple[int, int] = (512, 512)  # rows and columns of one block of the source
    palette: tuple[tuple[int, int, int, int], ...] | None = None
    driver: str = "array"
    overviews: tuple[int, ...] = ()  # downsampling factors of the overviews in the file
    warnings: tuple[str, ...] = ()
    scales: tuple[BandScale, ...] = ()  # the scale, offset and unit of each band
    added_nodata: float | None = None  # another one, of all bands that are read


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ArraySource(RasterMetadata):
    """A raster source backed by an array."""

    array: Any  # (rows, cols) or (bands, rows, cols); what is masked in a masked array is invalid
    placed: bool = True  # whether it says where it lies, which parts of a mosaic have to

    @property
    def name(self) -> str:
        """The name of the array."""
        return self.path

    def scale_of(self, band: int, _bits: int) -> BandScale:
        """Return the scale of the numbers of a band, counted from 1."""
        return self.scales[band - 1] if self.scales else BandScale()

    def fingerprint(self) -> object:
        """Raise ParameterError: an array in memory cannot be recognised in another run."""
        raise ParameterError(
            f"{self.name} is an array, which cannot be checked for changes; to resume, give the file that it "
            "comes from"
        )

    def read(
        self, _handles: object, choice: BandChoice, window: Window, shape: tuple[int, int] | None = None
    ) -> tuple[Values, Valid | None]:
        """Return pixels of the chosen bands, and which of them are valid (None: all); see `RasterFile.read`.

        As in files with masks, a pixel is invalid where any band that is read is masked. A RasterReadError
        says that what computes the array, or reads it from a file, fails.
        """
        rows = _index(window.row, window.rows, shape[0] if shape else window.rows)
        cols = _index(window.col, window.cols, shape[1] if shape else window.cols)
        alpha = self.layout.alpha
        numbers = choice.bands if alpha is None else (*choice.bands, alpha)
        planes = [self._read_plane(band, rows, cols) for band in numbers]
        hidden = [np.ma.getmask(plane) for plane in planes]
        values = np.stack([np.ma.getdata(plane) for plane in planes[: len(choice.bands)]])
        mask = None
        if any(one is not np.ma.nomask for one in hidden):
            mask = ~np.logical_or.reduce(hidden)
        nodatas = [self.nodatas[band - 1] for band in choice.bands]
        transparency = None if alpha is None else np.ma.getdata(planes[-1])
        values = values.astype(choice.dtype, copy=False)
        return values, valid_pixels(values, nodatas, transparency, mask, choice.by_band, self.added_nodata)

    def is_empty(self, _handles: object, _choice: BandChoice, _window: Window) -> bool:
        """Return False: it is not known without reading."""
        return False

    def _read_plane(self, band: int, rows: Any, cols: Any) -> Values:
        plane = self.array if self.array.ndim == 2 else self.array[band - 1]
        if isinstance(plane, np.ndarray):
            part: Values = plane[rows][:, cols]  # both at once would pair positions
            return part
        try:
            if isinstance(rows, slice) and isinstance(cols, slice):
                return np.asarray(plane[rows, cols])
            return np.asarray(plane[rows][:, cols])
        except (UavsegError, MemoryError):
            raise
        except Exception as error:  # a lazy array computes whatever its maker wrote
            raise RasterReadError(f"{self.name} cannot be read ({cause_of(error)})") from error


def is_array_like(source: object) -> bool:
    """Return whether numpy makes an array of pixels of a source: a list and a column of a table are none."""
    return isinstance(source, np.ndarray) or (
        hasattr(type(source), "__array__") and getattr(source, "ndim", 2) != 1
    )


def from_array(array: Any) -> ArraySource:
    """Return a source of an array without a place: (rows, cols), or with bands first or last.

    A ParameterError says that it holds no pixels or no numbers, or not which axis is that of its bands.

    Examples
    --------
    >>> picture = np.zeros((100, 120, 3), np.uint8)
    >>> from_array(picture).shape, from_array(picture.transpose(2, 0, 1)).shape
    ((100, 120), (100, 120))
    """
    if not (isinstance(array, np.ma.MaskedArray) or _slices_like_numpy(array)):
        array = np.asarray(array)  # also what numpy's own subclasses make of indices
    shape = tuple(array.shape)
    check_pixels(array, "array")
    warnings: tuple[str, ...] = ()
    roles = ["undefined"]
    if len(shape) == 3:
        bands_last = _bands_are_last(shape)
        if bands_last:
            array = (array if hasattr(array, "transpose") else np.asarray(array)).transpose(2, 0, 1)
        roles = ["undefined"] * array.shape[0]
        if array.dtype == np.uint8 and len(roles) in _ALPHA_LAST:
            if bands_last:
                roles[-1] = "alpha"
            warnings = (alpha_note("array", len(roles), bands_last),)
    elif len(shape) != 2:
        raise ParameterError(
            f"expected an array of (rows, cols) or (bands, rows, cols), got {array.dtype} of shape {shape}"
        )
    rows, cols = array.shape[-2:]
    return ArraySource(
        array=array,
        path="array",
        shape=(int(rows), int(cols)),
        transform=Affine.identity(),
        crs=None,
        layout=layout_of(array.dtype, tuple(roles)),
        nodatas=(None,) * len(roles),
        warnings=warnings,
        placed=False,
    )


def check_pixels(array: Any, name: str) -> None:
    """Refuse an array without pixels, or of what are no numbers of a raster (ParameterError)."""
    dtype = np.dtype(array.dtype)
    got = f"got {dtype} of shape {tuple(array.shape)}"
    if 0 in array.shape:
        raise ParameterError(f"{name} has no pixels: expected at least one row and one column, {got}")
    if dtype.kind == "c":
        raise ParameterError(f"{name} holds complex numbers, {got}; take their magnitude (np.abs) first")
    if dtype.kind not in "biuf" or dtype.itemsize > 8:
        raise ParameterError(
            f"{name} holds no numbers of a raster: expected integers or floats of at most 64 bits, {got}; "
            "convert it first, for instance with .astype('float32')"
        )


def alpha_note(name: str, count: int, taken: bool) -> str:
    """Return what is said of the last of two or four bands of bytes, which may be transparency."""
    if taken:
        return (
            f"{name}: band {count} is taken for alpha, as of a picture: pixels where it is 0 are left out; "
            "give bands first (np.moveaxis) where it is not"
        )
    return (
        f"{name}: it does not say whether band {count} is alpha, so transparent pixels count; where it is, "
        "mask them (np.ma, nodata) or give the file"
    )


def layout_of(dtype: Any, roles: tuple[str, ...], names: tuple[str, ...] = ()) -> BandLayout:
    """Return the layout of bands of one type; a bool is an integer of one bit."""
    is_bool = np.dtype(dtype).kind == "b"
    kind = np.dtype(np.uint8 if is_bool else dtype)
    bits = 1 if is_bool else kind.itemsize * 8
    return BandLayout((kind.name,) * len(roles), roles, (bits,) * len(roles), names)


def from_values(values: Values, geobox: GeoBox, name: str) -> ArraySource:
    """Return a source of a (rows, cols) array, not copied; ParameterError if not numbers on the grid."""
    if values.shape != geobox.shape or values.dtype.kind not in "iuf":
        raise ParameterError(
            f"values are numbers of shape {geobox.shape}, as their grid, not {values.dtype} of {values.shape}"
        )
    return ArraySource(
        array=values,
        path=name,
        shape=geobox.shape,
        transform=geobox.transform,
        crs=geobox.crs,
        layout=layout_of(values.dtype, ("undefined",)),
        nodatas=(None,),
    )


def _bands_are_last(shape: tuple[int, ...]) -> bool:
    """Return whether the last of three axes, and not the first, is short enough for that of the bands."""
    first, last = shape[0] <= MAX_BANDS, shape[2] <= MAX_BANDS
    if first != last:
        return last
    raise ParameterError(
        f"an array of shape {shape} does not say whether its bands come first or last: expected the first or "
        f"the last axis, and not both, to have at most {MAX_BANDS} bands; give a DataArray with the "
        "dimensions band, y and x, or one band as (rows, cols)"
    )


def _slices_like_numpy(array: Any) -> bool:
    """Return whether an array that is not numpy's can be read by window: that of dask, zarr or h5py."""
    if isinstance(array, np.ndarray):
        return False
    names = ("shape", "dtype", "ndim", "__getitem__")
    return all(hasattr(array, name) for name in names) and isinstance(array.dtype, np.dtype)


def _index(start: int, length: int, count: int) -> Any:
    """Return index of a range of rows or columns: a slice, or even positions where it is downsampled."""
    return slice(start, start + length) if count == length else sample_positions(start, length, count)
