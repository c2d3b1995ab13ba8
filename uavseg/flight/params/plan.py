"""Parameters of a mission over regions: pattern, limits, safety, height above the ground.

They are checked when they are made: a value out of bounds raises ParameterError.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import replace

from uavseg.arguments import checked
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import NADIR_DEG, Photos
from uavseg.flight.mission.items import AUTOPILOTS, MAX_DISTANCE_M, MAX_HEIGHT_M, MAX_ITEMS, RallyPoint
from uavseg.flight.mission.mission import CRUISE_M_S, USUAL_MAX_HEIGHT_M
from uavseg.flight.mission.vehicle import Vehicle, Wind, default_vehicle
from uavseg.raster.elevation.dem import Dem

MAX_MARGIN_M = 1000.0
MIN_MARGIN_M = 0.001  # a smaller one counts as 0: GEOS returns an empty polygon for a buffer of 1e-320
MAX_HOLD_S = 3600.0
HOLES = ("skip", "fly")
ABSOLUTE, RELATIVE, FRAME = "absolute", "relative", "frame"
MODES = (FRAME, ABSOLUTE, RELATIVE)
DEFAULT_TOLERANCE_M = 5.0
MIN_TOLERANCE_M = 0.1
MIN_RATE_M_S, MAX_RATE_M_S = 0.1, 50.0


@dataclass(frozen=True, slots=True)
class TerrainParams:
    """Parameters of a flight that follows the ground.

    A ParameterError says that a value is out of bounds, or a DEM is missing.

    Heights are above the sea (MAV_FRAME_GLOBAL) or above home, both from the DEM, with points added where the
    ground bends; or, with the mode "frame", above the terrain, which the vehicle knows itself (ArduPilot
    only).
    """

    dem: Dem | None  # only the mode "frame" works without one
    mode: str = ABSOLUTE  # "absolute", "relative" or "frame"
    tolerance_m: float | None = None  # of the height; by default 5, or a quarter of the height if less
    climb_m_s: float | None = None  # in forward flight; by default that of the vehicle
    descent_m_s: float | None = None  # likewise

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ParameterError(f"terrain is one of {', '.join(MODES)}, not {self.mode!r}")
        if self.dem is None and self.mode != FRAME:
            raise ParameterError(f"heights that are {self.mode} follow from an elevation model: give --dem")
        for what, rate in (("climb", self.climb_m_s), ("descent", self.descent_m_s)):
            _check(f"{what} rate", rate, MIN_RATE_M_S, MAX_RATE_M_S, "m/s")
        if self.mode == ABSOLUTE and self.dem is not None and not self.dem.is_above_sea:
            raise ParameterError(
                f"{self.dem.name} has heights above the ellipsoid, up to 100 m from those above the sea that "
                "autopilots fly, and PROJ has no grid of the geoid (us_nga_egm96_15.tif) here to convert "
                "them: convert the file, or fly heights above home (--terrain relative)"
            )

    def tolerance_for(self, altitude_m: float) -> float:
        """Return the tolerance in metres at a height above the ground."""
        if self.tolerance_m is None:
            return max(min(DEFAULT_TOLERANCE_M, altitude_m / 4), MIN_TOLERANCE_M)
        return self.tolerance_m

    def rates_m_s(self, vehicle: Vehicle) -> tuple[float, float]:
        """Return the rates of climb and descent of a vehicle in forward flight."""
        climb, descent = self.climb_m_s, self.descent_m_s
        return (
            vehicle.climb_m_s if climb is None else climb,
            vehicle.descent_m_s if descent is None else descent,
        )

    def check(self, altitude_m: float, autopilot: str) -> None:
        """Refuse a tolerance that does not fit the height, or a mode that the autopilot lacks."""
        tolerance_m = self.tolerance_m
        if tolerance_m is not None and not MIN_TOLERANCE_M <= tolerance_m <= altitude_m / 2:
            raise ParameterError(
                f"the tolerance of the height above the ground is {MIN_TOLERANCE_M:g} m to half of the "
                f"height ({altitude_m / 2:g} m), not {tolerance_m:g}"
            )
        if self.mode == FRAME and autopilot != "ardupilot":
            raise ParameterError(
                "heights above the terrain (--terrain frame) are known to ArduPilot only, not to "
                f"{autopilot}: give --terrain absolute and a DEM"
            )


def terrain_params(
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None,
    mode: str | None = None,
    tolerance_m: float | None = None,
    climb_m_s: float | None = None,
    descent_m_s: float | None = None,
) -> TerrainParams | None:
    """Open an elevation model for `TerrainParams`; None where neither a DEM nor a mode is given.

    `mode` is by default "absolute"; the other values are as of `TerrainParams`. A ParameterError says that a
    value is out of bounds or a DEM missing, a RasterError that a file is no elevation model.
    """
    if dem is None and mode is None:
        given = {"tolerance": tolerance_m, "rate of climb": climb_m_s, "rate of descent": descent_m_s}
        for what, value in given.items():
            if value is not None:
                raise ParameterError(
                    f"a {what} is for heights above the ground, which need an elevation model: give --dem"
                )
        return None
    return TerrainParams(
        dem=None if dem is None else Dem.open(dem),
        mode=ABSOLUTE if mode is None else mode,
        tolerance_m=tolerance_m,
        climb_m_s=climb_m_s,
        descent_m_s=descent_m_s,
    )


@checked
@dataclass(frozen=True, slots=True)
class VisitParams:
    """Parameters of visits: seconds of hover over each region, 0 to 3600."""

    hold_s: float = 0.0

    def __post_init__(self) -> None:
        _check("hold", self.hold_s, 0, MAX_HOLD_S, "s")


@checked
@dataclass(frozen=True, slots=True)
class PerimeterParams:
    """Parameters of perimeters."""

    offset_m: float = 0.0  # distance from the outline, outward; negative inward
    min_leg_m: float | None = None  # no leg is shorter; by default a second of flight
    holes: str = "skip"  # "skip" or "fly" their outlines too

    def __post_init__(self) -> None:
        _check("offset of a perimeter", self.offset_m, -MAX_MARGIN_M, MAX_MARGIN_M, "m")
        _check("shortest leg", self.min_leg_m, 0, MAX_MARGIN_M, "m")
        if self.holes not in HOLES:
            raise ParameterError(f"holes are one of {', '.join(HOLES)}, not {self.holes!r}")


@checked
@dataclass(frozen=True, slots=True)
class SurveyParams:
    """Parameters of surveys in parallel lines."""

    margin_m: float = 0.0  # metres by which the regions are grown before they are covered
    crosshatch: bool = False  # whether lines at a right angle to the first are flown too
    turnaround_m: float = 0.0  # straight flight before and after each line, to turn without photographs

    def __post_init__(self) -> None:
        _check("margin", self.margin_m, 0, MAX_MARGIN_M, "m")
        _check("turnaround", self.turnaround_m, 0, MAX_MARGIN_M, "m")


@checked
@dataclass(frozen=True, slots=True)
class CorridorParams:
    """Parameters of corridors."""

    margin_m: float = 0.0  # metres by which the regions are grown before they are covered
    width_m: float | None = None  # of regions that are given as lines; by default half of the spacing

    def __post_init__(self) -> None:
        _check("margin", self.margin_m, 0, MAX_MARGIN_M, "m")
        _check("width of a corridor", self.width_m, MIN_NUMBER, MAX_DISTANCE_M, "m")


@checked
@dataclass(frozen=True, slots=True)
class OrbitParams:
    """Parameters of orbits: metres between a region and the circle around it."""

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


def _check(what: str, value: float | None, minimum: float, maximum: float, unit: str) -> None:
    """Refuse a number that is given and out of bounds."""
    if value is not None and not (math.isfinite(value) and minimum <= value <= maximum):
        raise ParameterError(f"the {what} is {minimum:g} to {maximum:g} {unit}, not {value:g}")


MIN_ITEMS = 10
MAX_FLIGHTS, MAX_VEHICLES = 1000, 20


@checked
@dataclass(frozen=True, slots=True)
class LimitParams:
    """Limits of each flight; a mission that exceeds them is split."""

    endurance_min: float | None = None  # minutes in the air on a full battery; by default without a limit
    reserve: float = 20.0  # per cent of the endurance that are left at the end
    max_items: int | None = None  # of a flight; by default what common boards of the autopilot hold
    max_waypoints: int | None = None  # of a flight, where a file is read by waypoints instead of items
    flights: int | None = None  # so many, of like length; by default the fewest that fit
    vehicles: int = 1  # in the air at once

    def __post_init__(self) -> None:
        if self.endurance_min is not None and not 0 < self.endurance_min <= 6000:
            raise ParameterError(f"the endurance is above 0 and at most 6000 min, not {self.endurance_min:g}")
        if not 0 <= self.reserve < 100:
            raise ParameterError(f"the reserve is 0 to below 100 per cent, not {self.reserve:g}")
        if self.max_items is not None and not MIN_ITEMS <= self.max_items <= MAX_ITEMS:
            raise ParameterError(f"a flight has {MIN_ITEMS} to {MAX_ITEMS} items, not {self.max_items}")
        if self.flights is not None and not 1 <= self.flights <= MAX_FLIGHTS:
            raise ParameterError(f"a mission has 1 to {MAX_FLIGHTS} flights, not {self.flights}")
        if self.max_waypoints is not None and not MIN_ITEMS <= self.max_waypoints <= MAX_ITEMS:
            raise ParameterError(
                f"a flight has {MIN_ITEMS} to {MAX_ITEMS} waypoints, not {self.max_waypoints}"
            )
        if not 1 <= self.vehicles <= MAX_VEHICLES:
            raise ParameterError(f"1 to {MAX_VEHICLES} vehicles are planned for, not {self.vehicles}")
        if self.vehicles > 1 and self.flights is not None:
            raise ParameterError(
                "a number of flights is for one vehicle; with several, each has as many as it needs: give "
                "--flights or --vehicles"
            )

    @property
    def seconds(self) -> float:
        """Maximum time of a flight; infinite without a limit."""
        return math.inf if self.endurance_min is None else 60 * self.endurance_min * (1 - self.reserve / 100)


@checked
@dataclass(frozen=True, slots=True)
class SafetyParams:
    """Keep-out margins, fence and limits of height and distance."""

    avoid_margin_m: float = 10.0  # minimum distance of the vehicle to keep-out zones
    fence_margin_m: float | None = 50.0  # distance of the fence from the flight; None: no fence is written
    max_altitude_m: float = USUAL_MAX_HEIGHT_M  # above home, or above the ground where that is known
    max_distance_m: float | None = None  # maximum distance from home; by default 100 km
    rally: tuple[RallyPoint, ...] = ()
    zone_height_m: float | None = None  # of keep-out zones, above home; None: they reach to the sky

    @property
    def over_zones_m(self) -> float:
        """Minimum height above home from which a flight may pass over keep-out zones."""
        height_m = math.inf if self.zone_height_m is None else self.zone_height_m
        return height_m + max(self.avoid_margin_m, MIN_OVER_M)

    def __post_init__(self) -> None:
        _check("height of keep-out zones (--zone-height)", self.zone_height_m, 0, MAX_HEIGHT_M, "m")
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


MIN_OVER_M = 5.0  # barometers drift by metres during a flight
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
        Azimuth of the lines of a survey, clockwise from north; by default, for each region, the one of the
        least time.
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
        By default the flight takes no photographs.
    how : VisitParams, PerimeterParams, SurveyParams, CorridorParams or OrbitParams, optional
        Parameters of the pattern.
    limits : LimitParams
    safety : SafetyParams
    vehicle : Vehicle, optional
        For estimates; by default a multirotor with the parameters of its autopilot.
    terrain : TerrainParams, optional
        By default the flight keeps one height above home.
    wind : Wind, optional
        By default estimates are for calm air, and flights are divided for 5 m/s from any direction.
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
    wind: Wind | None = None

    def __post_init__(self) -> None:
        _check("altitude", self.altitude_m, MIN_NUMBER, MAX_HEIGHT_M, "m above home")
        _check("speed", self.speed_m_s, MIN_NUMBER, MAX_SPEED_M_S, "m/s")
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
        if self.pattern in COVERING and self.spacing_m is None:
            raise ParameterError(
                f"a {self.pattern} needs the spacing of its lines in metres (--spacing or --camera)"
            )
        if self.pattern not in COVERING and self.spacing_m is not None:
            raise ParameterError(f"a spacing is for a survey or corridor, not for the pattern {self.pattern}")
        if self.pattern != "survey" and self.angle_deg is not None:
            raise ParameterError(f"an angle is for a survey, not for the pattern {self.pattern}")
        self._check_photos()
        _check("spacing", self.spacing_m, MIN_NUMBER, MAX_DISTANCE_M, "m")
        if self.angle_deg is not None and not math.isfinite(self.angle_deg):
            raise ParameterError(f"the angle of lines is a number of degrees, not {self.angle_deg}")
        _check("tolerance", self.tolerance_m, MIN_NUMBER, MAX_DISTANCE_M, "m")
        if self.terrain is not None:
            self.terrain.check(self.altitude_m, self.autopilot)
            if self.safety.zone_height_m is not None:
                raise ParameterError(
                    "--zone-height counts from home, above which a flight that follows the ground (--dem, "
                    "--terrain) changes its height; leave it out: then the flight leads around the zones"
                )

    @property
    def flown_by(self) -> Vehicle:
        """The vehicle that is given, or the default one of the autopilot."""
        return self.vehicle or default_vehicle(self.autopilot)

    @property
    def passes(self) -> "tuple[PlanParams, ...]":
        """Parameters for each gimbal pitch; `spacing_m` is that of the steepest, others in proportion."""
        if self.photos is None or not self.photos.flatter_deg:
            return (self,)
        pitches = (self.photos.pitch_deg, *self.photos.flatter_deg)
        each = [replace(self.photos, pitch_deg=pitch, flatter_deg=()) for pitch in pitches]
        share = (self.spacing_m or 0.0) / self.photos.spacing_m(1.0)
        return tuple(replace(self, photos=one, spacing_m=share * one.spacing_m(1.0)) for one in each)

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
        if self.pattern != "survey" and self.photos.flatter_deg:
            raise ParameterError(f"several gimbal pitches are for the pattern survey, not {self.pattern}")
