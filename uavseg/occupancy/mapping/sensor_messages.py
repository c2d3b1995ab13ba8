"""ROS sensor messages without ROS: `sensor_msgs/LaserScan`, `MultiEchoLaserScan`, `PointCloud2`, quaternions.

A message is any object with the fields of its type: of rclpy, rospy, rosbags or none of them.
"""

import math
from typing import Any

import numpy as np

from uavseg.arrays import Bools, Float32s, Floats
from uavseg.errors import SceneError, caused_errors
from uavseg.inputs import as_number
from uavseg.plain_text import shown

Heights = tuple[float, float]

MAX_BEAMS = 1_000_000
MAX_POINTS = 20_000_000
STEP_DEG = 0.5  # width of the sectors of a point cloud, each of which has one beam
NO_RETURN = ("inf", "range_max")  # possible ranges of a beam without a return
BEAM_ORDER = ("angles", "increment")  # what may decide the direction of beams where the two contradict

_LASERSCAN_NUMBERS = ("angle_min", "angle_max", "angle_increment", "range_min", "range_max")
_POINT_FORMATS = {7: "f4", 8: "f8"}  # sensor_msgs/PointField: FLOAT32, FLOAT64
MAX_TILT_DEG = 30.0  # a planar sensor that is tilted more measures floor and ceiling, not walls

_NEARLY_PARALLEL = 1 - 1e-9  # cosine above which slerp divides by almost nothing; linear is as exact


def read_laserscan(
    message: Any, max_range_m: float | None, no_return: str, beam_order: str | None
) -> tuple[Floats, Floats, float]:
    """Read a LaserScan or MultiEchoLaserScan by REP 117; see `Scan.from_laserscan`.

    Returns from farther than `max_range_m` become beams without a return; by default it is `range_max`. The
    results are angles in radians and ranges in metres, (n,) each, infinite without a return, NaN where the
    measurement is missing; and the distance in metres up to which a beam without a return observes free
    cells.
    """
    if no_return not in NO_RETURN:
        raise SceneError(f"no_return is inf or range_max, not {shown(no_return)}")
    numbers = {
        name: as_number(_field(message, name), f"{name} of a LaserScan", SceneError)
        for name in _LASERSCAN_NUMBERS
    }
    low, high = numbers["range_min"], numbers["range_max"]
    if not (math.isfinite(low) and 0 <= low < high):
        raise SceneError(f"a LaserScan has 0 <= range_min < range_max, not {low:g} and {high:g}")
    value = _field(message, "ranges")
    try:
        with np.errstate(invalid="ignore", over="ignore"):
            if _has_echoes(value):
                value = [_nearest_echo(np.asarray(one.echoes, np.float32), low, high) for one in value]
            ranges = np.asarray(value, np.float32)
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"ranges of a LaserScan are numbers, not {shown(value)}") from error
    if ranges.ndim != 1 or len(ranges) > MAX_BEAMS:
        raise SceneError(
            f"ranges of a LaserScan are one row of at most {MAX_BEAMS:,} numbers, not of shape {ranges.shape}"
        )
    limit = high if max_range_m is None else min(high, max_range_m)
    if not math.isfinite(limit):
        raise SceneError(
            f"the range_max of this LaserScan is {high:g}, so it is unknown how far a beam without a "
            "return observes free space; give max_range_m"
        )
    # In single precision, as the message holds all of them: a return at range_max is a valid one.
    with np.errstate(invalid="ignore", over="ignore"):  # NaN of any kind, limits outside single precision
        valid = _is_valid(ranges, low, high)
        metres = np.where(valid, ranges.astype(np.float64), np.where(ranges == np.inf, np.inf, np.nan))
        if no_return == "range_max":
            metres[valid & (ranges >= np.float32(high))] = np.inf
    if limit < high:
        metres[metres > limit] = np.inf
    return _angles(numbers, len(ranges), beam_order), metres, limit


def scan_duration_s(message: Any, beams: int, by_increment: bool = False) -> float:
    """Return the seconds from the first to the last beam of a LaserScan; 0 where it does not say.

    With `by_increment` only its `time_increment` counts: `scan_time` alone may be that between two scans.
    """
    increment = float(getattr(message, "time_increment", 0.0))
    if math.isfinite(increment) and increment > 0:
        return increment * max(beams - 1, 0)
    whole = 0.0 if by_increment else float(getattr(message, "scan_time", 0.0))
    return whole if math.isfinite(whole) and whole > 0 else 0.0


def _field(message: Any, name: str) -> Any:
    if not hasattr(message, name):
        required = ", ".join((*_LASERSCAN_NUMBERS, "ranges"))
        held = shown(type(message).__name__)
        raise SceneError(f"message is a LaserScan with {required}; this one, {held}, has no {name}")
    return getattr(message, name)


def _has_echoes(ranges: Any) -> bool:
    try:
        return hasattr(ranges[0], "echoes")
    except (TypeError, LookupError):  # not a sequence, or an empty one
        return False


def _nearest_echo(echoes: Float32s, low: float, high: float) -> float:
    """Return the nearest valid echo of a beam; +inf where all of them are, else NaN."""
    valid = echoes[_is_valid(echoes, low, high)]
    if len(valid):
        return float(valid.min())
    return np.inf if len(echoes) and (echoes == np.inf).all() else np.nan


def _is_valid(ranges: Float32s, low: float, high: float) -> Bools:
    return np.asarray((ranges >= np.float32(low)) & (ranges <= np.float32(high)))


def _angles(numbers: dict[str, float], count: int, beam_order: str | None) -> Floats:
    first, last, step = (numbers[name] for name in ("angle_min", "angle_max", "angle_increment"))
    if beam_order is not None and beam_order not in BEAM_ORDER:
        raise SceneError(f"beam_order is angles or increment, not {shown(beam_order)}")
    if not all(map(math.isfinite, (first, last, step))) or max(map(abs, (first, last, step))) > 1e3:
        raise SceneError(f"angles of a LaserScan are finite radians, not {first:g}, {last:g}, {step:g}")
    if count > 1 and step == 0:
        raise SceneError(f"angle_increment of a LaserScan with {count} ranges is not 0")
    contradict = count > 1 and (last - first) * step < 0
    if contradict and beam_order is None:
        raise SceneError(
            f"angles of this LaserScan go from {first:g} to {last:g} and its angle_increment is {step:g}; "
            "say which counts: --beam-order angles or increment"
        )
    spanned = (last - first) / (-step if contradict else step) + 1 if step else 1.0
    if abs(spanned - count) > 1.5:  # the last may be left out, or end a whole turn; angles are rounded
        raise SceneError(
            f"a LaserScan from {first:g} to {last:g} radians in steps of {step:g} has {spanned:.0f} ranges; "
            f"this one holds {count}"
        )
    if contradict and beam_order == "angles":
        step = -step
    return first + step * np.arange(count, dtype=np.float64)


def read_points(message: Any) -> Floats:
    """Read the points of a PointCloud2 whose three coordinates are finite: (n, 3) float64, in metres."""
    expected = f"expected a sensor_msgs/PointCloud2, not {shown(type(message).__name__)}"
    with caused_errors(expected, SceneError, AttributeError, TypeError, ValueError, form="{}"):
        fields = {str(field.name): field for field in message.fields}
        step, row_step = int(message.point_step), int(message.row_step)
        rows, cols = int(message.height), int(message.width)
        order = ">" if message.is_bigendian else "<"
        data = message.data
        content = memoryview(bytes(data) if isinstance(data, list | tuple) else data).cast("B")
    missing = [name for name in "xyz" if name not in fields or fields[name].datatype not in _POINT_FORMATS]
    if missing:
        raise SceneError(f"expected x, y and z as floats in a point cloud; missing: {', '.join(missing)}")
    if not (rows >= 0 and cols >= 0 and rows * cols <= MAX_POINTS):
        raise SceneError(f"a point cloud has at most {MAX_POINTS:,} points, not {rows:,} x {cols:,}")
    formats = [order + _POINT_FORMATS[fields[name].datatype] for name in "xyz"]
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
    xyz = np.stack([points[name].astype(np.float64) for name in "xyz"], axis=-1).reshape(-1, 3)
    return np.asarray(xyz[np.isfinite(xyz).all(axis=1)])


def nearest_points(points: Floats, heights: Heights, max_range_m: float) -> tuple[Floats, Floats]:
    """Return the directions and distances of the nearest point between two heights in each sector.

    `points` (n, 3) are x and y from the sensor, and the height; all lengths are metres. Those farther away
    than `max_range_m` are left out. The results (k,) are radians from the x axis, and metres. A sector
    without a point has no beam: the cloud does not tell whether one went there.
    """
    check_heights(heights)
    away = np.hypot(points[:, 0], points[:, 1])
    within = (points[:, 2] >= heights[0]) & (points[:, 2] <= heights[1]) & (away > 0) & (away <= max_range_m)
    angles, away = np.arctan2(points[within, 1], points[within, 0]), away[within]
    sector = np.floor(np.degrees(angles) / STEP_DEG).astype(np.int64)
    order = np.lexsort((angles, away, sector))  # the nearest of each sector first
    first = order[np.flatnonzero(np.diff(sector[order], prepend=np.int64(-1 << 40)))]
    return angles[first], away[first]


def check_heights(heights: Heights) -> None:
    """Refuse heights that are not two finite numbers, the lower one first."""
    low, high = heights
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise SceneError(
            f"heights are the lowest and the highest in metres, such as 0.1,1.8, not {low:g},{high:g}"
        )


def as_quaternion(value: Any) -> Floats:
    """Normalise a quaternion: four numbers x, y, z, w, or a message with fields of these names."""
    fields = ("x", "y", "z", "w")
    parts = [getattr(value, name) for name in fields] if all(hasattr(value, f) for f in fields) else value
    try:
        given = np.asarray(parts)
        numbers = np.empty(0) if np.iscomplexobj(given) else given.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty(0)
    if numbers.shape != (4,):
        raise SceneError(f"a quaternion is four numbers x, y, z, w, not {shown(value)}")
    length = math.hypot(*numbers)
    if not (math.isfinite(length) and length > 1e-6):
        raise SceneError(f"a quaternion has a finite length above 0, not x, y, z, w = {shown(parts)}")
    return numbers / length


def matrix_of_quaternion(quaternion: Floats) -> Floats:
    """Return the (3, 3) rotation matrix of a unit quaternion.

    Examples
    --------
    >>> matrix_of_quaternion(np.array([0, 0, 1.0, 0])).tolist()  # half a turn around z
    [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def heading_of(matrix: Floats) -> float:
    """Return the direction in the plane of the x axis of a rotation, in radians, counterclockwise."""
    return math.atan2(matrix[1, 0], matrix[0, 0])


def tilt_deg(matrix: Floats) -> float:
    """Return the angle between the z axis of a rotation and the vertical: 0 is upright, 180 upside down."""
    return math.degrees(math.acos(min(max(matrix[2, 2], -1.0), 1.0)))


def slerp(first: Floats, second: Floats, share: float) -> Floats:
    """Interpolate between unit quaternions (4,) on the sphere (slerp), along the shorter arc.

    K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985. A share of 0 gives the first, 1
    the second.
    """
    cosine = float(first @ second)
    if cosine < 0:  # q and -q are the same rotation
        second, cosine = -second, -cosine
    if cosine > _NEARLY_PARALLEL:
        mixed = first + share * (second - first)
    else:
        angle = math.acos(cosine)
        mixed = (math.sin((1 - share) * angle) * first + math.sin(share * angle) * second) / math.sin(angle)
    return mixed / math.hypot(*mixed)
