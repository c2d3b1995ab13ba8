"""Raster metadata: read once when a file is opened; unsupported kinds of raster are refused here."""

import math
import os
import shlex
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np
from affine import Affine
from rasterio.crs import CRS
from rasterio.enums import MaskFlags
from rasterio.io import DatasetReader

from uavseg.arrays import Path_
from uavseg.errors import RasterError, RasterReadError, caused_errors, named_errors
from uavseg.plain_text import cause_of
from uavseg.raster.access import opening
from uavseg.raster.access.open_checked import is_local, is_online, open_checked
from uavseg.raster.grid.geobox import check_transform
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.spectral.bands import BandLayout, BandScale
from uavseg.raster.tiff.directories import mask_page

Answer = TypeVar("Answer")

_ZEROS = (0.0,) * 6  # the geotransform that some drivers give where there is none
_BLACK_AND_WHITE = {0: (0, 0, 0, 255), 1: (255, 255, 255, 255)}


def inspect_file(path: Path_) -> RasterFile:
    """Read the metadata of a raster file.

    A RasterReadError says that it is not a raster that can be opened, a RasterError that it is of an
    unsupported kind, an AccessError that it names files or addresses that may not be opened.
    """
    found = inspect_unless(path, lambda _: False)
    assert found is not None
    return found


def inspect_unless(path: Path_, is_other: Callable[[DatasetReader], bool]) -> RasterFile | None:
    """Return the metadata of a raster file as `inspect_file`; None where the open file is something else."""
    name = opening.as_file_name(os.fspath(path))
    with opening.open_errors(name), open_checked(name) as source:
        return None if is_other(source) else _metadata(name, source)


def inspect_open(source: DatasetReader) -> RasterFile:
    """Return the metadata of a raster that is open; errors are those of `inspect_file`."""
    with opening.open_errors(source.name):
        return _metadata(source.name, source)


def _metadata(path: str, source: DatasetReader) -> RasterFile:
    warnings: list[str] = []
    crs = _crs(source, warnings)
    if crs is not None:
        _check_proj()
    layout = _layout(source)
    if not layout.dtypes:
        named = [f"; name one of its subdatasets, for instance {name}" for name in source.subdatasets[:1]]
        raise RasterError(f"{path} has no bands{''.join(named)}")
    structure = _retry(lambda: source.tags(ns="IMAGE_STRUCTURE"))
    inverted = structure.get("MINISWHITE") == "YES"
    transform = _transform(path, source)
    if transform is None:
        crs = None
        warnings.append("it has no place on the map (no geotransform): coordinates are pixels")
    elif crs is None and not warnings:
        warnings.append("it has no coordinate reference system: coordinates are local")
    return RasterFile(
        path=path,
        shape=source.shape,
        transform=transform or Affine.identity(),
        crs=crs,
        located=transform is not None,
        layout=layout,
        nodatas=tuple(source.nodatavals),
        block=tuple(source.block_shapes[0]),
        masks=_masks(path, source),
        white_is_zero=inverted and np.dtype(layout.dtypes[0]).kind == "u",
        palette=None if inverted else _palette(source, layout),
        driver=source.driver,
        online=is_online(path),
        overviews=tuple(source.overviews(1)),
        scales=_scales(source, warnings),
        warnings=tuple(f"{Path(path).name}: {text}" for text in warnings),
    )


def _scales(source: DatasetReader, warnings: list[str]) -> tuple[BandScale, ...]:
    found = []
    for band, tags in enumerate(zip(source.scales, source.offsets, source.units, strict=True), start=1):
        scale = BandScale.of_tags(*tags)
        if scale is None:
            warnings.append(
                f"band {band} has the scale {tags[0]:g} and the offset {tags[1]:g}: both are ignored"
            )
        found.append(scale or BandScale())
    return tuple(found)


def _retry(query: Callable[[], Answer]) -> Answer:
    """Call a query of GDAL, twice if needed: the first call may report an error left by an earlier one."""
    try:
        return query()
    except opening.GDAL_ERRORS:
        return query()


def _crs(source: DatasetReader, warnings: list[str]) -> CRS | None:
    """Return the CRS, or None with a warning; GDAL may report an invalid one only on the next call."""
    try:
        crs = source.crs
        source.colorinterp  # noqa: B018 - raises a pending error about the CRS
    except opening.GDAL_ERRORS as error:
        reason = cause_of(error)
        warnings.append(f"its coordinate reference system cannot be read ({reason}): coordinates are local")
        return None
    return crs or None


@lru_cache
def _check_proj() -> None:
    """Check PROJ's database: with one of another version, PROJ misreads coordinate reference systems."""
    lost = "PROJ finds no database, or that of another installation"
    unread = f"coordinate reference systems cannot be read: {lost}"
    form = "{} ({}); unset the environment variables PROJ_LIB and PROJ_DATA"
    with caused_errors(unread, RasterError, *opening.GDAL_ERRORS, form=form):
        CRS.from_epsg(4326)


def _layout(source: DatasetReader) -> BandLayout:
    dtypes = tuple(_retry(lambda: source.dtypes))
    bits = []
    for band, name in enumerate(dtypes, start=1):
        size = np.dtype(name).itemsize * 8
        stored = source.tags(band, ns="IMAGE_STRUCTURE").get("NBITS", size)
        bits.append(int(stored) if np.dtype(name).kind in "iu" else size)
    roles = tuple(role.name for role in source.colorinterp)
    descriptions = tuple(text or "" for text in source.descriptions)
    wavelengths = tuple(_wavelength(source, band) for band in range(1, len(dtypes) + 1))
    return BandLayout(
        dtypes,
        roles,
        tuple(bits),
        descriptions=descriptions if any(descriptions) else (),
        micrometres=wavelengths if any(wavelengths) else (),
    )


def _wavelength(source: DatasetReader, band: int) -> float | None:
    """Return GDAL's CENTRAL_WAVELENGTH_UM of a band."""
    text = source.tags(band, ns="IMAGERY").get("CENTRAL_WAVELENGTH_UM", "")
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 < value < math.inf else None


def _palette(source: DatasetReader, layout: BandLayout) -> tuple[tuple[int, int, int, int], ...] | None:
    if layout.roles[0] != "palette":
        return None
    colors = source.colormap(1)
    if colors == _BLACK_AND_WHITE:  # GDAL's palette for bits, which are used as they are
        return None
    return tuple(colors.get(index, (0, 0, 0, 0)) for index in range(max(colors) + 1))


def _masks(path: str, source: DatasetReader) -> str:
    """Return the masks of a raster; refuse a local TIFF with one that GDAL cannot read, and leaves out."""
    kind, has_mask = opening.mask_kind(source), False
    if source.driver == "GTiff" and is_local(path):
        if opening.file_exists(f"{path}.msk"):
            mask_page(f"{path}.msk")
        has_mask = mask_page(path) is not None
    if has_mask and not kind and MaskFlags.per_dataset not in source.mask_flag_enums[0]:
        raise RasterReadError(
            f"{path} cannot be opened as a raster (it has a mask that cannot be read); the file is damaged "
            "or incomplete: repair it"
        )
    return kind


def _transform(path: str, source: DatasetReader) -> Affine | None:
    transform = source.transform
    if opening.has_place(source) and not transform.is_identity and tuple(transform)[:6] != _ZEROS:
        with named_errors(path, RasterError):
            check_transform(transform, source.shape)
        return transform
    has_points, warped = bool(source.gcps[0]), f"{Path(path).stem}.warped.tif"
    if has_points or source.rpcs is not None:
        what = "ground control points" if has_points else "rational polynomial coefficients (RPC)"
        raise RasterError(
            f"{path} has {what} and no geotransform; warp it first: "
            f"gdalwarp {'-tps' if has_points else '-rpc'} -r near {shlex.quote(path)} {shlex.quote(warped)}"
        )
    return None
