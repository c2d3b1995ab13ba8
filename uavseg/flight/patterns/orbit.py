"""Orbits: a circle around a region as a polygon of waypoints, which every autopilot flies.

PX4 has no LOITER_TURNS in missions, and ArduPilot stores its radius in whole metres, up to 255 m, or in tens.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.camera.photos import Photos

Floats = NDArray[np.float64]

LEAST_RADIUS_M = 5.0
LATERAL_M_S2 = 2.5
"""Acceleration across the direction of flight: at 5 m/s a circle has a radius of 10 m at least."""
SAGITTA, MAX_SAGITTA_M = 0.02, 3.0  # share of the radius by which corners may lie outside of the circle
MAX_CORNERS = 72
LARGEST_STEP_DEG = 15.0
"""Between directions of photographs; with more, matching photographs fails."""


@dataclass(frozen=True, slots=True, eq=False)
class Orbit:
    """A circle around a region.

    Parameters
    ----------
    centre : (float, float)
        x, y in metres.
    radius_m : float
        No point of the path is nearer to the centre.
    least_radius_m : float
        The smallest radius that the vehicle flies at its speed; the circle has it where the region is small.
    ring : (n, 2) float64 array
        Corners of the path; the last is the first one.
    """

    centre: tuple[float, float]
    radius_m: float
    least_radius_m: float
    ring: Floats


def orbit(region: Any, margin_m: float, speed_m_s: float) -> Orbit:
    """The circle around a region that is so far away from the smallest circle around it.

    Parameters
    ----------
    region : shapely Polygon
        In metres.
    margin_m, speed_m_s : float

    Examples
    --------
    >>> found = orbit(shapely.box(-30, -40, 30, 40), 10, 5)
    >>> round(found.radius_m, 6), [round(abs(x), 6) for x in found.centre]
    (60.0, [0.0, 0.0])
    """
    x, y = shapely.get_coordinates(shapely.centroid(shapely.minimum_bounding_circle(region)))[0]
    x, y = float(x), float(y)
    corners = shapely.get_coordinates(region.exterior)
    enclosing = float(np.hypot(*(corners - (x, y)).T).max())
    least = max(LEAST_RADIUS_M, speed_m_s**2 / LATERAL_M_S2)
    radius = max(enclosing + margin_m, least)
    sagitta = min(SAGITTA * radius, MAX_SAGITTA_M)
    count = min(math.ceil(math.pi / math.acos(radius / (radius + sagitta))), MAX_CORNERS)
    turn = 2 * math.pi * np.arange(count + 1) / count
    outer = radius / math.cos(math.pi / count)
    ring = np.column_stack([x + outer * np.sin(turn), y + outer * np.cos(turn)])
    ring[-1] = ring[0]
    return Orbit((x, y), radius, least, ring)


def orbit_trigger_m(photos: Photos, found: Orbit, region: Any, height_m: float) -> float:
    """Distance between the photographs of an orbit.

    An image is as wide, where it shows what is nearest of the region, as its slant distance says.
    Neighbouring images share the front overlap of that, and their directions differ by 15 degrees at most.
    """
    ring = shapely.LineString(found.ring)
    near = math.hypot(float(shapely.distance(ring, region)), height_m)
    across = near * photos.camera.sensor_mm[0] / photos.camera.focal_mm
    step = found.radius_m * math.radians(LARGEST_STEP_DEG)
    return min(across * (1 - photos.overlap.front / 100), step)
