"""Layers of missions (legs with arrows, waypoints, home, fences, zones, rally points) and of paths."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, Self

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from uavseg.arrays import Bools, Floats, Integers, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, PathError
from uavseg.flight.mission.items import LANDINGS, RETURN, TAKEOFFS, WAYPOINT, Fence, FenceCircle
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.inputs import parse_json, read_bytes
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.plain_text import shown
from uavseg.plot.page.page import Frame

FLIGHT_COLORS = ("#c4001a", "#1457c8", "#8a2be2", "#c25700", "#00796b", "#ad1457", "#5d4037", "#37474f")
_HALO_COLOR = "#ffffff"
_FENCE_COLOR, _KEEP_OUT_COLOR = "#1b7f3b", "#b00020"
_CIRCLE_CORNERS = 72
_MAX_NUMBERS = 60
_MIN_ARROW_LEG = 26.0  # points: shorter legs have no arrow
_MIN_NUMBER_DISTANCE = 15.0  # points between two numbers
_LINE_COLOR, _CASING_COLOR = "#ffffff", "#111111"
_START_COLOR, _GOAL_COLOR = "#37b24d", "#f03e3e"
_MISSION_SUFFIXES = (".plan", ".waypoints", ".kmz", ".csv", ".kml")


@dataclass(frozen=True)
class MissionLayer:
    """A mission in plot coordinates: home, each position that is flown to, and home again on a return."""

    path: Floats  # (n, 2)
    numbers: Integers  # (n,): of the waypoints, from 1; 0 for home and takeoff
    is_line: Bools  # (n - 1,): photographs are taken along the leg
    has_shot: Bools  # (n,): a single photograph is taken there
    returns: bool  # the last leg leads home
    mission: Mission
    name: str = ""  # for the legend; empty for a mission that is alone
    color: str = FLIGHT_COLORS[0]

    @classmethod
    def of(cls, mission: Mission, frame: Frame, name: str = "", color: str = FLIGHT_COLORS[0]) -> Self:
        """Place a mission in a picture; parameters as of the class."""
        from uavseg.flight.mission.estimate import flown_path

        lat, lon, _ = mission.path
        numbers, returns = path_numbers(mission)
        legs = flown_path(mission)
        return cls(
            path=frame.plot_from_lonlat(lon, lat),
            numbers=numbers,
            is_line=np.r_[legs.is_line, np.zeros(len(lat), bool)][: len(lat) - 1],
            has_shot=np.r_[legs.has_shot, np.zeros(len(lat), bool)][: len(lat)],
            returns=returns,
            mission=mission,
            name=name,
            color=color,
        )

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the number of items, length, duration and photographs."""
        return mission_title([self])

    def draw(self, ax: Any, point: float) -> None:
        legs = np.stack([self.path[:-1], self.path[1:]], axis=1)
        back = np.arange(len(legs)) == len(legs) - 1 if self.returns else np.zeros(len(legs), bool)
        transit = ~self.is_line & ~back
        flight = self.name or "flight"
        groups: list[tuple[Bools, str, float, Any]] = [
            (self.is_line, f"{flight}, with photographs", 2.0, "solid"),
            (transit, flight, 1.0 if self.is_line.any() else 1.3, "solid"),
            (back, "" if self.name else "return", 1.1, (0, (4, 2.5))),
        ]
        for chosen, label, width, dashes in groups:
            if chosen.any():
                lines, ends = list(legs[chosen]), {"capstyle": "round"} if dashes == "solid" else {}
                halo = LineCollection(lines, color=_HALO_COLOR, lw=width + 1.7, alpha=0.8, zorder=5)
                line = LineCollection(lines, color=self.color, lw=width, ls=dashes, zorder=5.2, **ends)
                line.set_label(label or None)
                ax.add_collection(halo)
                ax.add_collection(line)
        heads = list(arrow_heads(self.path, _MIN_ARROW_LEG * point, 7.0 * point))
        ax.add_collection(PolyCollection(heads, fc=self.color, ec=_HALO_COLOR, lw=0.6, zorder=5.4))
        self._draw_positions(ax, point)

    def _draw_positions(self, ax: Any, point: float) -> None:
        waypoints, home = self.path[self.numbers > 0], self.path[0]
        small = {"s": 9 if len(waypoints) > _MAX_NUMBERS else 16, "edgecolor": self.color, "lw": 1.0}
        label = None if self.name else "waypoint"
        ax.scatter(*waypoints.T, color=_HALO_COLOR, zorder=5.6, label=label, **small)
        shots = self.path[self.has_shot & ~np.r_[self.is_line, False]]
        if len(shots):
            ax.scatter(*shots.T, s=8, color=self.color, zorder=5.7, label="photograph")
        square = {"s": 110, "marker": "s", "color": self.color, "edgecolor": _HALO_COLOR, "lw": 1.2}
        ax.scatter(*self.path[:1].T, zorder=6, label=None if self.name else "home", **square)
        centred = {"ha": "center", "va": "center_baseline"}
        ax.text(*home, "H", color=_HALO_COLOR, size=7, weight="bold", zorder=6.1, **centred)
        halo = [withStroke(linewidth=2.0, foreground=_HALO_COLOR)]
        look = {"size": 6.5, "color": self.color, "weight": "bold", "zorder": 6.2, "clip_on": True}
        for n in choose_numbered(self.path, self.numbers, _MIN_NUMBER_DISTANCE * point):
            ax.text(*(self.path[n] + 4.5 * point), str(self.numbers[n]), **look).set_path_effects(halo)


def path_numbers(mission: Mission) -> tuple[Integers, bool]:
    """Return the number of each position of a path, 0 for home, takeoff and landing; and if it leads home."""
    commands = [item.command for item in mission.items if item.has_position or item.command == RETURN]
    counts = np.array([False] + [one not in {*TAKEOFFS, RETURN, *LANDINGS} for one in commands])
    return np.where(counts, np.cumsum(counts), 0), commands[-1:] == [RETURN]


def mission_layers(missions: Sequence[tuple[str, Mission]], frame: Frame) -> list[MissionLayer]:
    """Place missions with their names, each in another colour."""
    alone = len(missions) == 1
    return [
        MissionLayer.of(mission, frame, "" if alone else name, FLIGHT_COLORS[n % len(FLIGHT_COLORS)])
        for n, (name, mission) in enumerate(missions)
    ]


def read_missions(source: Any) -> list[tuple[str, Mission]]:
    """Read missions with their names: of a mission or a sequence of them, missions or files."""
    from uavseg.flight.formats.files import read_mission

    listed = source if isinstance(source, Sequence) and not isinstance(source, str) else [source]
    # A result of uavseg.plan has its missions in an attribute.
    parts = [one for part in listed for one in getattr(part, "missions", [part])]
    if not parts:
        raise MissionError("there is no mission to draw; give at least one")
    named = []
    for number, part in enumerate(parts, start=1):
        if isinstance(part, str | os.PathLike):
            named.append((Path(part).stem, read_mission(part)))
        elif not isinstance(part, Mission):
            raise MissionError(f"a mission to draw is a file or a Mission, not {shown(part)}")
        else:
            named.append((part.name or f"flight {number}", part))
    return named


def mission_title(layers: Sequence[MissionLayer]) -> list[str]:
    """Return the items, length, duration and photographs of flights together."""
    from uavseg.flight.mission.estimate import estimate_text

    missions = [layer.mission for layer in layers]
    estimates = [mission.estimate for mission in missions]
    items, shots = sum(len(one.items) for one in missions), sum(one.photographs for one in estimates)
    subject = "mission" if len(layers) == 1 else f"{len(layers)} flights"
    metres, seconds = sum(one.distance_m for one in estimates), sum(one.duration_s for one in estimates)
    estimate = estimate_text(metres, seconds)
    photographs = [f"{shots:,} photograph{'s' * (shots != 1)}"] if shots else []
    return [", ".join([f"{subject} of {items} items, {estimate}", *photographs])]


def arrow_heads(path: Floats, min_leg: float, size: float) -> Floats:
    """Compute arrow heads, (n, 3, 2), tip first, amid legs longer than `min_leg`, in plot coordinates."""
    legs = np.diff(path, axis=0)
    lengths = np.hypot(*legs.T)
    long = lengths > min_leg
    along = legs[long] / lengths[long, None]
    across = along[:, ::-1] * (-1, 1)
    middle = (path[:-1] + path[1:])[long] / 2
    tip, tail = middle + 0.6 * size * along, middle - 0.4 * size * along
    return np.stack([tip, tail + 0.4 * size * across, tail - 0.4 * size * across], axis=1)


def choose_numbered(path: Floats, numbers: Integers, min_distance: float) -> list[int]:
    """Choose the positions that get a number: the first, the last, and others at a distance from these.

    The path, (n, 2), and the distance are in plot coordinates; numbers, (n,), are 0 where there is none.

    Examples
    --------
    >>> choose_numbered(np.array([[0, 0], [1, 0], [2, 0], [30, 0]]), np.array([0, 1, 2, 3]), 10.0)
    [1, 3]
    """
    positions = np.flatnonzero(numbers)
    if len(positions) == 0:
        return []
    step = -(-len(positions) // _MAX_NUMBERS)
    order = dict.fromkeys([int(positions[0]), int(positions[-1]), *positions[::step].tolist()])
    chosen: list[int] = []
    for n in order:
        if not chosen or np.hypot(*(path[chosen] - path[n]).T).min() >= min_distance:
            chosen.append(n)
    return sorted(chosen)


@dataclass(frozen=True)
class FenceLayer:
    """The fences of missions in plot coordinates, each shape once."""

    inside: tuple[Floats, ...]  # outlines (n, 2) of inclusions
    keep_out: tuple[Floats, ...]  # of exclusions
    rally: Floats  # (n, 2)

    @classmethod
    def of(cls, missions: Sequence[Mission], frame: Frame) -> "FenceLayer":
        """Place the fences and rally points of missions."""
        shapes = dict.fromkeys(shape for mission in missions for shape in mission.fence)
        points = dict.fromkeys(point for mission in missions for point in mission.rally)
        lon, lat = [point.lon for point in points], [point.lat for point in points]
        return cls(
            tuple(_outlines((shape for shape in shapes if shape.inclusion), frame)),
            tuple(_outlines((shape for shape in shapes if not shape.inclusion), frame)),
            frame.plot_from_lonlat(lon, lat),
        )

    @property
    def points(self) -> Floats:
        """Return all corners and rally points, (n, 2)."""
        return np.concatenate([*self.inside, *self.keep_out, self.rally])

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return nothing: the legend names what is drawn."""
        return []

    def draw(self, ax: Any, point: float) -> None:
        edge: dict[str, Any]
        for ring in self.inside:
            ax.add_patch(Polygon(ring, fill=False, ec=_HALO_COLOR, lw=2.6, alpha=0.7, zorder=4.6))
            edge = {"ec": _FENCE_COLOR, "ls": (0, (7, 3)), "lw": 1.2, "label": "fence"}
            ax.add_patch(Polygon(ring, fill=False, zorder=4.7, **edge))
        for ring in self.keep_out:
            ax.add_patch(Polygon(ring, fc=_KEEP_OUT_COLOR, alpha=0.16, lw=0, zorder=4.6))
            edge = {"ec": _KEEP_OUT_COLOR, "lw": 1.2, "alpha": 0.75, "hatch": "////"}
            ax.add_patch(Polygon(ring, fill=False, zorder=4.7, label="keep-out zone", **edge))
        if len(self.rally):
            look = {"s": 70, "marker": "^", "color": _FENCE_COLOR, "edgecolor": _HALO_COLOR, "lw": 1.0}
            ax.scatter(*self.rally.T, zorder=5.9, label="rally point", **look)


def _outlines(shapes: Iterable[Fence], frame: Frame) -> Iterable[Floats]:
    angles = np.linspace(0, 2 * np.pi, _CIRCLE_CORNERS, endpoint=False)
    for shape in shapes:
        if isinstance(shape, FenceCircle):
            east, north = shape.radius_m * np.sin(angles), shape.radius_m * np.cos(angles)
            lon, lat = Plane(shape.lat, shape.lon).lonlat_from_xy(east, north)
        else:
            lat, lon = np.array(shape.vertices).T
        yield frame.plot_from_lonlat(lon, lat)


@dataclass(frozen=True)
class PathLayer:
    """A path, or the ways to several views, in plot coordinates."""

    lines: tuple[Floats, ...]  # one, or several if it is split at the antimeridian or leads to several views
    length_m: float | None  # None if the file does not contain it
    views: Floats = field(default_factory=lambda: np.empty((0, 2)))  # (n, 2); the best first
    headings: tuple[float, ...] = ()  # of the views, in degrees, counterclockwise from the x axis

    @classmethod
    def of(cls, source: PlannedPath | Path_, frame: Frame) -> "PathLayer":
        """Place a path of `uavseg.path`, a file of `uavseg path`, `next-view` or `explore`, or a mission."""
        if isinstance(source, PlannedPath):
            return cls((frame.plot_from_xy(source.xy),), source.length_m)
        if not isinstance(source, str | os.PathLike):
            raise PathError(f"a path to draw is a file or a path of uavseg.path, not {shown(source)}")
        if Path(source).suffix.lower() in _MISSION_SUFFIXES:
            from uavseg.flight.formats import files

            waypoints = [item for item in files.read_mission(source).items if item.command == WAYPOINT]
            if not waypoints:
                raise PathError(f"{source} has no waypoints, so there is no path to draw")
            lon, lat = [item.lon for item in waypoints], [item.lat for item in waypoints]
            return cls((frame.plot_from_lonlat(lon, lat),), None)
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
        units = {"angles": "xy", "scale_units": "xy", "scale": 1}
        ax.quiver(*self.views.T, *ahead.T, color=_GOAL_COLOR, width=0.004, zorder=4.94, **units)
        ax.scatter(*self.views.T, marker="o", color=_GOAL_COLOR, label="views", **(edge | {"s": 26}))


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
