"""Preview of missions without a raster: a map of the flights, and a profile of their heights."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection

from uavseg.arrays import Bools, Floats, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.execution.executors import decided, phase
from uavseg.flight.mission.estimate import flown_path
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_TERRAIN, TAKEOFFS
from uavseg.flight.mission.mission import Ground, Mission
from uavseg.flight.mission.track import Plane, plane_around
from uavseg.flight.terrain.altitude_profile import known_heights_m, profile_along
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.plain_text import first_of
from uavseg.plot.layers.mission_layer import FenceLayer, mission_layers, mission_title, read_missions
from uavseg.plot.page import page
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.grid.geobox import azimuthal_geobox

GAP_M = 1.0  # between the bounds of the ground that is drawn
_GROUND_COLOR, _GROUND_EDGE = "#d8cbb5", "#7a6648"
_SPACE = 0.04  # between two flights, as a share of all


@dataclass(frozen=True, slots=True, eq=False)
class FlightProfile:
    """Heights of a flight along its path, in metres above `zero`, with the return and the landing."""

    along_m: Floats  # (n,): distance from home over ground
    height_m: Floats  # (n,)
    is_line: Bools  # (n - 1,): photographs are taken on the leg
    ground_along_m: Floats  # (k,): empty where the ground is not known
    ground_m: Floats  # (k,)
    lowest_m: float  # minimum height above the ground between takeoff and landing, or NaN
    zero: str  # "home", "the sea" or "the ellipsoid"


def flight_profile(mission: Mission, dem: Dem | None = None) -> FlightProfile:
    """Compute the heights of a mission, from takeoff to where it ends.

    With a DEM they are above its zero. Without it they are above home, and heights above the terrain count as
    above home.
    """
    known = mission
    if dem is not None:  # with the ground at home and at the items
        items = [item for item in mission.items if item.has_position and not item.is_at_vehicle]
        places = [(mission.home.lat, mission.home.lon), *((item.lat, item.lon) for item in items)]
        lat, lon = np.array(places).T
        above_zero = dict(zip(places, known_heights_m(dem, lon, lat).tolist(), strict=True))
        known = replace(mission, ground=Ground(above_zero, np.nan, np.nan))
    path = flown_path(known)
    along, height = np.r_[0.0, np.cumsum(path.length_m)], path.xyz_m[:, 2]
    is_line, ground_along, below, lowest, zero = path.is_line, np.empty(0), np.empty(0), np.nan, "home"
    if dem is not None:
        lon, lat = Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(*path.xyz_m[:, :2].T)
        ground = profile_along(dem, lon, lat, GAP_M)
        ground_along, below, corners = ground.along_m, ground.upper_m, ground.corners
        home_m = float(below[0])
        if FRAME_AMSL in _frames(mission):
            if not dem.is_above_sea:
                raise MissionError(
                    f"the mission has heights above the sea, and {dem.name} above the ellipsoid, which PROJ "
                    "cannot convert on this machine: give a model with heights above the sea"
                )
            home_m = mission.home.altitude_m
        height = height + home_m
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
    ground_words = {"ground_along_m": ground_along, "ground_m": below}
    return FlightProfile(along, height, is_line, **ground_words, lowest_m=lowest, zero=zero)


def _frames(mission: Mission) -> set[int]:
    """Return the frames of the positions that are flown to, except for the takeoff."""
    return {item.frame for item in mission.items if item.has_position and item.command not in TAKEOFFS}


def draw_profiles(ax: Any, profiles: Sequence[FlightProfile], colors: Sequence[str]) -> None:
    """Draw the heights of flights, one after another along the path, and the ground below."""
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
    ax.set_xlabel(label, size=7.5, color=page.TEXT_COLOR)
    zeros = dict.fromkeys(profile.zero for profile in profiles)
    ax.set_ylabel(f"m above {' or '.join(zeros)}", size=7.5, color=page.TEXT_COLOR)
    ax.tick_params(labelsize=7, colors=page.TEXT_COLOR)
    ax.grid(axis="y", color="#dddddd", lw=0.5, zorder=0)
    page.draw_spines(ax)


Named = Sequence[tuple[str, Mission]]

_WIDTH_IN, _MARGIN_IN = 9.0, 0.15  # the page; text keeps its size on it
_HEAD_IN, _PROFILE_IN, _LEFT_IN, _FOOT_IN = 0.62, 1.7, 0.6, 0.8
_MIN_MAP_IN, _MAX_MAP_IN = 3.2, 8.5
_MIN_SIDE_M = 60.0
_MAX_NAMES = 3  # of flights in the title


def preview_missions(
    missions: Mission | Path_ | Sequence[Mission | Path_],
    out: Path_,
    *,
    dem: Path_ | Sequence[Path_] | None = None,
    width_px: int = 1400,
    overwrite: bool = False,
) -> Path:
    """Draw missions on a blank map, with a profile of their heights below, and write the picture as PNG.

    Legs are drawn in their order with arrows, lines with photographs wider; home, the return, the fence,
    keep-out zones and rally points too. Several missions have different colours.

    Parameters
    ----------
    missions : Mission, path or sequence of these
        A result of `uavseg.plan`, or mission files in any format that is read.
    out : path
        The picture, .png.
    dem : path or sequence of paths, optional
        Elevation model: the ground is drawn below the flights, and heights are above its zero.
    width_px, overwrite
        As `width` and `overwrite` of `uavseg.preview`.

    Raises
    ------
    OutputError
        If the picture exists, cannot be written there, or does not end in .png.
    MissionError
        If a mission cannot be read, or the elevation model does not cover it.
    ParameterError, RasterError
        If the width is out of bounds, or the elevation model is not one.
    """
    page.check_width(width_px)
    target = page.check_png_target(out, overwrite)
    keep_inputs([target], [missions, dem])
    named = read_missions(missions)
    for note in dict.fromkeys(note for _, mission in named for note in mission.notes):
        warnings.warn(note, stacklevel=2)
    ground = None if dem is None else Dem.open(dem)
    decided("missions: %d, with %s", len(named), "no ground" if ground is None else ground.name)

    with phase("profiles"):
        profiles = [flight_profile(mission, ground) for _, mission in named]
    with phase("picture"):
        figure = _figure(named, profiles, width_px / _WIDTH_IN, None if ground is None else ground.name)
        page.save_figure(figure, target, overwrite)
    return target


def _figure(named: Named, profiles: Sequence[FlightProfile], dpi: float, dem_name: str | None) -> Any:
    missions = [mission for _, mission in named]
    frame = _frame(missions)
    layers, fence = mission_layers(named, frame), FenceLayer.of(missions, frame)
    view = _view(np.concatenate([*(layer.path for layer in layers), fence.points]))
    left, right, bottom, top = view
    width = _WIDTH_IN - 2 * _MARGIN_IN
    height = min(max(width * (top - bottom) / (right - left), _MIN_MAP_IN), _MAX_MAP_IN)
    below = _PROFILE_IN + _FOOT_IN
    page_in = height + _HEAD_IN + below
    figure = page.new_figure(_WIDTH_IN, page_in, dpi)
    ax = figure.add_axes((_MARGIN_IN / _WIDTH_IN, below / page_in, width / _WIDTH_IN, height / page_in))
    ax.set_facecolor("#f7f6f2")
    point = page.fit_axes(ax, view, width, height)
    fence.draw(ax, point)
    for layer in layers:
        layer.draw(ax, point)
    page.draw_furniture(ax, frame, point)
    page.draw_legend(ax)
    box = (_LEFT_IN, _FOOT_IN - 0.15, _WIDTH_IN - _LEFT_IN - _MARGIN_IN, _PROFILE_IN - 0.05)
    profile = figure.add_axes((box[0] / _WIDTH_IN, box[1] / page_in, box[2] / _WIDTH_IN, box[3] / page_in))
    draw_profiles(profile, profiles, [layer.color for layer in layers])
    title, subtitle = first_of([name for name, _ in named], _MAX_NAMES), " · ".join(mission_title(layers))
    caption = _caption(missions, profiles, dem_name)
    page.write_text(figure, _MARGIN_IN / _WIDTH_IN, title, subtitle, caption, 0.08)
    return figure


def _frame(missions: Sequence[Mission]) -> page.Frame:
    """Return plot coordinates around the homes and positions of missions, north up."""
    lat, lon = (np.concatenate([mission.path[k] for mission in missions]) for k in (0, 1))
    plane, side = plane_around(np.column_stack([lon, lat, lon, lat]), float(lon[0])), _MIN_SIDE_M
    return page.Frame(azimuthal_geobox(plane.lat, plane.lon, (-side, -side, side, side)))


def _view(points: Floats) -> page.View:
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, _MIN_SIDE_M / 2)
    half = half + 0.06 * half.max()
    (left, bottom), (right, top) = (middle - half).tolist(), (middle + half).tolist()
    return left, right, bottom, top


def _caption(missions: Sequence[Mission], profiles: Sequence[FlightProfile], dem_name: str | None) -> str:
    home = missions[0].home
    parts = [f"home {home.lat:.6f},{home.lon:.6f}, {home.altitude_m:g} m above the sea"]
    pilots = dict.fromkeys(mission.autopilot for mission in missions)
    parts.append("for " + " and ".join("any autopilot" if one == "generic" else one for one in pilots))
    if dem_name is not None:
        lowest = min(profile.lowest_m for profile in profiles)
        parts.append(f"ground: {dem_name}, at least {lowest:.0f} m below the flight")
    return " · ".join(parts)
