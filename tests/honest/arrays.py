"""Arrays that numpy, xarray and rioxarray hand over, in every orientation: what the file of them says."""

from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import rasterio
import rioxarray
import xarray

import uavseg
from tests.honest import plain
from tests.honest.findings import differ, far, unlike
from tests.honest.picture import Picture, any_picture, any_shape, quiet, write_tiff
from tests.honest.places import is_upright
from tests.hostile.judging import Finding
from uavseg.errors import UavsegError

Lazy = Callable[[xarray.DataArray, Random], Any]
FORMS: dict[str, Lazy] = {
    "opened": lambda array, _: array,
    "squeezed": lambda array, _: array.squeeze(drop=True),
    "transposed": lambda array, _: array.squeeze(drop=True).transpose("x", "y", ...),
    "bands last": lambda array, _: array.transpose("y", "x", "band"),
    "sorted by y": lambda array, _: array.sortby("y"),
    "sorted by x downwards": lambda array, _: array.sortby("x", ascending=False),
    "upside down": lambda array, _: array[:, ::-1],
    "from right to left": lambda array, _: array[:, :, ::-1],
    "a window": lambda array, _: array[:, 3:, 5:],
    "a window by rioxarray": lambda array, _: array.rio.isel_window(
        rasterio.windows.Window(2, 1, array.shape[2] - 4, array.shape[1] - 3)
    ),
    "every second": lambda array, _: array[:, ::2, ::2],
    "every third row": lambda array, _: array[:, ::3],
    "coarsened": lambda array, _: array.coarsen(x=2, y=2, boundary="trim").max(),
    "another name of x and y": lambda array, _: array.rename(x="lon_", y="lat_").rio.set_spatial_dims(
        "lon_", "lat_"
    ),
    "without spatial_ref": lambda array, _: array.drop_vars("spatial_ref"),
    "masked by rioxarray": lambda array, _: array,
    "in chunks": lambda array, _: array.chunk(x=50, y=64),
    "reassigned": lambda array, _: array.assign_coords(x=array.x + 10 * float(array.x[1] - array.x[0])),
    "rolled": lambda array, _: array + 0,
    "selected": lambda array, _: array.isel(band=0, drop=False),
    "where": lambda array, _: array.where(array == array),
    "expanded": lambda array, _: array.isel(band=0).expand_dims("time"),
}


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """One form of an array, against the same array written to a file by rioxarray."""
    shape = tuple(max(side, 12) for side in any_shape(rng, 300))
    picture = any_picture(
        rng, shape, bys=("all", "nodata", "nan"), dtypes=("uint8", "uint16", "int16", "float32")
    )
    if not is_upright(picture.transform):
        return
    if rng.random() < 0.3:
        yield from numpy_case(rng, picture)
        return
    write_tiff(folder / "x.tif", picture, {})
    name = rng.choice(sorted(FORMS))
    with quiet(), rioxarray.open_rasterio(folder / "x.tif", masked=name == "masked by rioxarray") as opened:
        array = FORMS[name](opened.load() if name != "in chunks" else opened, rng)
        truth = truth_of(array, picture)
        if truth is None or not truth.valid.any():
            return
        yield from answer(array, truth, name, picture.span)


def of_values(values: Any) -> xarray.DataArray:
    """A DataArray as rioxarray opens one, of (bands, rows, cols)."""
    _, rows, cols = values.shape
    coords = {"band": [*range(1, 1 + len(values))], "y": 100.5 - np.arange(rows), "x": 7.5 + np.arange(cols)}
    return xarray.DataArray(values, coords, ("band", "y", "x")).rio.write_crs("EPSG:32633")


def truth_of(array: xarray.DataArray, picture: Picture) -> plain.Plain | None:
    """The pixels of a DataArray, row by row from the top, where its coordinates say that they lie."""
    x_name = next(name for name in ("x", "lon_") if name in array.dims)
    y_name = next(name for name in ("y", "lat_") if name in array.dims)
    if array.sizes[x_name] < 2 or array.sizes[y_name] < 2:
        return None
    others = [name for name in array.dims if name not in (x_name, y_name)]
    values = np.asarray(array.transpose(*others, y_name, x_name).values)
    if values.ndim == 2:
        values = values[np.newaxis]
    x, y = np.asarray(array[x_name]), np.asarray(array[y_name])
    step = (x[-1] - x[0]) / (len(x) - 1), (y[-1] - y[0]) / (len(y) - 1)
    transform = rasterio.Affine(step[0], 0, x[0] - step[0] / 2, 0, step[1], y[0] - step[1] / 2)
    hits = [np.zeros(values.shape[1:], bool)]
    if picture.nodata is not None and picture.nodata == picture.nodata:
        hits = [band == values.dtype.type(picture.nodata) for band in values]
    colour = len(values) == 3 and values.dtype.kind == "u"
    valid = ~(np.logical_and.reduce(hits) if colour else np.logical_or.reduce(hits))
    if values.dtype.kind == "f":
        valid &= np.isfinite(values).all(axis=0)
    numbers = values.astype(float)
    intensity = np.tensordot(plain.LUMINANCE, numbers, 1) if len(numbers) == 3 else numbers[0]
    return plain.Plain(intensity, valid, transform, picture.crs)


def answer(source: Any, truth: plain.Plain, about: str, span: tuple[float, float]) -> Iterator[Finding]:
    """All valid pixels of an array, and the brighter half, where they lie."""
    how: dict[str, Any] = {"stretch": f"{span[0]!r},{span[1]!r}", "threads": 1}
    try:
        found = uavseg.extract(source, range=(0, 1), refine="none", **how)
    except UavsegError as error:
        yield Finding("REFUSED ARRAY", about, str(error))
        return
    yield from differ("VALID", about, int(found["pixels"].sum()), int(np.count_nonzero(truth.valid)))
    place = truth.valid.shape, truth.transform
    yield from unlike(
        "PLACE", about, plain.drawn_pixels(found.geometry, *place), truth.valid.astype(np.uint8)
    )
    v = plain.v_of(truth.intensity[truth.valid], *span)
    mean = float(np.average(found["mean"], weights=found["pixels"]))
    yield from far("MEAN", about, mean, float(v.mean()), 0, 1.1 / 65535)


def numpy_case(rng: Random, picture: Picture) -> Iterator[Finding]:
    """A numpy array: local coordinates, one pixel is a square."""
    values = picture.values[0]
    name = rng.choice(["plain", "fortran", "turned view", "masked array", "big endian", "read only"])
    valid = np.isfinite(values) if values.dtype.kind == "f" else np.ones(values.shape, bool)
    array: Any = values
    if name == "fortran":
        array = np.asfortranarray(values)
    elif name == "turned view":
        array, values, valid = np.rot90(values), np.rot90(values), np.rot90(valid)
    elif name == "masked array":
        array, valid = np.ma.masked_array(values, ~picture.valid), valid & picture.valid
    elif name == "big endian":
        array = values.astype(values.dtype.newbyteorder(">"))
    elif name == "read only":
        array = values.copy()
        array.setflags(write=False)
    if not valid.any():
        return
    turned = rasterio.Affine(1, 0, 0, 0, 1, 0)
    truth = plain.Plain(values.astype(float), valid, turned, None)
    low, high = picture.span
    try:
        found = uavseg.extract(array, range=(0, 1), refine="none", stretch=f"{low!r},{high!r}", threads=1)
    except UavsegError as error:
        yield Finding("REFUSED ARRAY", f"numpy {name}", str(error))
        return
    yield from differ("VALID", f"numpy {name}", int(found["pixels"].sum()), int(np.count_nonzero(valid)))
    mean = float(np.average(found["mean"], weights=found["pixels"]))
    v = plain.v_of(truth.intensity[valid], low, high)
    yield from far("MEAN", f"numpy {name}", mean, float(v.mean()), 0, 1.1 / 65535)
