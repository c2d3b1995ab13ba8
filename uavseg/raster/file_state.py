"""File state: path, size and modification time of every file that a raster consists of."""

from pathlib import Path

from uavseg.errors import RasterReadError
from uavseg.raster.opening import GDAL_ERRORS, gdal_env, quiet_open, root_cause

FileState = tuple[str, int, int]


def file_states(path: str) -> tuple[FileState, ...]:
    """Path, size in bytes and modification time in ns of every file that a raster consists of.

    These are the file itself, its sidecar files (masks, overviews) and those that it refers to (a VRT). A
    file in an archive is represented by the archive; a remote file by its address, with -1 and -1.

    Raises
    ------
    RasterReadError
        If the raster cannot be opened.
    """
    try:
        with gdal_env(), quiet_open(path) as source:
            names = sorted({path, *source.files})
    except GDAL_ERRORS as error:
        raise RasterReadError(f"{path} cannot be opened as a raster ({root_cause(error)})") from error
    return tuple(_state(name) for name in names)


def _state(name: str) -> FileState:
    for path in _on_disk(name):
        try:
            found = path.stat()
        except OSError:
            continue
        return str(path.absolute()), found.st_size, found.st_mtime_ns
    return name, -1, -1


def _on_disk(name: str) -> list[Path]:
    """Paths on disk that a name may stand for: itself, or for a name in an archive, the archive."""
    if not name.startswith("/vsi"):
        return [Path(name)]
    inner = Path(name.split("/", 2)[-1].replace("{", "").replace("}", ""))
    candidates = [inner, Path("/") / inner]
    return [path for start in candidates for path in (start, *start.parents) if path.name]
