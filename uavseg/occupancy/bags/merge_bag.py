"""Mapping from a recorded bag: each scan is merged at the pose that the sensor had.

The bag is read three times: for the poses, for the extent of the map, and for the log-odds. So memory holds
the map and the poses, however long the bag is.
"""

import math
from collections.abc import Iterator
from dataclasses import field, replace
from typing import Any

import numpy as np

from uavseg.arrays import Float32s, Floats, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import BagError, ParameterError, SceneError
from uavseg.occupancy.bags.bag import LASERSCAN, MULTI_ECHO, POINT_CLOUD, Bag, open_bag
from uavseg.occupancy.bags.frames import (
    FrameTree,
    Transform,
    frame_name,
    read_odometry,
    read_transforms,
    stamp_ns,
)
from uavseg.occupancy.map_file import WritableMap
from uavseg.occupancy.mapping.beams import REACH_SIGMAS
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.grid_io import MAX_CELLS
from uavseg.occupancy.mapping.scan import DEFAULT_SIGMA_M, Pose, Scan, check_distance, scan_of_points
from uavseg.occupancy.mapping.sensor_messages import (
    BEAM_ORDER,
    MAX_TILT_DEG,
    NO_RETURN,
    check_heights,
    heading_of,
    read_points,
    scan_duration_s,
    tilt_deg,
)
from uavseg.plain_text import shown
from uavseg.raster.grid.geobox import GeoBox, local_geobox

MIN_CELL_M, MAX_CELL_M = 1e-3, 100.0
_MAX_SCAN_S = 10.0  # of a scan; where a message says more, the pose at the last beam is not known


@dataclass(frozen=True, slots=True)
class BagTopics:
    """Topics of a bag to use."""

    scan: str = "/scan"  # of sensor_msgs/LaserScan, MultiEchoLaserScan or PointCloud2
    odom: str | None = "/odom"  # of nav_msgs/Odometry; None to take poses from the tree of /tf and /tf_static


@dataclass(frozen=True, slots=True)
class MergeParams:
    """Parameters of the map and of the sensor."""

    resolution_m: float = 0.05  # side of a cell
    sigma_m: float = DEFAULT_SIGMA_M  # standard deviation of ranges
    # Beams are used up to here; by default up to the `range_max` of each scan, or all points of a cloud.
    max_range_m: float | None = None
    # Of point clouds: the lowest and the highest in metres above the origin of the map's frame; points
    # between them are obstacles.
    heights: tuple[float, float] | None = None
    no_return: str = "inf"  # see `Scan.from_laserscan`
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
    """Numbers of merged and of omitted scans."""

    merged: int = 0
    without_pose: int = 0  # no pose is known at their time
    tilted: int = 0  # the plane of their beams was tilted too far
    invalid: int = 0  # the message is not a scan by REP 117
    reason: str = ""  # why the first of these is not
    # Of the merged ones: the times of their beams are known and the pose at the last is not, so all beams are
    # at the pose of the first.
    without_end: int = 0

    @property
    def total(self) -> int:
        """Return the number of messages."""
        return self.merged + self.without_pose + self.tilted + self.invalid


@dataclass(frozen=True, slots=True, eq=False)
class BuiltMap(WritableMap):
    """The map of a bag."""

    grid: OccupancyGrid  # its `save` keeps the log-odds
    frame: str  # the coordinate frame of its poses, such as "odom" or "map"
    scans: ScanCounts  # merged and omitted ones
    warnings: tuple[str, ...]

    @property
    def probabilities(self) -> Float32s:
        """Return the probabilities of the cells, (rows, cols)."""
        return self.grid.probabilities

    @property
    def geobox(self) -> GeoBox:
        """Return the position of the cells."""
        return self.grid.geobox


@dataclass(slots=True)
class _Extent:
    """Bounding box of the beams of scans, in metres."""

    low: Floats = field(default_factory=lambda: np.full(2, np.inf))
    high: Floats = field(default_factory=lambda: np.full(2, -np.inf))

    def add(self, scan: Scan) -> None:
        """Enlarge the box by the sensor of a scan and the ends of its beams."""
        known = ~np.isnan(scan.ranges)
        ranges = scan.ranges[known]
        reach = np.where(np.isinf(ranges), scan.max_range_m, ranges + REACH_SIGMAS * scan.sigma_m)
        x, y, angles = (numbers[known] for numbers in scan.beams)
        poses = [(pose.x, pose.y) for pose in (scan.pose, scan.end) if pose is not None]
        ends = np.column_stack([x + reach * np.cos(angles), y + reach * np.sin(angles)])
        corners = np.vstack([ends, poses])
        self.low = np.minimum(self.low, corners.min(axis=0))
        self.high = np.maximum(self.high, corners.max(axis=0))

    def geobox(self, cell_m: float) -> GeoBox:
        """Return whole cells around the box, at multiples of their side; refuse too many."""
        first = [math.floor(low / cell_m) for low in self.low]
        cols, rows = (math.floor(high / cell_m) - low + 1 for high, low in zip(self.high, first, strict=True))
        if rows * cols > MAX_CELLS:
            width, height = (high - low for high, low in zip(self.high, self.low, strict=True))
            raise BagError(
                f"the scans cover {width:,.0f} x {height:,.0f} m, {rows * cols:,} cells of {cell_m:g} m; at "
                f"most {MAX_CELLS:,} are possible: give a larger resolution or a smaller max range"
            )
        return local_geobox((rows, cols), cell_m, (first[0] * cell_m, first[1] * cell_m))


def merge_bag(path: Path_, topics: BagTopics = BagTopics(), params: MergeParams = MergeParams()) -> BuiltMap:
    """Merge the scans of a bag, a .bag of ROS 1 or a folder, .mcap or .db3 of ROS 2, into a map.

    The frame of the map is the root of the frames above the sensor: that of the odometry, or the highest of
    the tree of /tf, such as `map`.
    """
    with open_bag(path) as bag:
        bag.check_topic(topics.scan, LASERSCAN, MULTI_ECHO, POINT_CLOUD)
        if (bag.types[topics.scan] == POINT_CLOUD) != (params.heights is not None):
            raise BagError(
                f"{topics.scan} of {bag.name} holds {bag.types[topics.scan]}; heights, such as 0.1,1.8, say "
                "which points of a PointCloud2 are obstacles, and are for these alone"
            )
        tree = read_transforms(bag) if topics.odom is None else read_odometry(bag, topics.odom)
        counts, extent, frames = ScanCounts(), _Extent(), set[str]()
        for scan in _scans(bag, topics.scan, tree, params, counts, frames):
            extent.add(scan)
        if not counts.merged:
            raise BagError(_why_none(f"{topics.scan} of {bag.name}", topics, tree, counts, frames))
        root = _root(tree, frames)
        grid = OccupancyGrid(extent.geobox(params.resolution_m))
        for scan in _scans(bag, topics.scan, tree, params, ScanCounts(), set()):
            grid.merge(scan)
        return BuiltMap(grid, root, counts, tuple(_warnings(topics, tree, counts, frames)))


def _scans(
    bag: Bag, topic: str, tree: FrameTree, params: MergeParams, counts: ScanCounts, frames: set[str]
) -> Iterator[Scan]:
    """Read the scans with their poses; updates the counts, and adds the names of their frames to `frames`."""
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
                    points = read_points(message) @ place.matrix.T
                    points[:, 2] += place.shift[2]
                    limit = math.inf if params.max_range_m is None else params.max_range_m
                    assert params.heights is not None, "checked when the bag is opened"
                    scan = scan_of_points(points, _pose_of(place), params.heights, params.sigma_m, limit)
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
    """Return the frame with the pose of the sensor; the base of the odometry where tf does not place it."""
    return frame if tree.reaches(frame) else tree.base


def _scan_at(message: Any, place: Transform, end: Transform | None, params: MergeParams) -> Scan:
    """Make the scan of a message. A sensor that hangs upside down turns clockwise, seen from above."""
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


def _pose_of(place: Transform) -> Pose:
    return Pose(float(place.shift[0]), float(place.shift[1]), heading_rad=heading_of(place.matrix))


def _why_none(what: str, topics: BagTopics, tree: FrameTree, counts: ScanCounts, frames: set[str]) -> str:
    """Explain why no scan was merged."""
    if not counts.total:
        return f"{what} has no messages"
    if counts.invalid:
        return f"none of the {counts.total:,} scans of {what} can be merged: {counts.reason}"
    if counts.tilted:
        return (
            f"the plane of the beams of {what} is tilted by more than {MAX_TILT_DEG:g} degrees; a map is "
            "made from level scans"
        )
    moving = ", ".join(shown(name) for name in list(tree.tracks)[:5]) or "none"
    return (
        f"no scan of {what} has a pose from {topics.odom or '/tf'}: the frame of the scans is "
        f"{', '.join(shown(name) for name in sorted(frames)[:3])}, frames that move are {moving}; no pose is "
        "extrapolated, or interpolated over more than 1 s"
    )


def _root(tree: FrameTree, frames: set[str]) -> str:
    """Return the frame of the map; refuse scans with poses in several."""
    sensors = [_frame_of_sensor(tree, frame) for frame in frames]
    roots = sorted({tree.root(sensor) for sensor in sensors if sensor is not None and tree.reaches(sensor)})
    if len(roots) > 1:
        listed = " and ".join(shown(root) for root in roots[:3])
        raise BagError(
            f"scans have poses in {listed}, which no transform joins; name the scans of one sensor"
        )
    return roots[0]


def _warnings(topics: BagTopics, tree: FrameTree, counts: ScanCounts, frames: set[str]) -> Iterator[str]:
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
