"""Tree of coordinate frames, as tf has it: poses over time and fixed ones, from a root to any frame."""

from dataclasses import dataclass, field
from typing import Any

from uavseg.errors import BagError
from uavseg.occupancy.bags.bag import ODOMETRY, TRANSFORMS, Bag
from uavseg.occupancy.bags.pose_track import IDENTITY, PoseLog, PoseTrack, Transform
from uavseg.occupancy.mapping.rotation import matrix_of_quaternion
from uavseg.plain_text import shown

MAX_POSES = 10_000_000  # of all frames, 27 hours at 100 Hz: 640 MB

TF, TF_STATIC = "/tf", "/tf_static"


@dataclass(slots=True)
class FrameTree:
    """Poses of frames in their parents.

    Parameters
    ----------
    parents : dict of str to str
    tracks : dict of str to PoseTrack
        Poses over time, by the name of the child.
    fixed : dict of str to Transform
        Poses that never change.
    base : str, optional
        Frame that the odometry moves; None where the poses come from tf.
    invalid : int
        How many poses are no rotations or not finite, and were left out.
    """

    parents: dict[str, str] = field(default_factory=dict)
    tracks: dict[str, PoseTrack] = field(default_factory=dict)
    fixed: dict[str, Transform] = field(default_factory=dict)
    base: str | None = None
    invalid: int = 0

    def chain(self, frame: str) -> list[str]:
        """Frames from one up to the child of the root.

        Raises
        ------
        BagError
            If the frames form a circle.
        """
        found: list[str] = []
        while frame in self.parents:
            if frame in found:
                raise BagError(f"the frames of {TF} form a circle at {shown(frame)}; expected a tree")
            found.append(frame)
            frame = self.parents[frame]
        return found

    def root(self, frame: str) -> str:
        """The highest frame above one."""
        return self.parents[self.chain(frame)[-1]] if frame in self.parents else frame

    def reaches(self, frame: str) -> bool:
        """Whether a frame moves with the robot: a pose over time leads to it."""
        return any(link in self.tracks for link in self.chain(frame))

    def at(self, time: int, frame: str) -> Transform | None:
        """The pose of a frame in the root at a time in nanoseconds; None where it is not known."""
        pose = IDENTITY
        for link in self.chain(frame):
            found = self.fixed[link] if link in self.fixed else self.tracks[link].at(time)
            if found is None:
                return None
            pose = found.then(pose)
        return pose


def frame_name(text: Any) -> str:
    """The name of a frame; ROS 1 may write it with a slash before."""
    return str(text).lstrip("/")


def stamp_ns(header: Any) -> int:
    """The time of a message in nanoseconds; ROS 1 and ROS 2 call the parts alike in rosbags."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def read_odometry(bag: Bag, topic: str) -> FrameTree:
    """Poses from a topic of odometry, and fixed ones from /tf_static where there is one.

    Raises
    ------
    BagError
        If the topic does not exist, is of another type, or moves several frames.
    """
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
        _set_parent(tree, child, parent)
    _read_fixed(bag, tree)
    return tree


def read_transforms(bag: Bag) -> FrameTree:
    """The tree of /tf and /tf_static.

    Raises
    ------
    BagError
        If there is no /tf, or it is not a tree.
    """
    bag.check_topic(TF, TRANSFORMS)
    tree = FrameTree()
    logs: dict[str, PoseLog] = {}
    count = 0
    for message in bag.messages(TF):
        for one in message.transforms:
            child = _linked(tree, one)
            valid = _add(logs.setdefault(child, PoseLog()), *_parts(one))
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
            child = _linked(tree, one)
            log = PoseLog()
            if not _add(log, *_parts(one)):
                raise BagError(
                    f"{TF_STATIC} of {bag.name}: the pose of {shown(child)} is not a finite rotation"
                )
            if child not in tree.tracks:
                kept = log.track()
                tree.fixed[child] = Transform(matrix_of_quaternion(kept.quaternions[0]), kept.shifts[0])


def _linked(tree: FrameTree, one: Any) -> str:
    """The child of a transform, once it is known to have no other parent."""
    child = frame_name(one.child_frame_id)
    _set_parent(tree, child, frame_name(one.header.frame_id))
    return child


def _parts(one: Any) -> tuple[Any, Any, Any]:
    return one.header, one.transform.translation, one.transform.rotation


def _set_parent(tree: FrameTree, child: str, parent: str) -> None:
    known = tree.parents.setdefault(child, parent)
    if known != parent:
        raise BagError(
            f"the frame {shown(child)} has two parents, {shown(known)} and {shown(parent)}; expected a tree. "
            "Record one source of its poses"
        )


def _add(log: PoseLog, header: Any, place: Any, turn: Any) -> bool:
    return log.add(stamp_ns(header), (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))


def _check_count(bag: Bag, topic: str, count: int) -> None:
    if count > MAX_POSES:
        raise BagError(f"{topic} of {bag.name} has more than {MAX_POSES:,} poses; cut the bag into parts")
