"""Paths from pose to pose over a map, from and to messages; transforms are arguments, as tf2 gives them."""

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import uavseg
from uavseg.errors import PathError, SceneError, UavsegError
from uavseg.occupancy.mapping.sensor_messages import as_quaternion, heading_of, matrix_of_quaternion
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg_ros.parameters import NodeParams

New = Callable[[], Any]  # a class of messages

_IN_PARAMETERS = (  # what uavseg advises, in the names of its commands
    (re.compile(r"--range [\d.]+,([\d.]+)"), r"passable_below: \1"),
    (re.compile(r"--clearance"), "clearance"),
)


class TransformMissingError(UavsegError, LookupError):
    """A transform that a path needs is not known, or too old."""


@dataclass(frozen=True, slots=True)
class PlanarPose:
    """Place and heading in the frame of a map: metres, and radians counterclockwise from the x axis."""

    x: float
    y: float
    yaw: float


def pose_in_plane(pose: Any, transform: Any = None) -> PlanarPose:
    """Return where a geometry_msgs/Pose lies in the map.

    Parameters
    ----------
    pose : geometry_msgs/Pose
    transform : geometry_msgs/TransformStamped, optional
        From the frame of the pose to that of the map; by default the pose is in the map's frame already.

    Raises
    ------
    PathError
        If a number is not finite, or the orientation is no rotation.
    """
    place = pose.position
    turn, shift = _rotation(pose.orientation), np.array([place.x, place.y, place.z], np.float64)
    if transform is not None:
        outer, moved = _rotation(transform.transform.rotation), transform.transform.translation
        turn, shift = outer @ turn, outer @ shift + (moved.x, moved.y, moved.z)
    if not np.isfinite(shift).all():
        raise PathError(f"a place is finite x, y and z, not {shift[0]:g}, {shift[1]:g}, {shift[2]:g}")
    return PlanarPose(float(shift[0]), float(shift[1]), heading_of(turn))


def frame_in_plane(transform: Any) -> PlanarPose:
    """Return where the origin of a frame lies, such as that of the robot, as `pose_in_plane`."""
    moved = transform.transform.translation
    if not all(map(math.isfinite, (moved.x, moved.y))):
        raise PathError(f"a transform has finite x and y, not {moved.x:g}, {moved.y:g}")
    return PlanarPose(float(moved.x), float(moved.y), heading_of(_rotation(transform.transform.rotation)))


def check_age(transform: Any, now_ns: int, tolerance_s: float) -> None:
    """Refuse a transform that is too old; one without a time, such as a static one, never is.

    Raises
    ------
    TransformMissingError
        If its stamp lies more than `tolerance_s` seconds before `now_ns`, in nanoseconds.
    """
    stamp = transform.header.stamp
    then_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    age_s = (now_ns - then_ns) / 1e9
    if then_ns and age_s > tolerance_s:
        raise TransformMissingError(
            f"the transform from {transform.child_frame_id} to {transform.header.frame_id} is {age_s:.1f} s "
            f"old, and at most {tolerance_s:g} s are allowed (transform_tolerance)"
        )


def plan_path(source: uavseg.Dataset, start: PlanarPose, goal: PlanarPose, params: NodeParams) -> PlannedPath:
    """Plan a path over a map, as the command `path` does with --range 0,passable_below.

    Warnings are those of the result.

    Raises
    ------
    PathError
        If the start or the goal lies outside of the map or is not free, or no path leads from one to the
        other; advice names parameters of the node.
    UavsegError
        If the map cannot be planned over.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # they are in the result
            return uavseg.path(
                source,
                (params.passable.low, params.passable.high),
                (start.x, start.y),
                (goal.x, goal.y),
                clearance=params.clearance,
                smooth=params.smooth,
            )
    except PathError as error:
        raise PathError(in_parameters(str(error))) from error


def in_parameters(text: str) -> str:
    """Name the parameters of the node where a message names options of a command.

    Examples
    --------
    >>> in_parameters("a path with at most 0.1 m exists (--clearance); --range 0,0.51 joins them there")
    'a path with at most 0.1 m exists (clearance); passable_below: 0.51 joins them there'
    """
    for option, parameter in _IN_PARAMETERS:
        text = option.sub(parameter, text)
    return text


def path_message(
    path: PlannedPath | None, goal: PlanarPose | None, header: Any, spacing_m: float, new: New, new_pose: New
) -> Any:
    """Return a path as a nav_msgs/Path, all of whose poses have one header: frame of the map, and time.

    A pose heads for the next one, the last as the goal does. Poses lie at the corners of the path, and
    between them at most `spacing_m` metres apart; 0 is for corners alone. Without a path there are no poses.
    """
    message = new()
    message.header, message.poses = header, []
    if path is not None and goal is not None:
        xy = _densified(path.xy, spacing_m)
        headings = [math.atan2(dy, dx) for dx, dy in np.diff(xy, axis=0)]
        message.poses = [
            _pose(x, y, yaw, header, new_pose) for (x, y), yaw in zip(xy, [*headings, goal.yaw], strict=True)
        ]
    return message


def _densified(xy: NDArray[np.float64], spacing_m: float) -> NDArray[np.float64]:
    """Return the corners (n, 2) of a line, with positions between them at most a spacing apart."""
    if spacing_m == 0:
        return xy
    legs = np.hypot(*np.diff(xy, axis=0).T)
    counts = np.maximum(np.ceil(legs / spacing_m), 1).astype(np.int64)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(xy[:-1], xy[1:], counts, strict=True)]
    return np.concatenate([*parts, xy[-1:]])


def _pose(x: float, y: float, yaw: float, header: Any, new_pose: New) -> Any:
    stamped = new_pose()
    stamped.header = header
    place, turn = stamped.pose.position, stamped.pose.orientation
    place.x, place.y = float(x), float(y)
    turn.z, turn.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return stamped


def _rotation(quaternion: Any) -> NDArray[np.float64]:
    try:
        return matrix_of_quaternion(as_quaternion(quaternion))
    except SceneError as error:
        raise PathError(f"an orientation: {error}") from error
