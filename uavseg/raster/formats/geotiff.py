"""GeoTIFF writer and reader: label rasters tile by tile, or as many files under a VRT; bands in pages."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.windows import Window as FileWindow

from uavseg.arrays import Path_, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, RasterReadError, caused_errors
from uavseg.execution.executors import Map, serial, threads_of_gdal, usable_cores
from uavseg.inputs import regular_file
from uavseg.output.atomic import atomic_file, check_target
from uavseg.output.renames import recover
from uavseg.raster.access.open_checked import check_limits, check_readable_whole
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, tiles

STRIPE = 256  # rows that are written at once, and the side of a block in the file

LABEL_TILE_SIDE = 2048  # pixels; independent of the tiles of the processing
_VRT = """\
<VRTDataset rasterXSize="{cols}" rasterYSize="{rows}">
{place}  <VRTRasterBand dataType="UInt32" band="1">
    <NoDataValue>0</NoDataValue>
{sources}  </VRTRasterBand>
</VRTDataset>
"""
_SOURCE = """\
    <SimpleSource>
      <SourceFilename relativeToVRT="1">{path}</SourceFilename>
      <SourceBand>1</SourceBand>
      <SourceProperties {raster} DataType="UInt32" BlockXSize="{side}" BlockYSize="{side}" />
      <SrcRect xOff="0" yOff="0" {size} />
      <DstRect xOff="{col}" yOff="{row}" {size} />
    </SimpleSource>
"""


@dataclass(frozen=True, slots=True)
class LabelBand:
    """Type of the labels in a file, and the name of their band in GIS programs."""

    dtype: Any = np.uint32
    description: str | None = None


def check_geotiff_name(path: Path_, what: str) -> None:
    """Refuse a file name that ends neither in .tif nor in .tiff (OutputError); `what` is its content."""
    if Path(path).suffix.lower() not in (".tif", ".tiff"):
        raise OutputError(f"{os.fspath(path)}: {what} is written as GeoTIFF; name a .tif")


def write_label_geotiff(
    path: Path_,
    tiles: Iterable[tuple[Window, NDArray[Any]]],
    geobox: GeoBox,
    overwrite: bool = False,
    tags: Mapping[str, str] | None = None,
    band: LabelBand = LabelBand(),
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write labels, or states, as a tiled, compressed GeoTIFF in which 0 is nodata.

    The bytes of the file do not depend on the tiles. One row of tiles is held in memory.

    The tiles cover the raster of `geobox` once, row of tiles after row of tiles, from the top; `tags` are
    metadata items. An OutputExistsError or OutputError says that the file exists or cannot be written, a
    ParameterError that creation options do not fit the type of the labels.
    """
    with atomic_file(path, overwrite) as target, _write_errors(path):
        options = _profile(geobox, 1, np.dtype(band.dtype), creation)
        with quiet_open(target, "w", **options, nodata=0) as file:
            file.update_tags(**(tags or {}))
            if band.description is not None:
                file.set_band_description(1, band.description)
            for row, stripe in _stripes(tiles, geobox.shape, band.dtype):
                file.write(stripe, 1, window=FileWindow(0, row, stripe.shape[1], stripe.shape[0]))
        _check_complete(target)


def _stripes(
    tiles: Iterable[tuple[Window, NDArray[Any]]], shape: tuple[int, int], dtype: Any
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield stripes of 256 rows from the top, each with its first row, whatever the tiles are."""
    buffer, top = np.zeros((0, shape[1]), dtype), 0  # rows from `top` on, not all of them complete
    for window, labels in tiles:
        complete = (window.row - top) // STRIPE * STRIPE  # what lies above a row of tiles is complete
        yield from _split_rows(buffer[:complete], top)
        buffer, top = buffer[complete:], top + complete
        end = window.row + window.rows - top
        if end > len(buffer):
            buffer, shorter = np.zeros((end, shape[1]), dtype), buffer
            buffer[: len(shorter)] = shorter
        buffer[window.row - top : end, window.slices[1]] = labels
    yield from _split_rows(buffer, top)
    assert top + len(buffer) == shape[0], f"tiles end at row {top + len(buffer)} of {shape[0]}"


def _split_rows(rows: NDArray[Any], top: int) -> Iterator[tuple[int, NDArray[Any]]]:
    for start in range(0, len(rows), STRIPE):
        yield top + start, rows[start : start + STRIPE]


def write_image_geotiff(
    path: Path_,
    strips: Iterable[tuple[int, NDArray[Any]]],
    geobox: GeoBox,
    types: Sequence[str],
    overwrite: bool = False,
    tags: Mapping[str, str] | None = None,
) -> None:
    """Write bands of one type and an alpha band as a tiled, compressed GeoTIFF; three are colours.

    `strips` are first rows, and pixels (bands and alpha, rows, cols): from the top, each but the last a
    multiple of 256 rows. `types` are of the bands without alpha. Errors are those of `write_geotiff`.
    """
    creation = CreationOptions(predictor=2, threads=usable_cores())
    options = _profile(geobox, len(types) + 1, np.dtype(types[0]), creation)
    # Blocks of all bands together: those that leave GDAL's cache early are in the order of the others.
    options |= {
        "interleave": "pixel",
        "photometric": "rgb" if len(types) == 3 else "minisblack",
        "alpha": "yes",
    }
    with atomic_file(path, overwrite) as target, _write_errors(path):
        with quiet_open(target, "w", **options) as file:
            file.update_tags(**(tags or {}))
            for top, strip in strips:
                file.write(strip, window=FileWindow(0, top, strip.shape[2], strip.shape[1]))
        _check_complete(target)


@dataclass(frozen=True, slots=True)
class Page:
    """One image of a GeoTIFF: bands of one type, their grid, their names in GIS programs, and nodata."""

    bands: Sequence[NDArray[Any]]
    geobox: GeoBox
    descriptions: Sequence[str]
    nodata: float | None = None

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of its bands."""
        return np.result_type(*self.bands)


def write_geotiff(
    path: Path_,
    bands: Sequence[NDArray[Any]],
    geobox: GeoBox,
    descriptions: Sequence[str] | None = None,
    tags: Mapping[str, str] | None = None,
    overwrite: bool = False,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write bands, (rows, cols) each, of one type as a tiled, compressed GeoTIFF.

    `descriptions` are names of the bands in GIS programs, `tags` metadata items of the file. An
    OutputExistsError or OutputError says that the file exists or cannot be written, a ParameterError that
    creation options do not fit the type of the bands.
    """
    page = Page(bands, geobox, descriptions or [""] * len(bands))
    write_geotiff_pages(path, [page], tags, overwrite, creation)


def write_geotiff_pages(
    path: Path_,
    pages: Sequence[Page],
    tags: Mapping[str, str] | None = None,
    overwrite: bool = False,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write several images (subdatasets) to one GeoTIFF, tags to the first; else as `write_geotiff`."""
    with atomic_file(path, overwrite) as target, _write_errors(path):
        for number, page in enumerate(pages, start=1):
            options = _profile(page.geobox, len(page.bands), page.dtype, creation)
            options |= {"append_subdataset": number > 1, "nodata": page.nodata}
            with quiet_open(target, "w", **options) as file:
                if number == 1:
                    file.update_tags(**(tags or {}))
                for band, (values, name) in enumerate(
                    zip(page.bands, page.descriptions, strict=True), start=1
                ):
                    file.write(values.astype(page.dtype, copy=False), band)
                    if name:
                        file.set_band_description(band, name)
        for number in range(1, len(pages) + 1):
            _check_complete(target, number)


def read_geotiff(
    path: Path_, page: int = 1, shape: tuple[int, ...] | None = None, bands: int | None = None
) -> tuple[NDArray[Any], GeoBox, list[str], dict[str, str]]:
    """Read an image that `write_geotiff` wrote: bands (n, rows, cols), grid, names ("" for none), tags.

    `page` counts from 1. What `shape` and number of bands the image must have may be given, so that nothing
    is allocated for a damaged header. A RasterReadError says that there is no such raster, or another one
    than expected, a RasterError that its header claims more than the file can hold.
    """
    regular_file(path)
    with caused_errors(f"{os.fspath(path)} cannot be read as a raster", RasterReadError, *GDAL_ERRORS):
        options = {"driver": "GTiff", "num_threads": threads_of_gdal("all_cpus")}
        with gdal_env(), quiet_open(_page_name(path, page), **options) as file:
            check_limits(os.fspath(path), file)
            if shape not in (None, file.shape) or bands not in (None, file.count):
                raise RasterReadError(f"image {page} of {os.fspath(path)} has another size than expected")
            check_readable_whole(os.fspath(path), file)
            geobox = GeoBox(file.shape, file.transform, file.crs)
            return file.read(), geobox, [text or "" for text in file.descriptions], file.tags()


def _page_name(path: Path_, page: int) -> str:
    """Return the name by which GDAL opens one image of a file."""
    return os.fspath(path) if page == 1 else f"GTIFF_DIR:{page}:{os.fspath(path)}"


def _profile(geobox: GeoBox, count: int, dtype: np.dtype[Any], creation: CreationOptions) -> dict[str, Any]:
    creation.check_types(dtype)
    place = {} if geobox.transform == Affine.identity() else {"transform": geobox.transform}
    height, width = geobox.shape
    kind = {"driver": "GTiff", "height": height, "width": width, "count": count, "dtype": dtype.name}
    layout = {"tiled": True, "blockxsize": STRIPE, "blockysize": STRIPE, "interleave": "band"}
    return place | kind | {"crs": geobox.crs} | layout | creation.gdal_options()


def _check_complete(path: Path, page: int = 1) -> None:
    """Check that every block lies inside the file: GDAL does not report a full disk on close."""
    size = path.stat().st_size
    with quiet_open(_page_name(path, page)) as file:
        for band in file.indexes:
            for (i, j), _ in file.block_windows(band):
                offset = int(file.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", dm="TIFF", bidx=band) or size)
                if offset + file.block_size(band, i, j) > size:
                    raise OutputError(f"{path.name} cannot be written whole; is the disk full?")


@contextmanager
def _write_errors(path: Path_) -> Iterator[None]:
    """Raise GDAL's errors on writing as OutputError."""
    with caused_errors(f"{os.fspath(path)} cannot be written", OutputError, *GDAL_ERRORS), gdal_env():
        yield


class LabelTile(Protocol):
    """What a worker needs to paint one window."""

    @property
    def window(self) -> Window: ...

    def rasterise(self) -> Uint32s:
        """Return the labels, (rows, cols) uint32."""


def label_windows(shape: tuple[int, int]) -> list[Window]:
    """Return the windows of the label tiles, row by row."""
    return tiles(shape, LABEL_TILE_SIDE)


def tiles_folder(path: Path_) -> Path:
    """Return the folder of tiles beside a VRT: labels.tiles for labels.vrt."""
    return Path(path).with_suffix(".tiles")


def check_label_tiles(path: Path_, overwrite: bool = False) -> None:
    """Check that a VRT and its folder of tiles may be written, before the work whose result they hold.

    An OutputExistsError says that one of them exists and `overwrite` is false, an OutputError that their
    folder does not exist, or that the folder of tiles contains anything else.
    """
    check_target(path, overwrite)
    folder = tiles_folder(path)
    files = list(folder.iterdir()) if folder.exists() else []
    names = [file.stem.partition("-") for file in files if file.suffix == ".tif"]
    if len(names) < len(files) or not all(row.isdecimal() and col.isdecimal() for row, _, col in names):
        raise OutputError(f"{folder} contains something else than label tiles; move it away")


def write_label_tiles(
    path: Path_,
    parts: Sequence[LabelTile],
    geobox: GeoBox,
    overwrite: bool = False,
    map: Map = serial,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write labels as GeoTIFFs in a folder beside a VRT that combines them to one uint32 raster, 0 nodata.

    Tiles without labels have no file. The workers of `map` write into the folder, so they must share it.

    There is one part for each of `label_windows`, and the tiles are in a folder of the name of the VRT with
    the suffix .tiles. An OutputExistsError or OutputError says that the files exist or cannot be written.
    """
    check_label_tiles(path, overwrite)
    with atomic_file(path, overwrite) as target:
        folder = tiles_folder(target)
        folder.mkdir()
        write = partial(_write_tile, str(folder.absolute()), geobox, creation)
        written = [part for part in map(write, parts) if part is not None]
        recover(folder)  # what workers left that were killed
        missing = [name for window in written if not (folder / (name := _tile_name(window))).is_file()]
        if missing:
            raise OutputError(
                f"the tile {missing[0]} of {path} was written by a worker and is not here; "
                "workers must share the folder of the labels"
            )
        target.write_bytes(_vrt_xml(geobox, written, folder.name))


def _write_tile(folder: str, geobox: GeoBox, creation: CreationOptions, part: LabelTile) -> Window | None:
    """Paint and write one tile; its window, or None where there is no label."""
    labels, window = part.rasterise(), part.window
    if not labels.any():
        return None
    place = Window(0, 0, window.rows, window.cols)
    path = Path(folder) / _tile_name(window)  # there already if the tile was sent twice
    write_label_geotiff(path, [(place, labels)], geobox.window(window), overwrite=True, creation=creation)
    return window


def _tile_name(window: Window) -> str:
    return f"{window.row // LABEL_TILE_SIDE:04d}-{window.col // LABEL_TILE_SIDE:04d}.tif"


def _vrt_xml(geobox: GeoBox, windows: Sequence[Window], folder: str) -> bytes:
    """Return a GDAL virtual raster of the tiles, with relative paths."""
    from html import escape  # only here

    place = "" if geobox.wkt is None else f"  <SRS>{escape(geobox.wkt, quote=False)}</SRS>\n"
    if geobox.transform != Affine.identity():
        numbers = ", ".join(repr(float(value)) for value in geobox.transform.to_gdal())
        place += f"  <GeoTransform>{numbers}</GeoTransform>\n"
    sources = [
        _SOURCE.format(
            path=escape(f"{folder}/{_tile_name(one)}", quote=False),
            raster=f'RasterXSize="{one.cols}" RasterYSize="{one.rows}"',
            size=f'xSize="{one.cols}" ySize="{one.rows}"',
            side=STRIPE,
            row=one.row,
            col=one.col,
        )
        for one in windows
    ]
    rows, cols = geobox.shape
    return _VRT.format(rows=rows, cols=cols, place=place, sources="".join(sources)).encode()
