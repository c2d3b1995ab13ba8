"""Rasters as GeoTIFF: labels tile by tile, and stacks of bands; a file appears whole or not at all."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.windows import Window as FileWindow

from uavseg.atomic import whole_file
from uavseg.errors import OutputError, RasterReadError
from uavseg.raster.geobox import GeoBox
from uavseg.raster.opening import GDAL_ERRORS, gdal_env, quiet_open, root_cause
from uavseg.raster.tiling import Window

STRIPE = 256  # rows that are written at once, and the side of a block in the file

Labels = NDArray[np.uint32]
Path_ = str | os.PathLike[str]


def write_label_geotiff(
    path: Path_,
    tiles: Iterable[tuple[Window, NDArray[Any]]],
    geobox: GeoBox,
    overwrite: bool = False,
    tags: Mapping[str, str] | None = None,
    threads: int = 1,
    dtype: Any = np.uint32,
    description: str | None = None,
) -> None:
    """Write labels, or states, as a tiled, compressed GeoTIFF in which 0 is nodata.

    The bytes of the file do not depend on how the labels are cut into tiles. What is held in memory is one
    row of tiles.

    Parameters
    ----------
    path : path
    tiles : iterable of (Window, (rows, cols) array)
        Cover the raster once, row of tiles after row of tiles, from the top.
    geobox : GeoBox
        Of the raster whose pixels were labelled.
    overwrite : bool
        Whether a file that is there may be replaced.
    tags : mapping of str to str, optional
        Metadata items.
    threads : int
        How many compress; the bytes of the file do not depend on that either.
    dtype : dtype
        Of the file.
    description : str, optional
        Name of the band, as QGIS shows it.

    Raises
    ------
    OutputExistsError, OutputError
        If the file may not or cannot be written.
    """
    with whole_file(path, overwrite) as target, _writing(path):
        how = _profile(geobox, 1, np.dtype(dtype)) | {"nodata": 0, "num_threads": str(threads)}
        with quiet_open(target, "w", **how) as file:
            file.update_tags(**(tags or {}))
            if description is not None:
                file.set_band_description(1, description)
            for row, stripe in _stripes(tiles, geobox.shape, dtype):
                file.write(stripe, 1, window=FileWindow(0, row, stripe.shape[1], stripe.shape[0]))
        _check_whole(target)


def _stripes(
    tiles: Iterable[tuple[Window, NDArray[Any]]], shape: tuple[int, int], dtype: Any
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Stripes of 256 rows from the top, each with its first row, however the tiles are cut."""
    held, top = np.zeros((0, shape[1]), dtype), 0  # rows from `top` on, not all of them complete
    for window, labels in tiles:
        ready = (window.row - top) // STRIPE * STRIPE  # what lies above a row of tiles is complete
        yield from _cut(held[:ready], top)
        held, top = held[ready:], top + ready
        end = window.row + window.rows - top
        if end > len(held):
            held, kept = np.zeros((end, shape[1]), dtype), held
            held[: len(kept)] = kept
        held[window.row - top : end, window.slices[1]] = labels
    yield from _cut(held, top)
    assert top + len(held) == shape[0], f"tiles end at row {top + len(held)} of {shape[0]}"


def _cut(rows: NDArray[Any], top: int) -> Iterator[tuple[int, NDArray[Any]]]:
    for start in range(0, len(rows), STRIPE):
        yield top + start, rows[start : start + STRIPE]


def write_geotiff(
    path: Path_,
    bands: Sequence[NDArray[Any]],
    geobox: GeoBox,
    descriptions: Sequence[str] | None = None,
    tags: Mapping[str, str] | None = None,
    overwrite: bool = False,
    nodata: float | None = None,
    pages: Sequence["Page"] = (),
) -> None:
    """Write bands of one type as a tiled, compressed GeoTIFF.

    Parameters
    ----------
    path : path
    bands : sequence of (rows, cols) arrays
    geobox : GeoBox
    descriptions : sequence of str, optional
        Names of the bands, as QGIS shows them.
    tags : mapping of str to str, optional
        Metadata items of the file.
    overwrite : bool
        Whether a file that is there may be replaced.
    nodata : float, optional
    pages : sequence of Page
        More images in the same file, which GDAL calls its subdatasets.

    Raises
    ------
    OutputExistsError, OutputError
        If the file may not or cannot be written.
    """
    first = Page(bands, geobox, descriptions or [""] * len(bands))
    with whole_file(path, overwrite) as target, _writing(path):
        for number, page in enumerate((first, *pages), start=1):
            dtype = np.result_type(*page.bands)
            how = _profile(page.geobox, len(page.bands), dtype) | {"append_subdataset": number > 1}
            with quiet_open(target, "w", **how, nodata=nodata if number == 1 else None) as file:
                if number == 1:
                    file.update_tags(**(tags or {}))
                for band, (values, name) in enumerate(
                    zip(page.bands, page.descriptions, strict=True), start=1
                ):
                    file.write(values.astype(dtype, copy=False), band)
                    if name:
                        file.set_band_description(band, name)
        for number in range(1, len(pages) + 2):
            _check_whole(target, number)


@dataclass(frozen=True, slots=True)
class Page:
    """One image of a file: bands of one type, where they lie, and what they are called."""

    bands: Sequence[NDArray[Any]]
    geobox: GeoBox
    descriptions: Sequence[str]


def read_geotiff(path: Path_, page: int = 1) -> tuple[NDArray[Any], GeoBox, list[str], dict[str, str]]:
    """What `write_geotiff` wrote.

    Parameters
    ----------
    path : path
    page : int
        Which image of the file, counted from 1.

    Returns
    -------
    bands : (bands, rows, cols) array
    geobox : GeoBox
    descriptions : list of str
        Names of the bands, "" where one has none.
    tags : dict of str to str

    Raises
    ------
    RasterReadError
        If there is no such raster.
    """
    try:
        with gdal_env(), quiet_open(_of_page(path, page), num_threads="all_cpus") as file:
            geobox = GeoBox(file.shape, file.transform, file.crs)
            return file.read(), geobox, [text or "" for text in file.descriptions], file.tags()
    except GDAL_ERRORS as error:
        raise RasterReadError(f"{os.fspath(path)} cannot be read as a raster ({error})") from error


def _of_page(path: Path_, page: int) -> str:
    """The name by which GDAL opens one image of a file."""
    return os.fspath(path) if page == 1 else f"GTIFF_DIR:{page}:{os.fspath(path)}"


def _profile(geobox: GeoBox, count: int, dtype: np.dtype[Any]) -> dict[str, Any]:
    place = {} if geobox.transform == Affine.identity() else {"transform": geobox.transform}
    return place | {
        "driver": "GTiff",
        "height": geobox.shape[0],
        "width": geobox.shape[1],
        "count": count,
        "dtype": dtype.name,
        "crs": geobox.crs,
        "tiled": True,
        "blockxsize": STRIPE,
        "blockysize": STRIPE,
        "compress": "deflate",
        "zlevel": 6,
        "interleave": "band",
        "bigtiff": "IF_SAFER",
    }


def _check_whole(path: Path, page: int = 1) -> None:
    """Every block lies inside the file; a disk that is full when the file is closed is told to nobody."""
    size = path.stat().st_size
    with quiet_open(_of_page(path, page)) as file:
        for band in file.indexes:
            for (i, j), _ in file.block_windows(band):
                offset = int(file.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", dm="TIFF", bidx=band) or size)
                if offset + file.block_size(band, i, j) > size:
                    raise OutputError(f"{path.name} cannot be written whole; is the disk full?")


@contextmanager
def _writing(path: Path_) -> Iterator[None]:
    """Errors of writing, in one sentence."""
    try:
        with gdal_env():
            yield
    except GDAL_ERRORS as error:
        raise OutputError(f"{os.fspath(path)} cannot be written ({root_cause(error)})") from error
