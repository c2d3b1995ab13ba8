"""Simulated flights of planned missions: time, photographs, ground covered, distance to keep-out zones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import Proj

from benchmarks.flight import arducopter, px4
from benchmarks.flight.arducopter import Rise
from benchmarks.flight.fields import Field
from benchmarks.flight.log import Log
from benchmarks.flight.route import route
from uavseg.flight.mission.estimate import estimate
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import Wind

Floats = NDArray[np.float64]

MARGIN_M = 10.0  # the default around keep-out zones: what lies in it is not photographed on purpose


@dataclass(frozen=True, slots=True)
class Flown:
    """A mission, estimated and simulated.

    Parameters
    ----------
    estimated_s, simulated_s : float
    estimated_photographs, photographs : int
    covered : float
        Share of the regions, apart from keep-out zones and their margin, that the photographs show; nan
        without a camera.
    zone_m : float
        Least distance to a keep-out zone; infinite without one.
    lowest_m, highest_m : float
        Height above the ground between takeoff and landing.
    """

    estimated_s: float
    simulated_s: float
    estimated_photographs: int
    photographs: int
    covered: float
    zone_m: float
    lowest_m: float
    highest_m: float

    @property
    def error(self) -> float:
        """By what share of the simulated time the estimate is too long."""
        return self.estimated_s / self.simulated_s - 1


def simulate(
    missions: Sequence[Mission],
    field: Field,
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rise: Rise | None = None,
) -> Flown:
    """Fly the missions over a field one after another, and compare them with their estimates in the wind."""
    logs = [fly(mission, wind, rise) for mission in missions]
    east, north, _ = wind
    blows = Wind(math.hypot(east, north), math.degrees(math.atan2(-east, -north)) % 360)
    estimates = [estimate(mission, wind=blows) for mission in missions]
    photos = missions[0].photos
    taken = Log(photographs=[photograph for log in logs for photograph in log.photographs])
    zones = in_metres(field.zones, field)
    region = shapely.difference(in_metres(field.polygons, field), shapely.buffer(zones, MARGIN_M))
    above = np.concatenate([heights_m(log, rise) for log in logs])
    return Flown(
        sum(one.duration_s for one in estimates),
        sum(log.seconds for log in logs),
        sum(one.photographs for one in estimates),
        len(taken.photographs),
        covered(taken, region, photos, rise) if photos else float("nan"),
        min(least_distance_m(log, zones) for log in logs) if field.zones else float("inf"),
        float(above.min()),
        float(above.max()),
    )


def fly(
    mission: Mission,
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rise: Rise | None = None,
    gust_m_s: float = 0.0,
) -> Log:
    """Fly a mission as its autopilot does; gusts are for ArduCopter."""
    if mission.autopilot == "px4":
        return px4.fly(*route(mission), wind)
    return arducopter.fly(*route(mission), wind, rise, gust_m_s)


def heights_m(log: Log, rise: Rise | None) -> Floats:
    """Height above the ground along the track, between takeoff and landing."""
    track = log.track[log.begin : log.end]
    return np.array([z - (rise(x, y) if rise else 0.0) for x, y, z in track])


def in_metres(polygons: Any, field: Field) -> Any:
    """The union of polygons in metres east and north of home."""
    flat = Proj(proj="aeqd", lat_0=field.home[0], lon_0=field.home[1], datum="WGS84")
    whole = shapely.union_all(list(polygons))
    return shapely.transform(whole, lambda lonlat: np.column_stack(flat(*lonlat.T)))


def covered(log: Log, region: Any, photos: Any, rise: Rise | None = None) -> float:
    """Share of a region that photographs show, from where and in which direction they were taken.

    The ground that a photograph shows is taken to be as high as it is below the camera.
    """
    footprints = []
    for x, y, z, heading in log.photographs:
        height = z - (rise(x, y) if rise else 0.0)
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
