"""Speed ramps with limited acceleration and jerk (S-curves): their time, and what is flown on the way.

A change of speed is symmetric: the acceleration rises, stays at its limit where the change is large enough,
and falls, so the mean speed is that of its ends (L. Biagiotti and C. Melchiorri, Trajectory Planning for
Automatic Machines and Robots, 2008, section 3.4). The jerk itself rises and falls within `jerk_rise_s`, like
a raised cosine.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

HALVINGS = 30  # of an interval, in a search for a root: to a thousandth of a millionth of it


@dataclass(frozen=True, slots=True)
class Ramp:
    """Limits of a change of speed: numbers, or one for each leg.

    Parameters
    ----------
    acceleration_m_s2, jerk_m_s3, jerk_rise_s : float or (n,) float64 array
    """

    acceleration_m_s2: Floats | float
    jerk_m_s3: float
    jerk_rise_s: float

    def seconds(self, change_m_s: Floats) -> Floats:
        """Time of a change of speed.

        With acceleration a, jerk j and jerk rise r it is dv / a + a / j + r where a is reached, which is at
        dv >= a (a / j + r); else 2 (u + r), with u (u + r) j = dv.

        Examples
        --------
        >>> Ramp(2.0, 1.0, 0.0).seconds(np.array([0.0, 1.0, 10.0])).tolist()
        [0.0, 2.0, 7.0]
        """
        a, j, r = self.acceleration_m_s2, self.jerk_m_s3, self.jerk_rise_s
        rise = (np.sqrt(r * r + 4 * change_m_s / j) - r) / 2
        short = 2 * (rise + r)
        long = change_m_s / a + a / j + r
        seconds: Floats = np.where(change_m_s >= a * (a / j + r), long, short) * (change_m_s > 0)
        return seconds

    def start(self, seconds: Floats, speed_m_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Way, speed and acceleration so long after a start from rest, within the first half of the ramp.

        The acceleration is taken to rise linearly, in the time that the whole ramp needs.
        """
        a, j, r = self.acceleration_m_s2, self.jerk_m_s3, self.jerk_rise_s
        whole = self.seconds(speed_m_s)
        rise = np.maximum(np.minimum(a / j + r, whole / 2), 1e-9)
        peak = speed_m_s / np.maximum(whole - rise, 1e-9)
        early, late = np.minimum(seconds, rise), np.maximum(seconds - rise, 0.0)
        way = peak * (early**3 / (6 * rise) + rise / 2 * late + late**2 / 2)
        speed = peak * (early**2 / (2 * rise) + late)
        return way, speed, peak * early / rise


def largest(fits: Callable[[Floats], NDArray[np.bool_]], low: Floats, high: Floats) -> Floats:
    """The largest values between low and high that fit, by bisection; low where none does."""
    top = fits(high)
    if top.all():
        return np.array(high, float)
    low, high = np.array(low, float), np.array(high, float)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = fits(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.where(top, high, low)
