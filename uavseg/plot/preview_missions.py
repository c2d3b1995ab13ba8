"""Preview of missions without a raster: a map of the flights, and a profile of their heights."""

import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.phases import decided, phase
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.output.atomic import atomic_file
from uavseg.plot.flight_profile import FlightProfile, draw_profiles, flight_profile
from uavseg.plot.layers.mission_layer import FenceLayer, mission_layers, mission_title, read_missions
from uavseg.plot.page.frame import Frame
from uavseg.plot.page.page import (
    View,
    check_png_target,
    check_width,
    draw_furniture,
    draw_legend,
    fit_axes,
    new_figure,
    save_figure,
    write_text,
)
from uavseg.raster.grid.geobox import azimuthal_geobox

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission

File = str | os.PathLike[str]

_WIDTH_IN, _MARGIN_IN = 9.0, 0.15  # the page; text keeps its size on it
_HEAD_IN, _PROFILE_IN, _LEFT_IN, _FOOT_IN = 0.62, 1.7, 0.6, 0.8
_MIN_MAP_IN, _MAX_MAP_IN = 3.2, 8.5
_MIN_SIDE_M = 60.0
_MAX_NAMES = 3  # of flights in the title


def preview_missions(
    missions: "Mission | File | Sequence[Mission | File]",
    out: File,
    *,
    dem: File | Sequence[File] | None = None,
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
    width_px : int
        Width of the picture, 200 to 8000 pixels.
    overwrite : bool
        Whether an existing picture may be replaced.

    Returns
    -------
    out : Path

    Raises
    ------
    OutputError
        If the picture exists, cannot be written there, or does not end in .png.
    MissionError
        If a mission cannot be read, or the elevation model does not cover it.
    ParameterError, RasterError
        If the width is out of bounds, or the elevation model is not one.
    """
    check_width(width_px)
    target = check_png_target(out, overwrite)
    keep_inputs([target], [missions, dem])
    named = read_missions(missions)
    for note in dict.fromkeys(note for _, mission in named for note in mission.notes):
        warnings.warn(note, stacklevel=2)
    ground = None
    if dem is not None:
        from uavseg.raster.elevation.dem import Dem

        ground = Dem.open(dem)
    decided("missions: %d, with %s", len(named), "no ground" if ground is None else ground.name)

    with phase("profiles"):
        profiles = [flight_profile(mission, ground) for _, mission in named]
    with phase("picture"):
        figure = _figure(named, profiles, width_px / _WIDTH_IN, None if ground is None else ground.name)
        with atomic_file(target, overwrite) as temporary:
            save_figure(figure, temporary)
    return target


def _figure(
    named: Sequence[tuple[str, "Mission"]],
    profiles: Sequence[FlightProfile],
    dpi: float,
    dem_name: str | None,
) -> Any:
    missions = [mission for _, mission in named]
    frame = _frame(missions)
    layers, fence = mission_layers(named, frame), FenceLayer.of(missions, frame)
    view = _view(np.concatenate([*(layer.path for layer in layers), fence.points]))
    left, right, bottom, top = view
    width = _WIDTH_IN - 2 * _MARGIN_IN
    height = min(max(width * (top - bottom) / (right - left), _MIN_MAP_IN), _MAX_MAP_IN)
    below = _PROFILE_IN + _FOOT_IN
    page = height + _HEAD_IN + below
    figure = new_figure(_WIDTH_IN, page, dpi)
    ax = figure.add_axes((_MARGIN_IN / _WIDTH_IN, below / page, width / _WIDTH_IN, height / page))
    ax.set_facecolor("#f7f6f2")
    point = fit_axes(ax, view, width, height)
    fence.draw(ax, point)
    for layer in layers:
        layer.draw(ax, point)
    draw_furniture(ax, frame, point)
    draw_legend(ax)
    box = (_LEFT_IN, _FOOT_IN - 0.15, _WIDTH_IN - _LEFT_IN - _MARGIN_IN, _PROFILE_IN - 0.05)
    profile = figure.add_axes((box[0] / _WIDTH_IN, box[1] / page, box[2] / _WIDTH_IN, box[3] / page))
    draw_profiles(profile, profiles, [layer.color for layer in layers])
    names = [name for name, _ in named]
    others = f" and {len(names) - _MAX_NAMES} more" if len(names) > _MAX_NAMES else ""
    title, subtitle = ", ".join(names[:_MAX_NAMES]) + others, " · ".join(mission_title(layers))
    caption = _caption(missions, profiles, dem_name)
    write_text(figure, _MARGIN_IN / _WIDTH_IN, title, subtitle, caption, 0.08)
    return figure


def _frame(missions: Sequence["Mission"]) -> Frame:
    """Return plot coordinates around the homes and positions of missions, north up."""
    from uavseg.flight.mission.plane import plane_around

    lat, lon = (np.concatenate([mission.path[k] for mission in missions]) for k in (0, 1))
    plane, side = plane_around(np.column_stack([lon, lat, lon, lat]), float(lon[0])), _MIN_SIDE_M
    return Frame(azimuthal_geobox(plane.lat, plane.lon, (-side, -side, side, side)))


def _view(points: NDArray[np.float64]) -> View:
    """Return the view of all points with a margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, _MIN_SIDE_M / 2)
    half = half + 0.06 * half.max()
    (left, bottom), (right, top) = (middle - half).tolist(), (middle + half).tolist()
    return left, right, bottom, top


def _caption(missions: Sequence["Mission"], profiles: Sequence[FlightProfile], dem_name: str | None) -> str:
    home = missions[0].home
    parts = [f"home {home.lat:.6f},{home.lon:.6f}, {home.altitude_m:g} m above the sea"]
    pilots = dict.fromkeys(mission.autopilot for mission in missions)
    parts.append("for " + " and ".join("any autopilot" if one == "generic" else one for one in pilots))
    if dem_name is not None:
        lowest = min(profile.lowest_m for profile in profiles)
        parts.append(f"ground: {dem_name}, at least {lowest:.0f} m below the flight")
    return " · ".join(parts)
