"""Simulated flights of planned missions: time, photographs, ground covered, distance to keep-out zones."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from pyproj import Proj

from benchmarks.flight import arducopter, px4
from benchmarks.flight.fields import Field
from benchmarks.flight.log import Log
from benchmarks.flight.route import route
from uavseg.flight.mission import Mission

SIMULATORS = {"ardupilot": arducopter.fly, "px4": px4.fly}


@dataclass(frozen=True, slots=True)
class Flown:
    """A mission, estimated and simulated.

    Parameters
    ----------
    estimated_s, simulated_s : float
    estimated_photographs, photographs : int
    covered : float
        Share of the regions that the photographs show; nan without a camera.
    zone_m : float
        Least distance to a keep-out zone; infinite without one.
    """

    estimated_s: float
    simulated_s: float
    estimated_photographs: int
    photographs: int
    covered: float
    zone_m: float

    @property
    def error(self) -> float:
        """By what share of the simulated time the estimate is too long."""
        return self.estimated_s / self.simulated_s - 1


def simulate(mission: Mission, field: Field, wind: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Flown:
    """Fly a mission, and compare it with its estimate."""
    log = fly(mission, wind)
    estimate = mission.estimate
    return Flown(
        estimate.duration_s,
        log.seconds,
        estimate.photographs,
        len(log.photographs),
        covered(log, in_metres(field.polygons, field), mission.photos) if mission.photos else float("nan"),
        least_distance_m(log, in_metres(field.zones, field)) if field.zones else float("inf"),
    )


def fly(mission: Mission, wind: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Log:
    """Fly a mission as its autopilot does."""
    return SIMULATORS[mission.autopilot](*route(mission), wind)


def in_metres(polygons: Any, field: Field) -> Any:
    """The union of polygons in metres east and north of home."""
    flat = Proj(proj="aeqd", lat_0=field.home[0], lon_0=field.home[1], datum="WGS84")
    whole = shapely.union_all(list(polygons))
    return shapely.transform(whole, lambda lonlat: np.column_stack(flat(*lonlat.T)))


def covered(log: Log, region: Any, photos: Any) -> float:
    """Share of a region that photographs show, from where and in which direction they were taken."""
    footprints = []
    for x, y, height, heading in log.photographs:
        corners = photos.camera.footprint_corners_m(height, photos.pitch_deg)
        ahead = np.array([np.sin(heading), np.cos(heading)])
        right = np.array([ahead[1], -ahead[0]])
        footprints.append(shapely.Polygon(np.array([x, y]) + corners @ np.array([right, ahead])))
    shown = shapely.intersection(shapely.union_all(footprints), region)
    return float(shown.area / region.area)


def least_distance_m(log: Log, zones: Any) -> float:
    """Least distance of the track over ground to keep-out zones; 0 inside of one."""
    track = shapely.LineString([point[:2] for point in log.track])
    return float(shapely.distance(track, zones))
