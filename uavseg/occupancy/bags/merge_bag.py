"""Merging of a recorded bag: each scan at the pose that the sensor had, into a map that covers them all.

The bag is read three times: for the poses, for the extent of the map, and for the evidence. So what is held
in memory is the map and the poses, however long the bag is.
"""

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from uavseg.errors import BagError, ParameterError, SceneError
from uavseg.occupancy.bags.bag import LASERSCAN, MULTI_ECHO, POINT_CLOUD, Bag, open_bag
from uavseg.occupancy.bags.extent import Extent
from uavseg.occupancy.bags.frames import FrameTree, frame_name, read_odometry, read_transforms, stamp_ns
from uavseg.occupancy.bags.pose_track import Transform
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.point_cloud import check_heights, points_of, scan_of_points
from uavseg.occupancy.mapping.rotation import MAX_TILT_DEG, heading_of, tilt_deg
from uavseg.occupancy.mapping.scan import (
    BEAM_ORDER,
    DEFAULT_SIGMA_M,
    NO_RETURN,
    Pose,
    Scan,
    check_distance,
    scan_duration_s,
)
from uavseg.plain_text import shown

MIN_CELL_M, MAX_CELL_M = 1e-3, 100.0
_MAX_SCAN_S = 10.0  # where a message says more, the pose at the last beam counts as not known


@dataclass(frozen=True, slots=True)
class BagTopics:
    """Which topics of a bag are used.

    Parameters
    ----------
    scan : str
        Of sensor_msgs/LaserScan, MultiEchoLaserScan or PointCloud2.
    odom : str, optional
        Of nav_msgs/Odometry; None to take poses from the tree of /tf and /tf_static.
    """

    scan: str = "/scan"
    odom: str | None = "/odom"


@dataclass(frozen=True, slots=True)
class MergeParams:
    """How scans become a map.

    Parameters
    ----------
    resolution_m : float
        Side of a cell.
    sigma_m : float
        Standard deviation of ranges.
    max_range_m : float, optional
        Beams are used up to here; by default up to the `range_max` of each scan, or all points of a cloud.
    heights : (float, float), optional
        Of point clouds: the lowest and the highest in metres above the origin of the map's frame; what lies
        between is an obstacle.
    no_return, beam_order : str
        As of `Scan.from_laserscan`.

    Raises
    ------
    ParameterError, SceneError
        If a length is out of its domain, or a word is none of its words.
    """

    resolution_m: float = 0.05
    sigma_m: float = DEFAULT_SIGMA_M
    max_range_m: float | None = None
    heights: tuple[float, float] | None = None
    no_return: str = "inf"
    beam_order: str | None = None

    def __post_init__(self) -> None:
        if not MIN_CELL_M <= self.resolution_m <= MAX_CELL_M:
            raise ParameterError(
                f"resolution is {MIN_CELL_M:g} to {MAX_CELL_M:g} metres per cell, not {self.resolution_m:g}"
            )
        check_distance("sigma", self.sigma_m)
        if self.max_range_m is not None:
            check_distance("max range", self.max_range_m)
        if self.heights is not None:
            check_heights(self.heights)
        if self.no_return not in NO_RETURN:
            raise ParameterError(f"no return is inf or range_max, not {shown(self.no_return)}")
        if self.beam_order is not None and self.beam_order not in BEAM_ORDER:
            raise ParameterError(f"beam order is angles or increment, not {shown(self.beam_order)}")


@dataclass(slots=True)
class ScanCounts:
    """What became of the scans of a bag.

    Parameters
    ----------
    merged : int
    without_pose : int
        No pose is known at their time.
    tilted : int
        The plane of their beams was tilted too far.
    invalid : int
        The message is not a scan as REP 117 has it; `reason` says why the first is not.
    without_end : int
        Of the merged ones: the times of their beams are known and the pose at the last is not, so all beams
        are at the pose of the first.
    """

    merged: int = 0
    without_pose: int = 0
    tilted: int = 0
    invalid: int = 0
    reason: str = ""
    without_end: int = 0

    @property
    def total(self) -> int:
        """Number of messages."""
        return self.merged + self.without_pose + self.tilted + self.invalid


@dataclass(frozen=True, slots=True, eq=False)
class MergedBag:
    """The map of a bag.

    Parameters
    ----------
    grid : OccupancyGrid
    frame : str
        In whose coordinates the map is, such as "odom" or "map".
    counts : ScanCounts
    warnings : tuple of str
    """

    grid: OccupancyGrid
    frame: str
    counts: ScanCounts
    warnings: tuple[str, ...]


def merge_bag(
    path: str | os.PathLike[str], topics: BagTopics = BagTopics(), params: MergeParams = MergeParams()
) -> MergedBag:
    """Merge the scans of a bag into a map.

    The frame of the map is the root of the frames above the sensor: that of the odometry, or the highest of
    the tree of /tf, such as `map`.

    Parameters
    ----------
    path : path
        A .bag of ROS 1; a folder, .mcap or .db3 of ROS 2.
    topics : BagTopics
    params : MergeParams

    Raises
    ------
    BagError
        If the bag cannot be read, lacks a topic, or no scan has a pose; if the map would be too large.
    """
    with open_bag(path) as bag:
        bag.check_topic(topics.scan, LASERSCAN, MULTI_ECHO, POINT_CLOUD)
        if (bag.types[topics.scan] == POINT_CLOUD) != (params.heights is not None):
            raise BagError(
                f"{topics.scan} of {bag.name} holds {bag.types[topics.scan]}; heights, such as 0.1,1.8, say "
                "which points of a PointCloud2 are obstacles, and are for these alone"
            )
        tree = read_transforms(bag) if topics.odom is None else read_odometry(bag, topics.odom)
        counts, extent, frames = ScanCounts(), Extent(), set[str]()
        for scan in _scans(bag, topics.scan, tree, params, counts, frames):
            extent.add(scan)
        _check_merged(bag, topics, tree, counts, frames)
        root = _root(tree, frames)
        grid = OccupancyGrid(extent.geobox(params.resolution_m))
        for scan in _scans(bag, topics.scan, tree, params, ScanCounts(), set()):
            grid.merge(scan)
        return MergedBag(grid, root, counts, tuple(_warnings(topics, tree, counts, frames)))


def _scans(
    bag: Bag, topic: str, tree: FrameTree, params: MergeParams, counts: ScanCounts, frames: set[str]
) -> Iterator[Scan]:
    """Scans with their poses, counted; the names of their frames are added to `frames`."""
    is_cloud = bag.types[topic] == POINT_CLOUD
    for message in bag.messages(topic):
        frame = frame_name(message.header.frame_id)
        frames.add(frame)
        moving = _frame_of_sensor(tree, frame)
        place = None if moving is None else tree.at(stamp_ns(message.header), moving)
        if place is None or moving is None:
            counts.without_pose += 1
        elif not is_cloud and abs(90 - tilt_deg(place.matrix)) < 90 - MAX_TILT_DEG:
            counts.tilted += 1
        else:
            seconds = 0.0 if is_cloud else scan_duration_s(message, len(message.ranges), by_increment=True)
            known = 0 < seconds <= _MAX_SCAN_S
            end = tree.at(stamp_ns(message.header) + round(1e9 * seconds), moving) if known else None
            try:
                if is_cloud:
                    scan = _scan_of_cloud(message, place, params)
                else:
                    scan = _scan_at(message, place, end, params)
            except SceneError as error:
                counts.invalid += 1
                counts.reason = counts.reason or str(error)
                continue
            counts.merged += 1
            counts.without_end += seconds > 0 and end is None
            yield scan


def _frame_of_sensor(tree: FrameTree, frame: str) -> str | None:
    """The frame whose pose is that of the sensor; the base of the odometry where tf does not place it."""
    return frame if tree.reaches(frame) else tree.base


def _scan_at(message: Any, place: Transform, end: Transform | None, params: MergeParams) -> Scan:
    """The scan of a message. A sensor that hangs upside down turns clockwise, seen from above."""
    scan = Scan.from_laserscan(
        message,
        _pose_of(place),
        end=None if end is None else _pose_of(end),
        sigma_m=params.sigma_m,
        max_range_m=params.max_range_m,
        no_return=params.no_return,
        beam_order=params.beam_order,
    )
    return replace(scan, angles=-scan.angles) if place.matrix[2, 2] < 0 else scan


def _scan_of_cloud(message: Any, place: Transform, params: MergeParams) -> Scan:
    points = points_of(message) @ place.matrix.T
    points[:, 2] += place.shift[2]
    limit = math.inf if params.max_range_m is None else params.max_range_m
    assert params.heights is not None, "checked when the bag is opened"
    return scan_of_points(points, _pose_of(place), params.heights, params.sigma_m, limit)


def _pose_of(place: Transform) -> Pose:
    return Pose(float(place.shift[0]), float(place.shift[1]), heading_rad=heading_of(place.matrix))


def _check_merged(bag: Bag, topics: BagTopics, tree: FrameTree, counts: ScanCounts, frames: set[str]) -> None:
    """Check that there is anything to merge.

    Raises
    ------
    BagError
        If not, with the reason.
    """
    if counts.merged:
        return
    what = f"{topics.scan} of {bag.name}"
    if not counts.total:
        raise BagError(f"{what} has no messages")
    if counts.invalid:
        raise BagError(f"none of the {counts.total:,} scans of {what} can be merged: {counts.reason}")
    if counts.tilted:
        raise BagError(
            f"the plane of the beams of {what} is tilted by more than {MAX_TILT_DEG:g} degrees; a map is "
            "made from level scans"
        )
    source = topics.odom or "/tf"
    moving = ", ".join(shown(name) for name in list(tree.tracks)[:5]) or "none"
    raise BagError(
        f"no scan of {what} has a pose from {source}: the frame of the scans is "
        f"{', '.join(shown(name) for name in sorted(frames)[:3])}, frames that move are {moving}; no pose is "
        "extrapolated, or interpolated over more than 1 s"
    )


def _root(tree: FrameTree, frames: set[str]) -> str:
    """The frame of the map.

    Raises
    ------
    BagError
        If scans have poses in several.
    """
    sensors = [_frame_of_sensor(tree, frame) for frame in frames]
    roots = sorted({tree.root(sensor) for sensor in sensors if sensor is not None and tree.reaches(sensor)})
    if len(roots) > 1:
        listed = " and ".join(shown(root) for root in roots[:3])
        raise BagError(
            f"scans have poses in {listed}, which no transform joins; name the scans of one sensor"
        )
    return roots[0]


def _warnings(topics: BagTopics, tree: FrameTree, counts: ScanCounts, frames: set[str]) -> Iterator[str]:
    """What is to be known of the map."""
    source = topics.odom or "/tf"
    if counts.without_pose:
        yield (
            f"{counts.without_pose:,} of {counts.total:,} scans have no pose from {source} at their time, "
            "and are left out"
        )
    if counts.tilted:
        yield (
            f"{counts.tilted:,} of {counts.total:,} scans were tilted by more than {MAX_TILT_DEG:g} degrees, "
            "and are left out"
        )
    if counts.invalid:
        yield f"{counts.invalid:,} of {counts.total:,} scans are invalid, and left out: {counts.reason}"
    if counts.without_end:
        yield (
            f"{counts.without_end:,} of {counts.merged:,} scans have no pose at their last beam: all of "
            "their beams are taken to be at the pose of the first"
        )
    if tree.invalid:
        yield f"{tree.invalid:,} poses of {source} are not finite rotations, and are left out"
    for frame in sorted(frames):
        if tree.base is not None and not tree.reaches(frame):
            yield (
                f"no transform leads from {shown(tree.base)} to {shown(frame)} in /tf_static: the sensor is "
                f"taken to be at {shown(tree.base)}"
            )
