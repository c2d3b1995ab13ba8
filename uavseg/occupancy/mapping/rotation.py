"""Rotations in space as unit quaternions (x, y, z, w), as in ROS messages: matrix, heading, tilt, slerp."""

import math
from typing import Any

import numpy as np

from uavseg.arrays import Floats
from uavseg.errors import SceneError
from uavseg.plain_text import shown

MAX_TILT_DEG = 30.0  # a planar sensor that is tilted more measures floor and ceiling, not walls

_NEARLY_PARALLEL = 1 - 1e-9  # cosine above which slerp divides by almost nothing; linear is as exact


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
    unit: Floats = numbers / length
    return unit


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
    unit: Floats = mixed / math.hypot(*mixed)
    return unit
