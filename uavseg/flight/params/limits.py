"""Limits of flights, and what keeps them safe: endurance, items, height, distance, zones, fence, rally."""

import math
from dataclasses import dataclass

from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.flight.mission.fence import RallyPoint
from uavseg.flight.mission.items import MAX_DISTANCE_M, MAX_HEIGHT_M, MAX_ITEMS

USUAL_MAX_HEIGHT_M = 120.0
"""What most countries allow without a permit, above the ground."""
LEAST_ITEMS = 10


@checked
@dataclass(frozen=True, slots=True)
class LimitParams:
    """What each flight may take; a mission that takes more is split.

    Parameters
    ----------
    endurance_min : float, optional
        Minutes in the air on a full battery; by default without a limit.
    reserve : float
        Per cent of the endurance that are left at the end.
    max_items : int, optional
        Mission items of a flight; by default what common boards of the autopilot hold.

    Raises
    ------
    ParameterError
        If a value is out of bounds.
    """

    endurance_min: float | None = None
    reserve: float = 20.0
    max_items: int | None = None

    def __post_init__(self) -> None:
        if self.endurance_min is not None and not 0 < self.endurance_min <= 6000:
            raise ParameterError(f"the endurance is above 0 and at most 6000 min, not {self.endurance_min:g}")
        if not 0 <= self.reserve < 100:
            raise ParameterError(f"the reserve is 0 to below 100 per cent, not {self.reserve:g}")
        if self.max_items is not None and not LEAST_ITEMS <= self.max_items <= MAX_ITEMS:
            raise ParameterError(f"a flight has {LEAST_ITEMS} to {MAX_ITEMS} items, not {self.max_items}")

    @property
    def seconds(self) -> float:
        """Time of a flight at most; infinite without a limit."""
        return math.inf if self.endurance_min is None else 60 * self.endurance_min * (1 - self.reserve / 100)


@checked
@dataclass(frozen=True, slots=True)
class SafetyParams:
    """What a flight keeps away from, and where it stays.

    Parameters
    ----------
    avoid_margin_m : float
        Least distance to keep-out zones.
    fence_margin_m : float, optional
        The fence leads so far around the flight; None: no fence is written.
    max_altitude_m : float
        Greatest height above home, or above the ground where that is known.
    max_distance_m : float, optional
        Greatest distance from home; by default 100 km.
    rally : tuple of RallyPoint

    Raises
    ------
    ParameterError
        If a value is out of bounds.
    """

    avoid_margin_m: float = 10.0
    fence_margin_m: float | None = 50.0
    max_altitude_m: float = USUAL_MAX_HEIGHT_M
    max_distance_m: float | None = None
    rally: tuple[RallyPoint, ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.avoid_margin_m <= 10_000:
            raise ParameterError(f"the margin of zones is 0 to 10,000 m, not {self.avoid_margin_m:g}")
        if self.fence_margin_m is not None and not 5 <= self.fence_margin_m <= 10_000:
            raise ParameterError(f"the margin of the fence is 5 to 10,000 m, not {self.fence_margin_m:g}")
        if not 0 < self.max_altitude_m <= MAX_HEIGHT_M:
            raise ParameterError(
                f"--max-altitude is above 0 and at most {MAX_HEIGHT_M:g} m, not {self.max_altitude_m:g}"
            )
        if self.max_distance_m is not None and not 0 < self.max_distance_m <= MAX_DISTANCE_M:
            raise ParameterError(
                f"the greatest distance from home is above 0 and at most {MAX_DISTANCE_M:g} m, "
                f"not {self.max_distance_m:g}"
            )
