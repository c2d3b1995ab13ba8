"""A picture: pixels, which of them are valid, and where they lie; written in any layout of a TIFF."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import rasterio
import rasterio.shutil
from affine import Affine
from numpy.typing import NDArray

from tests.honest.patterns import Field, any_pattern, drawn, holes
from tests.honest.places import any_place

DTYPES = ("uint8", "uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")
SIZES = (1, 2, 7, 8, 9, 15, 16, 17, 63, 64, 65, 100, 127, 128, 129, 255, 256, 257, 300, 511, 512, 513)
SPANS = {  # stored values of 0 and 1
    "uint8": [(0, 255), (40, 90)],
    "int8": [(-128, 127), (0, 100)],
    "uint16": [(0, 65535), (100, 3000), (1000, 1003)],
    "int16": [(-500, 2500), (-32768, 32767), (0, 1)],
    "uint32": [(0, 4294967295), (70000, 90000)],
    "int32": [(-70000, 90000), (-2147483648, 2147483647)],
    "float32": [(0.0, 1.0), (-1.0, 1.0), (271.3, 315.8), (1e-8, 3e-8), (0.0, 1e30)],
    "float64": [(0.0, 1.0), (-1.0, 1.0), (1e6, 1e6 + 1), (-1e-300, 1e-300), (-1e9, 1e9)],
}
ODD_NODATA = {
    "uint8": [0, 1, 128, 255],
    "int8": [-128, 0, 127],
    "uint16": [0, 65535, 65534],
    "int16": [-32768, -9999, 0, 32767],
    "uint32": [0, 4294967295],
    "int32": [-2147483648, -9999, 0, 2147483647],
    "float32": [float("nan"), -9999.0, -3.4028234663852886e38, 0.1, 1e20, 0.0, float("inf")],
    "float64": [float("nan"), -9999.0, -1.7976931348623157e308, 0.1, 1e-200, float("-inf")],
}
Pixels = NDArray[Any]
UTM = Affine(1, 0, 500000, 0, -1, 4500000)


@dataclass(frozen=True, eq=False)
class Picture:
    """What is written.

    Parameters
    ----------
    values : (bands, rows, cols) array
    valid : (rows, cols) bool array
        Which pixels are meant to be valid.
    span : (float, float)
        Stored values of 0 and 1 of the pattern.
    by : str
        How a file says which pixels are valid: "all", "nodata", "nan", "mask", "sidecar" or "alpha".
    """

    values: Pixels
    valid: NDArray[np.bool_]
    span: tuple[float, float]
    by: str = "all"
    nodata: float | None = None
    crs: str | None = "EPSG:32633"
    transform: Affine = UTM
    place: str = "utm, north up"
    names: dict[str, Any] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.values.shape[-2:]  # type: ignore[return-value]

    def part(self, row: int, col: int, rows: int, cols: int) -> "Picture":
        """A window of it, where it lies."""
        at = slice(row, row + rows), slice(col, col + cols)
        return replace(
            self,
            values=self.values[:, *at],
            valid=self.valid[at],
            transform=self.transform * Affine.translation(col, row),
        )


def any_shape(rng: Random, largest: int = 513) -> tuple[int, int]:
    """Rows and columns around multiples of blocks and tiles; large ones are rarer."""
    sizes = [size for size in SIZES if size <= largest]
    small = [size for size in sizes if size <= 130]
    rows, cols = rng.choice(sizes if rng.random() < 0.4 else small), rng.choice(sizes)
    return (rows, cols) if rng.random() < 0.5 else (cols, rows)


def any_picture(
    rng: Random,
    shape: tuple[int, int] | None = None,
    dtypes: tuple[str, ...] = DTYPES,
    bys: tuple[str, ...] = ("all", "nodata", "nan", "mask", "sidecar", "alpha"),
    pattern: Field | None = None,
    placed: bool = True,
) -> Picture:
    """A picture of any pattern, type, validity and place."""
    shape = shape or any_shape(rng)
    dtype, by = rng.choice(dtypes), rng.choice(bys)
    span = rng.choice(SPANS[dtype])
    field = any_pattern(rng, shape) if pattern is None else pattern
    values = as_type(field, span, dtype)[np.newaxis]
    if dtype in ("uint8", "uint16") and rng.random() < 0.25:
        values = np.stack([values[0], np.roll(values[0], 3, 1), values[0][::-1]])
    if by == "nan" and not dtype.startswith("float"):
        by = "nodata"
    valid = np.ones(shape, bool) if by == "all" else holes(rng, shape)
    crs, transform, place = any_place(rng, shape) if placed else ("EPSG:32633", UTM, "utm")
    nodata = rng.choice(ODD_NODATA[dtype]) if by == "nodata" else None
    picture = Picture(values, valid, span, by, nodata, crs, transform, place)
    return with_holes(picture)


def as_type(field: Field, span: tuple[float, float], dtype: str) -> Pixels:
    """The stored values of a pattern."""
    low, high = span
    scaled = field * high + (1 - field) * low
    if dtype.startswith("float"):
        return scaled.astype(dtype)
    limits = np.iinfo(dtype)
    return np.clip(np.rint(scaled), limits.min, limits.max).astype(dtype)


def with_holes(picture: Picture) -> Picture:
    """The picture with its nodata value, or NaN, where it is not valid, and nowhere else."""
    values, valid = picture.values.copy(), picture.valid.copy()
    if picture.by == "nan":
        values[:, ~valid] = np.nan
    if picture.by == "nodata":
        own = values.dtype.type(picture.nodata)
        taken = values == own
        other = own + 1 if own < picture.span[1] else own - 1
        if values.dtype.kind == "f":
            other = values.dtype.type(0.5 * sum(picture.span))
        values[taken] = other
        values[:, ~valid] = own
    return replace(picture, values=values, valid=valid)


def any_layout(rng: Random, picture: Picture) -> dict[str, Any]:
    """How a TIFF stores it."""
    rows, cols = picture.shape
    how: dict[str, Any] = {}
    dtype, bands = picture.values.dtype.name, len(picture.values)
    lossless = ["none", "deflate", "deflate", "lzw", "zstd", "packbits", "lzma"]
    if dtype == "uint8" and bands in (1, 3) and rng.random() < 0.15:
        compress = "jpeg"
    elif dtype != "int8" and rng.random() < 0.1:
        compress = rng.choice(["lerc", "lerc_deflate", "lerc_zstd"])
    elif dtype == "uint8" and bands == 3 and rng.random() < 0.3:
        compress = "webp"
        how["WEBP_LOSSLESS"] = "TRUE"
    else:
        compress = rng.choice(lossless)
    if compress != "none":
        how["compress"] = compress
    if compress in ("deflate", "lzw", "zstd") and rng.random() < 0.6:
        how["predictor"] = 2 if dtype.startswith(("u", "i")) or rng.random() < 0.3 else 3
    if rng.random() < 0.6:
        sides = [16, 32, 64, 128, 256, 512]
        how |= {"tiled": True, "blockxsize": rng.choice(sides), "blockysize": rng.choice(sides)}
        if cols % 16 == 0 and rng.random() < 0.5:
            how["blockxsize"] = cols  # as wide as the raster
    elif rng.random() < 0.7:
        how["blockysize"] = rng.randint(1, rows) if compress != "jpeg" else min(16 * rng.randint(1, 4), rows)
    if bands > 1 or picture.by == "alpha":
        how["interleave"] = "pixel" if compress in ("jpeg", "webp") else rng.choice(["pixel", "band"])
    if rng.random() < 0.15:
        how["bigtiff"] = "YES"
    if rng.random() < 0.1:
        how["endianness"] = "BIG"
    if rng.random() < 0.1:
        how["sparse_ok"] = True
    return how


def write_tiff(path: Path, picture: Picture, how: dict[str, Any], overviews: bool = False) -> None:
    """Write a picture as a TIFF."""
    values = picture.values
    if picture.by == "alpha":
        alpha = np.where(picture.valid, 1 + (np.indices(picture.shape).sum(axis=0) * 7) % 255, 0)
        top = 1 if values.dtype.kind == "f" else np.iinfo(values.dtype).max
        alpha = np.clip(alpha, 0, min(top, 255)).astype(values.dtype)
        values = np.concatenate([values, alpha[np.newaxis]])
        how = how | {"alpha": "yes"}
    profile = {
        "driver": "GTiff",
        "dtype": values.dtype.name,
        "count": len(values),
        "height": values.shape[1],
        "width": values.shape[2],
        "crs": picture.crs,
        "transform": picture.transform,
        "nodata": picture.nodata,
    }
    if len(picture.values) == 3:
        profile["photometric"] = "ycbcr" if how.get("compress") == "jpeg" else "rgb"
    with quiet(), rasterio.Env(GDAL_TIFF_INTERNAL_MASK=picture.by != "sidecar"):
        with rasterio.open(path, "w", **profile | how) as file:
            file.write(values)
            if picture.by in ("mask", "sidecar"):
                file.write_mask(picture.valid)
        if overviews and min(picture.shape) > 4:
            with rasterio.open(path, "r+") as file:
                file.build_overviews([2, 4], rasterio.enums.Resampling.average)


def any_file(rng: Random, folder: Path, picture: Picture) -> str:
    """A name of a new TIFF in any layout, or of a cloud-optimised one."""
    how = any_layout(rng, picture)
    if picture.by == "alpha" and how.get("compress") == "jpeg":
        how.pop("compress")
    path = folder / "x.tif"
    write_tiff(path, picture, how, overviews=rng.random() < 0.15)
    if rng.random() < 0.15 and picture.by != "sidecar":
        compress = rng.choice(["deflate", "lzw", "zstd", "none"])
        with quiet():
            rasterio.shutil.copy(
                path,
                folder / "cog.tif",
                driver="COG",
                compress=compress,
                blocksize=rng.choice([128, 256, 512]),
            )
        return "cog.tif"
    return "x.tif"


@contextmanager
def quiet() -> Iterator[None]:
    """Without rasterio's warnings about rasters that have no place."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


__all__ = ["Picture", "any_file", "any_layout", "any_picture", "any_shape", "drawn", "quiet", "write_tiff"]
