"""Layer of a mission: home, legs with arrows, numbered waypoints."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.plot.frame import Frame

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission

_MISSION_COLOR, _HALO_COLOR = "#c4001a", "#ffffff"
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
    returns : bool
        Whether the last leg leads home.
    distance_m, duration_s : float
    items : int
    """

    path: Floats
    numbers: NDArray[np.int64]
    returns: bool
    distance_m: float
    duration_s: float
    items: int

    @classmethod
    def of(cls, mission: "Mission | str | os.PathLike[str]", frame: Frame) -> "MissionLayer":
        """A mission, or one in a .plan or .waypoints file."""
        from uavseg.flight import files
        from uavseg.flight.items import LANDINGS, RETURN, TAKEOFFS

        flight = files.read_mission(mission) if isinstance(mission, str | os.PathLike) else mission
        lat, lon, _ = flight.path
        flown = [item for item in flight.items if item.has_position or item.command == RETURN]
        aside = {*TAKEOFFS, RETURN, *LANDINGS}
        counts = np.array([False] + [item.command not in aside for item in flown])
        return cls(
            frame.plot_from_lonlat(lon, lat),
            np.where(counts, np.cumsum(counts), 0),
            bool(flown) and flown[-1].command == RETURN,
            flight.distance_m,
            flight.duration_s,
            len(flight.items),
        )

    def title_parts(self, has_crs: bool) -> list[str]:
        """Number of items, length and duration."""
        minutes = max(round(self.duration_s / 60), 1)
        return [f"mission of {self.items} items, {self.distance_m / 1000:.2g} km, about {minutes} min"]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        outward = self.path[:-1] if self.returns else self.path
        ax.plot(*outward.T, color=_HALO_COLOR, lw=3.0, alpha=0.85, solid_joinstyle="round", zorder=5)
        ax.plot(*outward.T, color=_MISSION_COLOR, lw=1.3, solid_joinstyle="round", zorder=5.2, label="flight")
        if self.returns:
            ax.plot(*self.path[-2:].T, color=_HALO_COLOR, lw=3.0, alpha=0.6, zorder=5)
            ax.plot(
                *self.path[-2:].T, color=_MISSION_COLOR, lw=1.2, ls=(0, (4, 2.5)), zorder=5.2, label="return"
            )
        self._draw_arrows(ax, point)
        self._draw_places(ax, point)

    def _draw_arrows(self, ax: Any, point: float) -> None:
        from matplotlib.collections import PolyCollection

        heads = arrow_heads(self.path, _MIN_ARROW_LEG * point, 7.0 * point)
        ax.add_collection(
            PolyCollection(list(heads), facecolor=_MISSION_COLOR, edgecolor=_HALO_COLOR, lw=0.6, zorder=5.4)
        )

    def _draw_places(self, ax: Any, point: float) -> None:
        points = self.path[self.numbers > 0]
        size = 9 if len(points) > _MAX_NUMBERS else 16
        ax.scatter(
            *points.T,
            s=size,
            color=_HALO_COLOR,
            edgecolor=_MISSION_COLOR,
            lw=1.0,
            zorder=5.6,
            label="waypoint",
        )
        ax.scatter(
            *self.path[:1].T,
            s=110,
            marker="s",
            color=_MISSION_COLOR,
            edgecolor=_HALO_COLOR,
            lw=1.2,
            zorder=6,
            label="home",
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
                color=_MISSION_COLOR,
                weight="bold",
                zorder=6.2,
                clip_on=True,
            )
            text.set_path_effects(halo)


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
