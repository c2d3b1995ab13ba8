"""Simulated laser range finder: field of view, maximum range, Gaussian noise."""

import math
from dataclasses import dataclass

import numpy as np

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import MAX_BEAMS, Floats, Pose, Scan, check_distance, check_positive
from uavseg.occupancy.simulation.scene import Scene


@dataclass(frozen=True, slots=True)
class RangeFinder:
    """A laser range finder.

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
        If a value is not positive or a distance above 1e9 m, or the field of view is wider than 360 degrees.

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
        check_distance("a standard deviation of ranges", self.sigma_m)
        check_distance("a maximum range", self.max_range_m)
        check_positive("an angular step", self.step_deg)
        if not 0 < self.fov_deg <= 360:
            raise SceneError(f"a field of view is more than 0 and at most 360 degrees, not {self.fov_deg:g}")
        if self.fov_deg / self.step_deg > MAX_BEAMS:
            raise SceneError(
                f"steps of {self.step_deg:g} degrees make {self.fov_deg / self.step_deg:.0f} beams; "
                f"at most {MAX_BEAMS} are cast at once"
            )

    @property
    def angles(self) -> Floats:
        """Angles of the beams in radians from the heading, (n,): evenly spaced over the field of view."""
        steps = math.floor(self.fov_deg / self.step_deg + 1e-9)
        beams = steps if self.fov_deg == 360 else steps + 1  # a whole turn ends where it began
        angles: Floats = np.radians((np.arange(beams) - (beams - 1) / 2) * self.step_deg)
        return angles

    def scan(self, scene: Scene, pose: Pose, random: np.random.Generator) -> Scan:
        """Simulate one scan.

        A beam returns if a surface lies within the maximum range. The range is its distance with noise added:
        it may exceed the maximum range a little, but is never negative.
        """
        angles = self.angles
        distances = scene.cast(pose.x, pose.y, pose.heading_rad + angles)
        noise = random.normal(0.0, self.sigma_m, len(angles))
        measured = np.where(distances <= self.max_range_m, np.maximum(distances + noise, 0.0), np.inf)
        return Scan(pose, angles, measured, self.max_range_m, self.sigma_m)
