"""Files that appear whole or not at all: written beside the target, renamed at the end."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uavseg.errors import OutputError, OutputExistsError, UavsegError


def check_target(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """The path, if a file may be written there; call it before the work that makes the file.

    Raises
    ------
    OutputExistsError
        If something is there already and `overwrite` is false.
    OutputError
        If the folder does not exist or the path is a folder.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise OutputError(f"the folder {target.parent} does not exist; make it first")
    if target.is_dir():
        raise OutputError(f"{target} is a folder; name a file in it")
    if target.exists() and not overwrite:
        raise OutputExistsError(f"{target} exists; give --overwrite (overwrite=True) to replace it")
    return target


@contextmanager
def whole_file(path: str | os.PathLike[str], overwrite: bool = False) -> Iterator[Path]:
    """A temporary path beside `path`; what is written there is renamed to `path` if nothing was raised.

    The temporary path keeps the name's suffix, and lies in a folder of its own, so that drivers which
    write several files (a shapefile's parts) or a folder may do so: all of them move together. A folder
    takes the place of one that is there, which must be the caller's own.

    Raises
    ------
    OutputExistsError, OutputError
        As `check_target`, and if writing fails, as on a full disk.
    """
    target = check_target(path, overwrite)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise OutputError(f"{target.parent} cannot be written to: {error.strerror}") from error
    try:
        yield folder / target.name
        for part in sorted(folder.iterdir()):
            _put(part, target.parent / part.name)
    except OSError as error:
        if isinstance(error, UavsegError):
            raise
        raise OutputError(f"{target} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _put(part: Path, place: Path) -> None:
    """Move a file or a folder to its place; what a folder replaces goes with the temporary ones."""
    if not (part.is_dir() and place.is_dir()):
        part.replace(place)
        return
    former = part.with_name(f".former.{part.name}")
    place.replace(former)
    try:
        part.replace(place)
    except OSError:
        former.replace(place)
        raise
