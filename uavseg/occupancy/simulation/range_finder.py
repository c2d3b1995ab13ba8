"""A laser range finder in simulation: where it stands, how it measures, what it returns."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SceneError
from uavseg.occupancy.simulation.scene import Scene

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
        _check_positive("a maximal range", self.max_range_m)
        _check_positive("a standard deviation of ranges", self.sigma_m)
        if self.angles.ndim != 1 or self.angles.shape != self.ranges.shape:
            raise SceneError(
                f"a scan wants one range for each angle, not {self.angles.shape} and {self.ranges.shape}"
            )
        if not np.isfinite(self.angles).all() or (self.ranges < 0).any():
            raise SceneError("a scan wants finite angles, and ranges that are not negative")


@dataclass(frozen=True, slots=True)
class RangeFinder:
    """A laser range finder that sees as far as `max_range_m` across a field of view.

    Parameters
    ----------
    sigma_m : float
        Standard deviation of the Gaussian noise on ranges.
    max_range_m : float
    fov_deg : float
        Field of view, up to 360.
    step_deg : float
        Between neighbouring beams.

    Raises
    ------
    SceneError
        If one of them is not positive, or the field of view wider than 360 degrees.

    Examples
    --------
    >>> np.degrees(RangeFinder(0.05, 2.0, fov_deg=2.0, step_deg=0.5).angles).round(9)
    array([-1. , -0.5,  0. ,  0.5,  1. ])
    """

    sigma_m: float = 0.05
    max_range_m: float = 2.0
    fov_deg: float = 360.0
    step_deg: float = 0.5

    def __post_init__(self) -> None:
        _check_positive("a standard deviation of ranges", self.sigma_m)
        _check_positive("a maximal range", self.max_range_m)
        _check_positive("an angular step", self.step_deg)
        if not 0 < self.fov_deg <= 360:
            raise SceneError(f"a field of view is more than 0 and at most 360 degrees, not {self.fov_deg:g}")
        if self.fov_deg / self.step_deg > MAX_BEAMS:
            raise SceneError(
                f"steps of {self.step_deg:g} degrees make {self.fov_deg / self.step_deg:.0f} beams; "
                f"at most {MAX_BEAMS} are cast at once"
            )

    @property
    def angles(self) -> Floats:
        """Of the beams in radians from the heading: evenly spaced, and as many as the field of view holds."""
        steps = math.floor(self.fov_deg / self.step_deg + 1e-9)
        beams = steps if self.fov_deg == 360 else steps + 1  # the first is not cast again after a whole turn
        angles: Floats = np.radians((np.arange(beams) - (beams - 1) / 2) * self.step_deg)
        return angles

    def scan(self, scene: Scene, pose: Pose, random: np.random.Generator) -> Scan:
        """What the sensor returns.

        A beam returns where a surface lies within the maximal range: its distance with noise added, which may
        come out a little longer than that range, but never negative.
        """
        angles = self.angles
        distances = scene.cast(pose.x, pose.y, math.radians(pose.heading_deg) + angles)
        noise = random.normal(0.0, self.sigma_m, len(angles))
        measured = np.where(distances <= self.max_range_m, np.maximum(distances + noise, 0.0), np.inf)
        return Scan(pose, angles, measured, self.max_range_m, self.sigma_m)


def _check_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise SceneError(f"{name} is a number above 0, not {value:g}")
