"""Range scans: the pose of a sensor, and the angles and ranges of its beams; from ROS messages too."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arguments import checked
from uavseg.errors import SceneError
from uavseg.occupancy.mapping.rotation import (
    MAX_TILT_DEG,
    as_quaternion,
    heading_of,
    matrix_of_quaternion,
    tilt_deg,
)
from uavseg.plain_text import shown

Floats = NDArray[np.float64]

MAX_BEAMS = 1_000_000
MAX_METRES = 1e9
DEFAULT_SIGMA_M = 0.03  # of range finders on robots, where a message does not say it

NO_RETURN = ("inf", "range_max")  # what a range may be where nothing returned
BEAM_ORDER = ("angles", "increment")  # which may say where beams go, where the two contradict each other

_LASERSCAN_NUMBERS = ("angle_min", "angle_max", "angle_increment", "range_min", "range_max")


@checked
@dataclass(frozen=True, slots=True)
class Pose:
    """Position and heading of a sensor, in map coordinates.

    Parameters
    ----------
    x, y : float
        In metres.
    heading_rad : float
        Direction in which the beam of angle 0 leaves, counterclockwise from the x axis. Given by name,
        so that degrees are not taken for radians.

    Raises
    ------
    SceneError
        If one of them is not finite, or the position is beyond 1e9 m.

    Examples
    --------
    >>> Pose(1.0, 2.0, heading_rad=math.pi / 2)
    Pose(x=1.0, y=2.0, heading_rad=1.5707963267948966)
    """

    x: float
    y: float
    heading_rad: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        if not all(math.isfinite(number) for number in (self.x, self.y, self.heading_rad)):
            raise SceneError(
                f"a pose has finite x, y and heading, not {self.x}, {self.y}, {self.heading_rad}"
            )
        check_place("a pose", self.x, self.y)

    @classmethod
    @checked
    def from_quaternion(cls, x: float, y: float, quaternion: Any) -> "Pose":
        """A pose from a position and a rotation in space, as in `geometry_msgs/Pose`.

        Parameters
        ----------
        x, y : float
            In metres.
        quaternion : four numbers x, y, z, w, or a message with these fields
            Need not be of length 1.

        Returns
        -------
        pose : Pose
            Headed to where the rotation turns the x axis, seen from above.

        Raises
        ------
        SceneError
            If it is no rotation, or tilts the plane of the beams by more than 30 degrees.

        Examples
        --------
        >>> round(Pose.from_quaternion(1.0, 2.0, (0, 0, 1, 1)).heading_rad, 6)
        1.570796
        """
        matrix = matrix_of_quaternion(as_quaternion(quaternion))
        if tilt_deg(matrix) > MAX_TILT_DEG:
            raise SceneError(
                f"the quaternion tilts the sensor by {tilt_deg(matrix):.0f} degrees; the plane of the beams "
                f"of a scan is tilted by at most {MAX_TILT_DEG:g} degrees"
            )
        return cls(x, y, heading_rad=heading_of(matrix))


@checked
@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One turn of a range finder.

    Parameters
    ----------
    pose : Pose
    angles : (n,) float64 array
        Of the beams in radians, counterclockwise from the heading.
    ranges : (n,) float64 array
        In metres; infinite without a return, NaN where the measurement is missing.
    max_range_m : float
        Distance up to which a beam without a return observes free cells.
    sigma_m : float
        Standard deviation of ranges.
    end : Pose, optional
        Of the sensor at its last beam, where it moved meanwhile; `pose` is that at its first. Beams follow
        each other in equal times.

    Raises
    ------
    SceneError
        If the arrays differ in shape, a range is negative, an angle is not finite, or the maximum range or
        the standard deviation is not positive or above 1e9 m.
    """

    pose: Pose
    angles: Floats
    ranges: Floats
    max_range_m: float
    sigma_m: float
    end: Pose | None = None

    def __post_init__(self) -> None:
        check_distance("a maximum range", self.max_range_m)
        check_distance("a standard deviation of ranges", self.sigma_m)
        if self.angles.ndim != 1 or self.angles.shape != self.ranges.shape:
            raise SceneError(
                f"a scan has one range for each angle, not {self.angles.shape} and {self.ranges.shape}"
            )
        if not np.isfinite(self.angles).all() or (self.ranges < 0).any():
            raise SceneError("a scan has finite angles, and ranges that are not negative")

    @property
    def beams(self) -> tuple[Floats, Floats, Floats]:
        """x and y of the sensor at each beam in metres, and the direction of the beam in radians; each (n,).

        Between `pose` and `end` the sensor moves along a straight line, and turns by the smaller angle, both
        evenly.
        """
        count = len(self.angles)
        if self.end is None:
            here = (np.full(count, self.pose.x), np.full(count, self.pose.y))
            return *here, self.pose.heading_rad + self.angles
        share = np.linspace(0.0, 1.0, count)
        x = self.pose.x + share * (self.end.x - self.pose.x)
        y = self.pose.y + share * (self.end.y - self.pose.y)
        turn = math.remainder(self.end.heading_rad - self.pose.heading_rad, math.tau)
        return x, y, self.pose.heading_rad + share * turn + self.angles

    @classmethod
    @checked
    def from_laserscan(
        cls,
        message: Any,
        pose: Pose,
        *,
        end: Pose | None = None,
        twist: Any = None,
        sigma_m: float = DEFAULT_SIGMA_M,
        max_range_m: float | None = None,
        no_return: str = "inf",
        beam_order: str | None = None,
    ) -> "Scan":
        """A scan from a message with the fields of `sensor_msgs/LaserScan`, as it is.

        Ranges are understood by REP 117 and REP 145: +inf is a beam without a return, which observes free
        cells up to `range_max`. Beams with -inf (too near to measure), NaN (invalid), or a range that is not
        in `range_min`..`range_max` say nothing. Of the echoes of a `sensor_msgs/MultiEchoLaserScan` the
        nearest valid one counts.

        Parameters
        ----------
        message : LaserScan or MultiEchoLaserScan
            Of rclpy, rospy, rosbags, or any object with `angle_min`, `angle_max`, `angle_increment`, `ranges`
            (any sequence of numbers), `range_min` and `range_max`.
        pose : Pose
            Of the sensor when it scanned; at its first beam, where `end` or `twist` is given.
        end : Pose, optional
            Of the sensor at its last beam.
        twist : three numbers or a Twist message, optional
            In place of `end`: how the sensor moved meanwhile, in its own frame; metres a second forward and
            to the left, and radians a second counterclockwise. The time from the first to the last beam is
            that of the message's `time_increment`, or its `scan_time` where that is 0.
        sigma_m : float
            Standard deviation of ranges, which the message does not hold.
        max_range_m : float, optional
            Beams are used up to here only: what returns from farther observes free cells up to here. By
            default `range_max`.
        no_return : {"inf", "range_max"}
            What a range is where nothing returned: +inf by REP 117, or also `range_max`, as some drivers have
            it.
        beam_order : {"angles", "increment"}, optional
            What counts where the sign of `angle_increment` contradicts the angles; such messages are refused
            if left out.

        Returns
        -------
        scan : Scan
            With NaN for beams that say nothing.

        Raises
        ------
        SceneError
            If a field is missing or not as REP 117 has it: angles that do not fit the number of ranges, or a
            `range_max` that is not finite while `max_range_m` is not given. If both `end` and `twist` are
            given, or the message does not say how long the scan took.
        """
        if no_return not in NO_RETURN:
            raise SceneError(f"no_return is inf or range_max, not {shown(no_return)}")
        numbers = {name: _number(message, name) for name in _LASERSCAN_NUMBERS}
        low, high = numbers["range_min"], numbers["range_max"]
        if not (math.isfinite(low) and 0 <= low < high):
            raise SceneError(f"a LaserScan has 0 <= range_min < range_max, not {low:g} and {high:g}")
        ranges = _ranges(message, low, high)
        limit = high if max_range_m is None else min(high, max_range_m)
        if not math.isfinite(limit):
            raise SceneError(
                f"the range_max of this LaserScan is {high:g}, so it is unknown how far a beam without a "
                "return observes free space; give max_range_m"
            )
        # In single precision, as the message holds all of them: a return at range_max is a valid one.
        with np.errstate(invalid="ignore", over="ignore"):  # NaN of any kind, limits beyond single precision
            valid = _is_valid(ranges, low, high)
            metres = np.where(valid, ranges.astype(np.float64), np.where(ranges == np.inf, np.inf, np.nan))
            if no_return == "range_max":
                metres[valid & (ranges >= np.float32(high))] = np.inf
        if limit < high:
            metres[metres > limit] = np.inf
        if twist is not None:
            if end is not None:
                raise SceneError("a scan has a pose at its end, or a twist, not both")
            end = _end_pose(pose, twist, scan_duration_s(message, len(ranges)))
        return cls(pose, _angles(numbers, len(ranges), beam_order), metres, limit, sigma_m, end)

    @classmethod
    @checked
    def from_point_cloud(
        cls,
        message: Any,
        pose: Pose,
        *,
        heights: tuple[float, float],
        sigma_m: float = DEFAULT_SIGMA_M,
        max_range_m: float = math.inf,
    ) -> "Scan":
        """A scan from a message with the fields of `sensor_msgs/PointCloud2`: its nearest points of a band.

        In steps of half a degree the nearest point counts. A direction without a point says nothing.

        Parameters
        ----------
        message : PointCloud2
            Of rclpy, rospy, rosbags, or any object with its fields; x, y and z are floats.
        pose : Pose
            Of the sensor, which is level.
        heights : (float, float)
            The lowest and the highest z in metres, from the sensor: what lies between is an obstacle.
        sigma_m : float
            Standard deviation of ranges.
        max_range_m : float
            Points beyond are left out.

        Raises
        ------
        SceneError
            If the message is no point cloud, or the heights are no band.
        """
        from uavseg.occupancy.mapping.point_cloud import points_of, scan_of_points

        points = points_of(message)
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        points[:, :2] = points[:, :2] @ np.array([[cos, sin], [-sin, cos]])
        return scan_of_points(points, pose, heights, sigma_m, max_range_m)


def scan_duration_s(message: Any, beams: int, by_increment: bool = False) -> float:
    """Seconds from the first to the last beam of a LaserScan; 0 where it does not say.

    With `by_increment`, only its `time_increment` counts: `scan_time` alone may be that between two scans.
    """
    increment = float(getattr(message, "time_increment", 0.0))
    if math.isfinite(increment) and increment > 0:
        return increment * max(beams - 1, 0)
    whole = 0.0 if by_increment else float(getattr(message, "scan_time", 0.0))
    return whole if math.isfinite(whole) and whole > 0 else 0.0


def _end_pose(pose: Pose, twist: Any, seconds: float) -> Pose:
    """Where a sensor is after it moved with a constant twist: along an arc."""
    if seconds == 0:
        raise SceneError(
            "this LaserScan does not say how long it took (time_increment and scan_time are 0); give its end"
        )
    try:
        if hasattr(twist, "linear"):
            twist = (twist.linear.x, twist.linear.y, twist.angular.z)
        forward, left, turning = (float(number) * seconds for number in twist)
    except (AttributeError, TypeError, ValueError) as error:
        raise SceneError(f"twist is three numbers or a geometry_msgs/Twist, not {shown(twist)}") from error
    if not all(map(math.isfinite, (forward, left, turning))) or abs(turning) >= math.pi:
        raise SceneError("twist is finite, and turns a sensor by less than half a turn in one scan")
    chord = np.sinc(turning / math.tau)  # of an arc of length 1
    direction = pose.heading_rad + turning / 2
    cos, sin = chord * math.cos(direction), chord * math.sin(direction)
    x, y = pose.x + forward * cos - left * sin, pose.y + forward * sin + left * cos
    return Pose(float(x), float(y), heading_rad=pose.heading_rad + turning)


def _number(message: Any, name: str) -> float:
    """A number of a LaserScan."""
    value = _field(message, name)
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"{name} of a LaserScan is a number, not {shown(value)}") from error


def _field(message: Any, name: str) -> Any:
    try:
        return getattr(message, name)
    except AttributeError as error:
        wanted = ", ".join((*_LASERSCAN_NUMBERS, "ranges"))
        raise SceneError(
            f"message is a LaserScan with {wanted}; this one, {shown(type(message).__name__)}, has no {name}"
        ) from error


def _ranges(message: Any, low: float, high: float) -> NDArray[np.float32]:
    """Ranges of a LaserScan in the precision of the message; of several echoes the nearest valid one."""
    value = _field(message, "ranges")
    try:
        with np.errstate(invalid="ignore", over="ignore"):
            if _has_echoes(value):
                value = [_nearest(np.asarray(one.echoes, np.float32), low, high) for one in value]
            ranges = np.asarray(value, np.float32)
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"ranges of a LaserScan are numbers, not {shown(value)}") from error
    if ranges.ndim != 1 or len(ranges) > MAX_BEAMS:
        raise SceneError(
            f"ranges of a LaserScan are one row of at most {MAX_BEAMS:,} numbers, not of shape {ranges.shape}"
        )
    return ranges


def _has_echoes(ranges: Any) -> bool:
    try:
        return hasattr(ranges[0], "echoes")
    except (TypeError, LookupError):  # no ranges, or none at all
        return False


def _nearest(echoes: NDArray[np.float32], low: float, high: float) -> float:
    """The nearest valid echo of a beam; +inf where all of them are, else NaN."""
    valid = echoes[_is_valid(echoes, low, high)]
    if len(valid):
        return float(valid.min())
    return np.inf if len(echoes) and (echoes == np.inf).all() else np.nan


def _is_valid(ranges: NDArray[np.float32], low: float, high: float) -> NDArray[np.bool_]:
    return np.asarray((ranges >= np.float32(low)) & (ranges <= np.float32(high)))


def _angles(numbers: dict[str, float], count: int, beam_order: str | None) -> Floats:
    """Angles of so many beams: the first, and steps of the increment."""
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
    angles: Floats = first + step * np.arange(count, dtype=np.float64)
    return angles


def check_positive(name: str, value: float) -> None:
    """Raise SceneError unless a number is finite and above 0."""
    if not (math.isfinite(value) and value > 0):
        raise SceneError(f"{name} is a number above 0, not {value:g}")


def check_distance(name: str, metres: float) -> None:
    """Raise SceneError unless a distance is above 0 and at most 1e9 m: cells are counted in 64 bits."""
    check_positive(name, metres)
    if metres > MAX_METRES:
        raise SceneError(f"{name} is at most {MAX_METRES:g} m, not {metres:g}")


def check_place(name: str, *coordinates: float) -> None:
    """Raise SceneError unless coordinates are within 1e9 m of 0, so that products of them are finite."""
    beyond = [metres for metres in coordinates if not abs(metres) <= MAX_METRES]
    if beyond:
        raise SceneError(f"{name} lies within {MAX_METRES:g} m of the origin, not at {beyond[0]:g}")
