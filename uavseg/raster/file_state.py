"""Which files a raster is made of, and what tells whether they changed."""

from pathlib import Path

from uavseg.errors import RasterReadError
from uavseg.raster.opening import GDAL_ERRORS, gdal_env, quiet_open, root_cause

FileState = tuple[str, int, int]


def file_states(path: str) -> tuple[FileState, ...]:
    """Path, size in bytes and time of change in ns of every file that a raster is made of.

    That is the file itself, what lies beside it (masks, overviews) and what it refers to (a VRT). Of a file
    within an archive it is the archive; of one that is not on this machine's disks only the address is known,
    with -1 and -1.

    Raises
    ------
    RasterReadError
        If the raster cannot be opened any more.
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
    """Where a name may lie on a disk: as it is, or for a name within an archive, the archive."""
    if not name.startswith("/vsi"):
        return [Path(name)]
    inner = Path(name.split("/", 2)[-1].replace("{", "").replace("}", ""))
    candidates = [inner, Path("/") / inner]
    return [path for start in candidates for path in (start, *start.parents) if path.name]
