"""Tree of coordinate frames, as tf has it: poses over time, interpolated by slerp, and fixed ones."""

import math
from array import array
from dataclasses import field
from typing import Any

import numpy as np

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import BagError
from uavseg.occupancy.bags.bag import ODOMETRY, TRANSFORMS, Bag
from uavseg.occupancy.mapping.sensor_messages import matrix_of_quaternion, slerp
from uavseg.plain_text import shown

MAX_POSES = 10_000_000  # of all frames, 27 hours at 100 Hz: 640 MB
MIN_LENGTH = 1e-6  # of a quaternion; a shorter one is not a rotation
MAX_GAP_NS = 1_000_000_000  # between two poses; a movement in between for longer is not known
TF, TF_STATIC = "/tf", "/tf_static"


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """A pose in space: a (3, 3) rotation matrix, then a shift of (3,) metres."""

    matrix: Floats
    shift: Floats

    def then(self, inner: "Transform") -> "Transform":
        """Return the outer pose of what lies at `inner` within this pose."""
        return Transform(self.matrix @ inner.matrix, self.matrix @ inner.shift + self.shift)


IDENTITY = Transform(np.eye(3), np.zeros(3))


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrack:
    """Poses of one frame in another, over time."""

    times: Integers  # (n,) int64; in nanoseconds, increasing
    shifts: Floats  # (n, 3) float64
    quaternions: Floats  # (n, 4) float64; unit ones, x, y, z, w

    def at(self, time: int) -> Transform | None:
        """Interpolate the pose at a time in nanoseconds: linearly, the rotation by slerp.

        None before the first and after the last pose, and where the poses around are more than a second
        apart: nothing is extrapolated.
        """
        after = int(np.searchsorted(self.times, time))
        if after < len(self.times) and self.times[after] == time:
            return Transform(matrix_of_quaternion(self.quaternions[after]), self.shifts[after])
        if after in (0, len(self.times)):
            return None
        start, end = int(self.times[after - 1]), int(self.times[after])
        if end - start > MAX_GAP_NS:
            return None
        share = (time - start) / (end - start)
        shift = self.shifts[after - 1] + share * (self.shifts[after] - self.shifts[after - 1])
        quaternion = slerp(self.quaternions[after - 1], self.quaternions[after], share)
        return Transform(matrix_of_quaternion(quaternion), shift)


@dataclass(frozen=True, slots=True)
class PoseLog:
    """Poses as they are read, in any order; 64 bytes each."""

    _times: "array[int]" = field(default_factory=lambda: array("q"))
    _numbers: "array[float]" = field(default_factory=lambda: array("d"))

    def __len__(self) -> int:
        return len(self._times)

    def add(
        self, time: int, shift: tuple[float, float, float], quaternion: tuple[float, float, float, float]
    ) -> bool:
        """Add a pose; False if a number is not finite, or the length of the quaternion is 0."""
        length = math.hypot(*quaternion)
        if not (math.isfinite(sum(shift)) and math.isfinite(length) and length > MIN_LENGTH):
            return False
        self._times.append(time)
        self._numbers.extend((*shift, *(number / length for number in quaternion)))
        return True

    def track(self) -> PoseTrack:
        """Sort the poses by time; of several at one time, the last one that was added counts."""
        times = np.array(self._times, np.int64)
        poses = np.array(self._numbers, np.float64).reshape(-1, 7)
        order = np.argsort(times, kind="stable")
        order = order[np.append(np.diff(times[order]) > 0, np.ones(min(len(times), 1), bool))]
        return PoseTrack(times=times[order], shifts=poses[order, :3], quaternions=poses[order, 3:])


@dataclass(slots=True)
class FrameTree:
    """Poses of frames in their parents."""

    parents: dict[str, str] = field(default_factory=dict)
    tracks: dict[str, PoseTrack] = field(default_factory=dict)  # poses over time, by the name of the child
    fixed: dict[str, Transform] = field(default_factory=dict)  # poses that never change
    base: str | None = None  # frame that the odometry moves; None where the poses come from tf
    invalid: int = 0  # number of poses that were left out, because they are not rotations or not finite

    def chain(self, frame: str) -> list[str]:
        """Return the frames from one up to the child of the root."""
        frames: list[str] = []
        while frame in self.parents:
            if frame in frames:
                raise BagError(f"the frames of {TF} form a circle at {shown(frame)}; expected a tree")
            frames.append(frame)
            frame = self.parents[frame]
        return frames

    def root(self, frame: str) -> str:
        """Return the highest frame above one."""
        return self.parents[self.chain(frame)[-1]] if frame in self.parents else frame

    def reaches(self, frame: str) -> bool:
        """Return whether a frame moves with the robot: a pose over time leads to it."""
        return any(link in self.tracks for link in self.chain(frame))

    def at(self, time: int, frame: str) -> Transform | None:
        """Return the pose of a frame in the root at a time in nanoseconds; None where it is not known."""
        pose = IDENTITY
        for link in self.chain(frame):
            outer = self.fixed[link] if link in self.fixed else self.tracks[link].at(time)
            if outer is None:
                return None
            pose = outer.then(pose)
        return pose

    def link(self, child: Any, parent: Any) -> str:
        """Set the parent of a frame, and return the child's name; refuse a second parent."""
        name, above = frame_name(child), frame_name(parent)
        known = self.parents.setdefault(name, above)
        if known != above:
            raise BagError(
                f"the frame {shown(name)} has two parents, {shown(known)} and {shown(above)}; expected a "
                "tree. Record one source of its poses"
            )
        return name


def frame_name(text: Any) -> str:
    """Return the name of a frame; ROS 1 may write it with a slash before."""
    return str(text).lstrip("/")


def stamp_ns(header: Any) -> int:
    """Return the time of a message in nanoseconds; rosbags gives its parts the same names for ROS 1 and 2."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _add(log: PoseLog, header: Any, place: Any, turn: Any) -> bool:
    return log.add(stamp_ns(header), (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))


def read_odometry(bag: Bag, topic: str) -> FrameTree:
    """Read poses from a topic of odometry, and fixed ones from /tf_static where there is one."""
    bag.check_topic(topic, ODOMETRY)
    tree, log = FrameTree(), PoseLog()
    links: set[tuple[str, str]] = set()
    for message in bag.messages(topic):
        links.add((frame_name(message.header.frame_id), frame_name(message.child_frame_id)))
        if len(links) > 1:
            raise BagError(f"{topic} of {bag.name} moves several frames: {shown(sorted(links))}")
        pose = message.pose.pose
        tree.invalid += not _add(log, message.header, pose.position, pose.orientation)
        _check_count(bag, topic, len(log))
    if not links:
        raise BagError(f"{topic} of {bag.name} has no messages")
    for parent, child in links:
        tree.base, tree.tracks[child] = child, log.track()
        tree.link(child, parent)
    _read_fixed(bag, tree)
    return tree


def read_transforms(bag: Bag) -> FrameTree:
    """Read the tree of /tf and /tf_static."""
    bag.check_topic(TF, TRANSFORMS)
    tree = FrameTree()
    logs: dict[str, PoseLog] = {}
    count = 0
    for message in bag.messages(TF):
        for one in message.transforms:
            child = tree.link(one.child_frame_id, one.header.frame_id)
            log = logs.setdefault(child, PoseLog())
            valid = _add(log, one.header, one.transform.translation, one.transform.rotation)
            tree.invalid += not valid
            count += valid
        _check_count(bag, TF, count)
    _read_fixed(bag, tree)
    tree.tracks |= {child: log.track() for child, log in logs.items() if child not in tree.fixed}
    return tree


def _read_fixed(bag: Bag, tree: FrameTree) -> None:
    """Add the poses of /tf_static; the last one of a frame counts."""
    if bag.types.get(TF_STATIC) != TRANSFORMS:
        return
    for message in bag.messages(TF_STATIC):
        for one in message.transforms:
            child = tree.link(one.child_frame_id, one.header.frame_id)
            log = PoseLog()
            if not _add(log, one.header, one.transform.translation, one.transform.rotation):
                raise BagError(
                    f"{TF_STATIC} of {bag.name}: the pose of {shown(child)} is not a finite rotation"
                )
            if child not in tree.tracks:
                track = log.track()
                tree.fixed[child] = Transform(matrix_of_quaternion(track.quaternions[0]), track.shifts[0])


def _check_count(bag: Bag, topic: str, count: int) -> None:
    if count > MAX_POSES:
        raise BagError(f"{topic} of {bag.name} has more than {MAX_POSES:,} poses; cut the bag into parts")
