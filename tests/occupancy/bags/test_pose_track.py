"""Poses over time: exact between poses on a line at constant speed, and unknown beyond."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from uavseg.occupancy.bags.frames import MAX_GAP_NS, PoseLog, PoseTrack
from uavseg.occupancy.mapping.sensor_messages import heading_of

STEP = 100_000_000


def driven(times: list[int]) -> PoseTrack:
    """2 m/s along a line, turning at 0.5 rad/s."""
    log = PoseLog()
    for time in times:
        assert log.add(time, pose(time)[0], pose(time)[1])
    return log.track()


def pose(time: int) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    seconds = time / 1e9
    half = 0.25 * seconds
    return (2 * seconds, 1 - seconds, 0.5), (0.0, 0.0, math.sin(half), math.cos(half))


@given(st.integers(0, 100 * STEP))
def test_between_poses_the_motion_is_uniform(time: int) -> None:
    found = driven([k * STEP for k in range(101)]).at(time)
    assert found is not None
    assert found.shift == pytest.approx(pose(time)[0], abs=1e-9)
    assert math.cos(heading_of(found.matrix) - 0.5 * time / 1e9) == pytest.approx(1, abs=1e-12)


def test_the_heading_takes_the_shorter_way_across_half_a_turn() -> None:
    log = PoseLog()
    for time, yaw in ((0, 3.1), (STEP, -3.1)):
        log.add(time, (0, 0, 0), (0, 0, math.sin(yaw / 2), math.cos(yaw / 2)))
    found = log.track().at(STEP // 2)
    assert found is not None
    assert abs(heading_of(found.matrix)) == pytest.approx(math.pi, abs=1e-6)


def test_nothing_is_extrapolated_or_bridged() -> None:
    track = driven([STEP, 2 * STEP, 2 * STEP + MAX_GAP_NS + 1])
    assert [track.at(time) is None for time in (STEP - 1, STEP, STEP + 1, 2 * STEP)] == [
        True,
        False,
        False,
        False,
    ]
    assert track.at(2 * STEP + 5) is None
    assert track.at(2 * STEP + MAX_GAP_NS + 1) is not None
    assert track.at(2 * STEP + MAX_GAP_NS + 2) is None
    assert PoseLog().track().at(0) is None


def test_poses_may_come_in_any_order_and_the_last_of_a_time_counts() -> None:
    log = PoseLog()
    for time, x in ((STEP, 5.0), (0, 1.0), (STEP, 7.0)):
        log.add(time, (x, 0, 0), (0, 0, 0, 2))
    track = log.track()
    assert track.times.tolist() == [0, STEP] and track.shifts[:, 0].tolist() == [1.0, 7.0]
    np.testing.assert_array_equal(track.quaternions, [[0, 0, 0, 1]] * 2)


@pytest.mark.parametrize(
    ("shift", "turn"),
    [((math.nan, 0, 0), (0, 0, 0, 1)), ((0, 0, math.inf), (0, 0, 0, 1)), ((0, 0, 0), (0, 0, 0, 0))],
)
def test_what_is_no_pose_is_not_kept(shift: tuple[float, ...], turn: tuple[float, ...]) -> None:
    log = PoseLog()
    assert not log.add(0, shift, turn)  # type: ignore[arg-type]
    assert not len(log)
