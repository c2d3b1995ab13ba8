"""How to fly, from the words of the command line and of Python."""

import math
import os

from uavseg.errors import ParameterError
from uavseg.flight.mission.vehicle import Vehicle, read_vehicle
from uavseg.flight.params.limits import LimitParams, SafetyParams
from uavseg.flight.params.plan import COVERING, PlanParams
from uavseg.flight.params.terrain import TerrainParams
from uavseg.jobs.words.pattern_words import PatternWords, pattern_params
from uavseg.jobs.words.photo_words import PhotoWords, photos_of

MAX_GSD_CM = 100.0
NO_PHOTOS, NOTHING_SAID = PhotoWords(), PatternWords()


def flight_params(
    altitude: float | None,
    *,
    pattern: str | None = None,
    spacing: float | None = None,
    angle: float | None = None,
    speed: float = 5.0,
    autopilot: str = "ardupilot",
    tolerance: float | None = None,
    photos: PhotoWords = NO_PHOTOS,
    words: PatternWords = NOTHING_SAID,
    gsd: float | None = None,
    vehicle: str | os.PathLike[str] | Vehicle | None = None,
    limits: LimitParams = LimitParams(),
    safety: SafetyParams = SafetyParams(),
    terrain: TerrainParams | None = None,
) -> PlanParams:
    """How to fly; without a pattern, regions are visited, or surveyed where a spacing or camera is given.

    With a camera, the height follows from the ground sampling distance (`gsd`, centimetres) where that is
    given, and the spacing from the overlap. A vehicle is one, or its JSON file.

    Raises
    ------
    ParameterError
        If a value is out of bounds, or values do not go together.
    """
    taken = photos_of(photos, pattern)
    if gsd is not None:
        if taken is None:
            raise ParameterError("a ground sampling distance needs a camera (--camera)")
        if altitude is not None:
            raise ParameterError("the height follows from the ground sampling distance; give one of the two")
        if not 0 < gsd <= MAX_GSD_CM:
            raise ParameterError(f"a ground sampling distance is above 0 and at most 100 cm, not {gsd:g}")
        altitude = taken.camera.height_m(gsd / 100, taken.pitch_deg)
    if altitude is None:
        raise ParameterError("a mission needs --altitude, in metres above home, or --camera and --gsd")
    if pattern is None:
        pattern = "visit" if spacing is None and taken is None else "survey"
    if taken is not None and pattern in COVERING and 0 < altitude < math.inf:
        spacing = taken.spacing_m(altitude) if spacing is None else spacing
    return PlanParams(
        altitude_m=altitude,
        pattern=pattern,
        spacing_m=spacing,
        angle_deg=angle,
        speed_m_s=speed,
        autopilot=autopilot,
        tolerance_m=tolerance,
        photos=taken,
        vehicle=read_vehicle(vehicle, autopilot) if isinstance(vehicle, str | os.PathLike) else vehicle,
        how=pattern_params(pattern, words),
        limits=limits,
        safety=safety,
        terrain=terrain,
    )
