"""Parameters of a mission over regions, checked when they are made."""

import math
from dataclasses import dataclass

from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.flight.camera.photos import Photos
from uavseg.flight.estimate.vehicle import Vehicle
from uavseg.flight.items import AUTOPILOTS, MAX_DISTANCE_M, MAX_HEIGHT_M
from uavseg.flight.limits import LimitParams, SafetyParams
from uavseg.flight.mission import CRUISE_M_S

PATTERNS = ("visit", "perimeter", "survey")
MAX_SPEED_M_S = 50.0
MIN_NUMBER = 0.001  # of metres, or metres per second


@checked
@dataclass(frozen=True, slots=True)
class PlanParams:
    """Parameters of a mission over regions.

    Parameters
    ----------
    altitude_m : float
        Height of the whole flight above home, above 0 and at most 1000.
    pattern : "visit", "perimeter" or "survey"
        Fly to a point inside each region, along its outline, or in parallel lines over it.
    spacing_m : float, optional
        Distance between the lines of a survey; required for one.
    angle_deg : float, optional
        Azimuth of the lines of a survey, clockwise from north; by default, for each region, the one that
        needs the fewest.
    speed_m_s : float
        Over ground, above 0 and at most 50.
    autopilot : "ardupilot", "px4" or "generic"
        The autopilot that the mission is for; "generic" for what ArduPilot and PX4 both accept.
    tolerance_m : float, optional
        Distance by which an outline may be simplified; by default a metre, or a pixel if the pixels of a
        region are larger.
    name : str
        Name of the mission.
    photos : Photos, optional
        How a survey is photographed; without, it takes no photographs.
    limits : LimitParams
        What each flight may take.
    safety : SafetyParams
        What flights keep away from, and where they stay.
    vehicle : Vehicle, optional
        What flies, for estimates; by default a multirotor with the parameters of its autopilot.

    Raises
    ------
    ParameterError
        If a value is out of bounds.
    """

    altitude_m: float
    pattern: str = "visit"
    spacing_m: float | None = None
    angle_deg: float | None = None
    speed_m_s: float = CRUISE_M_S
    autopilot: str = "ardupilot"
    tolerance_m: float | None = None
    name: str = ""
    photos: Photos | None = None
    limits: LimitParams = LimitParams()
    safety: SafetyParams = SafetyParams()
    vehicle: Vehicle | None = None

    def __post_init__(self) -> None:
        _check_number("altitude", self.altitude_m, MAX_HEIGHT_M, "m above home")
        _check_number("speed", self.speed_m_s, MAX_SPEED_M_S, "m/s")
        if self.altitude_m > self.safety.max_altitude_m:
            raise ParameterError(
                f"{self.altitude_m:g} m is higher than {self.safety.max_altitude_m:g} m above the ground, "
                "more than most countries allow without a permit; with one, give --max-altitude"
            )
        if self.pattern not in PATTERNS:
            raise ParameterError(f"a pattern is one of {', '.join(PATTERNS)}, not {self.pattern!r}")
        if self.autopilot not in AUTOPILOTS:
            raise ParameterError(f"an autopilot is one of {', '.join(AUTOPILOTS)}, not {self.autopilot!r}")
        if self.pattern == "survey" and self.spacing_m is None:
            raise ParameterError("a survey needs the spacing of its lines in metres")
        if self.pattern != "survey" and (self.spacing_m, self.angle_deg, self.photos) != (None,) * 3:
            raise ParameterError(
                f"spacing, angle and camera are for a survey, not for the pattern {self.pattern}"
            )
        if self.spacing_m is not None:
            _check_number("spacing", self.spacing_m, MAX_DISTANCE_M, "m")
        if self.angle_deg is not None and not math.isfinite(self.angle_deg):
            raise ParameterError(f"the angle of lines is a number of degrees, not {self.angle_deg}")
        if self.tolerance_m is not None:
            _check_number("tolerance", self.tolerance_m, MAX_DISTANCE_M, "m")


def _check_number(what: str, value: float, maximum: float, unit: str) -> None:
    if not MIN_NUMBER <= value <= maximum:
        raise ParameterError(f"the {what} is {MIN_NUMBER:g} to {maximum:g} {unit}, not {value:g}")
