"""Layer of a mission: home, legs with arrows, lines with photographs, numbered waypoints."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.plain_text import shown
from uavseg.plot.page.frame import Frame

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission

FLIGHT_COLORS = ("#c4001a", "#1457c8", "#8a2be2", "#c25700", "#00796b", "#ad1457", "#5d4037", "#37474f")
_HALO_COLOR = "#ffffff"
_MAX_NUMBERS = 60
_MIN_ARROW_LEG = 26.0  # points: shorter legs have no arrow
_MIN_NUMBER_DISTANCE = 15.0  # points between two numbers

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MissionLayer:
    """A mission in plot coordinates.

    Parameters
    ----------
    path : (n, 2) float64 array
        Home, then each position that is flown to; home again at the end if the mission returns.
    numbers : (n,) int64 array
        Number of each position among the waypoints, from 1; 0 for home and takeoff.
    is_line : (n - 1,) bool array
        Whether photographs are taken along a leg.
    has_shot : (n,) bool array
        Whether a single photograph is taken at a position.
    returns : bool
        Whether the last leg leads home.
    distance_m, duration_s : float
    items, photographs : int
    name : str
        What the legend calls it, beside others; empty if it is alone.
    color : str
    """

    path: Floats
    numbers: NDArray[np.int64]
    is_line: NDArray[np.bool_]
    has_shot: NDArray[np.bool_]
    returns: bool
    distance_m: float
    duration_s: float
    items: int
    photographs: int
    name: str = ""
    color: str = FLIGHT_COLORS[0]

    @classmethod
    def of(
        cls, mission: "Mission", frame: Frame, name: str = "", color: str = FLIGHT_COLORS[0]
    ) -> "MissionLayer":
        """A mission as it lies in a picture."""
        from uavseg.flight.mission.flown import flown_path
        from uavseg.flight.mission.items import LANDINGS, RETURN, TAKEOFFS
        from uavseg.flight.mission.vehicle import default_vehicle

        lat, lon, _ = mission.path
        flown = [item for item in mission.items if item.has_position or item.command == RETURN]
        aside = {*TAKEOFFS, RETURN, *LANDINGS}
        counts = np.array([False] + [item.command not in aside for item in flown])
        estimate = mission.estimate
        legs = flown_path(mission, mission.vehicle or default_vehicle(mission.autopilot))
        return cls(
            frame.plot_from_lonlat(lon, lat),
            np.where(counts, np.cumsum(counts), 0),
            np.r_[legs.is_line, np.zeros(len(lat), bool)][: len(lat) - 1],
            np.r_[legs.has_shot, np.zeros(len(lat), bool)][: len(lat)],
            bool(flown) and flown[-1].command == RETURN,
            estimate.distance_m,
            estimate.duration_s,
            len(mission.items),
            estimate.photographs,
            name,
            color,
        )

    def title_parts(self, has_crs: bool) -> list[str]:
        """Number of items, length, duration and photographs."""
        return mission_title([self])

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.collections import LineCollection

        legs = np.stack([self.path[:-1], self.path[1:]], axis=1)
        back = np.arange(len(legs)) == len(legs) - 1 if self.returns else np.zeros(len(legs), bool)
        ways = ~self.is_line & ~back
        flight = self.name or "flight"
        kinds: list[tuple[NDArray[np.bool_], str, float, Any]] = [
            (self.is_line, f"{flight}, with photographs", 2.0, "solid"),
            (ways, flight, 1.0 if self.is_line.any() else 1.3, "solid"),
            (back, "" if self.name else "return", 1.1, (0, (4, 2.5))),
        ]
        for chosen, label, width, dashes in kinds:
            if chosen.any():
                ends = {"capstyle": "round"} if dashes == "solid" else {}
                halo = LineCollection(
                    list(legs[chosen]), color=_HALO_COLOR, lw=width + 1.7, alpha=0.8, zorder=5
                )
                line = LineCollection(
                    list(legs[chosen]), color=self.color, lw=width, ls=dashes, zorder=5.2, **ends
                )
                line.set_label(label or None)
                ax.add_collection(halo)
                ax.add_collection(line)
        self._draw_arrows(ax, point)
        self._draw_places(ax, point)

    def _draw_arrows(self, ax: Any, point: float) -> None:
        from matplotlib.collections import PolyCollection

        heads = arrow_heads(self.path, _MIN_ARROW_LEG * point, 7.0 * point)
        ax.add_collection(
            PolyCollection(list(heads), facecolor=self.color, edgecolor=_HALO_COLOR, lw=0.6, zorder=5.4)
        )

    def _draw_places(self, ax: Any, point: float) -> None:
        points = self.path[self.numbers > 0]
        size = 9 if len(points) > _MAX_NUMBERS else 16
        ax.scatter(
            *points.T,
            s=size,
            color=_HALO_COLOR,
            edgecolor=self.color,
            lw=1.0,
            zorder=5.6,
            label=None if self.name else "waypoint",
        )
        shots = self.path[self.has_shot & ~np.r_[self.is_line, False]]
        if len(shots):
            ax.scatter(*shots.T, s=8, color=self.color, zorder=5.7, label="photograph")
        ax.scatter(
            *self.path[:1].T,
            s=110,
            marker="s",
            color=self.color,
            edgecolor=_HALO_COLOR,
            lw=1.2,
            zorder=6,
            label=None if self.name else "home",
        )
        ax.text(
            *self.path[0],
            "H",
            color=_HALO_COLOR,
            size=7,
            weight="bold",
            ha="center",
            va="center_baseline",
            zorder=6.1,
        )
        self._draw_numbers(ax, point)

    def _draw_numbers(self, ax: Any, point: float) -> None:
        from matplotlib.patheffects import withStroke

        halo = [withStroke(linewidth=2.0, foreground=_HALO_COLOR)]
        for n in choose_numbered(self.path, self.numbers, _MIN_NUMBER_DISTANCE * point):
            x, y = self.path[n] + 4.5 * point
            text = ax.text(
                x,
                y,
                str(self.numbers[n]),
                size=6.5,
                color=self.color,
                weight="bold",
                zorder=6.2,
                clip_on=True,
            )
            text.set_path_effects(halo)


def mission_layers(missions: Sequence[tuple[str, "Mission"]], frame: Frame) -> list[MissionLayer]:
    """Layers of missions with their names, each in a colour of its own."""
    alone = len(missions) == 1
    return [
        MissionLayer.of(mission, frame, "" if alone else name, FLIGHT_COLORS[n % len(FLIGHT_COLORS)])
        for n, (name, mission) in enumerate(missions)
    ]


def read_missions(given: Any) -> list[tuple[str, "Mission"]]:
    """Names and missions of a mission or a sequence of them, missions or files.

    Raises
    ------
    MissionError
        If a file cannot be read, or there is none.
    """
    from pathlib import Path

    from uavseg.errors import MissionError
    from uavseg.flight.formats.files import read_mission
    from uavseg.flight.mission.mission import Mission

    listed = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    parts = [one for part in listed for one in getattr(part, "missions", [part])]  # of what uavseg.plan gives
    if not parts:
        raise MissionError("there is no mission to draw; give at least one")
    found = []
    for number, part in enumerate(parts, start=1):
        if isinstance(part, str | os.PathLike):
            found.append((Path(part).stem, read_mission(part)))
        elif not isinstance(part, Mission):
            raise MissionError(f"a mission to draw is a file or a Mission, not {shown(part)}")
        else:
            found.append((part.name or f"flight {number}", part))
    return found


def mission_title(layers: Sequence[MissionLayer]) -> list[str]:
    """What flights take together: items, length, duration, photographs."""
    from uavseg.flight.mission.estimate import estimate_text

    items, shots = sum(one.items for one in layers), sum(one.photographs for one in layers)
    what = "mission" if len(layers) == 1 else f"{len(layers)} flights"
    estimate = estimate_text(sum(one.distance_m for one in layers), sum(one.duration_s for one in layers))
    photographs = [f"{shots:,} photograph{'s' * (shots != 1)}"] if shots else []
    return [", ".join([f"{what} of {items} items, {estimate}", *photographs])]


def arrow_heads(path: Floats, min_leg: float, size: float) -> Floats:
    """Arrow heads: triangles in the middle of the legs that are longer than `min_leg`.

    Parameters
    ----------
    path : (n, 2) float64 array
    min_leg, size : float
        In plot coordinates.

    Returns
    -------
    heads : (n, 3, 2) float64 array
        Tip first.
    """
    legs = np.diff(path, axis=0)
    lengths = np.hypot(*legs.T)
    long = lengths > min_leg
    along = legs[long] / lengths[long, None]
    across = along[:, ::-1] * (-1, 1)
    middle = (path[:-1] + path[1:])[long] / 2
    tip, tail = middle + 0.6 * size * along, middle - 0.4 * size * along
    return np.stack([tip, tail + 0.4 * size * across, tail - 0.4 * size * across], axis=1)


def choose_numbered(path: Floats, numbers: NDArray[np.int64], apart: float) -> list[int]:
    """Positions that get a number: the first, the last, and others that keep a distance of `apart`.

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
        if not chosen or np.hypot(*(path[chosen] - path[n]).T).min() >= apart:
            chosen.append(n)
    return sorted(chosen)
