"""Inputs are kept: an output never replaces a file that the same command reads."""

import os
from collections.abc import Iterable
from pathlib import Path

from uavseg.errors import OutputError
from uavseg.output.targets import Path_, existing_files

Identity = tuple[int, int]


def check_not_inputs(outputs: Iterable[Path_ | None], inputs: Iterable[Path_]) -> None:
    """Check that no output would replace an input, by whatever name.

    Parameters
    ----------
    outputs : iterable of path or None
        Where they are not to be made, they are None; "-" is standard output.
    inputs : iterable of path
        Their sidecar files are inputs too. What is no file of this machine is left out.

    Raises
    ------
    OutputError
        If one would.
    """
    made = {
        file: path
        for path in outputs
        if path is not None and path != "-"
        for file in _files_of(Path(os.path.realpath(path)))
    }
    if not made:
        return
    read = {
        identity: path for path in inputs for file in _files_of(Path(path)) if (identity := _identity(file))
    }
    for file, output in made.items():
        if (identity := _identity(file)) in read:
            raise OutputError(
                f"{output} would replace {read[identity]}, which is read for it; name another output"
            )


def _files_of(path: Path) -> list[Path]:
    """The files of a path that are there, and what lies in its folders."""
    found = existing_files(path)
    return [*found, *(file for folder in found if folder.is_dir() for file in folder.iterdir())]


def _identity(file: Path) -> Identity | None:
    """Device and inode, which are the same for every name of a file; None if there is none."""
    try:
        about = file.stat()
    except OSError:
        return None
    return about.st_dev, about.st_ino
