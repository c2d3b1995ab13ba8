"""The ground below a flight, as values: under its points, and the heights above it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What an elevation model says of the ground below a mission.

    Parameters
    ----------
    below_m : mapping of (lat, lon) to float
        Height of the ground in metres at the positions of items and at home, above one and the same zero.
    lowest_m, highest_m : float
        Least and greatest height of the flight above the ground, on all legs; takeoff and landing aside.
    """

    below_m: Mapping[tuple[float, float], float]
    lowest_m: float
    highest_m: float

    def rise_m(self, home: tuple[float, float], place: tuple[float, float]) -> float:
        """How far the ground at a place lies above that at home; 0 where one of the two is not known."""
        if home not in self.below_m or place not in self.below_m:
            return 0.0
        return self.below_m[place] - self.below_m[home]
