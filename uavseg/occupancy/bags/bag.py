"""Recorded bags, read through rosbags without ROS: topics with their types, and messages of known types.

A bag holds the definitions of its messages. They are not used: rosbags would make Python code of them. Only
types that are known here are read, by the definition that all versions of ROS share; a bag whose own
definition has another hash is refused.

Each is a regular file in its place. rosbags itself decompresses a chunk to whatever size it has.
"""

import bz2
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from uavseg.access import current_policy
from uavseg.dataclass import dataclass
from uavseg.errors import BagError, caused_errors
from uavseg.inputs import parse_yaml, read_bytes, regular_file
from uavseg.plain_text import cause_of, shown
from uavseg.raster.access.untrusted import check_database

ROS1, ROS2 = (".bag",), (".mcap", ".db3")
MAX_METADATA = 1 << 20  # bytes of metadata.yaml
MAX_CHUNK = 256 << 20  # bytes of a chunk, unpacked; recorders make chunks of up to a few MB
MAX_TOGETHER = 1 << 30  # bytes of chunks that are unpacked at once, because their times overlap

_METADATA = "metadata.yaml"
_SQLITE_URI = re.compile(r"[?#%]")  # characters with which SQLite would open another file than the named one


def bag_files(path: str | os.PathLike[str]) -> list[Path]:
    """List the files of a bag (a file, or a folder of ROS 2 with its metadata.yaml) as they were recorded."""
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
    path = folder / _METADATA
    if not path.exists():
        raise BagError(f"{folder} is not a bag of ROS 2: it has no {_METADATA}; name a .mcap or .db3 in it")
    content = read_bytes(path, BagError, MAX_METADATA)
    aliases = f"{path} holds YAML aliases (*name), which the file of a bag does not need"
    invalid = f"{path} is not the metadata of a bag"
    described = parse_yaml(content, BagError, aliases, invalid)
    with caused_errors(invalid, BagError, TypeError, KeyError):
        metadata = described["rosbag2_bagfile_information"]
    if not isinstance(metadata, dict):
        raise BagError(invalid)
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

    `chunks` are those of rosbags' reader, which checks the unpacked size of each when it unpacks it.
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


MAX_MESSAGE = 64 << 20  # bytes
MAX_SHOWN = 8  # topics that a message lists

LASERSCAN = "sensor_msgs/msg/LaserScan"
MULTI_ECHO = "sensor_msgs/msg/MultiEchoLaserScan"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
_RENAMED = {"tf/msg/tfMessage": TRANSFORMS}  # its name in early versions of ROS 1


@dataclass(frozen=True, slots=True)
class Bag:
    """An open bag."""

    name: str  # its path
    types: dict[str, str]  # type of the messages of each topic, such as "sensor_msgs/msg/LaserScan"
    _readers: Sequence[tuple[str, Any]]  # path and open reader of each file
    _decode: Callable[[bytes, str], Any]
    _hash: Callable[[str], str]

    def check_topic(self, topic: str, *types: str) -> None:
        """Refuse a topic that does not exist or holds messages of other types, listing those that exist."""
        held = self.types.get(topic)
        if held is None:
            raise BagError(f"{self.name} has no topic {shown(topic, False)}; it has {self._listed()}")
        if held not in types:
            raise BagError(
                f"{shown(topic, False)} of {self.name} holds {shown(held, False)}; expected "
                f"{' or '.join(types)}. It has {self._listed()}"
            )

    def messages(self, topic: str) -> Iterator[Any]:
        """Read the messages of a topic one by one, as objects with the fields of their type."""
        type_name = self.types[topic]
        for name, reader in self._readers:
            with _errors_of(name):
                used = [one for one in reader.connections if one.topic == topic]
                if any(one.digest and one.digest != self._hash(type_name) for one in used):
                    raise BagError(f"{topic} of {name} holds another {type_name} than that of ROS")
                messages = reader.messages(connections=used) if used else iter(())
            while True:
                with _errors_of(name):
                    record = next(messages, None)
                    if record is None:
                        break
                    if len(record[2]) > MAX_MESSAGE:
                        raise BagError(f"a message in {name} has more than {MAX_MESSAGE >> 20} MB")
                    message = self._decode(record[2], type_name)
                yield message

    def _listed(self) -> str:
        """List the topics with their types, those of known types first."""
        known = (LASERSCAN, MULTI_ECHO, POINT_CLOUD, ODOMETRY, TRANSFORMS)
        ordered = sorted(self.types.items(), key=lambda item: (item[1] not in known, item[0]))
        listed = [f"{shown(topic, False)} ({shown(held, False)})" for topic, held in ordered[:MAX_SHOWN]]
        more = len(ordered) - len(listed)
        return ", ".join(listed) + (f" and {more} more" if more else "") if listed else "no topics"


@contextmanager
def open_bag(path: str | os.PathLike[str]) -> Iterator[Bag]:
    """Open a bag for reading: a .bag, .mcap or .db3 file, or a folder that ros2 bag recorded."""
    missing = 'reading bags needs rosbags; pip install "uavseg[ros]"'
    with caused_errors(missing, BagError, ImportError, form="{}"):
        import rosbags.rosbag1  # noqa: F401
        from rosbags.rosbag2 import Reader
    files = bag_files(path)
    name = os.fspath(path)
    with bounded_decompression(), ExitStack() as stack:
        readers = []
        is_ros1 = files[0].suffix in ROS1
        for file in files:
            with _errors_of(os.fspath(file)):
                reader = _bounded_reader(file) if file.suffix in ROS1 else Reader(file)
                reader.open()
                stack.callback(reader.close)
                storage: Any = getattr(reader, "storage", None)
                check_overlap(getattr(storage, "chunks", []), os.fspath(file))
                if hasattr(storage, "dbconn"):
                    import apsw

                    storage.dbconn.limit(apsw.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)
            readers.append((os.fspath(file), reader))
        store = _known_types(is_ros1)
        types: dict[str, str] = {}
        for one in (connection for _, reader in readers for connection in reader.connections):
            held = _RENAMED.get(one.msgtype, one.msgtype)
            if types.setdefault(one.topic, held) != held:
                raise BagError(f"{shown(one.topic, False)} of {name} holds messages of several types")
        yield Bag(
            name=name,
            types=types,
            _readers=readers,
            _decode=store.deserialize_ros1 if is_ros1 else store.deserialize_cdr,
            _hash=(lambda name: store.generate_msgdef(name)[1]) if is_ros1 else store.hash_rihs01,
        )


def _bounded_reader(file: Any) -> Any:
    """Make rosbags' reader of ROS 1 refuse an index larger than the file: chunks may share one, damaged."""
    from rosbags.rosbag1 import Reader

    class BoundedReader(Reader):  # type: ignore[misc]
        left = file.stat().st_size

        def read_index_data(self, pos: int, indexes: Any) -> None:
            start = self.bio.tell()
            super().read_index_data(pos, indexes)
            self.left -= self.bio.tell() - start
            if self.left < 0:
                raise ValueError("its index is larger than the file")

    return BoundedReader(file)


@contextmanager
def _errors_of(name: str) -> Iterator[None]:
    """Turn any error on a damaged file into a BagError: rosbags raises whatever its parsers raise."""
    try:
        yield
    except BagError:
        raise
    except MemoryError as error:
        raise BagError(f"{name} asks for more memory than there is; is it damaged?") from error
    except Exception as error:
        raise BagError(f"{name} cannot be read as a bag ({cause_of(error)}); is it damaged?") from error


@cache
def _known_types(is_ros1: bool) -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    if is_ros1:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store
