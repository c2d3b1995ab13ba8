"""Estimate of a mission: length, time, photographs and their footprints on the ground, energy."""

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Photos
from uavseg.flight.mission.flown import FlownPath, flown_path
from uavseg.flight.mission.items import MOUNT_CONTROL, ROI_LOCATION
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.vehicle import Vehicle, default_vehicle


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimated length, time, photographs and energy of a flight without wind."""

    distance_m: float  # over ground, with the return
    duration_s: float  # from takeoff to touchdown: the sum of the five times that follow
    climb_s: float
    flight_s: float
    hold_s: float
    return_s: float  # to above home, with the wait there
    landing_s: float
    photographs: int
    # of photographs, where the ground sampling distance is coarsest; None where the camera is not known
    gsd_m: float | None = None
    footprint_m: tuple[float, float] | None = None  # width and depth, across and along the line of flight
    photographed_m2: float | None = None  # flat ground that the photographs show
    energy_wh: float | None = None  # None where the power of the vehicle is not known
    battery: float | None = None  # share of a full battery

    def as_dict(self) -> dict[str, Any]:
        """Return the estimate for JSON: times and lengths to a tenth, unknown values as None."""
        decimals = {"gsd_m": 6, "battery": 4}
        return {name: _rounded(value, decimals.get(name, 1)) for name, value in asdict(self).items()}


def _rounded(value: Any, decimals: int) -> Any:
    if isinstance(value, tuple):
        return [round(part, decimals) for part in value]
    return value if value is None or isinstance(value, int) else round(value, decimals)


def estimate(mission: Mission, vehicle: Vehicle | None = None, photos: Photos | None = None) -> Estimate:
    """Estimate a mission.

    By default with the photographs and the vehicle of the mission, or else a multirotor with the default
    parameters of its autopilot.

    Examples
    --------
    >>> from uavseg.flight.mission.items import FRAME_RELATIVE, RETURN, TAKEOFF, HomePosition, MissionItem
    >>> from uavseg.flight.mission.mission import Mission
    >>> up = MissionItem(TAKEOFF, FRAME_RELATIVE, lat=47.0, lon=8.0, altitude_m=30.0)
    >>> there = MissionItem(16, FRAME_RELATIVE, lat=47.001, lon=8.0, altitude_m=30.0)
    >>> flight = estimate(Mission(HomePosition(47, 8), (up, there, MissionItem(RETURN, 2))))
    >>> round(flight.distance_m), round(flight.duration_s)
    (222, 99)
    """
    vehicle = vehicle or mission.vehicle or default_vehicle(mission.autopilot)
    path = flown_path(mission, vehicle)
    times = {part: float(path.seconds[path.part == part].sum()) for part in ("climb", "flight", "return")}
    hold, landing = float(path.hold_s.sum()), path.landing_s
    waits = hold + path.return_hold_s
    photos = photos or mission.photos
    gsd_m = footprint_m = photographed_m2 = energy = None
    if photos and path.photographs.any():
        highest_m = float(path.height_m[path.photographs > 0].max())
        gsd_m = photos.camera.gsd_m(highest_m, photos.pitch_deg)
        footprint_m = photos.camera.footprint_m(highest_m, photos.pitch_deg)
        photographed_m2 = _photographed_m2(path, photos)
    if vehicle.hover_w is not None and vehicle.cruise_w is not None:
        hover_s, cruise_s = times["climb"] + waits + landing, times["flight"] + times["return"]
        energy = (vehicle.cruise_w * cruise_s + vehicle.hover_w * hover_s) / 3600
    return Estimate(
        distance_m=float(path.length_m.sum()),
        duration_s=sum(times.values()) + waits + landing,
        climb_s=times["climb"],
        flight_s=times["flight"],
        hold_s=hold,
        return_s=times["return"] + path.return_hold_s,
        landing_s=landing,
        photographs=int(path.photographs.sum()),
        gsd_m=gsd_m,
        footprint_m=footprint_m,
        photographed_m2=photographed_m2,
        energy_wh=energy,
        battery=None if energy is None else energy / (vehicle.battery_wh or math.nan),
    )


def _photographed_m2(path: FlownPath, photos: Photos) -> float:
    """Return the area of the union of the strips that the photographs of each leg show."""
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
    """Return length (metres) and duration (seconds) of flights for people.

    >>> estimate_text(4410.3, 425)
    '4.41 km, about 7 min 05 s'
    """
    return f"{distance_m / 1000:.2f} km, {duration_text(duration_s)}"


def duration_text(seconds: float | None) -> str:
    """Return a duration for people: about 7 min 05 s."""
    if seconds is None or not math.isfinite(seconds):  # a sum of waits may overflow
        return "without end"
    minutes, rest = divmod(round(seconds), 60)
    return f"about {minutes} min {rest:02d} s"


MAX_FOOTPRINTS = 5000


@dataclass(frozen=True)
class Footprints:
    """Footprints of the photographs of a mission on flat ground."""

    lonlat: Floats  # (n, 4, 2), corners in degrees: near left, near right, far right, far left, as flown
    note: str = ""  # reason why there are none; empty where there are


def footprints(mission: Mission, photos: Photos | None = None) -> Footprints:
    """Compute the flat ground that each photograph of a mission shows; the camera looks along the flight.

    `photos` are by default those of the mission. A gimbal pitch that items of the mission set takes
    precedence.
    """
    path = flown_path(mission, mission.vehicle or default_vehicle(mission.autopilot))
    count = int(path.photographs.sum())
    known = photos or mission.photos
    if not count:
        return _none("the mission takes no photographs" if photos else "")
    if known is None:
        return _none("a mission file does not say which camera: name it for footprints of photographs")
    if any(item.command == ROI_LOCATION for item in mission.items):
        return _none("no footprints: the camera looks at places, not along the flight")
    if count > MAX_FOOTPRINTS:
        return _none(f"no footprints: {count:,} photographs are more than {MAX_FOOTPRINTS:,}")
    pitches = {item.params[0] for item in mission.items if item.command == MOUNT_CONTROL}
    if len(pitches) > 1:
        return _none("no footprints: the gimbal pitch changes during the flight")
    try:
        for pitch in pitches:
            known = replace(known, pitch_deg=float(pitch or 0.0))
        corners = known.camera.footprint_corners_m(1.0, known.pitch_deg)
    except ParameterError as error:
        return _none(f"no footprints: {error}")
    ground = []
    for run in path.shots:
        shares = np.clip(run.first + run.step * np.arange(run.count), 0, 1)
        ground.append(_on_ground(path, run.leg, shares, corners))
    xy = np.concatenate(ground)
    plane = Plane(mission.home.lat, mission.home.lon)
    lon, lat = plane.lonlat_from_xy(xy[..., 0].ravel(), xy[..., 1].ravel())
    return Footprints(np.stack([lon, lat], axis=-1).reshape(-1, 4, 2))


def _none(note: str) -> Footprints:
    return Footprints(np.empty((0, 4, 2)), note)


def _on_ground(path: FlownPath, leg: int, shares: Floats, corners: Floats) -> Floats:
    """Project corners (4, 2) at a height of 1 m to metres east and north of home, for shares of a leg.

    Photographs at or below the ground show none of it: their corners coincide.
    """
    start, end = path.xyz_m[leg], path.xyz_m[leg + 1]
    heights = path.xyz_m[leg : leg + 2, 2] - path.rise_m[leg : leg + 2]
    height = np.maximum(heights[0] + shares * (heights[1] - heights[0]), 0.0)
    along = np.array([0.0, 1.0])
    steps = np.diff(path.xyz_m[:, :2], axis=0)
    for step in (*steps[leg::-1], *steps[leg + 1 :]):  # a leg of no length has the direction of another one
        if length := math.hypot(*step):
            along = step / length
            break
    across = np.array([along[1], -along[0]])
    offsets = corners[:, :1] * across + corners[:, 1:] * along
    places = start[:2] + shares[:, None] * (end - start)[:2]
    ground: Floats = places[:, None] + height[:, None, None] * offsets
    return ground
