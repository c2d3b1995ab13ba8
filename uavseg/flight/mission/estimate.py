"""Estimate of a mission: length, time with turns and holds, photographs, ground they show, energy."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.camera.photos import Photos
from uavseg.flight.mission.flown import FlownPath, flown_path
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import Vehicle, default_vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a flight takes and gives, without wind.

    Parameters
    ----------
    distance_m : float
        Over ground, with the return.
    duration_s : float
        From takeoff to touching down: the sum of the five times that follow.
    climb_s, flight_s, hold_s, return_s, landing_s : float
        Takeoff; legs between items; waiting at items; the return to above home with its wait; the descent.
    photographs : int
    gsd_m : float, optional
        Ground sampling distance where it is coarsest; where the camera is known.
    footprint_m : (float, float), optional
        Width and depth of the flat ground that one photograph shows, across and along the line of flight,
        where the ground sampling distance is coarsest.
    photographed_m2 : float, optional
        Flat ground that the photographs show.
    energy_wh, battery : float, optional
        Energy, and its share of a full battery; where the power of the vehicle is known.
    """

    distance_m: float
    duration_s: float
    climb_s: float
    flight_s: float
    hold_s: float
    return_s: float
    landing_s: float
    photographs: int
    gsd_m: float | None = None
    footprint_m: tuple[float, float] | None = None
    photographed_m2: float | None = None
    energy_wh: float | None = None
    battery: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """As JSON: times to a tenth of a second, lengths to a tenth of a metre; what is not known is null."""
        decimals = {"gsd_m": 6, "battery": 4}
        return {name: _rounded(value, decimals.get(name, 1)) for name, value in asdict(self).items()}


def _rounded(value: Any, decimals: int) -> Any:
    if isinstance(value, tuple):
        return [round(part, decimals) for part in value]
    return value if value is None or isinstance(value, int) else round(value, decimals)


def estimate(mission: Mission, vehicle: Vehicle | None = None, photos: Photos | None = None) -> Estimate:
    """Estimate a mission.

    Parameters
    ----------
    mission : Mission
    vehicle : Vehicle, optional
        By default the mission's own, or else a multirotor with the default parameters of its autopilot.
    photos : Photos, optional
        By default the mission's own camera.

    Examples
    --------
    >>> from uavseg.flight.mission.items import FRAME_RELATIVE, RETURN, TAKEOFF, HomePosition, MissionItem
    >>> from uavseg.flight.mission.mission import Mission
    >>> up = MissionItem(TAKEOFF, FRAME_RELATIVE, lat=47.0, lon=8.0, altitude_m=30.0)
    >>> there = MissionItem(16, FRAME_RELATIVE, lat=47.001, lon=8.0, altitude_m=30.0)
    >>> found = estimate(Mission(HomePosition(47, 8), (up, there, MissionItem(RETURN, 2))))
    >>> round(found.distance_m), round(found.duration_s)
    (222, 99)
    """
    flyer = vehicle or mission.vehicle or default_vehicle(mission.autopilot)
    path = flown_path(mission, flyer)
    times = {part: float(path.seconds[path.part == part].sum()) for part in ("climb", "flight", "return")}
    hold, landing = float(path.hold_s.sum()), path.landing_s
    waits = hold + path.return_hold_s
    known = photos or mission.photos
    shown = bool(path.photographs.any())
    energy = _energy_wh(flyer, times["flight"] + times["return"], times["climb"] + waits + landing)
    return Estimate(
        distance_m=float(path.length_m.sum()),
        duration_s=sum(times.values()) + waits + landing,
        climb_s=times["climb"],
        flight_s=times["flight"],
        hold_s=hold,
        return_s=times["return"] + path.return_hold_s,
        landing_s=landing,
        photographs=int(path.photographs.sum()),
        gsd_m=_coarsest_gsd_m(path, known) if known and shown else None,
        footprint_m=_largest_footprint_m(path, known) if known and shown else None,
        photographed_m2=_photographed_m2(path, known) if known and shown else None,
        energy_wh=energy,
        battery=None if energy is None else energy / (flyer.battery_wh or math.nan),
    )


def _greatest_height_m(path: FlownPath) -> float:
    return float(path.height_m[path.photographs > 0].max())


def _coarsest_gsd_m(path: FlownPath, photos: Photos) -> float:
    return photos.camera.gsd_m(_greatest_height_m(path), photos.pitch_deg)


def _largest_footprint_m(path: FlownPath, photos: Photos) -> tuple[float, float]:
    return photos.camera.footprint_m(_greatest_height_m(path), photos.pitch_deg)


def _energy_wh(vehicle: Vehicle, cruise_s: float, hover_s: float) -> float | None:
    if vehicle.hover_w is None or vehicle.cruise_w is None:
        return None
    return (vehicle.cruise_w * cruise_s + vehicle.hover_w * hover_s) / 3600


def _photographed_m2(path: FlownPath, photos: Photos) -> float:
    """Area of the strips that the photographs of each leg show, where they overlap counted once."""
    strips = []
    for leg in np.flatnonzero(path.photographs > 0):
        start, end = path.xyz_m[leg, :2], path.xyz_m[leg + 1, :2]
        length = float(np.hypot(*(end - start)))
        height = float(path.height_m[leg])
        if height <= 0:
            continue
        along = (end - start) / length if length else np.array([0.0, 1.0])
        across = np.array([along[1], -along[0]])
        near, far = photos.camera.ground_reach_m(height, photos.pitch_deg)
        half = photos.camera.footprint_m(height, photos.pitch_deg)[0] / 2
        first, last = start + near * along, end + far * along
        ring = [first - half * across, first + half * across, last + half * across, last - half * across]
        strips.append(shapely.Polygon(ring))
    return float(shapely.union_all(strips).area)


def estimate_text(distance_m: float, duration_s: float) -> str:
    """Length and duration of flights.

    Examples
    --------
    >>> estimate_text(4410.3, 425)
    '4.41 km, about 7 min 05 s'
    """
    return f"{distance_m / 1000:.2f} km, {duration_text(duration_s)}"


def duration_text(seconds: float | None) -> str:
    """A duration in words: about 7 min 05 s; a sum of waits may be larger than any number."""
    if seconds is None or not math.isfinite(seconds):
        return "without end"
    minutes, rest = divmod(round(seconds), 60)
    return f"about {minutes} min {rest:02d} s"
