"""GDAL access: drivers by extension, open files per thread, a block cache, messages, readable errors.

Where one of those cannot be read, it tries them all again for each row after it, and again for those: 2^n
times for n rows. So rows are read in order here, and after the first that fails none is asked for.

GDAL recognises formats by content, and some formats (VRT, descriptions of web services, tile indexes) name
other files or addresses. So a file is opened by the drivers of its extension; a file without a known one, by
drivers that read that file alone.
"""

import ctypes
import logging
import os
import re
import threading
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any
from weakref import WeakKeyDictionary

import rasterio
from rasterio._env import del_gdal_config
from rasterio._err import CPLE_BaseError
from rasterio.env import get_gdal_config, set_gdal_config
from rasterio.errors import CRSError, NotGeoreferencedWarning, RasterioError
from rasterio.io import DatasetReader

from uavseg.access import is_address
from uavseg.errors import RasterReadError
from uavseg.plain_text import cause_of
from uavseg.raster.grid.tiling import Window
from uavseg.warning_filters import changing_filters

_JPEG2000 = ("JP2OpenJPEG", "JP2KAK", "JP2ECW", "JP2MrSID")
_RAW = ("ENVI", "EHdr")  # raw pixels with a header beside them
_WEB_SERVICES = ("WMS", "WMTS", "WCS")
_DRIVERS = (
    {"GTiff": "tif tiff gtiff gtif btf tf8 cog", "VRT": "vrt", "PNG": "png", "JPEG": "jpg jpeg", "BMP": "bmp"}
    | {"GIF": "gif", "PNM": "pgm ppm pnm", "WEBP": "webp", "SRTMHGT": "hgt", "DTED": "dt0 dt1 dt2"}
    | {"NITF": "ntf nitf", "GRIB": "grb grb2 grib grib2", "GPKG": "gpkg", "MBTiles": "mbtiles"}
    | {"netCDF": "nc"}
)
_BY_EXTENSION: dict[str, tuple[str, ...]] = {
    **{f".{end}": (driver,) for driver, ends in _DRIVERS.items() for end in ends.split()},
    **dict.fromkeys((".jp2", ".j2k", ".jpx"), _JPEG2000),
    **dict.fromkeys((".bil", ".bip", ".bsq", ".bin", ".flt"), _RAW),
    ".img": ("HFA", *_RAW),
    ".asc": ("AAIGrid", "GRASSASCIIGrid"),
    ".dem": ("USGSDEM", *_RAW),
    ".xml": _WEB_SERVICES,
}
_PLAIN = ("GTiff", "PNG", "JPEG", *_JPEG2000, "HFA", "BMP", "GIF", "PNM", "WEBP", "NITF", *_RAW, "AAIGrid")

_NOT_ONLY_IMAGES = {".vrt", ".gpkg", ".xml", ".bin", ".nc", ".mbtiles"}  # nor VRT, which is made of others

_SUBDATASET = re.compile(r"[A-Za-z0-9_]{2,}:(?!//)")  # GTIFF_DIR:2:a.tif, NETCDF:"a.nc":band, ...
_TEXT_DRIVERS = frozenset({"AAIGrid", "GRASSASCIIGrid"})
_read: "WeakKeyDictionary[DatasetReader, int]" = WeakKeyDictionary()  # rows so far, by open file
MAX_OPEN = 64  # open files per thread
CACHE_BYTES = 32 << 20  # GDAL's cache of decoded blocks; its own default is a twentieth of the memory
GDAL_OPTIONS = {
    "GDAL_PNG_WHOLE_IMAGE_OPTIM": "NO",  # it reads missing parts of truncated files as 0
    "GDAL_VRT_ENABLE_PYTHON": "NO",  # code of files is not run
    "GDAL_NUM_THREADS": "1",  # threads of the JPEG 2000 driver read damaged tiles as 0, without an error
}
OFFLINE_OPTIONS = {  # the second line of defence: what files name is checked before they are opened
    "GDAL_HTTP_PROXY": "none://offline",  # no such kind of proxy: every request fails before it is sent
    "CPL_VSIL_CURL_ALLOWED_FILENAME": "\n",  # no file of a network file system has this name
}
# They have no common base class; the last one is of a name, or of a text in the file.
GDAL_ERRORS = (RasterioError, CRSError, CPLE_BaseError, UnicodeError)
_UNREAD_TAG = re.compile(r'IO error during reading of "((?:Geo|GDAL|RPC|Extra|Color|Sample|Transparency)\w*)')


def drivers_of(path: str) -> tuple[str, ...]:
    """Return the drivers that may open a raster, in the order in which they are tried; empty for any.

    Any driver is for names that are not those of files: subdatasets, and descriptions as the name itself.

    Examples
    --------
    >>> drivers_of("a.TIF"), drivers_of("https://example.org/a.png?key=1"), drivers_of("WMTS:https://a.org")
    (('GTiff',), ('PNG',), ())
    """
    if names_no_file(path):
        return ()
    name = path.split("?", 1)[0] if is_address(path) else path
    return _BY_EXTENSION.get(PurePosixPath(name).suffix.lower(), _PLAIN)


def image_extensions() -> frozenset[str]:
    """Return extensions of files that are images by their name alone, in lower case."""
    return frozenset(_BY_EXTENSION) - _NOT_ONLY_IMAGES


def names_no_file(path: str) -> bool:
    """Return whether a name is a subdataset or a description, which GDAL's drivers read as they like."""
    is_description = path.startswith(("<", "{")) or path.lower().startswith("vrt://")
    return is_description or _SUBDATASET.match(path) is not None


def as_file_name(path: str) -> str:
    """Return the name of a file so that GDAL takes it for nothing else, whatever characters it has."""
    return f"./{path}" if names_no_file(path) and Path(path).exists() else path


def is_sequential(driver: str) -> bool:
    """Return whether a row can be read only if all rows before it can."""
    return driver in _TEXT_DRIVERS


def read_rows_before(source: DatasetReader, window: Window) -> None:
    """Read the rows above the end of a window that were not read yet, in order (RasterioError)."""
    for row in range(_read.get(source, 0), window.row + window.rows):
        source.read(1, window=((row, row + 1), (0, source.width)))
        _read[source] = row + 1


def _silence_libtiff() -> None:
    """Take away libtiff's handlers that print of full disks to stderr, where it is a library of its own."""
    with suppress(OSError, AttributeError):
        maps = Path("/proc/self/maps").read_text(errors="replace")
        for path in set(re.findall(r"/\S*/libtiff[^/\s]*\.so[^/\s]*", maps)):
            library = ctypes.CDLL(path)
            for name in ("TIFFSetErrorHandler", "TIFFSetWarningHandler"):
                unset = getattr(library, name)
                unset.argtypes, unset.restype = [ctypes.c_void_p], ctypes.c_void_p
                unset(None)


_silence_libtiff()


class OpenFiles:
    """Pool of open files, one for each thread; it is empty after unpickling."""

    def __init__(self) -> None:
        self._local = threading.local()

    def __reduce__(self) -> tuple[type["OpenFiles"], tuple[()]]:
        return OpenFiles, ()

    def open(self, path: str, located: bool, driver: str | None = None, masks: str = "") -> DatasetReader:
        """Return the open file, opened now if it is not; beyond 64 files the least recently used is closed.

        A RasterReadError says that it cannot be opened, or has lost its place on the map (`located`) or its
        masks (`masks`, of `mask_kind`).
        """
        files: OrderedDict[str, DatasetReader] = self._local.__dict__.setdefault("files", OrderedDict())
        if path not in files:
            with open_errors(path):
                source = (rasterio.open if located else quiet_open)(path, driver=driver)
                if (masks and mask_kind(source) != masks) or (located and source.transform.is_identity):
                    source.close()
                    raise RasterReadError(f"{path} changed, or its header cannot be read any more")
            files[path] = source
            if len(files) > MAX_OPEN:
                files.popitem(last=False)[1].close()
        files.move_to_end(path)
        return files[path]

    def failed_blocks(self, path: str, bands: tuple[int, ...]) -> set[tuple[int, int]]:
        """Return first row and column of the blocks that this thread could not read, to be added to.

        A block is not tried again for each tile that it meets: where a strip of a damaged file is as wide as
        the raster, that took most of the time.
        """
        known: dict[tuple[str, tuple[int, ...]], set[tuple[int, int]]]
        known = self._local.__dict__.setdefault("failed", {})
        return known.setdefault((path, bands), set())

    def bad_as_a_whole(self, path: str, bands: tuple[int, ...], is_bad: Callable[[], bool]) -> bool:
        """Return whether nothing of a file can be read, which this thread asks once."""
        known: dict[tuple[str, tuple[int, ...]], bool] = self._local.__dict__.setdefault("bad", {})
        if (path, bands) not in known:
            known[path, bands] = is_bad()
        return known[path, bands]

    def close(self, path: str) -> None:
        """Close a file, if this thread has it open; it is opened anew when it is needed."""
        files: OrderedDict[str, DatasetReader] = self._local.__dict__.get("files", OrderedDict())
        if path in files:
            files.pop(path).close()


@contextmanager
def gdal_env(online: bool = False) -> Iterator[None]:
    """Capture GDAL's messages, without requests unless `online`, and with a small block cache.

    The cache is left as it is where GDAL_CACHEMAX is set.
    """
    if _thread_options.hold(online):
        yield
        return
    with rasterio.Env(), _thread_options.in_use(online):
        yield


class _ThreadOptions(threading.local):
    """GDAL's options while this thread reads: rasterio sets those of the process in the main thread."""

    def __init__(self) -> None:
        self._readers = 0
        self._online = 0
        self._before: dict[str, Any] = {}

    def hold(self, online: bool) -> bool:
        """Whether this thread reads already, and may make requests if it is to."""
        return self._readers > 0 and (self._online > 0 or not online)

    @contextmanager
    def in_use(self, online: bool) -> Iterator[None]:
        self._readers += 1
        self._online += online
        if self._readers == 1:
            default: int | None = get_gdal_config("GDAL_CACHEMAX")
            cache = {"GDAL_CACHEMAX": min(CACHE_BYTES, default or CACHE_BYTES)}
            self._set(GDAL_OPTIONS | ({} if "GDAL_CACHEMAX" in os.environ else cache))
        if online and self._online == 1:
            self._restore(OFFLINE_OPTIONS)
        elif not self._online and self._readers == 1:
            self._set(OFFLINE_OPTIONS)
        try:
            yield
        finally:
            self._readers -= 1
            self._online -= online
            if self._readers == 0:
                self._restore(list(self._before))
            elif online and not self._online:
                self._set(OFFLINE_OPTIONS)

    def _set(self, options: dict[str, Any]) -> None:
        for name, value in options.items():
            self._before[name] = get_gdal_config(name, normalize=False)
            set_gdal_config(name, value)

    def _restore(self, names: Iterable[str]) -> None:
        for name in [name for name in names if name in self._before]:
            value = self._before.pop(name)
            if value is None:
                del_gdal_config(name)
            else:
                set_gdal_config(name, value, normalize=False)


_thread_options = _ThreadOptions()


def quiet_open(path: str | os.PathLike[str], mode: str = "r", **how: Any) -> Any:
    """Call `rasterio.open` without its warning about files that are not georeferenced."""
    while True:
        with changing_filters(), suppress(NotGeoreferencedWarning):  # shapely may change them beside it
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            return rasterio.open(path, mode, **how)


def mask_kind(source: DatasetReader) -> str:
    """Return the masks of a raster: "file" if all bands share one, "band" if each has its own, or ""."""
    names = [{flag.name for flag in band} for band in source.mask_flag_enums]
    if "per_dataset" in names[0] and "alpha" not in names[0]:
        return "file"
    return "band" if any(not band for band in names) else ""


@contextmanager
def unread_tags_are_errors(path: str) -> Iterator[None]:
    """Raise RasterReadError if a tag that matters of a TIFF opened here cannot be read: GDAL ignores it."""
    found: list[str] = []
    thread = threading.get_ident()

    def note(record: logging.LogRecord) -> None:
        if record.thread == thread and _UNREAD_TAG.search(record.getMessage()):
            found.append(record.getMessage())

    handler = logging.Handler(logging.WARNING)
    handler.emit = note  # type: ignore[method-assign]
    log = logging.getLogger("rasterio._env")
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
    if found:
        tag = _UNREAD_TAG.findall(found[0])[0]
        raise RasterReadError(
            f"{path} cannot be opened as a raster (its tag {tag} cannot be read); the file is damaged or "
            "incomplete: repair it"
        )


def has_place(source: DatasetReader) -> bool:
    """Return whether GDAL finds a geotransform, ground control points or RPCs in a raster."""
    with changing_filters(), suppress(NotGeoreferencedWarning):
        warnings.simplefilter("error", NotGeoreferencedWarning)
        source.read_transform()
        return True
    return False


@contextmanager
def gdal_read_errors(path: str, window: Window, online: bool = False) -> Iterator[None]:
    """Capture GDAL's messages, and raise its errors on reading a window as RasterReadError."""
    try:
        with gdal_env(online):
            yield
    except GDAL_ERRORS as error:
        rows, cols = rasterio_window(window)
        raise RasterReadError(
            f"{path} cannot be read in rows {rows[0]} to {rows[1]}, columns {cols[0]} to {cols[1]} "
            f"({cause_of(error)}); the file is damaged or incomplete: repair it, or give --skip-bad-tiles "
            "(skip_bad_tiles=True) to count unreadable blocks as nodata"
        ) from error


@contextmanager
def open_errors(path: str) -> Iterator[None]:
    """Enter a block in which GDAL's errors are raised as why a raster cannot be opened (RasterReadError)."""
    try:
        yield
    except GDAL_ERRORS as error:
        reason = f"{path} cannot be opened as a raster ({cause_of(error)})"
        if os.path.isdir(path):  # noqa: PTH112 - false for a name that is too long
            reason = f"{path} is a folder; name the rasters in it"
        elif not (is_remote(path) or ":" in path[2:] or file_exists(path)):
            reason = f"there is no file {path}"
        raise RasterReadError(reason) from error


def file_exists(path: str | os.PathLike[str]) -> bool:
    """Return whether there is a file or folder; False too for what is too long for a name."""
    return os.path.exists(path)  # noqa: PTH110 - the method of Path raises then


def is_remote(path: str) -> bool:
    """Return whether a path is a URL, or belongs to one of GDAL's virtual file systems."""
    return "://" in path or path.startswith("/vsi")


def absolute_path(path: str) -> str:
    """Return a path that means the same in another process: that of an existing local file becomes absolute.

    Examples
    --------
    >>> absolute_path("/vsicurl/https://example.org/a.tif")
    '/vsicurl/https://example.org/a.tif'
    """
    archive = re.match(r"/vsi(?:zip|tar|gzip|7z|rar)/(?!/|vsi|\{)", path)
    if archive:
        return path[: archive.end()] + str(Path(path[archive.end() :]).absolute())
    return str(Path(path).absolute()) if file_exists(path) else path


def rasterio_window(window: Window) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return a window for rasterio: start and end of the rows, and of the columns."""
    return (window.row, window.row + window.rows), (window.col, window.col + window.cols)
