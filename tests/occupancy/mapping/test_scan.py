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
