"""Arrays as raster sources: arrays in memory, or a DataArray with `.rio`, read by slices to keep it lazy."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from uavseg.errors import ParameterError, RasterError
from uavseg.raster.bands import BandChoice, BandLayout, Valid, Values, valid_pixels
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tiling import Window, sample_positions
from uavseg.raster.value_scale import AS_STORED, BandScale


@dataclass(frozen=True, slots=True, eq=False)
class ArraySource:
    """A raster source backed by an array; the attributes are those of `RasterFile`."""

    array: Any
    path: str
    shape: tuple[int, int]
    transform: Affine
    crs: CRS | None
    located: bool
    layout: BandLayout
    nodatas: tuple[float | None, ...]
    block: tuple[int, int]
    warnings: tuple[str, ...]
    palette: None = None
    driver: str = "DataArray"
    overviews: tuple[int, ...] = ()
    scale: BandScale = AS_STORED
    added_nodata: float | None = None

    @property
    def name(self) -> str:
        """The name of the array."""
        return self.path

    def scale_of(self, _band: int, _bits: int) -> BandScale:
        """The scale of its numbers."""
        return self.scale

    def fingerprint(self) -> object:
        """Refused: an array in memory cannot be recognised in another run.

        Raises
        ------
        ParameterError
            Always.
        """
        raise ParameterError(
            f"{self.name} is an array, which cannot be checked for changes; to resume, give the file that it "
            "comes from"
        )

    def read(
        self, _handles: object, choice: BandChoice, window: Window, shape: tuple[int, int] | None = None
    ) -> tuple[Values, Valid | None]:
        """Pixels of the chosen bands, and which of them are valid (None: all); see `RasterFile.read`."""
        rows = _index(window.row, window.rows, shape[0] if shape else window.rows)
        cols = _index(window.col, window.cols, shape[1] if shape else window.cols)
        planes = [self._read_plane(band, rows, cols) for band in choice.bands]
        values = np.stack(planes).astype(choice.dtype, copy=False)
        nodatas = [self.nodatas[band - 1] for band in choice.bands]
        by_band = choice.formula is not None
        return values, valid_pixels(values, nodatas, None, None, by_band, self.added_nodata)

    def is_empty(self, _handles: object, _choice: BandChoice, _window: Window) -> bool:
        """False: it is not known without reading."""
        return False

    def _read_plane(self, band: int, rows: Any, cols: Any) -> Values:
        plane = self.array if self.array.ndim == 2 else self.array[band - 1]
        if isinstance(rows, slice) and isinstance(cols, slice):
            return np.asarray(plane[rows, cols])
        return np.asarray(plane[rows][:, cols])  # numpy would pair positions


def is_array(source: object) -> bool:
    """Whether a source is a DataArray with `.rio`."""
    return hasattr(source, "dims") and hasattr(source, "rio")


def from_array(array: Any) -> ArraySource:
    """A source of a DataArray of (rows, cols) or (bands, rows, cols).

    Raises
    ------
    RasterError
        If the array has other dimensions or no pixels.
    """
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise RasterError(
            f"a DataArray must have dimensions (rows, cols) or (bands, rows, cols), not {array.dims} "
            f"of shape {array.shape}"
        )
    dtype = np.dtype(np.uint8) if array.dtype == bool else np.dtype(array.dtype)
    count = 1 if array.ndim == 2 else array.shape[0]
    name = str(getattr(array, "name", None) or "array")
    rows, cols = array.shape[-2:]
    crs = array.rio.crs
    bits = 1 if array.dtype == bool else dtype.itemsize * 8
    return ArraySource(
        array=array,
        path=name,
        shape=(int(rows), int(cols)),
        transform=array.rio.transform(),
        crs=CRS.from_user_input(crs) if crs else None,
        located=True,
        layout=BandLayout(
            (dtype.name,) * count, ("undefined",) * count, (bits,) * count, _names(array, count)
        ),
        nodatas=(array.rio.nodata,) * count,
        block=_chunk(array),
        warnings=() if crs else (f"{name}: it has no coordinate reference system: coordinates are local",),
        scale=_scale(array),
    )


def from_values(values: Values, geobox: GeoBox, name: str) -> ArraySource:
    """A source of a (rows, cols) array, which is neither copied nor changed.

    Raises
    ------
    ParameterError
        If it has not the shape of the grid, or holds no numbers.
    """
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
        located=True,
        layout=BandLayout((values.dtype.name,), ("undefined",), (values.dtype.itemsize * 8,)),
        nodatas=(None,),
        block=(512, 512),
        warnings=(),
        driver="array",
    )


def _names(array: Any, count: int) -> tuple[str, ...]:
    """Names of the bands: rioxarray's `long_name`, or a coordinate of texts; empty if there are none."""
    for names in (getattr(array, "attrs", {}).get("long_name"), _band_coordinate(array)):
        if isinstance(names, tuple | list) and len(names) == count and all(isinstance(n, str) for n in names):
            return tuple(names)
    return ()


def _band_coordinate(array: Any) -> Any:
    coords = getattr(array, "coords", {})
    return coords[array.dims[0]].values.tolist() if array.ndim == 3 and array.dims[0] in coords else None


def _scale(array: Any) -> BandScale:
    """The scale of a DataArray by its attributes (CF conventions)."""
    attributes = getattr(array, "attrs", {})
    names = ("scale_factor", "add_offset", "units")
    return BandScale.of_tags(*(attributes.get(name) for name in names)) or AS_STORED


def _chunk(array: Any) -> tuple[int, int]:
    """Rows and columns of the first chunk; 512 x 512 where the array is in memory."""
    chunks = getattr(array, "chunks", None)
    if not chunks:
        return 512, 512
    return int(chunks[-2][0]), int(chunks[-1][0])


def _index(start: int, length: int, count: int) -> Any:
    """Index of a range of rows or columns: a slice, or evenly spaced positions where it is downsampled."""
    return slice(start, start + length) if count == length else sample_positions(start, length, count)
