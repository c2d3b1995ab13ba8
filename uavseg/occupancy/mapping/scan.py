"""Range scans: the pose of a sensor and what its beams return."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SceneError

Floats = NDArray[np.float64]

MAX_BEAMS = 1_000_000


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a sensor stands and looks, in map coordinates.

    Parameters
    ----------
    x, y : float
        In metres.
    heading_deg : float
        Of the middle of its field of view, counterclockwise from the x axis.

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
                f"a pose wants finite x, y and heading, not {self.x}, {self.y}, {self.heading_deg}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One turn of a range finder.

    Parameters
    ----------
    pose : Pose
    angles : (n,) float64 array
        Of the beams in radians, counterclockwise from the heading.
    ranges : (n,) float64 array
        In metres; infinite where nothing returned, NaN where the sensor cannot tell.
    max_range_m : float
        How far a beam without a return has seen that there is nothing.
    sigma_m : float
        Standard deviation of ranges.

    Raises
    ------
    SceneError
        If the arrays do not fit together, a range is negative, or the sensor is not one.
    """

    pose: Pose
    angles: Floats
    ranges: Floats
    max_range_m: float
    sigma_m: float

    def __post_init__(self) -> None:
        check_positive("a maximal range", self.max_range_m)
        check_positive("a standard deviation of ranges", self.sigma_m)
        if self.angles.ndim != 1 or self.angles.shape != self.ranges.shape:
            raise SceneError(
                f"a scan wants one range for each angle, not {self.angles.shape} and {self.ranges.shape}"
            )
        if not np.isfinite(self.angles).all() or (self.ranges < 0).any():
            raise SceneError("a scan wants finite angles, and ranges that are not negative")


def check_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise SceneError(f"{name} is a number above 0, not {value:g}")
