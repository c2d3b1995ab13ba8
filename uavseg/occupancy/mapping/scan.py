"""Range scans: the pose of a sensor, and the angles and ranges of its beams; from ROS messages too."""

import math
from dataclasses import field
from typing import Any

import numpy as np

from uavseg.arguments import checked
from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import SceneError
from uavseg.occupancy.mapping import sensor_messages
from uavseg.plain_text import shown

MAX_METRES = 1e9
DEFAULT_SIGMA_M = 0.03  # of range finders on robots, where a message does not say it


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
        If one of them is not finite, or the position is farther than 1e9 m from 0.

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
        """Make a pose from a position and a rotation in space, as in `geometry_msgs/Pose`.

        Parameters
        ----------
        x, y : float
            In metres.
        quaternion : four numbers x, y, z, w, or a message with these fields
            Need not be of length 1. The pose is headed to where it turns the x axis, seen from above.

        Raises
        ------
        SceneError
            If it is not a rotation, or tilts the plane of the beams by more than 30 degrees.

        Examples
        --------
        >>> round(Pose.from_quaternion(1.0, 2.0, (0, 0, 1, 1)).heading_rad, 6)
        1.570796
        """
        matrix = sensor_messages.matrix_of_quaternion(sensor_messages.as_quaternion(quaternion))
        if sensor_messages.tilt_deg(matrix) > sensor_messages.MAX_TILT_DEG:
            raise SceneError(
                f"the quaternion tilts the sensor by {sensor_messages.tilt_deg(matrix):.0f} degrees; the "
                f"plane of the beams of a scan is tilted by at most {sensor_messages.MAX_TILT_DEG:g} degrees"
            )
        return cls(x, y, heading_rad=sensor_messages.heading_of(matrix))


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
        """Return x and y of the sensor at each beam in metres, and the direction in radians; each (n,).

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
        """Make a scan from a message with the fields of `sensor_msgs/LaserScan`, as it is.

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
            In place of `end`: the motion of the sensor meanwhile, in its frame; metres a second forward and
            to the left, and radians a second counterclockwise. The time from the first to the last beam is
            that of the message's `time_increment`, or its `scan_time` where that is 0.
        sigma_m : float
            Standard deviation of ranges, which the message does not hold.
        max_range_m : float, optional
            Beams are used up to here only: a return from farther observes free cells up to here. By
            default `range_max`.
        no_return : {"inf", "range_max"}
            Range of a beam without a return: +inf by REP 117, or also `range_max`, as some drivers have it.
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
        angles, ranges, limit = sensor_messages.read_laserscan(message, max_range_m, no_return, beam_order)
        if twist is not None:
            if end is not None:
                raise SceneError("a scan has a pose at its end, or a twist, not both")
            end = _end_pose(pose, twist, sensor_messages.scan_duration_s(message, len(ranges)))
        return cls(pose=pose, angles=angles, ranges=ranges, max_range_m=limit, sigma_m=sigma_m, end=end)

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
        """Make a scan from a message with the fields of `sensor_msgs/PointCloud2`.

        In steps of half a degree the nearest point between the heights counts. A direction without a
        point says nothing.

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
            Points farther away are left out.

        Raises
        ------
        SceneError
            If the message is not a point cloud, or the lowest height is not below the highest.
        """
        points = sensor_messages.read_points(message)
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        points[:, :2] = points[:, :2] @ np.array([[cos, sin], [-sin, cos]])
        return scan_of_points(points, pose, heights, sigma_m, max_range_m)


def scan_of_points(
    points: Floats, pose: Pose, heights: sensor_messages.Heights, sigma_m: float, max_range_m: float
) -> Scan:
    """Return the scan that a sensor at a pose would take of points at some heights, see `nearest_points`.

    `points` (n, 3) are x and y from the sensor in metres, along the axes of the map, and the height; those
    farther away than `max_range_m` are left out. `heights` are the lowest and the highest, in metres. The
    heading of the pose does not matter.
    """
    angles, ranges = sensor_messages.nearest_points(points, heights, min(max_range_m, MAX_METRES))
    limit = max_range_m if math.isfinite(max_range_m) else float(ranges.max(initial=1.0))
    level = Pose(pose.x, pose.y)
    return Scan(pose=level, angles=angles, ranges=ranges, max_range_m=limit, sigma_m=sigma_m)


def _end_pose(pose: Pose, twist: Any, seconds: float) -> Pose:
    """Move a sensor by a constant twist: along an arc."""
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


def check_positive(name: str, value: float) -> None:
    """Refuse a number that is not finite and above 0."""
    if not (math.isfinite(value) and value > 0):
        raise SceneError(f"{name} is a number above 0, not {value:g}")


def check_distance(name: str, metres: float) -> None:
    """Refuse a distance that is not above 0 and at most 1e9 m: cells are counted in 64 bits."""
    check_positive(name, metres)
    if metres > MAX_METRES:
        raise SceneError(f"{name} is at most {MAX_METRES:g} m, not {metres:g}")


def check_place(name: str, *coordinates: float) -> None:
    """Refuse coordinates farther than 1e9 m from 0, so that products of them are finite."""
    outside = [metres for metres in coordinates if not abs(metres) <= MAX_METRES]
    if outside:
        raise SceneError(f"{name} lies within {MAX_METRES:g} m of the origin, not at {outside[0]:g}")
