"""Files of a bag: a .bag of ROS 1, or the .mcap and .db3 files of ROS 2, each a regular file in its place."""

import os
import re
from pathlib import Path
from typing import Any

from uavseg.access import current_policy
from uavseg.errors import BagError
from uavseg.inputs import check_yaml_brackets, read_bytes, regular_file
from uavseg.plain_text import cause_of, shown
from uavseg.raster.access.databases import check_database

ROS1, ROS2 = (".bag",), (".mcap", ".db3")
MAX_METADATA = 1 << 20  # bytes of metadata.yaml

_METADATA = "metadata.yaml"
_SQLITE_URI = re.compile(r"[?#%]")  # characters with which SQLite would open another file than the named one


def bag_files(path: str | os.PathLike[str]) -> list[Path]:
    """The files of a bag, in the order in which they were recorded.

    Parameters
    ----------
    path : path
        A file, or a folder of ROS 2 with its metadata.yaml.

    Raises
    ------
    BagError
        If it is no bag, or cannot be read.
    AccessError
        If a file of the folder is a link to one outside of it, which the access policy does not allow.
    """
    is_folder = os.path.isdir(path)  # noqa: PTH112 - false for a name that is too long
    files = _files_of_folder(Path(path)) if is_folder else [regular_file(path, BagError)]
    for file in files:
        if file.suffix not in (*ROS1, *ROS2):
            raise BagError(
                f"{os.fspath(path)} is not a bag: expected a .bag of ROS 1, or a folder, .mcap "
                "or .db3 of ROS 2"
            )
        if file.suffix == ".db3":
            _check_database(file)
    return files


def _files_of_folder(folder: Path) -> list[Path]:
    described = _read_metadata(folder)
    names = described.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise BagError(f"{folder / _METADATA} names no files of a bag; ros2 bag reindex writes it anew")
    mode = str(described.get("compression_mode") or "none").lower()
    if mode != "none":
        raise BagError(
            f"{folder} is compressed by {shown(mode)}; ros2 bag convert writes it without compression, or "
            "with that of its storage (mcap), which is read"
        )
    files = [folder / Path(name).name for name in names]  # earlier versions wrote the folder as well
    for file in files:
        current_policy().check_file(folder / _METADATA, file)
    return files


def _read_metadata(folder: Path) -> dict[str, Any]:
    """What metadata.yaml says of a bag."""
    import yaml

    path = folder / _METADATA
    if not path.exists():
        raise BagError(f"{folder} is not a bag of ROS 2: it has no {_METADATA}; name a .mcap or .db3 in it")
    content = read_bytes(path, BagError, MAX_METADATA)
    try:
        check_yaml_brackets(content)
        if any(isinstance(token, yaml.AliasToken) for token in yaml.scan(content, Loader=yaml.SafeLoader)):
            raise BagError(f"{path} holds YAML aliases (*name), which the file of a bag does not need")
        found = yaml.safe_load(content)
        described = found["rosbag2_bagfile_information"]
    except (yaml.YAMLError, ValueError, RecursionError, TypeError, KeyError) as error:
        if isinstance(error, BagError):
            raise
        raise BagError(f"{path} is not the metadata of a bag ({cause_of(error)})") from error
    if not isinstance(described, dict):
        raise BagError(f"{path} is not the metadata of a bag")
    return described


def _check_database(file: Path) -> None:
    """Check that SQLite opens this file, and whole."""
    if _SQLITE_URI.search(os.fspath(file)):
        raise BagError(f"{file} has ?, # or % in its path, which SQLite does not open safely; rename it")
    for ending in ("-wal", "-journal"):
        left = file.with_name(file.name + ending)
        if left.exists() and left.stat().st_size:
            raise BagError(
                f"{file} was not closed when it was recorded: {left.name} holds messages; open and close it "
                "once with sqlite3, or ros2 bag reindex"
            )
    check_database(file, os.fspath(file), BagError)
