"""How to fly regions, as one value that checks itself."""

import math
from dataclasses import dataclass

from uavseg.errors import ParameterError
from uavseg.flight.items import FARTHEST_M, FIRMWARES, HIGHEST_M
from uavseg.flight.mission import CRUISE_M_S

PATTERNS = ("visit", "perimeter", "survey")
FASTEST_M_S = 50.0


@dataclass(frozen=True, slots=True)
class PlanParams:
    """How to fly regions.

    Parameters
    ----------
    altitude_m : float
        Height of the whole flight above home, above 0 and at most 1000.
    pattern : "visit", "perimeter" or "survey"
        Fly to a point inside each region, along its outline, or to and fro over it.
    spacing_m : float, optional
        Distance between the lines of a survey, which needs it.
    angle_deg : float, optional
        Azimuth of the lines of a survey, clockwise from north; by default, for each region, the one that
        needs the fewest.
    speed_m_s : float
        Over ground, above 0 and at most 50.
    firmware : "ardupilot" or "px4"
    tolerance_m : float, optional
        How far an outline may be moved to have fewer corners; by default a metre, or a pixel where the
        pixels of a region are larger.
    name : str
        Of the mission, for people.

    Raises
    ------
    ParameterError
        If a value is outside of these.
    """

    altitude_m: float
    pattern: str = "visit"
    spacing_m: float | None = None
    angle_deg: float | None = None
    speed_m_s: float = CRUISE_M_S
    firmware: str = "ardupilot"
    tolerance_m: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        _check_number("altitude", self.altitude_m, HIGHEST_M, "m above home")
        _check_number("speed", self.speed_m_s, FASTEST_M_S, "m/s")
        if self.pattern not in PATTERNS:
            raise ParameterError(f"a pattern is one of {', '.join(PATTERNS)}, not {self.pattern!r}")
        if self.firmware not in FIRMWARES:
            raise ParameterError(f"a firmware is one of {', '.join(FIRMWARES)}, not {self.firmware!r}")
        if self.pattern == "survey" and self.spacing_m is None:
            raise ParameterError("a survey needs the spacing of its lines in metres")
        if self.pattern != "survey" and (self.spacing_m, self.angle_deg) != (None, None):
            raise ParameterError(f"spacing and angle are for a survey, not for the pattern {self.pattern}")
        if self.spacing_m is not None:
            _check_number("spacing", self.spacing_m, FARTHEST_M, "m")
        if self.angle_deg is not None and not math.isfinite(self.angle_deg):
            raise ParameterError(f"the angle of lines is a number of degrees, not {self.angle_deg}")
        if self.tolerance_m is not None:
            _check_number("tolerance", self.tolerance_m, FARTHEST_M, "m")


def _check_number(what: str, value: float, most: float, unit: str) -> None:
    if not 0 < value <= most:
        raise ParameterError(f"the {what} is above 0 and at most {most:g} {unit}, not {value:g}")
