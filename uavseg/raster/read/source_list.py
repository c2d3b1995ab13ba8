"""Lists of rasters: a folder, a pattern or a file of names becomes the names of rasters."""

import glob
import os
from collections.abc import Iterable
from pathlib import Path

from uavseg.access import current_policy, is_address
from uavseg.arrays import Path_
from uavseg.errors import RasterReadError
from uavseg.inputs import read_bytes
from uavseg.raster.access.opening import file_exists, image_extensions, is_remote, names_no_file

MAX_LIST = 64 << 20  # bytes of a file of names


def expand_sources(names: Iterable[Path_]) -> list[str]:
    """Return the rasters that names stand for; a name that is none of the following stands for itself.

    - A folder: the image files in it, not those of its subfolders, in the order of their names. A VRT, which
      is made of other rasters, and files whose names begin with a point are not among them.
    - A pattern, such as ``tiles/*.tif`` or ``tiles/**/*.tif``: the files that match, in the order of their
      names.
    - ``@FILE``, as GDAL has it: the names in a text file, one a line; empty lines and lines that begin with
      ``#`` are skipped. They are relative to the working directory.

    A file whose name looks like one of them is that file. A RasterReadError says that a folder holds no
    rasters, that nothing matches a pattern, or that a list names nothing or cannot be read, an AccessError
    that it names an address, and requests are not allowed.
    """
    return [raster for name in names for raster in _expanded(os.fspath(name))]


def is_list(name: Path_) -> bool:
    """Return whether a name may stand for several rasters."""
    text = os.fspath(name)
    if is_remote(text) or names_no_file(text):
        return False
    if file_exists(text):
        return os.path.isdir(text)  # noqa: PTH112 - false for a name that is too long
    return text.startswith("@") or glob.has_magic(text)


def parse_list(content: bytes) -> list[str]:
    """Return names of a list, which end with a line or, as `find -print0` writes them, with a zero byte."""
    if b"\0" in content:
        return [os.fsdecode(name) for name in content.split(b"\0") if name]
    lines = [line.rstrip(b"\r") for line in content.split(b"\n")]
    return [os.fsdecode(line) for line in lines if line.strip() and not line.startswith(b"#")]


def stem_of(name: Path_) -> str:
    """Return the stem of an output's name: that of the folder, or of the first raster that a name stands for.

    Examples
    --------
    >>> stem_of("tiles/a.tif")
    'a'
    """
    text = os.fspath(name)
    if not is_list(text):
        return Path(text).stem
    if os.path.isdir(text):  # noqa: PTH112
        return Path(text).resolve().name or "regions"
    return Path(_expanded(text)[0]).stem


def _expanded(name: str) -> list[str]:
    if not is_list(name):
        return [name]
    if os.path.isdir(name):  # noqa: PTH112
        return _rasters_in(name)
    return _listed(name[1:]) if name.startswith("@") else _matching(name)


def _rasters_in(folder: str) -> list[str]:
    """Return image files of a folder, in the order of their names."""
    known = image_extensions()
    try:
        with os.scandir(folder) as entries:
            shown = [entry for entry in entries if not entry.name.startswith(".") and entry.is_file()]
            found = [one.name for one in shown if Path(one.name).suffix.lower() in known]
    except OSError as error:
        raise RasterReadError(f"{folder} cannot be listed ({error.strerror})") from error
    if not found:
        raise RasterReadError(
            f"{folder} is a folder without rasters (.tif, .jp2, .img, .png ...); name files, or a pattern "
            f"such as '{os.path.join(folder, '**', '*.tif')}' for its subfolders"  # noqa: PTH118
        )
    return [os.path.join(folder, name) for name in sorted(found)]  # noqa: PTH118 - keeps ./


def _matching(pattern: str) -> list[str]:
    try:
        result = sorted(name for name in glob.iglob(pattern, recursive=True) if Path(name).is_file())  # noqa: PTH207
    except (OSError, ValueError) as error:
        raise RasterReadError(f"{pattern} is no pattern that can be looked for ({error})") from error
    if not result:
        raise RasterReadError(f"no file matches {pattern}")
    return result


def _listed(path: str) -> list[str]:
    names = parse_list(read_bytes(path, limit=MAX_LIST))
    for name in names:
        if is_address(name):
            current_policy().check_address(path, name)
    if not names:
        raise RasterReadError(f"{path} names no rasters; write one name a line")
    return names
