"""Quaternions against scipy's rotations."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation, Slerp

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.sensor_messages import (
    as_quaternion,
    heading_of,
    matrix_of_quaternion,
    slerp,
    tilt_deg,
)

numbers = st.floats(-1, 1).map(lambda x: round(x, 6))
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: math.hypot(*q) > 0.01)


@given(quaternions)
def test_the_matrix_is_that_of_scipy(quaternion: tuple[float, ...]) -> None:
    expected = Rotation.from_quat(quaternion).as_matrix()
    np.testing.assert_allclose(matrix_of_quaternion(as_quaternion(quaternion)), expected, atol=1e-12)


@given(st.floats(-3.1, 3.1))
def test_a_turn_in_the_plane_has_its_heading_and_no_tilt(yaw: float) -> None:
    matrix = matrix_of_quaternion(as_quaternion((0, 0, math.sin(yaw / 2), math.cos(yaw / 2))))
    assert heading_of(matrix) == pytest.approx(yaw, abs=1e-12)
    assert tilt_deg(matrix) == pytest.approx(0, abs=1e-6)


@given(st.floats(0, 180))
def test_tilt_is_the_angle_of_a_roll(roll: float) -> None:
    half = math.radians(roll) / 2
    assert tilt_deg(matrix_of_quaternion(np.array([math.sin(half), 0, 0, math.cos(half)]))) == pytest.approx(
        roll, abs=1e-5
    )


@given(quaternions, quaternions, st.floats(0, 1))
def test_slerp_is_that_of_scipy(first: tuple[float, ...], second: tuple[float, ...], share: float) -> None:
    one, other = as_quaternion(first), as_quaternion(second)
    if abs(one @ other) < 1e-6:  # half a turn apart: both ways are as short
        return
    expected = Slerp([0, 1], Rotation.from_quat([one, other]))(share).as_matrix()
    np.testing.assert_allclose(matrix_of_quaternion(slerp(one, other, share)), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ((0, 0, 0, 0), "a finite length above 0"),
        ((0, 0, math.nan, 1), "a finite length above 0"),
        ((0, 0, math.inf, 1), "a finite length above 0"),
        ((0, 0, 1), "four numbers x, y, z, w"),
        ("up", "four numbers x, y, z, w, not 'up'"),
        (None, "four numbers x, y, z, w, not None"),
        ((0, 0, "a", 1), "four numbers x, y, z, w"),
        (np.array([0, 0, 1j, 1]), "four numbers x, y, z, w"),
    ],
)
def test_what_is_no_rotation_is_refused(value: object, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        as_quaternion(value)
