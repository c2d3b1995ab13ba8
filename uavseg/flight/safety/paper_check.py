"""A flight on paper: every leg of a mission against zones, fence, height and distance from home."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.safety.fence_check import fence_problems
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
            The first of its `problems`.
        """
        for problem in self.problems(mission):
            raise MissionError(problem)

    def problems(self, mission: Mission) -> Iterator[str]:
        """Why a mission must not be flown, one sentence each.

        A leg or rally point comes too near to a zone or to the ground, lies outside of the fence, is too
        high, or too far from home.
        """
        plane = Plane(mission.home.lat, mission.home.lon)
        lat, lon, height = mission.path
        xy = np.column_stack(plane.xy_from_lonlat(lon, lat))
        legs = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
        walk = _Walk(lat, lon, legs)
        yield from self._near_zones(mission, walk, plane)
        yield from fence_problems(mission)
        if self.clearance is not None:
            yield from self.clearance.problems(mission, self.safety.max_altitude_m + HEIGHT_SLACK_M)
        else:
            yield from self._too_high(mission, walk, height)
        yield from self._too_far(mission, walk, np.hypot(*xy.T), plane)

    def _near_zones(self, mission: Mission, walk: "_Walk", plane: Plane) -> Iterator[str]:
        if not self.zones:
            return
        zones = shapely.STRtree(shapely.make_valid(plane.project_polygons(self.zones)))
        places = [shapely.Point(plane.xy_from_lonlat(point.lon, point.lat)) for point in mission.rally]
        for kind, shapes in ((walk.leg, walk.legs), (partial(_rally, mission), places)):
            if not len(shapes):
                continue
            _, distance = zones.query_nearest(shapes, return_distance=True, all_matches=False)
            nearest = int(distance.argmin())
            if distance[nearest] < self.safety.avoid_margin_m - SLACK_M or distance[nearest] == 0:
                yield (
                    f"{kind(nearest)} comes within {distance[nearest]:.1f} m of a keep-out zone, "
                    f"and at least {self.safety.avoid_margin_m:g} m are kept"
                )

    def _too_high(self, mission: Mission, walk: "_Walk", height: Floats) -> Iterator[str]:
        rally = [point.altitude_m for point in mission.rally]
        for kind, heights in ((walk.corner, height), (partial(_rally, mission), np.array(rally))):
            if not len(heights):
                continue
            highest = int(heights.argmax())
            if heights[highest] > self.safety.max_altitude_m + HEIGHT_SLACK_M:
                yield (
                    f"{kind(highest)} is {heights[highest]:.1f} m high, above the "
                    f"{self.safety.max_altitude_m:g} m that are allowed (--max-altitude)"
                )

    def _too_far(self, mission: Mission, walk: "_Walk", away: Floats, plane: Plane) -> Iterator[str]:
        most = self.safety.max_distance_m
        rally = [float(np.hypot(*plane.xy_from_lonlat(point.lon, point.lat))) for point in mission.rally]
        for kind, distance in ((walk.corner, away), (partial(_rally, mission), np.array(rally))):
            if most is None or not len(distance):
                continue
            farthest = int(distance.argmax())
            if distance[farthest] > most:
                yield (
                    f"{kind(farthest)} is {distance[farthest]:.0f} m from home, farther than the {most:g} m "
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


def _rally(mission: Mission, k: int) -> str:
    point = mission.rally[k]
    return f"rally point {k + 1} at {point.lat:.6f},{point.lon:.6f}"
