"""Returns that start early: what an autopilot's own way home, which is straight, may lead into."""

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.vehicle import returning_vehicles
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.safety.keep_out import KeepOut

Floats = NDArray[np.float64]

STEP_M = 5.0
STARTS = 2000  # places of the flight from which returns are looked at, at most
NAMES = {
    "ardupilot": ("ArduPilot", "RTL_ALT"),
    "px4": ("PX4", "RTL_RETURN_ALT"),
    "generic": ("the autopilot", "RTL_ALT, RTL_RETURN_ALT"),
}


def return_notes(path: Floats, keep_out: KeepOut, plane: Plane, params: PlanParams) -> Iterator[str]:
    """Notes on a return that the pilot or a failsafe starts during the flight.

    It is straight and not planned around zones, and the vehicle may climb before it. The end of the mission
    is: it leads around zones.

    Parameters
    ----------
    path : (n, 2) float64 array
        Corners of the flight in metres, home first and last.
    keep_out : KeepOut
    plane : Plane
    params : PlanParams
    """
    name, setting = NAMES[params.autopilot]
    most_m, height_m = params.safety.max_altitude_m, _return_height_m(path, params)
    if height_m > most_m:
        yield (
            f"for a return, {name} climbs to {height_m:.0f} m above home unless it is set otherwise, above "
            f"the {most_m:g} m of --max-altitude: set {setting} to {most_m:g} m at most"
        )
    if not keep_out.zones:
        return
    starts = _along(path)
    ways = shapely.linestrings(np.stack([np.broadcast_to(path[0], starts.shape), starts], axis=1))
    crosses = shapely.intersects(keep_out.grown, ways)
    if crosses.any():
        x, y = starts[int(crosses.argmax())]
        lon, lat = plane.lonlat_from_xy(x, y)
        yield (
            "a return that starts early is straight: it leads through a keep-out zone or its margin from "
            f"{max(100 * crosses.mean(), 1):.0f} % of the flight, the first at "
            f"{float(lat):.6f},{float(lon):.6f}; there, lead the vehicle by hand, or give rally points"
        )


def _return_height_m(path: Floats, params: PlanParams) -> float:
    """The greatest height to which a return climbs; within a cone around home it climbs less."""
    known = returning_vehicles(params.vehicle, params.autopilot)
    away_m = float(np.hypot(*(path - path[0]).T).max())
    return max(min(vehicle.return_height_m, vehicle.return_slope * away_m) for vehicle in known)


def _along(path: Floats) -> Floats:
    """Places along a path at equal distances."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.linspace(0, length[-1], min(int(length[-1] / STEP_M) + 2, STARTS))
    return np.column_stack([np.interp(at, length, path[:, 0]), np.interp(at, length, path[:, 1])])
