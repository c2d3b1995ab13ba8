"""Parameters of a flight at a constant height above the ground, checked when they are made."""

import os
from collections.abc import Sequence

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.mission.vehicle import Vehicle
from uavseg.raster.elevation.dem import Dem

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
            if rate is not None and not MIN_RATE_M_S <= rate <= MAX_RATE_M_S:
                raise ParameterError(
                    f"the {what} rate is {MIN_RATE_M_S:g} to {MAX_RATE_M_S:g} m/s, not {rate:g}"
                )
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
