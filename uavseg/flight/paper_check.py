"""A flight on paper: every leg of a mission against zones, fence, height and distance from home."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.fence import FenceCircle
from uavseg.flight.items import FRAME_AMSL
from uavseg.flight.limits import SafetyParams
from uavseg.flight.mission import Mission
from uavseg.flight.plane import Plane
from uavseg.flight.terrain.clearance import Clearance

Floats = NDArray[np.float64]

SLACK_M = 0.05
"""What the decimals of a file and the local plane may take from a distance."""
HEIGHT_SLACK_M = 0.5


@dataclass(frozen=True, eq=False)
class PaperCheck:
    """What a mission is checked against.

    Parameters
    ----------
    safety : SafetyParams
    zones : sequence of shapely Polygon or MultiPolygon
        Keep-out zones in degrees (lon, lat; WGS 84).
    clearance : Clearance, optional
        The ground and how far flights keep above it; without, heights above home are checked.
    """

    safety: SafetyParams = SafetyParams()
    zones: Sequence[Any] = ()
    clearance: Clearance | None = None

    def check(self, mission: Mission) -> None:
        """Fly a mission on paper.

        Raises
        ------
        MissionError
            If a leg comes too near to a zone or to the ground, leaves the fence, is too high or too far from
            home.
        """
        plane = Plane(mission.home.lat, mission.home.lon)
        lat, lon, height = mission.path
        xy = np.column_stack(plane.xy_from_lonlat(lon, lat))
        legs = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
        walk = _Walk(lat, lon, legs)
        self._check_zones(walk, plane)
        _check_fence(mission, walk, plane)
        if self.clearance is not None:
            self.clearance.check(mission, self.safety.max_altitude_m + HEIGHT_SLACK_M)
        elif not any(item.has_position and item.frame == FRAME_AMSL for item in mission.items):
            self._check_height(walk, height)
        self._check_distance(walk, np.hypot(*xy.T))

    def _check_zones(self, walk: "_Walk", plane: Plane) -> None:
        if not self.zones:
            return
        zones = shapely.union_all(shapely.make_valid(plane.project_polygons(self.zones)))
        distance = shapely.distance(walk.legs, zones)
        nearest = int(distance.argmin())
        if distance[nearest] < self.safety.avoid_margin_m - SLACK_M or distance[nearest] == 0:
            raise MissionError(
                f"{walk.leg(nearest)} comes within {distance[nearest]:.1f} m of a keep-out zone, "
                f"and at least {self.safety.avoid_margin_m:g} m are kept"
            )

    def _check_height(self, walk: "_Walk", height: Floats) -> None:
        highest = int(height.argmax())
        if height[highest] > self.safety.max_altitude_m + HEIGHT_SLACK_M:
            raise MissionError(
                f"{walk.corner(highest)} is {height[highest]:.1f} m high, above the "
                f"{self.safety.max_altitude_m:g} m that are allowed (--max-altitude)"
            )

    def _check_distance(self, walk: "_Walk", away: Floats) -> None:
        most = self.safety.max_distance_m
        farthest = int(away.argmax())
        if most is not None and away[farthest] > most:
            raise MissionError(
                f"{walk.corner(farthest)} is {away[farthest]:.0f} m from home, farther than the {most:g} m "
                "that are allowed (--max-distance)"
            )


@dataclass(frozen=True, eq=False)
class _Walk:
    """The corners of a mission with home first, and its legs in metres."""

    lat: Floats
    lon: Floats
    legs: NDArray[np.object_]

    def corner(self, k: int) -> str:
        return f"the position {self.lat[k]:.6f},{self.lon[k]:.6f}"

    def leg(self, k: int) -> str:
        here, there = (f"{self.lat[end]:.6f},{self.lon[end]:.6f}" for end in (k, k + 1))
        return f"the leg from {here} to {there}"


def _check_fence(mission: Mission, walk: _Walk, plane: Plane) -> None:
    inside = [_area(shape, plane) for shape in mission.fence if shape.inclusion]
    outside = [_area(shape, plane) for shape in mission.fence if not shape.inclusion]
    if inside:
        area = shapely.union_all(inside)
        out = np.flatnonzero(~shapely.covered_by(walk.legs, area))
        if len(out):
            raise MissionError(f"{walk.leg(int(out[0]))} leaves the fence")
    if outside:
        into = np.flatnonzero(shapely.intersects(walk.legs, shapely.union_all(outside)))
        if len(into):
            raise MissionError(f"{walk.leg(int(into[0]))} enters an area that the fence excludes")


def _area(shape: Any, plane: Plane) -> Any:
    lat, lon = np.array(shape.positions).T
    xy = np.column_stack(plane.xy_from_lonlat(lon, lat))
    if isinstance(shape, FenceCircle):
        return shapely.buffer(shapely.Point(xy[0]), shape.radius_m, quad_segs=32)
    return shapely.Polygon(xy)
