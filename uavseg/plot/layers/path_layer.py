"""Layer of a path: its line in white, its start and its goal."""

import os
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import PathError
from uavseg.inputs import parse_json, read_bytes
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.plain_text import shown
from uavseg.plot.page.frame import Frame

_LINE_COLOR, _CASING_COLOR = "#ffffff", "#111111"
_START_COLOR, _GOAL_COLOR = "#37b24d", "#f03e3e"
_MISSION_SUFFIXES = (".plan", ".waypoints", ".kmz", ".csv", ".kml")


@dataclass(frozen=True)
class PathLayer:
    """A path, or the ways to several views, in plot coordinates."""

    lines: tuple[Floats, ...]  # one, or several if it is split at the antimeridian or leads to several views
    length_m: float | None  # None if the file does not contain it
    views: Floats = field(default_factory=lambda: np.empty((0, 2)))  # (n, 2); the best first
    headings: tuple[float, ...] = ()  # of the views, in degrees, counterclockwise from the x axis

    @classmethod
    def of(cls, source: "PlannedPath | str | os.PathLike[str]", frame: Frame) -> "PathLayer":
        """Place a path of `uavseg.path`, a file of `uavseg path`, `next-view` or `explore`, or a mission."""
        if isinstance(source, PlannedPath):
            return cls((frame.plot_from_xy(source.xy),), source.length_m)
        if not isinstance(source, str | os.PathLike):
            raise PathError(f"a path to draw is a file or a path of uavseg.path, not {shown(source)}")
        if Path(source).suffix.lower() in _MISSION_SUFFIXES:
            return cls((_read_mission_path(source, frame),), None)
        lines, length, views, headings = _read_geojson(Path(source))
        if frame.geobox.crs is None:
            placed = [frame.plot_from_xy(line) for line in (*lines, views)]
        elif any(np.abs(line).max(initial=0) > 180 for line in (*lines, views)):
            raise PathError(f"{source} has local coordinates, and this raster has a place on Earth")
        else:
            placed = [frame.plot_from_lonlat(*line.T) for line in (*lines, views)]
        return cls(tuple(placed[:-1]), length, placed[-1], headings)

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the length of the path."""
        if len(self.views) and self.length_m is None:
            return [f"{len(self.views)} views"]
        unit = " m" if has_crs else ""
        return ["path" if self.length_m is None else f"path of {self.length_m:,.5g}{unit}"]

    def draw(self, ax: Any, point: float) -> None:
        for line in self.lines:
            ax.plot(*line.T, color=_CASING_COLOR, lw=3.2, alpha=0.8, solid_joinstyle="round", zorder=4.8)
            ax.plot(*line.T, color=_LINE_COLOR, lw=1.6, solid_joinstyle="round", zorder=4.9)
        edge = {"s": 48, "edgecolor": _LINE_COLOR, "lw": 1.1, "zorder": 4.95}
        ax.scatter(*self.lines[0][0], marker="o", color=_START_COLOR, label="start", **edge)
        if not len(self.views):
            ax.scatter(*self.lines[-1][-1], marker="D", color=_GOAL_COLOR, label="goal", **edge)
            return
        angles = np.radians(self.headings)
        ahead = 14 * point * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        ax.quiver(
            *self.views.T,
            *ahead.T,
            color=_GOAL_COLOR,
            angles="xy",
            scale_units="xy",
            scale=1,
            width=0.004,
            zorder=4.94,
        )
        ax.scatter(*self.views.T, marker="o", color=_GOAL_COLOR, label="views", **(edge | {"s": 26}))


def _read_mission_path(source: str | os.PathLike[str], frame: Frame) -> Floats:
    from uavseg.flight.formats import files
    from uavseg.flight.mission.items import WAYPOINT

    waypoints = [item for item in files.read_mission(source).items if item.command == WAYPOINT]
    if not waypoints:
        raise PathError(f"{source} has no waypoints, so there is no path to draw")
    return frame.plot_from_lonlat([item.lon for item in waypoints], [item.lat for item in waypoints])


def _read_geojson(source: Path) -> tuple[list[Floats], float | None, Floats, tuple[float, ...]]:
    """Read the lines of a GeoJSON file, the length of the first, and views with their headings."""
    try:
        features = parse_json(read_bytes(source, PathError).decode())["features"]
        lines, views, headings = [], [], []
        for feature in features:
            shape = feature["geometry"]
            if shape["type"] == "Point":
                views.append(np.array(shape["coordinates"], np.float64).reshape(2))
                headings.append(float(feature["properties"]["heading_deg"]))
                continue
            parts = {"LineString": [shape["coordinates"]], "MultiLineString": shape["coordinates"]}
            lines += [np.array(part, np.float64).reshape(-1, 2) for part in parts[shape["type"]]]
        places = np.array(views, np.float64).reshape(-1, 2)
        finite = all(np.isfinite(numbers).all() for numbers in (*lines, places, np.array(headings)))
        if not (lines and finite and all(len(line) for line in lines)):
            raise ValueError("a line without places")
        length = features[0]["properties"].get("length_m")
        return lines, None if length is None else float(length), places, tuple(headings)
    except PathError as error:
        raise PathError(f"{error}; uavseg path makes such a file") from error
    except (LookupError, ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise PathError(f"{source} holds no line of a path; uavseg path makes such a file") from error
