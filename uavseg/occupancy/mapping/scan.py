"""Range scans: the pose of a sensor, and the angles and ranges of its beams."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.arguments import checked
from uavseg.errors import SceneError

Floats = NDArray[np.float64]

MAX_BEAMS = 1_000_000
MAX_METRES = 1e9


@checked
@dataclass(frozen=True, slots=True)
class Pose:
    """Position and heading of a sensor, in map coordinates.

    Parameters
    ----------
    x, y : float
        In metres.
    heading_deg : float
        Direction of the middle of its field of view, counterclockwise from the x axis.

    Raises
    ------
    SceneError
        If one of them is not finite.
    """

    x: float
    y: float
    heading_deg: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(number) for number in (self.x, self.y, self.heading_deg)):
            raise SceneError(
                f"a pose has finite x, y and heading, not {self.x}, {self.y}, {self.heading_deg}"
            )


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

    def __post_init__(self) -> None:
        check_distance("a maximum range", self.max_range_m)
        check_distance("a standard deviation of ranges", self.sigma_m)
        if self.angles.ndim != 1 or self.angles.shape != self.ranges.shape:
            raise SceneError(
                f"a scan has one range for each angle, not {self.angles.shape} and {self.ranges.shape}"
            )
        if not np.isfinite(self.angles).all() or (self.ranges < 0).any():
            raise SceneError("a scan has finite angles, and ranges that are not negative")


def check_positive(name: str, value: float) -> None:
    """Raise SceneError unless a number is finite and above 0."""
    if not (math.isfinite(value) and value > 0):
        raise SceneError(f"{name} is a number above 0, not {value:g}")


def check_distance(name: str, metres: float) -> None:
    """Raise SceneError unless a distance is above 0 and at most 1e9 m: cells are counted in 64 bits."""
    check_positive(name, metres)
    if metres > MAX_METRES:
        raise SceneError(f"{name} is at most {MAX_METRES:g} m, not {metres:g}")
