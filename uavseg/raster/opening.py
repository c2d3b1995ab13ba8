"""Files open to be read: few at a time, each thread its own, with GDAL kept quiet and small."""

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
from uavseg.raster.tiling import Window

MAX_OPEN = 64  # files that a thread keeps open
CACHE_BYTES = 32 << 20  # decoded blocks that GDAL keeps; its own default is a twentieth of the memory
GDAL_OPTIONS = {
    "GDAL_PNG_WHOLE_IMAGE_OPTIM": "NO"
}  # the shortcut reads what a truncated file lacks as 0, untold
GDAL_ERRORS = (RasterioError, CRSError, CPLE_BaseError)  # they have no parent of their own


class OpenFiles:
    """The files that are open, for each thread its own; pickled, it arrives empty."""

    def __init__(self) -> None:
        self._local = threading.local()

    def __reduce__(self) -> tuple[type["OpenFiles"], tuple[()]]:
        return OpenFiles, ()

    def open(self, path: str, located: bool) -> DatasetReader:
        """The open file, opened now if it is not; the one unused for longest is closed beyond 64."""
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


@contextmanager
def gdal_env() -> Iterator[None]:
    """GDAL with its messages caught, and with a small cache of blocks unless GDAL_CACHEMAX says otherwise."""
    with rasterio.Env(**GDAL_OPTIONS), _small_cache:
        yield


class _SmallCache:
    """Holds GDAL's cache of blocks small while anyone reads; the cache is one for the process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._readers = 0
        self._usual: int | None = None

    def __enter__(self) -> None:
        with self._lock:
            self._readers += 1
            if self._readers == 1 and "GDAL_CACHEMAX" not in os.environ:
                self._usual = get_gdal_config("GDAL_CACHEMAX")
                set_gdal_config("GDAL_CACHEMAX", min(CACHE_BYTES, self._usual or CACHE_BYTES))

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._readers -= 1
            if self._readers == 0 and self._usual is not None:
                set_gdal_config("GDAL_CACHEMAX", self._usual)
                self._usual = None


_small_cache = _SmallCache()
_warning_filters = threading.Lock()  # they belong to the process: one thread at a time changes them


def quiet_open(path: str | os.PathLike[str], mode: str = "r", **how: Any) -> Any:
    """`rasterio.open` without its warning about files that have no place on the map."""
    with _warning_filters, warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        return rasterio.open(path, mode, **how)


@contextmanager
def gdal_read_errors(path: str, window: Window) -> Iterator[None]:
    """GDAL's messages caught, its errors told in one sentence."""
    try:
        with gdal_env():
            yield
    except GDAL_ERRORS as error:
        rows, cols = rasterio_window(window)
        raise RasterReadError(
            f"{path} cannot be read in rows {rows[0]} to {rows[1]}, columns {cols[0]} to {cols[1]} "
            f"({root_cause(error)}); the file is damaged or incomplete: mend it, or give --skip-bad-tiles "
            "(skip_bad_tiles=True) to count what cannot be read as nodata"
        ) from error


def open_error_text(path: str, error: BaseException) -> str:
    """Why a raster cannot be opened, in one sentence."""
    if Path(path).is_dir():
        return f"{path} is a folder; name the rasters in it"
    if not (is_remote(path) or ":" in path[2:] or Path(path).exists()):
        return f"there is no file {path}"
    return f"{path} cannot be opened as a raster ({root_cause(error)})"


def is_remote(path: str) -> bool:
    """Whether a path is no file of this machine's own: of one of GDAL's virtual file systems, or a URL."""
    return "://" in path or path.startswith("/vsi")


def absolute_path(path: str) -> str:
    """A path as it means the same in another process: a relative one of a file that is here becomes absolute.

    Examples
    --------
    >>> in_full("/vsicurl/https://example.org/a.tif")
    '/vsicurl/https://example.org/a.tif'
    """
    archive = re.match(r"/vsi(?:zip|tar|gzip|7z|rar)/(?!/|vsi|\{)", path)
    if archive:
        return path[: archive.end()] + str(Path(path[archive.end() :]).absolute())
    return str(Path(path).absolute()) if Path(path).exists() else path


def root_cause(error: BaseException) -> str:
    """What GDAL said first, in one line."""
    while error.__cause__ is not None:
        error = error.__cause__
    return str(error).strip().rstrip(".").replace("\n", " ")


def rasterio_window(window: Window) -> tuple[tuple[int, int], tuple[int, int]]:
    """The window as rasterio takes it: first and past-the-end row, and the same of columns."""
    return (window.row, window.row + window.rows), (window.col, window.col + window.cols)
