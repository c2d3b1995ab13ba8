"""Profile of a flight: its heights along the way, and the ground below where it is known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.flown import flown_path
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_TERRAIN, TAKEOFFS
from uavseg.flight.mission.mission import Ground, Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.terrain.profile import check_known, profile_along
from uavseg.plot.page.map_furniture import TEXT_COLOR

if TYPE_CHECKING:
    from uavseg.raster.elevation.dem import Dem

GAP_M = 1.0  # between the bounds of the ground that is drawn
_GROUND_COLOR, _GROUND_EDGE = "#d8cbb5", "#7a6648"
_SPACE = 0.04  # between two flights, as a share of all

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FlightProfile:
    """Heights of a flight along its way.

    Parameters
    ----------
    along_m, height_m : (n,) float64 arrays
        Distance from home over ground, and metres above `zero`, with the return and the landing.
    is_line : (n - 1,) bool array
        Whether photographs are taken on a leg.
    ground_along_m, ground_m : (k,) float64 arrays
        The ground below; empty where it is not known.
    lowest_m : float
        Least height above the ground between takeoff and landing; NaN where the ground is not known.
    zero : str
        "home", "the sea" or "the ellipsoid".
    """

    along_m: Floats
    height_m: Floats
    is_line: NDArray[np.bool_]
    ground_along_m: Floats
    ground_m: Floats
    lowest_m: float
    zero: str


def flight_profile(mission: Mission, dem: "Dem | None" = None) -> FlightProfile:
    """The heights of a mission, from takeoff to where it ends.

    Parameters
    ----------
    mission : Mission
    dem : Dem, optional
        The ground. With it heights are above its zero. Without it they are above home, and heights above the
        terrain count as above home.

    Raises
    ------
    MissionError
        If the DEM does not cover the flight, or its heights cannot be compared with those of the mission.
    """
    known = mission if dem is None else replace(mission, ground=_ground(mission, dem))
    path = flown_path(known, mission.vehicle or default_vehicle(mission.autopilot))
    along, height = np.r_[0.0, np.cumsum(path.length_m)], path.xyz_m[:, 2]
    if dem is None:
        nothing, flown = np.empty(0), _landed(along, height, path.is_line, 0.0 if path.landing_s else None)
        return FlightProfile(*flown, nothing, nothing, np.nan, "home")
    lon, lat = Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(*path.xyz_m[:, :2].T)
    ground = profile_along(dem, lon, lat, GAP_M)
    below, corners = ground.upper_m, ground.corners
    height = height + _zero_m(mission, dem, float(below[0]))
    is_line = path.is_line
    if _frames(mission) == {FRAME_TERRAIN}:  # the vehicle follows the ground between waypoints too
        above = np.interp(ground.along_m, ground.along_m[corners], height - below[corners])
        line, leg = below + above, np.searchsorted(corners, np.arange(1, len(below)), side="left") - 1
        line[0], along, height, is_line = height[0], ground.along_m, line, is_line[leg]
    else:
        line = np.interp(ground.along_m, ground.along_m[corners], height)
    lowest = float((line - below)[corners[1] :].min())
    zero = "the sea" if dem.is_above_sea else "the ellipsoid"
    flown = _landed(along, height, is_line, float(below[-1]) if path.landing_s else None)
    return FlightProfile(*flown, ground.along_m, below, lowest, zero)


def _ground(mission: Mission, dem: "Dem") -> Ground:
    """The ground at home and at the items of a mission."""
    places = [(mission.home.lat, mission.home.lon)]
    places += [(item.lat, item.lon) for item in mission.items if item.has_position and not item.is_at_vehicle]
    lat, lon = np.array(places).T
    height = dem.heights_m(lon, lat)
    check_known(dem, lon, lat, height)
    return Ground(dict(zip(places, height.tolist(), strict=True)), np.nan, np.nan)


def _frames(mission: Mission) -> set[int]:
    """Frames of the places that are flown to, takeoff aside."""
    return {item.frame for item in mission.items if item.has_position and item.command not in TAKEOFFS}


def _zero_m(mission: Mission, dem: "Dem", ground_m: float) -> float:
    """Height of home above the zero of a DEM, as the heights of the mission have it."""
    if FRAME_AMSL not in _frames(mission):
        return ground_m
    if not dem.is_above_sea:
        raise MissionError(
            f"the mission has heights above the sea, and {dem.name} above the ellipsoid, which PROJ cannot "
            "convert on this machine: give a model with heights above the sea"
        )
    return mission.home.altitude_m


def _landed(
    along: Floats, height: Floats, is_line: NDArray[np.bool_], ground_m: float | None
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """A flight with the descent to the ground at its end; None where it ends in the air."""
    if ground_m is None:
        return along, height, is_line
    return np.append(along, along[-1]), np.append(height, ground_m), np.append(is_line, False)


def draw_profiles(ax: Any, profiles: Sequence[FlightProfile], colors: Sequence[str]) -> None:
    """Draw the heights of flights, one after another along the way, and the ground below.

    Parameters
    ----------
    ax : matplotlib Axes
    profiles : sequence of FlightProfile
    colors : sequence of str
        Of the flights.
    """
    from matplotlib.collections import LineCollection

    total = sum(float(profile.along_m[-1]) for profile in profiles)
    start, low, high = 0.0, 0.0, 0.0
    for profile, color in zip(profiles, colors, strict=True):
        x = (start + profile.along_m) / 1000
        points = np.column_stack([x, profile.height_m])
        legs = np.stack([points[:-1], points[1:]], axis=1)
        for chosen, width in ((~profile.is_line, 1.0), (profile.is_line, 2.2)):
            ax.add_collection(LineCollection(list(legs[chosen]), color=color, lw=width, zorder=3))
        known = [profile.height_m]
        if len(profile.ground_m):
            ground_x = (start + profile.ground_along_m) / 1000
            known.append(profile.ground_m)
            ax.plot(ground_x, profile.ground_m, color=_GROUND_EDGE, lw=0.8, zorder=2)
            ax.fill_between(ground_x, profile.ground_m, -1e5, color=_GROUND_COLOR, lw=0, zorder=1)
        heights = np.concatenate(known)
        low, high = (
            (heights.min(), heights.max())
            if not start
            else (min(low, heights.min()), max(high, heights.max()))
        )
        start += float(profile.along_m[-1]) + _SPACE * total
    end, room = max(start - _SPACE * total, 1.0) / 1000, 0.12 * max(high - low, 1.0)
    ax.set(xlim=(-0.01 * end, 1.01 * end), ylim=(low - room / 2, high + room), autoscale_on=False)
    ax.set_xlabel(
        "km flown" if len(profiles) == 1 else "km flown, one flight after another", size=7.5, color=TEXT_COLOR
    )
    zeros = dict.fromkeys(profile.zero for profile in profiles)
    ax.set_ylabel(f"m above {' or '.join(zeros)}", size=7.5, color=TEXT_COLOR)
    ax.tick_params(labelsize=7, colors=TEXT_COLOR)
    ax.grid(axis="y", color="#dddddd", lw=0.5, zorder=0)
    for side in ax.spines.values():
        side.set(color="#bbbbbb", lw=0.6)
