"""Bags for tests, written by rosbags' own writers: a range finder that drives through a drawn scene."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene

LASERSCAN, MULTI_ECHO, POINT_CLOUD, ODOMETRY, TRANSFORMS = (
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/MultiEchoLaserScan",
    "sensor_msgs/msg/PointCloud2",
    "nav_msgs/msg/Odometry",
    "tf2_msgs/msg/TFMessage",
)
START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000

ROOM = Scene(
    polygons=[
        [(0, 0), (6, 0), (6, 0.2), (0, 0.2)],
        [(0, 3.8), (6, 3.8), (6, 4), (0, 4)],
        [(0, 0.2), (0.2, 0.2), (0.2, 3.8), (0, 3.8)],
        [(3, 2.2), (3.6, 2.2), (3.6, 2.8), (3, 2.8)],
    ],
    circles=[(4.6, 1.2, 0.3)],
)
SENSOR = RangeFinder(sigma_m=0.02, max_range_m=3.0, fov_deg=270.0, step_deg=1.0)


@dataclass(frozen=True)
class Recorded:
    """A message with its topic, type and time."""

    topic: str
    kind: str
    time: int
    message: Any


@cache
def store(ros: int) -> Any:
    """Types of messages of ROS 1 or 2."""
    found = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    if ros == 1:
        for name in (TRANSFORMS, "tf/msg/tfMessage"):
            found.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return found


@dataclass(frozen=True)
class Drive:
    """Poses over time, and what is recorded on the way.

    Parameters
    ----------
    count : int
        Number of scans.
    laser : (float, float, float)
        x, y and yaw of the sensor on the robot.
    beam_ns : int
        From one beam of a scan to the next; the robot moves meanwhile.
    turning : float
        Of the robot, in radians a second.
    """

    ros: int = 2
    count: int = 12
    laser: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sensor: RangeFinder = field(default=SENSOR)
    beam_ns: int = 0
    turning: float = 0.5

    def base(self, time: int) -> tuple[float, float, float]:
        """x, y and yaw of the robot: it drives a straight line at constant speed and turns."""
        seconds = (time - START_NS) / 1e9
        return 0.8 + 2.0 * seconds, 1.5 + 0.1 * seconds, 0.2 + self.turning * seconds

    def scan_times(self) -> list[int]:
        return [START_NS + STEP_NS // 3 + k * STEP_NS for k in range(self.count)]

    def pose_times(self) -> list[int]:
        return [START_NS + k * STEP_NS for k in range(self.count + 1)]

    def sensor_pose(self, time: int) -> Pose:
        x, y, yaw = self.base(time)
        right, up, turn = self.laser
        cos, sin = math.cos(yaw), math.sin(yaw)
        return Pose(x + cos * right - sin * up, y + sin * right + cos * up, heading_rad=yaw + turn)

    def scans(self) -> list[Scan]:
        """Scans in the precision of messages."""
        taken = []
        for k, time in enumerate(self.scan_times()):
            scan = self.sensor.scan(ROOM, self.sensor_pose(time), np.random.default_rng([3, k]))
            taken.append(replace(scan, ranges=self.ranges_at(time)) if self.beam_ns else scan)
        return taken

    def ranges_at(self, time: int) -> Any:
        """Ranges of a scan that begins at a time, without noise, each beam at the pose of its time."""
        found = []
        for k, angle in enumerate(self.sensor.angles):
            pose = self.sensor_pose(time + k * self.beam_ns)
            found += ROOM.cast(pose.x, pose.y, np.array([pose.heading_rad + angle])).tolist()
        return np.where(np.array(found) <= self.sensor.max_range_m, found, np.inf)

    def everything(self) -> list[Recorded]:
        """Scans, odometry, and both trees of tf."""
        found = self.recorded_scans() + self.recorded_odometry()
        return found + self.recorded_tf() + self.recorded_static()

    def recorded_scans(self, topic: str = "/scan", frame: str = "laser") -> list[Recorded]:
        return [
            Recorded(topic, LASERSCAN, time, self.laserscan(scan, time, frame))
            for time, scan in zip(self.scan_times(), self.scans(), strict=True)
        ]

    def laserscan(self, scan: Scan, time: int, frame: str = "laser") -> Any:
        ranges = np.where(scan.ranges > scan.max_range_m, np.inf, scan.ranges).astype(np.float32)
        step = float(scan.angles[1] - scan.angles[0])
        kind = store(self.ros).types[LASERSCAN]
        return kind(
            header=self.header(time, frame),
            angle_min=single(scan.angles[0]),
            angle_max=single(scan.angles[-1]),
            angle_increment=single(step),
            time_increment=single(self.beam_ns * 1e-9),
            scan_time=0.1,
            range_min=0.0,
            range_max=single(scan.max_range_m),
            ranges=ranges,
            intensities=np.zeros(0, np.float32),
        )

    def multi_echo(self, scan: Any) -> Any:
        """A LaserScan as a message of echoes: before each range an invalid and a farther one."""
        types = store(self.ros).types
        echo = types["sensor_msgs/msg/LaserEcho"]
        rows = [[one] if np.isinf(one) else [np.nan, one + 0.5, one] for one in scan.ranges.tolist()]
        same = {name: getattr(scan, name) for name in scan.__dataclass_fields__ if not name.startswith("_")}
        del same["ranges"], same["intensities"]
        same.pop("__msgtype__", None)
        ranges = [echo(np.array(row, np.float32)) for row in rows]
        return types[MULTI_ECHO](**same, ranges=ranges, intensities=[])

    def point_cloud(self, points: Any, time: int, frame: str = "laser") -> Any:
        """Points (n, 3) with an intensity before their coordinates."""
        types = store(self.ros).types
        kind = np.dtype([("intensity", "<f4"), ("x", "<f4"), ("y", "<f4"), ("z", "<f8")])
        table = np.zeros(len(points), kind)
        table["x"], table["y"], table["z"] = np.asarray(points).T
        fields = [
            types["sensor_msgs/msg/PointField"](name, offset, 8 if name == "z" else 7, 1)
            for name, offset in (("intensity", 0), ("x", 4), ("y", 8), ("z", 12))
        ]
        return types[POINT_CLOUD](
            header=self.header(time, frame),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=20,
            row_step=20 * len(points),
            data=np.frombuffer(table.tobytes(), np.uint8),
            is_dense=True,
        )

    def recorded_odometry(self, topic: str = "/odom") -> list[Recorded]:
        return [
            Recorded(topic, ODOMETRY, time, self.odometry(time, self.base(time)))
            for time in self.pose_times()
        ]

    def odometry(self, time: int, pose: tuple[float, float, float], child: str = "base_link") -> Any:
        types = store(self.ros).types
        zeros = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        place = types["geometry_msgs/msg/Point"](pose[0], pose[1], 0.0)
        at = types["geometry_msgs/msg/Pose"](place, self.rotation(pose[2]))
        covariance = np.zeros(36)
        return types[ODOMETRY](
            header=self.header(time, "odom"),
            child_frame_id=child,
            pose=types["geometry_msgs/msg/PoseWithCovariance"](at, covariance),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](
                types["geometry_msgs/msg/Twist"](zeros, zeros), covariance
            ),
        )

    def recorded_tf(self) -> list[Recorded]:
        """The robot in odom, which lies still in map."""
        found = []
        for time in self.pose_times():
            moving = self.transform(time, "odom", "base_link", self.base(time))
            still = self.transform(time, "map", "odom", (1.0, -2.0, 0.0))
            found.append(Recorded("/tf", TRANSFORMS, time, self.transforms([moving, still])))
        return found

    def recorded_static(self, quaternion: Sequence[float] | None = None) -> list[Recorded]:
        one = self.transform(START_NS, "base_link", "laser", self.laser, quaternion)
        return [Recorded("/tf_static", TRANSFORMS, START_NS, self.transforms([one]))]

    def transforms(self, links: list[Any]) -> Any:
        return store(self.ros).types[TRANSFORMS](links)

    def transform(
        self,
        time: int,
        parent: str,
        child: str,
        pose: tuple[float, float, float],
        quaternion: Sequence[float] | None = None,
    ) -> Any:
        types = store(self.ros).types
        turn = self.rotation(pose[2]) if quaternion is None else self.quaternion(quaternion)
        shift = types["geometry_msgs/msg/Vector3"](pose[0], pose[1], 0.0)
        moved = types["geometry_msgs/msg/Transform"](shift, turn)
        return types["geometry_msgs/msg/TransformStamped"](self.header(time, parent), child, moved)

    def rotation(self, yaw: float) -> Any:
        return self.quaternion((0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))

    def quaternion(self, numbers: Sequence[float]) -> Any:
        return store(self.ros).types["geometry_msgs/msg/Quaternion"](*map(float, numbers))

    def header(self, time: int, frame: str) -> Any:
        types = store(self.ros).types
        stamp = types["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9)
        first = {"seq": 0} if self.ros == 1 else {}
        return types["std_msgs/msg/Header"](**first, stamp=stamp, frame_id=frame)


def single(number: float) -> float:
    """A number in the precision of messages."""
    return float(np.float32(number))


def write_ros1(path: Path, messages: Iterable[Recorded], compression: str | None = None) -> Path:
    types = store(1)
    writer = Writer1(path)
    if compression is not None:
        writer.set_compression(Writer1.CompressionFormat[compression])
    with writer:
        connections: dict[str, Any] = {}
        for one in sorted(messages, key=lambda found: found.time):
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, one.kind, typestore=types)
            content = types.serialize_ros1(one.message, one.kind)
            writer.write(connections[one.topic], one.time, content)
    return path


def write_ros2(
    path: Path, messages: Iterable[Recorded], storage: str = "SQLITE3", compress: Any = None
) -> Path:
    """Write a folder; returns it."""
    types = store(2)
    writer = Writer2(path, version=9, storage_plugin=StoragePlugin[storage])
    if compress is not None:
        writer.set_compression(*compress)
    with writer:
        connections: dict[str, Any] = {}
        for one in sorted(messages, key=lambda found: found.time):
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, one.kind, typestore=types)
            writer.write(connections[one.topic], one.time, types.serialize_cdr(one.message, one.kind))
    return path
