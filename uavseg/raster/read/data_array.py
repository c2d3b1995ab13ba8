"""DataArrays of xarray as raster sources: their dimensions, place and nodata, checked against each other.

rioxarray keeps the transform of a file beside the coordinates, where xarray's own operations leave it as it
was. So the coordinates place the pixels, and the transform only where there are none.
"""

import importlib
import sys
from collections.abc import Hashable
from typing import Any

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from uavseg.dataclass import dataclass
from uavseg.errors import MissingLibraryError, RasterError, caused_errors, named_errors
from uavseg.plain_text import cause_of, shown
from uavseg.raster.grid.geobox import check_transform
from uavseg.raster.read.array_source import ArraySource, alpha_note, check_pixels, layout_of
from uavseg.raster.spectral.bands import AS_STORED, BandScale

_FAR = 1 << 16  # pixels from a corner, beyond which a grid that counts from 0 is another
EVENNESS = 0.05  # pixels by which a coordinate may lie off its place on a regular grid
_AXES = (  # names of rows and columns
    *(("y", "x"), ("latitude", "longitude"), ("lat", "lon"), ("northing", "easting")),
    *(("row", "col"), ("row", "column"), ("line", "sample")),
)
_NODATA_NAMES = ("_FillValue", "missing_value", "fill_value", "nodata")


def is_data_array(source: object) -> bool:
    """Return whether a source is a DataArray, or a Dataset or Variable of xarray."""
    is_xarray = type(source).__module__.partition(".")[0] == "xarray"
    return hasattr(source, "dims") and (is_xarray or hasattr(source, "rio"))


def from_data_array(given: Any) -> ArraySource:
    """Return a source of a DataArray, which is not loaded, or of a Dataset that holds a single one.

    Rows and columns are the dimensions y and x (or latitude and longitude, ...) in any order, or the last two
    where names say nothing; of the others, one may be longer than 1, that of the bands. A RasterError says
    that it has other dimensions, that its coordinates are not evenly spaced, or that they contradict its
    transform, a ParameterError that it holds no pixels or no numbers, a MissingLibraryError that rioxarray is
    not installed.
    """
    array = _single(given)
    name = str(getattr(array, "name", None) or "array")
    rio = _rio(array, name)
    original, array, notes = array, _bands_rows_cols(array, rio, name), []
    check_pixels(array, name)
    crs, nodata = _crs(rio, name), _nodata(original, rio, name)
    names = _names(array)
    count = 1 if array.ndim == 2 else array.shape[0]
    if crs is None:
        notes.append(f"{name}: it has no coordinate reference system: coordinates are local")
    if count in (2, 4) and array.dtype == np.uint8 and not names:
        notes.append(alpha_note(name, count, False))
    transform, placed = _transform(array, name, notes)
    scales = _scales(array, count, name, notes)
    chunks = getattr(array, "chunks", None)  # None where it is in memory
    return ArraySource(
        array=array,
        path=name,
        shape=(int(array.shape[-2]), int(array.shape[-1])),
        transform=transform,
        crs=crs,
        layout=layout_of(array.dtype, ("undefined",) * count, names),
        nodatas=(nodata,) * count,
        block=(int(chunks[-2][0]), int(chunks[-1][0])) if chunks else (512, 512),
        warnings=tuple(notes),
        driver="DataArray",
        scales=scales,
        placed=placed,
    )


def _single(given: Any) -> Any:
    """Return a DataArray, or that of a Dataset that holds one with rows and columns."""
    if hasattr(given, "children"):
        raise RasterError("a DataTree holds many arrays; give one of them, such as tree['group']['name']")
    if not hasattr(given, "data_vars"):
        is_array = hasattr(given, "rio") or hasattr(given, "coords")
        return given if is_array else sys.modules["xarray"].DataArray(given)  # a Variable
    places = [place for one in given.data_vars.values() for place in (one.attrs, one.encoding)]
    mappings = {str(place.get("grid_mapping")) for place in places} & set(map(str, given.data_vars))
    dataset = given.set_coords(sorted(mappings))  # where a CRS is kept
    found = [name for name, one in dataset.data_vars.items() if one.ndim >= 2]
    if len(found) != 1:
        names = ", ".join(map(str, found)) or "none"
        raise RasterError(
            f"a Dataset must have one variable with rows and columns, not {len(found)} ({names}); choose "
            'one, such as dataset["NAME"], or make bands of them: dataset.to_dataarray("band")'
        )
    return dataset[found[0]]


def _rio(array: Any, name: str) -> Any:
    if not hasattr(array, "rio"):
        try:
            importlib.import_module("rioxarray")
        except ImportError as error:
            raise MissingLibraryError(
                f"{name} is a DataArray, which needs rioxarray: pip install rioxarray ({error})"
            ) from error
    return array.rio


def _crs(rio: Any, name: str) -> CRS | None:
    unread = f"{name}: its coordinate reference system cannot be read"
    form = '{} ({}); set it again, for instance with array.rio.write_crs("EPSG:32633")'
    with caused_errors(unread, RasterError, Exception, form=form):  # of rioxarray, pyproj and rasterio
        found = rio.crs
        return CRS.from_user_input(found) if found else None


def _nodata(array: Any, rio: Any, name: str) -> float | None:
    """Return the nodata value that its attributes say, or that it is encoded with."""
    encoding, attributes = getattr(array, "encoding", {}), getattr(array, "attrs", {})
    encoded = encoding.get("_FillValue")
    is_scaled = any(name in encoding for name in ("scale_factor", "add_offset", "scales", "offsets"))
    if encoded is not None and not is_scaled:  # of the same numbers; those of a scaled array are others
        return _nodata_for(encoded, array.dtype, "its encoding", name)
    for key in _NODATA_NAMES:
        if attributes.get(key) is not None:
            return _nodata_for(attributes[key], array.dtype, f"its attribute {key}", name)
    try:
        return None if rio.nodata is None else _nodata_for(rio.nodata, array.dtype, "rioxarray", name)
    except (TypeError, ValueError, OverflowError) as error:
        raise RasterError(f"{name}: its nodata value cannot be read ({cause_of(error)})") from error


def _nodata_for(value: Any, dtype: Any, where: str, name: str) -> float:
    """Return a nodata value as the number that pixels of a type hold for it."""
    try:
        if isinstance(value, str | bool):
            raise TypeError
        number = np.asarray(value).reshape(-1)
        if len(number) != 1 or number.dtype.kind not in "iuf":
            raise TypeError
    except (TypeError, ValueError) as error:
        raise RasterError(
            f"{name}: the nodata value that {where} says is not a number: {shown(value)}; delete or correct "
            "it, for instance with array.rio.write_nodata(0)"
        ) from error
    with np.errstate(over="ignore"):
        rounded = np.dtype(dtype).type(number[0]) if np.dtype(dtype).kind == "f" else number[0]
    return rounded.item()  # type: ignore[no-any-return]


def _bands_rows_cols(array: Any, rio: Any, name: str) -> Any:
    """Return the array as (rows, cols) or (bands, rows, cols)."""
    dims = tuple(array.dims)
    if array.ndim < 2 or not all(isinstance(length, int) and length > 0 for length in array.shape):
        raise RasterError(_dimensions_text(array))
    y_dim, x_dim = _spatial_dims(array, rio, dims, name)
    others = [dim for dim in dims if dim not in (y_dim, x_dim)]
    lengths = dict(zip(dims, array.shape, strict=True))
    longer = [dim for dim in others if lengths[dim] != 1]
    if len(longer) > 1:
        raise RasterError(_dimensions_text(array))
    coords = getattr(array, "coords", {})
    is_of_time = any(np.asarray(coords[dim]).dtype.kind in "mM" for dim in longer if dim in coords)
    if is_of_time or any(str(dim).lower() in ("time", "t", "date") for dim in longer):
        raise RasterError(
            f"{name} has {lengths[longer[0]]} times along {longer[0]}, which are no bands; choose one, such "
            f"as array.isel({longer[0]}=0)"
        )
    bands = longer or [dim for dim in others if dim == "band"] or others[:1]
    dropped = {dim: 0 for dim in others if dim not in bands}
    if dropped:
        array = array.isel(dropped)
    order = (*bands, y_dim, x_dim)
    return array if tuple(array.dims) == order else array.transpose(*order)


def _dimensions_text(array: Any) -> str:
    sizes = ", ".join(f"{dim}: {length}" for dim, length in zip(array.dims, array.shape, strict=True))
    return (
        f"a DataArray must have dimensions (rows, cols) or (bands, rows, cols), not ({sizes}); choose one "
        "of the others, such as array.isel(time=0)"
    )


def _spatial_dims(array: Any, rio: Any, dims: tuple[Hashable, ...], name: str) -> tuple[Hashable, Hashable]:
    """Return dimensions of the rows and of the columns."""
    try:
        result = rio.y_dim, rio.x_dim
        if set(result) <= set(dims):
            return result
    except Exception:  # rioxarray knows none
        pass
    by_name = {str(dim).lower(): dim for dim in dims}
    for y_dim, x_dim in _AXES:
        if {y_dim, x_dim} <= set(by_name):
            return by_name[y_dim], by_name[x_dim]
    if any(dim in getattr(array, "coords", {}) for dim in dims[-2:]):
        raise RasterError(
            f"{name}: of the dimensions {', '.join(map(str, dims))} it is not known which are rows and "
            'columns; name them y and x, or say it with array.rio.set_spatial_dims(x_dim="...", y_dim="...")'
        )
    return dims[-2], dims[-1]


@dataclass(frozen=True, slots=True)
class _Axis:
    """Evenly spaced centres of pixels, and by how much their type rounds them; the step of one is None."""

    first: float
    last: float
    count: int
    rounding: float

    @property
    def step(self) -> float | None:
        return (self.last - self.first) / (self.count - 1) if self.count > 1 else None

    def counts_pixels_of(self, corner: float, step: float) -> bool:
        """Return whether these are numbers of the pixels of another grid, not places near its corner."""
        far = abs(self.first - corner) > _FAR * abs(step)
        return self.first in (0, 0.5) and self.step in (1, None) and (far or abs(step) != 1)

    def has_step(self, step: float) -> bool:
        """Return whether pixels of this size have these centres; one pixel has any."""
        return abs(self.first + step * (self.count - 1) - self.last) <= EVENNESS * abs(step)

    def begins(self, corner: float, step: float) -> bool:
        """Return whether the first pixel has this corner."""
        return abs(self.first - step / 2 - corner) <= EVENNESS * abs(step)

    def is_part_of(self, corner: float, step: float) -> bool:
        """Return whether they are whole pixels of another grid, or means of several."""
        ratio = 1.0 if self.step is None else abs(self.step / step)
        return _near_whole(ratio) and round(ratio) >= 1 and _near_whole(2 * (self.first - corner) / step)


def _near_whole(number: float) -> bool:
    return abs(number - round(number)) <= EVENNESS


def _axis(array: Any, dim: Hashable, name: str) -> _Axis | None:
    """Return the coordinates along a dimension, checked; None where it has none."""
    if dim not in getattr(array, "coords", {}):
        return None
    values = np.asarray(array.coords[dim])
    if values.dtype.kind not in "iuf":
        raise RasterError(
            f"{name}: its coordinates {dim} are no numbers but {values.dtype}, so they do not place it; "
            f'expected evenly spaced numbers, or none: array.drop_vars("{dim}")'
        )
    centres = values.astype(np.float64).reshape(-1)
    if not np.isfinite(centres).all():
        raise RasterError(
            f"{name}: {int((~np.isfinite(centres)).sum())} of its {len(centres)} coordinates {dim} are not "
            "finite, so they do not place it; correct them, or leave out these pixels"
        )
    rounding = float(np.spacing(np.abs(values).max())) / 2 if values.dtype.kind == "f" else 0.0
    axis = _Axis(float(centres[0]), float(centres[-1]), len(centres), rounding)
    if axis.step is None:
        return axis
    steps = np.diff(centres)
    if axis.step == 0 or (steps / axis.step <= 0).any():
        raise RasterError(
            f"{name}: its coordinates {dim} neither rise nor fall throughout; sort them (array.sortby), and "
            "leave out those that are there twice"
        )
    off = np.abs(centres - (axis.first + axis.step * np.arange(axis.count)))
    if off.max() > EVENNESS * abs(axis.step):
        raise RasterError(
            f"{name}: its coordinates {dim} are not evenly spaced: steps are {np.abs(steps).min():.6g} to "
            f"{np.abs(steps).max():.6g}; resample it to a regular grid, for instance with array.interp"
        )
    return axis


def _transform(array: Any, name: str, notes: list[str]) -> tuple[Affine, bool]:
    """Return the transform by the coordinates, or that kept beside them, and whether there is a place."""
    y_dim, x_dim = array.dims[-2:]
    x, y = _axis(array, x_dim, name), _axis(array, y_dim, name)
    kept = _kept_transform(array, name)
    if x is None and y is None:
        return _without_axes(array, kept, name), kept is not None
    if kept is None:
        if x is None or y is None:
            there, missing = (x_dim, y_dim) if y is None else (y_dim, x_dim)
            raise RasterError(
                f"{name} has coordinates {there} and none {missing}, so its place is not known; give both"
            )
        across, down = (_step(axis, dim, name, notes) for axis, dim in ((x, x_dim), (y, y_dim)))
    else:
        across, down = _fitting(x, y, kept, name, notes)
    found = Affine(across[1], 0.0, across[0], 0.0, down[1], down[0])
    with named_errors(name, RasterError):
        check_transform(found, (int(array.shape[-2]), int(array.shape[-1])))
    return found, True


def _step(axis: _Axis, dim: Hashable, name: str, notes: list[str]) -> tuple[float, float]:
    """Return first corner and step of the pixels along an axis."""
    if axis.step is None:
        raise RasterError(
            f"{name} has one coordinate {dim} and no transform, so the size of its pixels is not known; "
            "write it with array.rio.write_transform"
        )
    if axis.rounding > EVENNESS * abs(axis.step):
        notes.append(
            f"{name}: its type rounds coordinates {dim} by up to {axis.rounding:.3g}, so it may lie as far "
            "from its place; use float64"
        )
    return axis.first - axis.step / 2, axis.step


def _fitting(
    x: _Axis | None, y: _Axis | None, kept: Affine, name: str, notes: list[str]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return first corner and step along both axes, where a transform is kept too."""
    if (kept.b, kept.d) != (0, 0):
        raise _contradiction(name, "its transform is rotated, and its coordinates are not")
    pairs = (x, (kept.c, kept.a)), (y, (kept.f, kept.e))
    same_steps = all(axis is None or axis.has_step(step) for axis, (_, step) in pairs)
    same = same_steps and all(axis is None or axis.begins(*corner) for axis, corner in pairs)
    single = x is None or y is None or None in (x.step, y.step)
    if single and not (same if x is None or y is None else same_steps):
        raise _contradiction(name, "its coordinates are others than its transform says")
    if not same and all(axis is not None and axis.counts_pixels_of(*corner) for axis, corner in pairs):
        raise _contradiction(name, "its coordinates count pixels, and its transform does not")
    if not all(axis is None or axis.is_part_of(*corner) for axis, corner in pairs):
        notes.append(
            f"{name}: its coordinates say another place than its transform (spatial_ref.GeoTransform): the "
            "coordinates are used"
        )
    return _placed(*pairs[0]), _placed(*pairs[1])


def _placed(axis: _Axis | None, kept: tuple[float, float]) -> tuple[float, float]:
    """Return first corner and step along an axis; the step that is kept, where it fits, is more exact."""
    if axis is None:
        return kept
    step = kept[1] if axis.step is None or axis.has_step(kept[1]) else axis.step
    return axis.first - step / 2, step


def _contradiction(name: str, what: str) -> RasterError:
    return RasterError(
        f"{name}: {what}, so its place is not known; drop its coordinates (array.drop_vars), or its "
        "transform (array.drop_vars of spatial_ref, then array.rio.write_crs)"
    )


def _kept_transform(array: Any, name: str) -> Affine | None:
    """Return the transform that rioxarray keeps beside the coordinates."""
    coords, attributes = getattr(array, "coords", None), getattr(array, "attrs", {})
    try:
        if coords is None:
            return array.rio.transform()
        mapping = array.rio.grid_mapping
        text = coords[mapping].attrs.get("GeoTransform") if mapping in coords else None
        if text is not None:
            kept = Affine.from_gdal(*map(float, str(text).split()))
        elif "transform" in attributes:
            kept = Affine(*map(float, attributes["transform"][:6]))
        else:
            return None
        check_transform(kept, (int(array.shape[-2]), int(array.shape[-1])))
    except (TypeError, ValueError, IndexError) as error:  # also RasterError
        raise RasterError(
            f"{name}: its transform cannot be used ({cause_of(error)}); write it again with "
            "array.rio.write_transform"
        ) from error
    return kept


def _without_axes(array: Any, kept: Affine | None, name: str) -> Affine:
    """Return the transform without coordinates of axes, which rioxarray's xc and yc of pixels may check."""
    coords = getattr(array, "coords", {})
    result = kept or Affine.identity()
    if kept is not None and {"xc", "yc"} <= set(coords):
        rows, cols = array.shape[-2:]
        dims, ends = array.dims[-2:], ([0, rows - 1], [0, cols - 1])
        x, y = (
            coords[one].transpose(*dims).isel(dict(zip(dims, ends, strict=True))).values
            for one in ("xc", "yc")
        )
        there = [[kept * (col + 0.5, row + 0.5) for col in ends[1]] for row in ends[0]]
        off = np.abs(np.array(there) - np.stack([x, y], axis=-1)).max()
        if not off <= EVENNESS * max(abs(kept.a), abs(kept.b), abs(kept.d), abs(kept.e)):
            raise _contradiction(name, "its coordinates xc and yc are others than its transform says")
    return result


def _names(array: Any) -> tuple[str, ...]:
    """Return names of bands: rioxarray's `long_name`, or a coordinate of texts; empty if there are none."""
    count = 1 if array.ndim == 2 else array.shape[0]
    coords, bands = getattr(array, "coords", {}), array.dims[0]
    written = coords[bands].values.tolist() if array.ndim == 3 and bands in coords else None
    for names in (getattr(array, "attrs", {}).get("long_name"), written):
        if isinstance(names, tuple | list) and len(names) == count and all(isinstance(n, str) for n in names):
            return tuple(names)
    return ()


def _scales(array: Any, count: int, name: str, notes: list[str]) -> tuple[BandScale, ...]:
    """Return the scale of each band by the attributes: those of CF, or one for each band as of rioxarray."""
    attributes = getattr(array, "attrs", {})
    scale, offset, unit = (
        _for_each(attributes.get(one, attributes.get(other)), count)
        for one, other in (("scale_factor", "scales"), ("add_offset", "offsets"), ("units", "units"))
    )
    found = [BandScale.of_tags(*tags) for tags in zip(scale, offset, unit, strict=True)]
    if None in found:
        notes.append(f"{name}: its scale_factor or add_offset is no number that scales: both are ignored")
    return tuple(one or AS_STORED for one in found)


def _for_each(value: Any, count: int) -> list[Any]:
    """Return a value of each band, from one for each or one for all."""
    is_listed = isinstance(value, tuple | list | np.ndarray) and np.ndim(value) == 1
    return list(value) if is_listed and len(value) == count else [value] * count
