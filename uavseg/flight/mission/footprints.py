"""Footprints of photographs: the ground that each shows, as if it were flat."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.flight.camera.photos import Photos
from uavseg.flight.mission.flown import FlownPath, flown_path
from uavseg.flight.mission.items import MOUNT_CONTROL, ROI_LOCATION
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.vehicle import default_vehicle

MAX_FOOTPRINTS = 5000

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Footprints:
    """Ground that the photographs of a mission show.

    Parameters
    ----------
    lonlat : (n, 4, 2) float64 array
        Corners of each in degrees: near left, near right, far right, far left, as the vehicle flies.
    note : str
        Why there are none; empty where there are.
    """

    lonlat: Floats
    note: str = ""


def footprints(mission: Mission, photos: Photos | None = None) -> Footprints:
    """The ground that each photograph of a mission shows, where the camera looks along the flight.

    Parameters
    ----------
    mission : Mission
    photos : Photos, optional
        By default the mission's own camera. The gimbal pitch of the mission's items comes first.
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
    xy = np.concatenate([_on_ground(path, leg, shares, corners) for leg, shares in _places(path)])
    plane = Plane(mission.home.lat, mission.home.lon)
    lon, lat = plane.lonlat_from_xy(xy[..., 0].ravel(), xy[..., 1].ravel())
    return Footprints(np.stack([lon, lat], axis=-1).reshape(-1, 4, 2))


def _none(note: str) -> Footprints:
    return Footprints(np.empty((0, 4, 2)), note)


def _places(path: FlownPath) -> list[tuple[int, Floats]]:
    """Legs with the places of their photographs, as shares of the leg."""
    return [(run.leg, np.clip(run.first + run.step * np.arange(run.count), 0, 1)) for run in path.shots]


def _on_ground(path: FlownPath, leg: int, shares: Floats, corners: Floats) -> Floats:
    """Corners on the ground in metres east and north of home, for each place on a leg.

    Photographs at or below the ground show none of it: their corners coincide.
    """
    start, end = path.xyz_m[leg], path.xyz_m[leg + 1]
    heights = path.xyz_m[leg : leg + 2, 2] - path.rise_m[leg : leg + 2]
    height = np.maximum(heights[0] + shares * (heights[1] - heights[0]), 0.0)
    along = _direction(path, leg)
    across = np.array([along[1], -along[0]])
    offsets = corners[:, :1] * across + corners[:, 1:] * along
    places = start[:2] + shares[:, None] * (end - start)[:2]
    found: Floats = places[:, None] + height[:, None, None] * offsets
    return found


def _direction(path: FlownPath, leg: int) -> Floats:
    """Unit vector along a leg, or where it has no length, along the nearest leg before that has."""
    steps = np.diff(path.xyz_m[:, :2], axis=0)
    for step in (*steps[leg::-1], *steps[leg + 1 :]):
        if length := math.hypot(*step):
            unit: Floats = step / length
            return unit
    return np.array([0.0, 1.0])
