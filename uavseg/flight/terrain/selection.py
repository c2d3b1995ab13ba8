"""Few points of a profile: polyline simplification within a tolerance, and a limit of its slope."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FIRST_LOOK = 128  # samples that are looked at first


def points_within(along_m: Floats, height_m: Floats, tolerance_m: float) -> list[int]:
    """Few samples of a profile whose straight lines stay within a tolerance of all others.

    From each chosen sample, the farthest one that a line reaches which passes all samples between within the
    tolerance; the slopes that do so are a cone that only narrows (J. Sklansky and V. Gonzalez, Fast polygonal
    approximation of digitized curves, Pattern Recognition 12, 1980).

    Parameters
    ----------
    along_m : (n,) float64 array
        Increasing; all the same for a leg without length.
    height_m : (n,) float64 array
    tolerance_m : float
        Largest vertical distance.

    Returns
    -------
    list of int
        Indices, the first and the last sample among them.

    Examples
    --------
    >>> points_within(np.arange(5.0), np.array([0.0, 1, 2, 1, 0]), 0.1)
    [0, 2, 4]
    >>> points_within(np.arange(5.0), np.array([0.0, 1, 2, 1, 0]), 2.0)
    [0, 4]
    """
    chosen, last = [0], len(along_m) - 1
    if along_m[last] == along_m[0]:
        return [0, last]
    while chosen[-1] < last:
        chosen.append(_farthest(along_m, height_m, tolerance_m, chosen[-1]))
    return chosen


def _farthest(along_m: Floats, height_m: Floats, tolerance_m: float, start: int) -> int:
    """The farthest sample that one line reaches."""
    look = FIRST_LOOK
    while True:
        end = min(start + 1 + look, len(along_m))
        step = along_m[start + 1 : end] - along_m[start]
        rise = height_m[start + 1 : end] - height_m[start]
        least = np.maximum.accumulate((rise - tolerance_m) / step)
        most = np.minimum.accumulate((rise + tolerance_m) / step)
        slope = rise / step
        reached = np.flatnonzero((slope >= least) & (slope <= most))
        if least[-1] > most[-1] or end == len(along_m):
            return start + 1 + int(reached[-1])
        look *= 2


def limit_slopes(along_m: Floats, height_m: Floats, climb: float, descent: float) -> Floats:
    """The lowest profile above another that climbs and descends no steeper than these slopes.

    Parameters
    ----------
    along_m : (n,) float64 array
        Never decreasing.
    height_m : (n,) float64 array
    climb, descent : float
        Metres per metre, above 0.

    Examples
    --------
    >>> limit_slopes(np.arange(5.0), np.array([0.0, 0, 8, 0, 0]), climb=3, descent=5)
    array([2., 5., 8., 3., 0.])
    """
    after = np.maximum.accumulate(height_m + descent * along_m) - descent * along_m
    before = np.maximum.accumulate((height_m - climb * along_m)[::-1])[::-1] + climb * along_m
    return np.maximum(after, before)
