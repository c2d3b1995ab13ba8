"""Point clouds as scans: the nearest point of a band of heights in each direction.

A message is any object with the fields of `sensor_msgs/PointCloud2`: of rclpy, rospy, rosbags or none.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import MAX_METRES, Pose, Scan
from uavseg.plain_text import shown

Floats = NDArray[np.float64]
Heights = tuple[float, float]

STEP_DEG = 0.5  # of the directions, each of which has one beam
MAX_POINTS = 20_000_000

_NUMBERS = {7: "f4", 8: "f8"}  # sensor_msgs/PointField: FLOAT32, FLOAT64


def points_of(message: Any) -> Floats:
    """The points of a PointCloud2 whose three coordinates are finite, (n, 3) in metres.

    Raises
    ------
    SceneError
        If x, y or z is missing or no float, or the message holds less than it says.
    """
    try:
        fields = {str(field.name): field for field in message.fields}
        step, row_step = int(message.point_step), int(message.row_step)
        rows, cols = int(message.height), int(message.width)
        order = ">" if message.is_bigendian else "<"
        data = message.data
        content = memoryview(bytes(data) if isinstance(data, list | tuple) else data).cast("B")
    except (AttributeError, TypeError, ValueError) as error:
        kind = shown(type(message).__name__)
        raise SceneError(f"expected a sensor_msgs/PointCloud2, not {kind}") from error
    missing = [name for name in "xyz" if name not in fields or fields[name].datatype not in _NUMBERS]
    if missing:
        raise SceneError(f"expected x, y and z as floats in a point cloud; missing: {', '.join(missing)}")
    if not (rows >= 0 and cols >= 0 and rows * cols <= MAX_POINTS):
        raise SceneError(f"a point cloud has at most {MAX_POINTS:,} points, not {rows:,} x {cols:,}")
    formats = [order + _NUMBERS[fields[name].datatype] for name in "xyz"]
    offsets = [int(fields[name].offset) for name in "xyz"]
    ends = [offset + int(form[-1]) for offset, form in zip(offsets, formats, strict=True)]
    needed = (rows - 1) * row_step + cols * step if rows and cols else 0
    if min(offsets) < 0 or max(ends) > step or row_step < cols * step or needed > len(content):
        raise SceneError(
            f"this point cloud says {rows:,} x {cols:,} points of {step} bytes and holds "
            f"{len(content):,} bytes"
        )
    if needed == 0:
        return np.empty((0, 3))
    point = np.dtype({"names": ["x", "y", "z"], "formats": formats, "offsets": offsets, "itemsize": step})
    points = np.ndarray((rows, cols), point, content, strides=(row_step, step))
    found = np.stack([points[name].astype(np.float64) for name in "xyz"], axis=-1).reshape(-1, 3)
    return np.asarray(found[np.isfinite(found).all(axis=1)])


def scan_of_points(points: Floats, pose: Pose, heights: Heights, sigma_m: float, max_range_m: float) -> Scan:
    """The scan that a sensor at a pose would take of points at some heights.

    Where no point lies in a direction, or none of those heights, it says nothing: the cloud does not tell
    whether a beam went there.

    Parameters
    ----------
    points : (n, 3) float64 array
        x and y from the sensor in metres, along the axes of the map, and the height.
    pose : Pose
        Its heading does not matter.
    heights : (float, float)
        The lowest and the highest, in metres.
    sigma_m : float
        Standard deviation of ranges.
    max_range_m : float
        Points beyond are left out.
    """
    check_heights(heights)
    away = np.hypot(points[:, 0], points[:, 1])
    within = (points[:, 2] >= heights[0]) & (points[:, 2] <= heights[1])
    within &= (away > 0) & (away <= min(max_range_m, MAX_METRES))
    directions = np.arctan2(points[within, 1], points[within, 0])
    away = away[within]
    sector = np.floor(np.degrees(directions) / STEP_DEG).astype(np.int64)
    order = np.lexsort((directions, away, sector))  # the nearest of each sector first
    first = order[np.flatnonzero(np.diff(sector[order], prepend=np.int64(-1 << 40)))]
    level = Pose(pose.x, pose.y)
    limit = max_range_m if math.isfinite(max_range_m) else float(away.max(initial=1.0))
    return Scan(level, directions[first], away[first], limit, sigma_m)


def check_heights(heights: Heights) -> None:
    """Raise SceneError unless a band of heights is two finite numbers, the lower one first."""
    low, high = heights
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise SceneError(
            f"heights are the lowest and the highest in metres, such as 0.1,1.8, not {low:g},{high:g}"
        )
