"""What a raster file says about itself, asked once; what cannot be answered rightly is refused here."""

import os
import shlex
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np
from affine import Affine
from rasterio.crs import CRS
from rasterio.io import DatasetReader

from uavseg.errors import RasterError, RasterReadError
from uavseg.raster.bands import BandLayout
from uavseg.raster.opening import GDAL_ERRORS, gdal_env, open_error_text, quiet_open, root_cause
from uavseg.raster.raster_file import RasterFile

Answer = TypeVar("Answer")

_BLACK_AND_WHITE = {0: (0, 0, 0, 255), 1: (255, 255, 255, 255)}


def inspect_file(path: str | os.PathLike[str]) -> RasterFile:
    """Open a raster and note what it says about itself.

    Raises
    ------
    RasterReadError
        If there is no raster that can be opened.
    RasterError
        If it is of a kind that cannot be answered rightly.
    """
    name = os.fspath(path)
    try:
        with gdal_env(), quiet_open(name) as source:
            return _facts(name, source)
    except GDAL_ERRORS as error:
        raise RasterReadError(open_error_text(name, error)) from error


def _facts(path: str, source: DatasetReader) -> RasterFile:
    told: list[str] = []
    crs = _crs(source, told)
    if crs is not None:
        _check_proj()
    layout = _layout(source)
    if not layout.dtypes:
        raise RasterError(f"{path} has no bands of its own{_subdatasets(source)}")
    structure = _ask(lambda: source.tags(ns="IMAGE_STRUCTURE"))
    inverted = structure.get("MINISWHITE") == "YES"
    transform = _transform(path, source)
    if transform is None:
        crs = None
        told.append("it has no place on the map (no geotransform): coordinates are pixels")
    elif crs is None and not told:
        told.append("it has no coordinate reference system: coordinates are local")
    return RasterFile(
        path=path,
        shape=source.shape,
        transform=transform or Affine.identity(),
        crs=crs,
        located=transform is not None,
        layout=layout,
        nodatas=tuple(source.nodatavals),
        block=tuple(source.block_shapes[0]),
        masks=_masks(source),
        white_is_zero=inverted and np.dtype(layout.dtypes[0]).kind == "u",
        palette=None if inverted else _palette(source, layout),
        driver=source.driver,
        overviews=tuple(source.overviews(1)),
        warnings=tuple(f"{Path(path).name}: {text}" for text in told),
    )


def _ask(question: Callable[[], Answer]) -> Answer:
    """An answer of GDAL's, asked twice: the first time may fail for an error left by an earlier call."""
    try:
        return question()
    except GDAL_ERRORS:
        return question()


def _crs(source: DatasetReader, told: list[str]) -> CRS | None:
    """The CRS, or None with the reason told; GDAL may report a bad one only at the next question."""
    try:
        crs = source.crs
        source.colorinterp  # noqa: B018 - makes a pending complaint about the CRS come up
    except GDAL_ERRORS as error:
        told.append(f"its coordinate reference system cannot be read ({error}): coordinates are local")
        return None
    return crs or None


@lru_cache
def _check_proj() -> None:
    """Without a database of its own version, PROJ half understands what files say: better to stop."""
    try:
        CRS.from_epsg(4326)
    except GDAL_ERRORS as error:
        raise RasterError(
            "coordinate reference systems cannot be understood: PROJ finds no database, or that of another "
            f"installation ({root_cause(error)}); unset the environment variables PROJ_LIB and PROJ_DATA"
        ) from error


def _layout(source: DatasetReader) -> BandLayout:
    dtypes = tuple(_ask(lambda: source.dtypes))
    bits = []
    for band, name in enumerate(dtypes, start=1):
        size = np.dtype(name).itemsize * 8
        stored = source.tags(band, ns="IMAGE_STRUCTURE").get("NBITS", size)
        bits.append(int(stored) if np.dtype(name).kind in "iu" else size)
    return BandLayout(dtypes, tuple(role.name for role in source.colorinterp), tuple(bits))


def _palette(source: DatasetReader, layout: BandLayout) -> tuple[tuple[int, int, int, int], ...] | None:
    if layout.roles[0] != "palette":
        return None
    colors = source.colormap(1)
    if colors == _BLACK_AND_WHITE:  # how GDAL shows bits; they are fine as they are
        return None
    return tuple(colors.get(index, (0, 0, 0, 0)) for index in range(max(colors) + 1))


def _masks(source: DatasetReader) -> str:
    flags = source.mask_flag_enums
    names = [{flag.name for flag in band} for band in flags]
    if "per_dataset" in names[0] and "alpha" not in names[0]:
        return "file"
    return "band" if any(not band for band in names) else ""


def _transform(path: str, source: DatasetReader) -> Affine | None:
    """The geotransform; None if there is none."""
    transform = source.transform
    missing = transform.is_identity or not abs(transform.determinant) > 1e-200  # some drivers leave it unset
    if not missing:
        return transform
    warped = f"{Path(path).stem}.warped.tif"
    if source.gcps[0]:
        raise RasterError(
            f"{path} has ground control points and no geotransform; warp it first: "
            f"gdalwarp -tps -r near {shlex.quote(path)} {shlex.quote(warped)}"
        )
    if source.rpcs is not None:
        raise RasterError(
            f"{path} has rational polynomial coefficients (RPC) and no geotransform; warp it first: "
            f"gdalwarp -rpc -r near {shlex.quote(path)} {shlex.quote(warped)}"
        )
    return None


def _subdatasets(source: DatasetReader) -> str:
    if not source.subdatasets:
        return ""
    return f"; name one of its parts, for instance {source.subdatasets[0]}"
