"""Scans check themselves."""

import math
from array import array
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan


@pytest.mark.parametrize(
    ("angles", "ranges", "max_range", "sigma", "message"),
    [
        ([0.0], [1.0, 2.0], 1.0, 1.0, "one range for each angle"),
        ([0.0], [-1.0], 1.0, 1.0, "not negative"),
        ([math.nan], [1.0], 1.0, 1.0, "finite angles"),
        ([0.0], [1.0], 0.0, 1.0, "a maximum range is a number above 0, not 0"),
        ([0.0], [1.0], 1.0, math.nan, "a standard deviation of ranges is a number above 0, not nan"),
    ],
)
def test_a_scan_checks_itself(
    angles: list[float], ranges: list[float], max_range: float, sigma: float, message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        Scan(Pose(0, 0), np.array(angles), np.array(ranges), max_range, sigma)


@pytest.mark.parametrize("yaw", [0.0, 1.2, -3.0, math.pi / 2])
def test_a_pose_from_a_quaternion_has_its_heading(yaw: float) -> None:
    numbers = (0.0, 0.0, 3 * math.sin(yaw / 2), 3 * math.cos(yaw / 2))
    turn = SimpleNamespace(x=numbers[0], y=numbers[1], z=numbers[2], w=numbers[3])
    for quaternion in (numbers, np.array(numbers), turn):
        pose = Pose.from_quaternion(1.0, 2.0, quaternion)
        assert (pose.x, pose.y) == (1.0, 2.0)
        assert pose.heading_rad == pytest.approx(yaw, abs=1e-12)


def test_a_sensor_on_its_side_has_no_heading() -> None:
    with pytest.raises(SceneError, match="tilts the sensor by 90 degrees"):
        Pose.from_quaternion(0.0, 0.0, (1, 0, 0, 1))


def test_a_third_number_is_not_taken_for_a_heading() -> None:
    with pytest.raises(TypeError, match="positional"):
        Pose(0.0, 0.0, 90.0)  # type: ignore[misc]


# Messages


def laserscan(**how: Any) -> Any:
    """A message with five beams."""
    message = {
        "angle_min": -1.0,
        "angle_max": 1.0,
        "angle_increment": 0.5,
        "range_min": 0.1,
        "range_max": 8.0,
        "ranges": [1.0, math.inf, -math.inf, math.nan, 2.5],
    }
    return SimpleNamespace(**(message | how))


def test_ranges_are_understood_by_rep_117() -> None:
    scan = Scan.from_laserscan(laserscan(), Pose(0, 0))
    assert scan.angles.tolist() == [-1.0, -0.5, 0.0, 0.5, 1.0]
    np.testing.assert_array_equal(scan.ranges, [1.0, math.inf, math.nan, math.nan, 2.5])
    assert (scan.max_range_m, scan.sigma_m) == (8.0, 0.03)


def test_ranges_out_of_their_limits_say_nothing_and_the_limits_are_valid() -> None:
    given = np.array([0.1, 8.0, 0.0999, 8.001, 0.0], np.float32)
    limits = {"range_min": float(np.float32(0.1)), "range_max": 8.0}
    found = Scan.from_laserscan(laserscan(ranges=given, **limits), Pose(0, 0)).ranges
    np.testing.assert_array_equal(np.isnan(found), [False, False, True, True, True])


def test_a_return_at_range_max_is_valid_though_the_limit_is_written_in_double_precision() -> None:
    given = np.full(5, 12.3, np.float32)  # 12.300000190734863
    assert (Scan.from_laserscan(laserscan(ranges=given, range_max=12.3), Pose(0, 0)).ranges == given).all()


RANGES = [0.5, math.inf, math.nan, 7.25, 3.0]


@pytest.mark.parametrize(
    "make",
    [list, tuple, lambda r: array("f", r), lambda r: np.array(r, np.float32), lambda r: np.array(r, float)],
)
def test_ranges_may_be_of_any_kind_that_ros_has(make: Callable[[list[float]], Any]) -> None:
    found = Scan.from_laserscan(laserscan(ranges=make(RANGES)), Pose(0, 0))
    np.testing.assert_array_equal(found.ranges, RANGES)


def test_signalling_nans_and_limits_beyond_single_precision_warn_of_nothing() -> None:
    ranges = np.array([0x7F800001, 0x40000000, 0x7FC00000, 0x3F800000, 0xFF800000], np.uint32).view(
        np.float32
    )
    found = Scan.from_laserscan(laserscan(ranges=ranges, range_max=1e39), Pose(0, 0), max_range_m=9.0)
    np.testing.assert_array_equal(found.ranges, [math.nan, 2.0, math.nan, 1.0, math.nan])


def test_beams_beyond_a_maximum_range_observe_free_cells_up_to_it() -> None:
    found = Scan.from_laserscan(laserscan(ranges=RANGES), Pose(0, 0), max_range_m=4.0, sigma_m=0.1)
    np.testing.assert_array_equal(found.ranges, [0.5, math.inf, math.nan, math.inf, 3.0])
    assert (found.max_range_m, found.sigma_m) == (4.0, 0.1)
    assert Scan.from_laserscan(laserscan(), Pose(0, 0), max_range_m=50.0).max_range_m == 8.0


def test_a_message_makes_the_map_that_its_numbers_make() -> None:
    message = laserscan(ranges=[2.0, math.inf, math.nan, 3.0, 20.0], angle_min=0.2, angle_max=2.2)
    pose = Pose(2.05, 1.55, heading_rad=0.3)
    angles, ranges = 0.2 + 0.5 * np.arange(5), np.array([2.0, math.inf, math.nan, 3.0, math.nan])
    grids = [OccupancyGrid.empty((80, 90), 0.1) for _ in range(2)]
    grids[0].merge(Scan.from_laserscan(message, pose, sigma_m=0.1))
    grids[1].merge(Scan(pose, angles, ranges, 8.0, 0.1))
    assert grids[0].log_odds.any()
    assert np.array_equal(grids[0].log_odds, grids[1].log_odds)


@pytest.mark.parametrize("count", [4, 5, 6])
def test_one_beam_more_or_less_than_the_angles_say_is_usual(count: int) -> None:
    assert len(Scan.from_laserscan(laserscan(ranges=[1.0] * count), Pose(0, 0)).angles) == count


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"ranges": [1.0] * 8}, "in steps of 0.5 has 5 ranges; this one holds 8"),
        ({"ranges": [[1.0], [2.0]]}, "one row of at most 1,000,000 numbers"),
        ({"ranges": "abc"}, "ranges of a LaserScan are numbers, not 'abc'"),
        ({"ranges": None}, "one row"),
        ({"angle_increment": 0.0}, "angle_increment of a LaserScan with 5 ranges is not 0"),
        ({"angle_min": math.nan}, "finite radians"),
        ({"angle_min": "a"}, "angle_min of a LaserScan is a number, not 'a'"),
        ({"range_min": 9.0}, "0 <= range_min < range_max, not 9 and 8"),
        ({"range_min": math.nan}, "0 <= range_min < range_max"),
        ({"range_max": math.inf}, "range_max of this LaserScan is inf.*give max_range_m"),
        ({"range_max": 1e30}, "a maximum range is at most"),
    ],
)
def test_a_message_that_is_no_scan_is_refused(how: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scan.from_laserscan(laserscan(**how), Pose(0, 0))


def test_a_message_of_another_kind_is_refused() -> None:
    with pytest.raises(SceneError, match="this one, 'int', has no angle_min"):
        Scan.from_laserscan(5, Pose(0, 0))


# Moving sensors, and what drivers write in other ways


def timed(**how: Any) -> Any:
    return laserscan(ranges=[1.0, 2.0, 3.0, 2.0, 1.0], **({"time_increment": 0.025, "scan_time": 0.5} | how))


def test_beams_are_spread_evenly_between_the_first_and_the_last_pose() -> None:
    end = Pose(1.4, 2.0, heading_rad=-3.0)
    scan = Scan.from_laserscan(timed(), Pose(1.0, 1.0, heading_rad=3.0), end=end)
    x, y, directions = scan.beams
    assert x == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4]) and y == pytest.approx([1.0, 1.25, 1.5, 1.75, 2.0])
    turned = math.tau - 6.0  # through the back, not all the way around
    assert directions == pytest.approx(3.0 + turned * np.arange(5) / 4 + scan.angles)


@pytest.mark.parametrize("turning", [0.0, 1e-9, 0.3, -12.0])
def test_a_twist_ends_where_small_steps_end(turning: float) -> None:
    twist = (0.8, -0.2, turning)
    scan = Scan.from_laserscan(timed(), Pose(1.0, 2.0, heading_rad=0.7), twist=twist)
    x, y, heading = 1.0, 2.0, 0.7
    steps = 20_000
    for _ in range(steps):  # 0.1 s, in the middle of each step
        middle = heading + turning * 0.05 / steps
        x += (0.8 * math.cos(middle) + 0.2 * math.sin(middle)) * 0.1 / steps
        y += (0.8 * math.sin(middle) - 0.2 * math.cos(middle)) * 0.1 / steps
        heading += turning * 0.1 / steps
    assert scan.end is not None
    assert (scan.end.x, scan.end.y, scan.end.heading_rad) == pytest.approx((x, y, heading), abs=1e-7)
    parts = {"linear": SimpleNamespace(x=0.8, y=-0.2, z=0.0), "angular": SimpleNamespace(x=0, y=0, z=turning)}
    other = Scan.from_laserscan(timed(), Pose(1.0, 2.0, heading_rad=0.7), twist=SimpleNamespace(**parts))
    assert other.end == scan.end


def test_the_time_of_a_whole_scan_counts_where_that_between_beams_is_not_known() -> None:
    for increment in (0.0, math.nan, -1.0):
        scan = Scan.from_laserscan(timed(time_increment=increment), Pose(0, 0), twist=(1, 0, 0))
        assert scan.end == Pose(0.5, 0.0)
    with pytest.raises(SceneError, match="does not say how long it took"):
        Scan.from_laserscan(laserscan(), Pose(0, 0), twist=(1, 0, 0))


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"twist": (1, 0, 40.0)}, "by less than half a turn"),
        ({"twist": (math.nan, 0, 0)}, "twist is finite"),
        ({"twist": (1, 0)}, "three numbers or a geometry_msgs/Twist"),
        ({"twist": 3}, "three numbers or a geometry_msgs/Twist"),
        ({"twist": (1, 0, 0), "end": Pose(0, 0)}, "a pose at its end, or a twist"),
        ({"no_return": "0"}, "no_return is inf or range_max, not '0'"),
        ({"beam_order": "min"}, "beam_order is angles or increment, not 'min'"),
    ],
)
def test_how_a_scan_is_read_is_checked(how: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scan.from_laserscan(timed(), Pose(0, 0), **how)


def test_a_scan_that_moves_nowhere_makes_the_same_map() -> None:
    pose = Pose(2.05, 1.55, heading_rad=0.3)
    grids = [OccupancyGrid.empty((80, 90), 0.1) for _ in range(2)]
    for grid, end in zip(grids, (None, pose), strict=True):
        grid.merge(Scan.from_laserscan(timed(), pose, end=end))
    assert grids[0].log_odds.any() and np.array_equal(grids[0].log_odds, grids[1].log_odds)


def test_a_moving_scan_is_its_beams_one_by_one() -> None:
    rng = np.random.default_rng(1)
    angles, ranges = np.linspace(-2, 2, 40), rng.uniform(0.5, 3, 40)
    scan = Scan(Pose(3, 3, heading_rad=0.2), angles, ranges, 8.0, 0.05, Pose(3.6, 2.7, heading_rad=1.0))
    whole, one_by_one = (OccupancyGrid.empty((70, 80), 0.1) for _ in range(2))
    whole.merge(scan)
    for x, y, direction, metres in zip(*scan.beams, ranges, strict=True):
        one_by_one.merge(Scan(Pose(x, y), np.array([direction]), np.array([metres]), 8.0, 0.05))
    assert whole.log_odds.any()
    assert np.allclose(whole.log_odds, one_by_one.log_odds, atol=1e-5)


def test_range_max_may_be_no_return() -> None:
    message = laserscan(ranges=[1.0, 8.0, np.float32(8.0), 7.99, math.inf])
    usual, other = (
        Scan.from_laserscan(message, Pose(0, 0), no_return=word).ranges for word in ("inf", "range_max")
    )
    assert np.isinf(usual).tolist() == [False, False, False, False, True]
    assert np.isinf(other).tolist() == [False, True, True, False, True]


def test_an_increment_that_contradicts_the_angles_is_refused_until_it_is_said_which_counts() -> None:
    message = laserscan(angle_increment=-0.5)
    with pytest.raises(SceneError, match="say which counts: --beam-order angles or increment"):
        Scan.from_laserscan(message, Pose(0, 0))
    forwards = Scan.from_laserscan(message, Pose(0, 0), beam_order="angles").angles
    backwards = Scan.from_laserscan(message, Pose(0, 0), beam_order="increment").angles
    assert forwards == pytest.approx([-1, -0.5, 0, 0.5, 1]) and backwards == pytest.approx(
        [-1, -1.5, -2, -2.5, -3]
    )
    plain = Scan.from_laserscan(laserscan(), Pose(0, 0)).angles
    for word in ("angles", "increment"):
        assert np.array_equal(Scan.from_laserscan(laserscan(), Pose(0, 0), beam_order=word).angles, plain)


def test_the_nearest_valid_echo_counts() -> None:
    rows = [[3.0, 2.0, 0.05], [math.nan], [], [math.inf, math.inf], [9.0, math.inf]]
    message = laserscan(ranges=[SimpleNamespace(echoes=row) for row in rows])
    found = Scan.from_laserscan(message, Pose(0, 0)).ranges
    np.testing.assert_array_equal(found, [2.0, math.nan, math.nan, math.inf, math.nan])
