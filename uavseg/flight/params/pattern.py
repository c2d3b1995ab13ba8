"""Parameters of single patterns, checked when they are made."""

import math
from dataclasses import dataclass

from uavseg.arguments import checked
from uavseg.errors import ParameterError

MAX_MARGIN_M = 1000.0
LEAST_MARGIN_M = 0.001  # a smaller one is none: GEOS makes nothing of a polygon that is grown by 1e-320
MAX_HOLD_S = 3600.0
HOLES = ("skip", "fly")


@checked
@dataclass(frozen=True, slots=True)
class VisitParams:
    """How regions are visited.

    Parameters
    ----------
    hold_s : float
        Seconds for which the vehicle stands still over each region, 0 to 3600.
    """

    hold_s: float = 0.0

    def __post_init__(self) -> None:
        _check("hold", self.hold_s, 0, MAX_HOLD_S, "s")


@checked
@dataclass(frozen=True, slots=True)
class PerimeterParams:
    """How outlines are flown along.

    Parameters
    ----------
    offset_m : float
        Distance from the outline, outward; negative inward.
    min_leg_m : float, optional
        No leg is shorter; by default what the vehicle flies in a second.
    holes : "skip" or "fly"
        Whether the outlines of holes are flown too.
    """

    offset_m: float = 0.0
    min_leg_m: float | None = None
    holes: str = "skip"

    def __post_init__(self) -> None:
        _check("offset of a perimeter", self.offset_m, -MAX_MARGIN_M, MAX_MARGIN_M, "m")
        if self.min_leg_m is not None:
            _check("shortest leg", self.min_leg_m, 0, MAX_MARGIN_M, "m")
        if self.holes not in HOLES:
            raise ParameterError(f"holes are one of {', '.join(HOLES)}, not {self.holes!r}")


@checked
@dataclass(frozen=True, slots=True)
class SurveyParams:
    """How regions are surveyed in parallel lines.

    Parameters
    ----------
    margin_m : float
        Metres by which the regions are grown before they are covered.
    crosshatch : bool
        Whether lines at a right angle to the first are flown too.
    turnaround_m : float
        Straight flight without photographs before and after each line, for vehicles that cannot turn in
        place.
    """

    margin_m: float = 0.0
    crosshatch: bool = False
    turnaround_m: float = 0.0

    def __post_init__(self) -> None:
        _check("margin", self.margin_m, 0, MAX_MARGIN_M, "m")
        _check("turnaround", self.turnaround_m, 0, MAX_MARGIN_M, "m")


@checked
@dataclass(frozen=True, slots=True)
class CorridorParams:
    """How long, thin regions are surveyed in lines along their middle.

    Parameters
    ----------
    margin_m : float
        Metres by which the regions are grown before they are covered.
    """

    margin_m: float = 0.0

    def __post_init__(self) -> None:
        _check("margin", self.margin_m, 0, MAX_MARGIN_M, "m")


@checked
@dataclass(frozen=True, slots=True)
class OrbitParams:
    """How regions are flown around in a circle.

    Parameters
    ----------
    margin_m : float
        Metres between a region and the circle around it.
    """

    margin_m: float = 0.0

    def __post_init__(self) -> None:
        _check("margin", self.margin_m, 0, MAX_MARGIN_M, "m")


PatternParams = VisitParams | PerimeterParams | SurveyParams | CorridorParams | OrbitParams

PARAMS_OF = {
    "visit": VisitParams,
    "perimeter": PerimeterParams,
    "survey": SurveyParams,
    "corridor": CorridorParams,
    "orbit": OrbitParams,
}
PATTERNS = tuple(PARAMS_OF)


def _check(what: str, value: float, minimum: float, maximum: float, unit: str) -> None:
    if not (math.isfinite(value) and minimum <= value <= maximum):
        raise ParameterError(f"the {what} is {minimum:g} to {maximum:g} {unit}, not {value:g}")
