"""Safety check of a mission: every leg against zones, fence, height and distance from home."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.safety.fence import fence_problems
from uavseg.flight.terrain.clearance import Clearance

Name = Callable[[int], str]  # of the part of a mission with this number

SLACK_M = 0.05  # for the decimals of a file and the local plane
HEIGHT_SLACK_M = 0.5


@dataclass(frozen=True, eq=False)
class SafetyCheck:
    """Requirements that a mission is checked against."""

    safety: SafetyParams = SafetyParams()
    zones: Sequence[Any] = ()  # keep-out zones, shapely in degrees (lon, lat; WGS 84)
    clearance: Clearance | None = None  # above the ground; without it, heights above home are checked

    def check(self, mission: Mission) -> None:
        """Raise MissionError with the first of the `problems` of a mission."""
        for problem in self.problems(mission):
            raise MissionError(problem)

    def problems(self, mission: Mission) -> Iterator[str]:
        """Yield why a mission must not be flown, one sentence each.

        A leg or rally point comes too near to a zone or to the ground, lies outside of the fence, is too
        high, or too far from home.
        """
        plane = Plane(mission.home.lat, mission.home.lon)
        lat, lon, height = mission.path
        xy = np.column_stack(plane.xy_from_lonlat(lon, lat))
        rally = mission.rally
        rally_xy = [plane.xy_from_lonlat(point.lon, point.lat) for point in rally]

        def corner_name(k: int) -> str:
            return f"the position {lat[k]:.6f},{lon[k]:.6f}"

        def leg_name(k: int) -> str:
            return f"the leg from {lat[k]:.6f},{lon[k]:.6f} to {lat[k + 1]:.6f},{lon[k + 1]:.6f}"

        def rally_name(k: int) -> str:
            return f"rally point {k + 1} at {rally[k].lat:.6f},{rally[k].lon:.6f}"

        if len(self.zones):
            zones = shapely.STRtree(shapely.make_valid(plane.project_polygons(self.zones)))
            legs = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
            yield from self._near_zones(zones, legs, leg_name)
            yield from self._near_zones(zones, [shapely.Point(place) for place in rally_xy], rally_name)
        yield from fence_problems(mission)
        highest_m = self.safety.max_altitude_m
        if self.clearance is not None:
            yield from self.clearance.problems(mission, highest_m + HEIGHT_SLACK_M)
        else:
            rally_m = [point.altitude_m for point in rally]
            for heights, name in ((height, corner_name), (rally_m, rally_name)):
                for place, height_m in _greatest_above(heights, highest_m + HEIGHT_SLACK_M, name):
                    yield (
                        f"{place} is {height_m:.1f} m high, above the {highest_m:g} m that are allowed "
                        "(--max-altitude)"
                    )
        farthest_m = self.safety.max_distance_m
        if farthest_m is None:
            return
        rally_away = [float(np.hypot(*place)) for place in rally_xy]
        for distances, name in ((np.hypot(*xy.T), corner_name), (rally_away, rally_name)):
            for place, distance_m in _greatest_above(distances, farthest_m, name):
                yield (
                    f"{place} is {distance_m:.0f} m from home, farther than the {farthest_m:g} m that are "
                    "allowed (--max-distance)"
                )

    def _near_zones(self, zones: shapely.STRtree, shapes: Sequence[Any], name: Name) -> Iterator[str]:
        if not len(shapes):
            return
        _, distance = zones.query_nearest(shapes, return_distance=True, all_matches=False)
        nearest, margin_m = int(distance.argmin()), self.safety.avoid_margin_m
        if distance[nearest] < margin_m - SLACK_M or distance[nearest] == 0:
            yield (
                f"{name(nearest)} comes within {distance[nearest]:.1f} m of a keep-out zone, "
                f"and at least {margin_m:g} m are kept"
            )


def _greatest_above(
    values: Sequence[float] | NDArray[np.float64], limit: float, name: Name
) -> Iterator[tuple[str, float]]:
    """Yield the name and value of the greatest value, if it is above a limit."""
    if len(values) and values[k := int(np.argmax(values))] > limit:
        yield name(k), float(values[k])
