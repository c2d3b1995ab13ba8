"""Files of a bag (.bag of ROS 1, .mcap and .db3 of ROS 2), and bounds on what they unpack to.

Each is a regular file in its place. rosbags itself decompresses a chunk to whatever size it has.
"""

import bz2
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uavseg.access import current_policy
from uavseg.errors import BagError
from uavseg.inputs import check_yaml_brackets, read_bytes, regular_file
from uavseg.plain_text import cause_of, shown
from uavseg.raster.access.databases import check_database

ROS1, ROS2 = (".bag",), (".mcap", ".db3")
MAX_METADATA = 1 << 20  # bytes of metadata.yaml
MAX_CHUNK = 256 << 20  # bytes of a chunk, unpacked; recorders make chunks of up to a few MB
MAX_TOGETHER = 1 << 30  # bytes of chunks that are unpacked at once, because their times overlap

_METADATA = "metadata.yaml"
_SQLITE_URI = re.compile(r"[?#%]")  # characters with which SQLite would open another file than the named one


def bag_files(path: str | os.PathLike[str]) -> list[Path]:
    """List the files of a bag in the order in which they were recorded.

    Parameters
    ----------
    path : path
        A file, or a folder of ROS 2 with its metadata.yaml.
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
    metadata = _read_metadata(folder)
    names = metadata.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise BagError(f"{folder / _METADATA} names no files of a bag; ros2 bag reindex writes it anew")
    mode = str(metadata.get("compression_mode") or "none").lower()
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
    import yaml

    path = folder / _METADATA
    if not path.exists():
        raise BagError(f"{folder} is not a bag of ROS 2: it has no {_METADATA}; name a .mcap or .db3 in it")
    content = read_bytes(path, BagError, MAX_METADATA)
    try:
        check_yaml_brackets(content)
        if any(isinstance(token, yaml.AliasToken) for token in yaml.scan(content, Loader=yaml.SafeLoader)):
            raise BagError(f"{path} holds YAML aliases (*name), which the file of a bag does not need")
        metadata = yaml.safe_load(content)["rosbag2_bagfile_information"]
    except (yaml.YAMLError, ValueError, RecursionError, TypeError, KeyError) as error:
        if isinstance(error, BagError):
            raise
        raise BagError(f"{path} is not the metadata of a bag ({cause_of(error)})") from error
    if not isinstance(metadata, dict):
        raise BagError(f"{path} is not the metadata of a bag")
    return metadata


def _check_database(file: Path) -> None:
    """Refuse a database that SQLite would not open as this file, or not whole."""
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


@contextmanager
def bounded_decompression() -> Iterator[None]:
    """Limit the chunks that rosbags unpacks within the block to 256 MB, whatever they claim."""
    from rosbags.rosbag1 import reader as rosbag1
    from rosbags.rosbag2 import storage_mcap as mcap

    before = dict(rosbag1.decompressors), dict(mcap.DECOMPRESSORS)
    zstd = _bounded(mcap.zstd.ZstdDecompressor)
    rosbag1.decompressors.update(bz2=_bounded(bz2.BZ2Decompressor), lz4=_bounded(_lz4))
    mcap.DECOMPRESSORS.update(
        lz4=lambda packed, _: _bounded(_lz4)(packed), zstd=lambda packed, _: zstd(packed)
    )
    try:
        yield
    finally:
        rosbag1.decompressors.update(before[0])
        mcap.DECOMPRESSORS.update(before[1])


def _lz4() -> Any:
    import lz4.frame

    return lz4.frame.LZ4FrameDecompressor()


def _bounded(make: Callable[[], Any]) -> Callable[[bytes], bytes]:
    """Make a function that unpacks at most MAX_CHUNK bytes."""

    def unpack(packed: bytes) -> bytes:
        unpacker = make()
        unpacked: bytes = unpacker.decompress(packed, MAX_CHUNK)
        if not unpacker.eof:
            raise ValueError(f"a chunk is cut off, or has more than {MAX_CHUNK >> 20} MB")
        return unpacked

    return unpack


def check_overlap(chunks: list[Any], path: str) -> None:
    """Refuse an MCAP file of which too many bytes are unpacked at once: messages are merged by time.

    Parameters
    ----------
    chunks : list of ChunkInfo
        Of rosbags' reader, which checks the unpacked size of each when it unpacks it.
    path : str
    """
    changes = [(chunk.message_start_time, chunk.uncompressed_size) for chunk in chunks]
    changes += [(chunk.message_end_time + 1, -chunk.uncompressed_size) for chunk in chunks]
    together = 0
    for _, size in sorted(changes):
        together += size
        if together > MAX_TOGETHER:
            raise BagError(
                f"{path} has chunks of more than {MAX_TOGETHER >> 20:,} MB that overlap in time; is it "
                "damaged? ros2 bag convert writes it anew"
            )
