"""Parameters of a mission over regions, checked when they are made."""

import math
from dataclasses import dataclass

from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import NADIR_DEG
from uavseg.flight.camera.photos import Photos
from uavseg.flight.mission.items import AUTOPILOTS, MAX_DISTANCE_M, MAX_HEIGHT_M
from uavseg.flight.mission.mission import CRUISE_M_S
from uavseg.flight.mission.vehicle import Vehicle
from uavseg.flight.params.limits import LimitParams, SafetyParams
from uavseg.flight.params.pattern import PARAMS_OF, PATTERNS, PatternParams
from uavseg.flight.params.terrain import TerrainParams

COVERING = ("survey", "corridor")  # patterns of lines that cover a region
MAX_SPEED_M_S = 50.0
MIN_NUMBER = 0.001  # of metres, or metres per second


@checked
@dataclass(frozen=True, slots=True)
class PlanParams:
    """Parameters of a mission over regions.

    Parameters
    ----------
    altitude_m : float
        Height of the whole flight above home, or above the ground with `terrain`; above 0, at most 1000.
    pattern : "visit", "perimeter", "survey", "corridor" or "orbit"
        Fly to a point inside each region, along its outline, in parallel lines over it, in lines along its
        middle, or in a circle around it.
    spacing_m : float, optional
        Distance between the lines of a survey or corridor; required for one.
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
        How the regions are photographed; without, the flight takes no photographs.
    how : VisitParams, PerimeterParams, SurveyParams, CorridorParams or OrbitParams, optional
        More about the pattern; of its own kind.
    limits : LimitParams
        What each flight may take.
    safety : SafetyParams
        What flights keep away from, and where they stay.
    vehicle : Vehicle, optional
        What flies, for estimates; by default a multirotor with the parameters of its autopilot.
    terrain : TerrainParams, optional
        How the flight follows the ground; without, it keeps one height above home.

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
    how: PatternParams | None = None
    limits: LimitParams = LimitParams()
    safety: SafetyParams = SafetyParams()
    vehicle: Vehicle | None = None
    terrain: TerrainParams | None = None

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
        if self.how is None:
            object.__setattr__(self, "how", PARAMS_OF[self.pattern]())
        if not isinstance(self.how, PARAMS_OF[self.pattern]):
            raise ParameterError(f"{type(self.how).__name__} is not for the pattern {self.pattern}")
        self._check_lines()
        self._check_photos()
        if self.spacing_m is not None:
            _check_number("spacing", self.spacing_m, MAX_DISTANCE_M, "m")
        if self.angle_deg is not None and not math.isfinite(self.angle_deg):
            raise ParameterError(f"the angle of lines is a number of degrees, not {self.angle_deg}")
        if self.tolerance_m is not None:
            _check_number("tolerance", self.tolerance_m, MAX_DISTANCE_M, "m")
        if self.terrain is not None:
            self.terrain.check(self.altitude_m, self.autopilot)

    def _check_lines(self) -> None:
        """Spacing and angle are for patterns of lines."""
        if self.pattern in COVERING and self.spacing_m is None:
            raise ParameterError(
                f"a {self.pattern} needs the spacing of its lines in metres (--spacing or --camera)"
            )
        if self.pattern not in COVERING and self.spacing_m is not None:
            raise ParameterError(f"a spacing is for a survey or corridor, not for the pattern {self.pattern}")
        if self.pattern != "survey" and self.angle_deg is not None:
            raise ParameterError(f"an angle is for a survey, not for the pattern {self.pattern}")

    def _check_photos(self) -> None:
        if self.photos is None:
            return
        if self.pattern == "visit" and self.photos.trigger in {"distance", "interval"}:
            raise ParameterError(
                f"a visit takes one photograph over each region: its trigger is hover or none, "
                f"not {self.photos.trigger}"
            )
        if self.pattern == "orbit" and self.photos.pitch_deg != NADIR_DEG:
            raise ParameterError("in an orbit the camera looks at the region; a gimbal pitch is not for it")


def _check_number(what: str, value: float, maximum: float, unit: str) -> None:
    if not MIN_NUMBER <= value <= maximum:
        raise ParameterError(f"the {what} is {MIN_NUMBER:g} to {maximum:g} {unit}, not {value:g}")
