"""Recorded bags, read through rosbags without ROS: topics with their types, and messages of known types.

A bag holds the definitions of its messages. They are not used: rosbags would make Python code of them. Only
types that are known here are read, by the definition that all versions of ROS share; a bag whose own
definition has another hash is refused.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

from uavseg.errors import BagError
from uavseg.occupancy.bags.bounded import bounded_decompression, check_overlap
from uavseg.occupancy.bags.storage import ROS1, bag_files
from uavseg.plain_text import cause_of, shown

MAX_MESSAGE = 64 << 20  # bytes
MAX_SHOWN = 8  # topics that a message lists

LASERSCAN = "sensor_msgs/msg/LaserScan"
MULTI_ECHO = "sensor_msgs/msg/MultiEchoLaserScan"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
_SAME = {"tf/msg/tfMessage": TRANSFORMS}  # what ROS 1 called it before


@dataclass(frozen=True, slots=True)
class _Part:
    """One file of a bag, opened."""

    name: str
    reader: Any


@dataclass(frozen=True, slots=True)
class Bag:
    """An open bag.

    Parameters
    ----------
    name : str
        Its path.
    types : dict of str to str
        Type of the messages of each topic, such as "sensor_msgs/msg/LaserScan".
    """

    name: str
    types: dict[str, str]
    _parts: Sequence[_Part]
    _decode: Callable[[bytes, str], Any]
    _hash: Callable[[str], str]

    def check_topic(self, topic: str, *kinds: str) -> None:
        """Check that a topic exists and holds messages of one of some types.

        Raises
        ------
        BagError
            If not; the message lists the topics that exist.
        """
        found = self.types.get(topic)
        if found is None:
            raise BagError(f"{self.name} has no topic {shown(topic, False)}; it has {self._listed()}")
        if found not in kinds:
            raise BagError(
                f"{shown(topic, False)} of {self.name} holds {shown(found, False)}; expected "
                f"{' or '.join(kinds)}. "
                f"It has {self._listed()}"
            )

    def messages(self, topic: str) -> Iterator[Any]:
        """Messages of a topic, one after the other, as objects with the fields of their type.

        Raises
        ------
        BagError
            If the bag is damaged.
        """
        kind = self.types[topic]
        for part in self._parts:
            with _errors_of(part.name):
                used = [one for one in part.reader.connections if one.topic == topic]
                for one in used:
                    if one.digest and one.digest != self._hash(kind):
                        raise BagError(f"{topic} of {part.name} holds another {kind} than that of ROS")
                messages = part.reader.messages(connections=used) if used else iter(())
            while True:
                with _errors_of(part.name):
                    found = next(messages, None)
                    if found is None:
                        break
                    if len(found[2]) > MAX_MESSAGE:
                        raise BagError(f"a message in {part.name} has more than {MAX_MESSAGE >> 20} MB")
                    message = self._decode(found[2], kind)
                yield message

    def _listed(self) -> str:
        """The topics with their types, those of known types first."""
        known = (LASERSCAN, MULTI_ECHO, POINT_CLOUD, ODOMETRY, TRANSFORMS)
        ordered = sorted(self.types.items(), key=lambda item: (item[1] not in known, item[0]))
        listed = [f"{shown(topic, False)} ({shown(kind, False)})" for topic, kind in ordered[:MAX_SHOWN]]
        more = len(ordered) - len(listed)
        return ", ".join(listed) + (f" and {more} more" if more else "") if listed else "no topics"


@contextmanager
def open_bag(path: str | os.PathLike[str]) -> Iterator[Bag]:
    """A bag of ROS 1 or ROS 2, open for reading.

    Parameters
    ----------
    path : path
        A .bag, .mcap or .db3 file, or a folder that ros2 bag recorded.

    Raises
    ------
    BagError
        If rosbags is not installed, or the bag cannot be read.
    AccessError
        If it names files outside of its folder.
    """
    _check_installed()
    files = bag_files(path)
    name = os.fspath(path)
    with bounded_decompression(), ExitStack() as stack:
        parts = []
        for file in files:
            with _errors_of(os.fspath(file)):
                reader = _reader(file)
                reader.open()
                stack.callback(reader.close)
                _check_storage(getattr(reader, "storage", None), os.fspath(file))
            parts.append(_Part(os.fspath(file), reader))
        is_ros1 = files[0].suffix in ROS1
        store = _ros1_types() if is_ros1 else _ros2_types()
        decode = store.deserialize_ros1 if is_ros1 else store.deserialize_cdr
        kind_hash = (lambda kind: store.generate_msgdef(kind)[1]) if is_ros1 else store.hash_rihs01
        yield Bag(name, _types_of(name, parts), parts, decode, kind_hash)


def _check_installed() -> None:
    try:
        import rosbags.rosbag1
        import rosbags.rosbag2  # noqa: F401
    except ImportError as error:
        raise BagError('reading bags needs rosbags; pip install "uavseg[ros]"') from error


def _types_of(name: str, parts: Sequence[_Part]) -> dict[str, str]:
    """Type of each topic."""
    types: dict[str, str] = {}
    for part in parts:
        for one in part.reader.connections:
            kind = _SAME.get(one.msgtype, one.msgtype)
            if types.setdefault(one.topic, kind) != kind:
                raise BagError(f"{shown(one.topic, False)} of {name} holds messages of several types")
    return types


def _reader(file: Any) -> Any:
    from rosbags.rosbag2 import Reader

    return _indexed_reader(file) if file.suffix in ROS1 else Reader(file)


def _check_storage(storage: Any, name: str) -> None:
    """Bounds on an open file of ROS 2: chunks at one time of an MCAP, bytes of one value of a database."""
    check_overlap(getattr(storage, "chunks", []), name)
    if hasattr(storage, "dbconn"):
        import apsw

        storage.dbconn.limit(apsw.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)


def _indexed_reader(file: Any) -> Any:
    """rosbags' reader of ROS 1, which refuses an index that is larger than the file.

    The index of a chunk is found by its position. A damaged bag may point to one index many times, and every
    entry would be kept each time.
    """
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
    """Whatever rosbags raises on a damaged file as BagError: it raises what its parsers happen to raise."""
    try:
        yield
    except BagError:
        raise
    except MemoryError as error:
        raise BagError(f"{name} asks for more memory than there is; is it damaged?") from error
    except Exception as error:
        raise BagError(f"{name} cannot be read as a bag ({cause_of(error)}); is it damaged?") from error


@cache
def _ros1_types() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store


@cache
def _ros2_types() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)
