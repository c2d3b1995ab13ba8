"""Heights of waypoints along a path, the points that were added for them, and the speed of each leg."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.items import FRAME_RELATIVE
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.leg_speeds import speeds_of

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Heights:
    """Heights and speeds of n waypoints.

    Parameters
    ----------
    frame : int
        MAV_FRAME: 0 above the sea, 3 above home, 10 above the terrain.
    height_m : (n,) float64 array
        In metres, above what `frame` says.
    takeoff_m : float
        Height above home to which the vehicle climbs first.
    added : (n,) bool array
        Whether a waypoint lies on a leg, for its height alone: photographs go on there.
    speed_m_s : (n,) float64 array
        On the leg to each waypoint.
    """

    frame: int
    height_m: Floats
    takeoff_m: float
    added: NDArray[np.bool_]
    speed_m_s: Floats


def constant_height(track: Track, params: PlanParams, frame: int = FRAME_RELATIVE) -> Heights:
    """One height for the waypoints of a track."""
    count, height = len(track.xy), float(params.altitude_m)
    none = np.zeros(count, np.bool_)
    return Heights(frame, np.full(count, height), height, none, speeds_of(track, params))
