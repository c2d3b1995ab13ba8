"""Scans check themselves."""

import math

import numpy as np
import pytest

from uavseg.errors import SceneError
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
