"""GDAL access: a pool of open files per thread, a small block cache, captured messages, readable errors."""

import os
import re
import threading
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rasterio
from rasterio._err import CPLE_BaseError
from rasterio.env import get_gdal_config, set_gdal_config
from rasterio.errors import CRSError, NotGeoreferencedWarning, RasterioError
from rasterio.io import DatasetReader

from uavseg.errors import RasterReadError
from uavseg.plain_text import cause_of
from uavseg.raster.tiling import Window

MAX_OPEN = 64  # open files per thread
CACHE_BYTES = 32 << 20  # GDAL's cache of decoded blocks; its own default is a twentieth of the memory
GDAL_OPTIONS = {"GDAL_PNG_WHOLE_IMAGE_OPTIM": "NO"}  # it reads missing parts of truncated files as 0
GDAL_ERRORS = (  # they have no common base class
    RasterioError,
    CRSError,
    CPLE_BaseError,
    UnicodeError,  # of a name, or of a text in the file
)


class OpenFiles:
    """Pool of open files, one for each thread; it is empty after unpickling."""

    def __init__(self) -> None:
        self._local = threading.local()

    def __reduce__(self) -> tuple[type["OpenFiles"], tuple[()]]:
        return OpenFiles, ()

    def open(self, path: str, located: bool) -> DatasetReader:
        """The open file, opened now if it is not; beyond 64 files the least recently used is closed."""
        files: OrderedDict[str, DatasetReader] = self._local.__dict__.setdefault("files", OrderedDict())
        if path not in files:
            try:
                files[path] = rasterio.open(path) if located else quiet_open(path)
            except GDAL_ERRORS as error:
                raise RasterReadError(open_error_text(path, error)) from error
            if len(files) > MAX_OPEN:
                files.popitem(last=False)[1].close()
        files.move_to_end(path)
        return files[path]

    def close(self, path: str) -> None:
        """Close a file, if this thread has it open; it is opened anew when it is needed."""
        files: OrderedDict[str, DatasetReader] = self._local.__dict__.get("files", OrderedDict())
        if path in files:
            files.pop(path).close()


@contextmanager
def gdal_env() -> Iterator[None]:
    """GDAL with its messages captured, and with a small block cache unless GDAL_CACHEMAX is set."""
    with rasterio.Env(**GDAL_OPTIONS), _small_cache:
        yield


class _SmallCache:
    """Limits GDAL's block cache, which belongs to the process, while at least one thread reads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._readers = 0
        self._default: int | None = None

    def __enter__(self) -> None:
        with self._lock:
            self._readers += 1
            if self._readers == 1 and "GDAL_CACHEMAX" not in os.environ:
                self._default = get_gdal_config("GDAL_CACHEMAX")
                set_gdal_config("GDAL_CACHEMAX", min(CACHE_BYTES, self._default or CACHE_BYTES))

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._readers -= 1
            if self._readers == 0 and self._default is not None:
                set_gdal_config("GDAL_CACHEMAX", self._default)
                self._default = None


_small_cache = _SmallCache()
_warning_filters = threading.Lock()  # they belong to the process: only one thread at a time may change them


def quiet_open(path: str | os.PathLike[str], mode: str = "r", **how: Any) -> Any:
    """`rasterio.open` without its warning about files that are not georeferenced."""
    with _warning_filters, warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        return rasterio.open(path, mode, **how)


def open_noting_place(path: str | os.PathLike[str]) -> tuple[DatasetReader, bool]:
    """Open a raster, and tell whether GDAL finds a geotransform, control points or RPCs in it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        source = rasterio.open(path)
    others = [found for found in caught if not issubclass(found.category, NotGeoreferencedWarning)]
    for found in others:
        warnings.warn_explicit(found.message, found.category, found.filename, found.lineno)
    return source, len(others) == len(caught)


@contextmanager
def gdal_read_errors(path: str, window: Window) -> Iterator[None]:
    """GDAL's messages captured; its errors on reading a window as RasterReadError."""
    try:
        with gdal_env():
            yield
    except GDAL_ERRORS as error:
        rows, cols = rasterio_window(window)
        raise RasterReadError(
            f"{path} cannot be read in rows {rows[0]} to {rows[1]}, columns {cols[0]} to {cols[1]} "
            f"({cause_of(error)}); the file is damaged or incomplete: repair it, or give --skip-bad-tiles "
            "(skip_bad_tiles=True) to count unreadable blocks as nodata"
        ) from error


def open_error_text(path: str, error: BaseException) -> str:
    """Reason why a raster cannot be opened, as one line."""
    if os.path.isdir(path):  # noqa: PTH112 - false for a name that is too long
        return f"{path} is a folder; name the rasters in it"
    if not (is_remote(path) or ":" in path[2:] or file_exists(path)):
        return f"there is no file {path}"
    return f"{path} cannot be opened as a raster ({cause_of(error)})"


def file_exists(path: str | os.PathLike[str]) -> bool:
    """Whether there is a file or folder; False too for what is too long for a name."""
    return os.path.exists(path)  # noqa: PTH110 - the method of Path raises then


def is_remote(path: str) -> bool:
    """Whether a path is a URL, or belongs to one of GDAL's virtual file systems."""
    return "://" in path or path.startswith("/vsi")


def absolute_path(path: str) -> str:
    """A path that means the same in another process: that of an existing local file becomes absolute.

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
    """A window for rasterio: start and end of the rows, and of the columns."""
    return (window.row, window.row + window.rows), (window.col, window.col + window.cols)
