"""Checked opening of a raster: named files, driver, sizes. Every raster of a user is opened here first."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rasterio.errors import RasterioIOError
from rasterio.io import DatasetReader

from uavseg.access import current_policy, is_address
from uavseg.errors import AccessError, RasterReadError
from uavseg.inputs import regular_file
from uavseg.plain_text import cause_of
from uavseg.raster.access.drivers import as_file_name, drivers_of, names_no_file
from uavseg.raster.access.limits import check_limits
from uavseg.raster.access.named_files import NamedFiles, check_named_file
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open, unread_tags_are_errors
from uavseg.raster.access.sequential_rows import is_sequential, read_rows_before
from uavseg.raster.access.vrt_sources import sources_of
from uavseg.raster.grid.tiling import Window

_PAGE = re.compile(r"GTIFF_DIR:\d+:(.*)", re.IGNORECASE | re.DOTALL)
_DATABASES = (("GPKG",), ("MBTiles",))
_ARCHIVE = re.compile(r"/vsi(?!curl|s3|gs|az|adls|oss|swift|hdfs|webhdfs)", re.IGNORECASE)


@contextmanager
def open_checked(path: str) -> Iterator[DatasetReader]:
    """A raster, opened once what it names and the sizes in its header are known to be allowed.

    Parameters
    ----------
    path : str
        As the user named it: a file, or any name that GDAL opens.

    Raises
    ------
    UavsegError
        If it names what the access policy in effect does not allow, or its header is beyond the limits.
    RasterioError
        If GDAL cannot open it.
    """
    path, found = as_file_name(path), None
    if is_local(path):
        found = NamedFiles(path)
        found.check()
        for source_path in (path, *found.rasters):
            if drivers_of(source_path) in _DATABASES and Path(source_path).is_file():
                from uavseg.raster.access.databases import check_database

                check_database(source_path, source_path, RasterReadError)
    elif page := _PAGE.fullmatch(path):
        regular_file(page[1])
    elif drivers_of(path) == ("VRT",):
        _check_unread_vrt(path)
    with gdal_env(is_online(path)):
        for source_path in found.rasters if found else ():
            with open_by(source_path, drivers_of(source_path)) as source:
                _check_opened(path, source_path, source)
                if is_sequential(source.driver):  # of which GDAL would look for a later row for ever
                    _check_rows(path, source_path, source)
        with open_by(path, drivers_of(path)) as source:
            _check_opened(path, path, source)
            yield source


def open_by(path: str, drivers: tuple[str, ...]) -> DatasetReader:
    """A raster, opened by the first of these drivers that can; by any if there are none.

    Raises
    ------
    RasterioIOError
        The error of the first driver, if none can.
    """
    first: RasterioIOError | None = None
    for driver in drivers or (None,):
        try:
            with unread_tags_are_errors(path):
                return quiet_open(path, driver=driver)
        except RasterioIOError as error:
            first = first or error
    assert first is not None
    raise first


def is_local(path: str) -> bool:
    """Whether a name is that of a local file, which may not exist."""
    return not (is_address(path) or path.startswith("/vsi") or "://" in path or names_no_file(path))


def is_online(path: str) -> bool:
    """Whether a raster that the user named may make requests: by its own name, or if they are allowed."""
    return current_policy().allow_network or is_address(path) or "://" in path


def _check_unread_vrt(path: str) -> None:
    """A VRT that cannot be read before GDAL opens it."""
    if not is_address(path):
        raise AccessError(
            f"{path} lies in an archive, so what it names cannot be checked; unpack the archive"
        )
    current_policy().check_address(path, "of a file, which cannot be checked before it is read")


def _check_rows(owner: str, path: str, source: DatasetReader) -> None:
    """Check that each row of a text grid can be read, which a VRT names."""
    try:
        read_rows_before(source, Window(0, 0, *source.shape))
    except GDAL_ERRORS as error:
        raise RasterReadError(
            f"{owner} names {path}, which cannot be read as a whole ({cause_of(error)}); repair it"
        ) from error


def _check_opened(owner: str, path: str, source: DatasetReader) -> None:
    """Check what is known of a raster only once it is open."""
    overview = source.tags(ns="OVERVIEWS").get("OVERVIEW_FILE")
    if overview is not None:
        name = overview.removeprefix(":::BASE:::")
        check_named_file(owner, name if name == overview else str(Path(path).parent / name))
    check_limits(path, source)
    if source.driver not in ("GTiff", "VRT", "PNG", "JPEG") and is_local(path):
        for name in source.files:
            check_named_file(owner, name)
    if source.driver == "VRT" and not is_local(path):
        for text in source.tags(ns="xml:VRT").values():
            for named in sources_of(path, text.encode()):
                current_policy().check_name(path, named.name, Path())
