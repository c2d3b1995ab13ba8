"""Recorded bags, read through rosbags without ROS: topics with their types, and messages of known types.

A bag holds the definitions of its messages. They are not used: rosbags would make Python code of them. Only
types that are known here are read, by the definition that all versions of ROS share; a bag whose own
definition has another hash is refused.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

from uavseg.errors import BagError
from uavseg.occupancy.bags.storage import ROS1, bag_files, bounded_decompression, check_overlap
from uavseg.plain_text import cause_of, shown

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
    """Open a bag of ROS 1 or ROS 2 for reading.

    Parameters
    ----------
    path : path
        A .bag, .mcap or .db3 file, or a folder that ros2 bag recorded.
    """
    try:
        import rosbags.rosbag1  # noqa: F401
        from rosbags.rosbag2 import Reader
    except ImportError as error:
        raise BagError('reading bags needs rosbags; pip install "uavseg[ros]"') from error
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
                _check_storage(getattr(reader, "storage", None), os.fspath(file))
            readers.append((os.fspath(file), reader))
        store = _ros1_types() if is_ros1 else _ros2_types()
        yield Bag(
            name=name,
            types=_types_of(name, [reader for _, reader in readers]),
            _readers=readers,
            _decode=store.deserialize_ros1 if is_ros1 else store.deserialize_cdr,
            _hash=(lambda name: store.generate_msgdef(name)[1]) if is_ros1 else store.hash_rihs01,
        )


def _types_of(name: str, readers: Iterable[Any]) -> dict[str, str]:
    types: dict[str, str] = {}
    for one in (connection for reader in readers for connection in reader.connections):
        held = _RENAMED.get(one.msgtype, one.msgtype)
        if types.setdefault(one.topic, held) != held:
            raise BagError(f"{shown(one.topic, False)} of {name} holds messages of several types")
    return types


def _check_storage(storage: Any, name: str) -> None:
    """Bound an open file of ROS 2: chunks at one time of an MCAP, bytes of one value of a database."""
    check_overlap(getattr(storage, "chunks", []), name)
    if hasattr(storage, "dbconn"):
        import apsw

        storage.dbconn.limit(apsw.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)


def _bounded_reader(file: Any) -> Any:
    """Make rosbags' reader of ROS 1 refuse an index that is larger than the file.

    A chunk names the position of its index. A damaged bag may point to one index many times, and every
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
def _ros1_types() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store


@cache
def _ros2_types() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)
