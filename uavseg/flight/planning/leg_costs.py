"""What each leg of a route takes, before it is divided: time, and items besides those of its corners."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.flown import landing_seconds
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.track import Track
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.flown import LegPoints, points_of_leg
from uavseg.flight.terrain.leg_speeds import fewest_changes

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class LegCosts:
    """Time and items of legs, by the functions that make the items of flights.

    The ground of each leg is looked at by itself, and once.

    Parameters
    ----------
    plane : Plane
    params : PlanParams
    """

    plane: Plane
    params: PlanParams
    _known: dict[tuple[float, ...], LegPoints] = field(default_factory=dict)

    def level_seconds(self, xy: Floats) -> Floats:
        """Time of each leg of a path (n, 2) in metres over level ground."""
        params = self.params
        vehicle = params.vehicle or default_vehicle(params.autopilot)
        height = np.full(len(xy), params.altitude_m)
        return leg_seconds(np.column_stack([xy, height]), params.speed_m_s, vehicle)

    def return_seconds(self, length_m: float) -> float:
        """What a return over level ground takes at least: its own speed and height, and its landing."""
        params = self.params
        vehicle = params.vehicle or default_vehicle(params.autopilot)
        height = params.altitude_m
        above = max(min(vehicle.return_height_m, vehicle.return_slope * length_m), height)
        path = np.array([(0.0, 0.0, height), (0.0, 0.0, above), (length_m, 0.0, above)])
        landing_s = landing_seconds(above, vehicle) - landing_seconds(height, vehicle)
        return float(leg_seconds(path, vehicle.return_speed_m_s, vehicle).sum()) + landing_s

    def of(self, track: Track) -> tuple[Floats, Floats]:
        """Time of each leg, with the hold at its end, and its items: changes of speed, points that are added.

        Returns
        -------
        seconds, items : (n - 1,) float64 arrays
        """
        params, legs = self.params, len(track.is_line)
        if not legs:
            return np.zeros(0), np.zeros(0)
        vehicle = params.vehicle or default_vehicle(params.autopilot)
        points = self._points(track, fewest_changes(track, params))
        counts = np.array([len(leg.share) for leg in points])
        first = np.concatenate([[0], np.cumsum(counts[:-1])])
        of_leg = np.repeat(np.arange(legs), counts)
        share = np.concatenate([leg.share for leg in points])
        xy = track.xy[of_leg] + share[:, None] * (track.xy[of_leg + 1] - track.xy[of_leg])
        height = np.concatenate([points[0].height_m[:1], *(leg.height_m[1:] for leg in points)])
        path = np.column_stack([np.concatenate([track.xy[:1], xy]), height])
        speed = np.concatenate([leg.speed_m_s for leg in points])
        hold = np.zeros(len(path))
        hold[np.append(0, first + counts)] = track.hold_s
        seconds = np.add.reduceat(leg_seconds(path, speed, vehicle, hold > 0, hold) + hold[1:], first)
        change = np.diff(speed, prepend=speed[0])
        slower = (change < 0) & np.isin(np.arange(len(speed)), first)  # with a point before the line
        items = np.add.reduceat((change != 0) + slower.astype(float), first) + counts - 1
        return seconds, items

    def _points(self, track: Track, speeds: Floats) -> list[LegPoints]:
        params, terrain = self.params, self.params.terrain
        if terrain is None or terrain.dem is None:
            end, height = np.ones(1), np.full(2, params.altitude_m)
            return [LegPoints(end, height, np.array([speed])) for speed in speeds.tolist()]
        lon, lat = self.plane.lonlat_from_xy(*track.xy.T)
        places = np.column_stack([lon[:-1], lat[:-1], lon[1:], lat[1:], speeds])
        keys = [tuple(place) for place in places.tolist()]
        for key in keys:
            if key not in self._known:
                self._known[key] = points_of_leg(terrain.dem, key, params)
        return [self._known[key] for key in keys]
