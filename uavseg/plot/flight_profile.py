"""Profile of a flight: its heights along the path, and the ground below where it is known."""

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
from uavseg.plot.page.page import TEXT_COLOR, draw_spines

if TYPE_CHECKING:
    from uavseg.raster.elevation.dem import Dem

GAP_M = 1.0  # between the bounds of the ground that is drawn
_GROUND_COLOR, _GROUND_EDGE = "#d8cbb5", "#7a6648"
_SPACE = 0.04  # between two flights, as a share of all

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FlightProfile:
    """Heights of a flight along its path, in metres above `zero`, with the return and the landing."""

    along_m: Floats  # (n,): distance from home over ground
    height_m: Floats  # (n,)
    is_line: NDArray[np.bool_]  # (n - 1,): photographs are taken on the leg
    ground_along_m: Floats  # (k,): empty where the ground is not known
    ground_m: Floats  # (k,)
    lowest_m: float  # minimum height above the ground between takeoff and landing, or NaN
    zero: str  # "home", "the sea" or "the ellipsoid"


def flight_profile(mission: Mission, dem: "Dem | None" = None) -> FlightProfile:
    """Compute the heights of a mission, from takeoff to where it ends.

    Parameters
    ----------
    mission : Mission
    dem : Dem, optional
        The ground. With it heights are above its zero. Without it they are above home, and heights above the
        terrain count as above home.
    """
    known = mission if dem is None else replace(mission, ground=_ground(mission, dem))
    path = flown_path(known, mission.vehicle or default_vehicle(mission.autopilot))
    along, height = np.r_[0.0, np.cumsum(path.length_m)], path.xyz_m[:, 2]
    is_line, ground_along, below, lowest, zero = path.is_line, np.empty(0), np.empty(0), np.nan, "home"
    if dem is not None:
        lon, lat = Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(*path.xyz_m[:, :2].T)
        ground = profile_along(dem, lon, lat, GAP_M)
        ground_along, below, corners = ground.along_m, ground.upper_m, ground.corners
        height = height + _zero_m(mission, dem, float(below[0]))
        if _frames(mission) == {FRAME_TERRAIN}:  # the vehicle follows the ground between waypoints too
            above = np.interp(ground_along, ground_along[corners], height - below[corners])
            line, leg = below + above, np.searchsorted(corners, np.arange(1, len(below)), side="left") - 1
            line[0], along, height, is_line = height[0], ground_along, line, is_line[leg]
        else:
            line = np.interp(ground_along, ground_along[corners], height)
        lowest = float((line - below)[corners[1] :].min())
        zero = "the sea" if dem.is_above_sea else "the ellipsoid"
    if path.landing_s:  # the descent to the ground
        ground_m = float(below[-1]) if len(below) else 0.0
        along, height = np.append(along, along[-1]), np.append(height, ground_m)
        is_line = np.append(is_line, False)
    return FlightProfile(
        along_m=along,
        height_m=height,
        is_line=is_line,
        ground_along_m=ground_along,
        ground_m=below,
        lowest_m=lowest,
        zero=zero,
    )


def _ground(mission: Mission, dem: "Dem") -> Ground:
    """Read the ground at home and at the items of a mission."""
    places = [(mission.home.lat, mission.home.lon)]
    places += [(item.lat, item.lon) for item in mission.items if item.has_position and not item.is_at_vehicle]
    lat, lon = np.array(places).T
    height = dem.heights_m(lon, lat)
    check_known(dem, lon, lat, height)
    return Ground(dict(zip(places, height.tolist(), strict=True)), np.nan, np.nan)


def _frames(mission: Mission) -> set[int]:
    """Return the frames of the positions that are flown to, except for the takeoff."""
    return {item.frame for item in mission.items if item.has_position and item.command not in TAKEOFFS}


def _zero_m(mission: Mission, dem: "Dem", ground_m: float) -> float:
    """Return the height of home above the zero of a DEM, as the heights of the mission have it."""
    if FRAME_AMSL not in _frames(mission):
        return ground_m
    if not dem.is_above_sea:
        raise MissionError(
            f"the mission has heights above the sea, and {dem.name} above the ellipsoid, which PROJ cannot "
            "convert on this machine: give a model with heights above the sea"
        )
    return mission.home.altitude_m


def draw_profiles(ax: Any, profiles: Sequence[FlightProfile], colors: Sequence[str]) -> None:
    """Draw the heights of flights, one after another along the path, and the ground below.

    Parameters
    ----------
    ax : matplotlib Axes
    profiles : sequence of FlightProfile
    colors : sequence of str
        Of the flights.
    """
    from matplotlib.collections import LineCollection

    total = sum(float(profile.along_m[-1]) for profile in profiles)
    start, low, high = 0.0, np.inf, -np.inf
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
        low, high = min(low, heights.min()), max(high, heights.max())
        start += float(profile.along_m[-1]) + _SPACE * total
    end, room = max(start - _SPACE * total, 1.0) / 1000, 0.12 * max(high - low, 1.0)
    ax.set(xlim=(-0.01 * end, 1.01 * end), ylim=(low - room / 2, high + room), autoscale_on=False)
    label = "km flown" if len(profiles) == 1 else "km flown, one flight after another"
    ax.set_xlabel(label, size=7.5, color=TEXT_COLOR)
    zeros = dict.fromkeys(profile.zero for profile in profiles)
    ax.set_ylabel(f"m above {' or '.join(zeros)}", size=7.5, color=TEXT_COLOR)
    ax.tick_params(labelsize=7, colors=TEXT_COLOR)
    ax.grid(axis="y", color="#dddddd", lw=0.5, zorder=0)
    draw_spines(ax)
