"""A mission in a picture: home, the legs with their direction, the waypoints with their order."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.plot.frame import Frame

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission

INK, HALO = "#c4001a", "#ffffff"
MOST_NUMBERS = 60
LONG_LEG = 26.0  # points: shorter legs have no arrow
APART = 15.0  # points between two numbers

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MissionLayer:
    """A mission on the sheet.

    Parameters
    ----------
    path : (n, 2) array
        Home, then every place that is flown to; home again at the end where the mission returns.
    numbers : (n,) int array
        Order of each place among the waypoints, from 1; 0 for home and takeoff.
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
        """A mission, or one in a .plan or .waypoints file, brought to the sheet."""
        from uavseg.flight import files
        from uavseg.flight.mission import LANDINGS, RETURN, TAKEOFF, VTOL_TAKEOFF

        flight = files.read(mission) if isinstance(mission, str | os.PathLike) else mission
        lat, lon, _ = flight.path
        flown = [item for item in flight.items if item.is_place or item.command == RETURN]
        aside = {TAKEOFF, VTOL_TAKEOFF, RETURN, *LANDINGS}
        counts = np.array([False] + [item.command not in aside for item in flown])
        return cls(
            frame.sheet_from_lonlat(lon, lat),
            np.where(counts, np.cumsum(counts), 0),
            bool(flown) and flown[-1].command == RETURN,
            flight.distance_m,
            flight.duration_s,
            len(flight.items),
        )

    def told(self, on_globe: bool) -> list[str]:
        """What there is to fly."""
        minutes = max(round(self.duration_s / 60), 1)
        return [f"mission of {self.items} items, {self.distance_m / 1000:.2g} km, about {minutes} min"]

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        outward = self.path[:-1] if self.returns else self.path
        ax.plot(*outward.T, color=HALO, lw=3.0, alpha=0.85, solid_joinstyle="round", zorder=5)
        ax.plot(*outward.T, color=INK, lw=1.3, solid_joinstyle="round", zorder=5.2, label="flight")
        if self.returns:
            ax.plot(*self.path[-2:].T, color=HALO, lw=3.0, alpha=0.6, zorder=5)
            ax.plot(*self.path[-2:].T, color=INK, lw=1.2, ls=(0, (4, 2.5)), zorder=5.2, label="return")
        self._draw_arrows(ax, unit)
        self._draw_places(ax, unit)

    def _draw_arrows(self, ax: Any, unit: float) -> None:
        from matplotlib.collections import PolyCollection

        heads = arrow_heads(self.path, LONG_LEG * unit, 7.0 * unit)
        ax.add_collection(PolyCollection(list(heads), facecolor=INK, edgecolor=HALO, lw=0.6, zorder=5.4))

    def _draw_places(self, ax: Any, unit: float) -> None:
        points = self.path[self.numbers > 0]
        size = 9 if len(points) > MOST_NUMBERS else 16
        ax.scatter(*points.T, s=size, color=HALO, edgecolor=INK, lw=1.0, zorder=5.6, label="waypoint")
        ax.scatter(
            *self.path[:1].T, s=110, marker="s", color=INK, edgecolor=HALO, lw=1.2, zorder=6, label="home"
        )
        ax.text(
            *self.path[0],
            "H",
            color=HALO,
            size=7,
            weight="bold",
            ha="center",
            va="center_baseline",
            zorder=6.1,
        )
        self._draw_numbers(ax, unit)

    def _draw_numbers(self, ax: Any, unit: float) -> None:
        from matplotlib.patheffects import withStroke

        halo = [withStroke(linewidth=2.0, foreground=HALO)]
        for n in numbered(self.path, self.numbers, APART * unit):
            x, y = self.path[n] + 4.5 * unit
            text = ax.text(
                x, y, str(self.numbers[n]), size=6.5, color=INK, weight="bold", zorder=6.2, clip_on=True
            )
            text.set_path_effects(halo)


def arrow_heads(path: Floats, least: float, size: float) -> Floats:
    """Triangles in the middle of the legs that are longer than `least`, pointing along them.

    Returns
    -------
    heads : (n, 3, 2) array
        Tip first.
    """
    legs = np.diff(path, axis=0)
    lengths = np.hypot(*legs.T)
    long = lengths > least
    way = legs[long] / lengths[long, None]
    side = way[:, ::-1] * (-1, 1)
    middle = (path[:-1] + path[1:])[long] / 2
    tip, tail = middle + 0.6 * size * way, middle - 0.4 * size * way
    return np.stack([tip, tail + 0.4 * size * side, tail - 0.4 * size * side], axis=1)


def numbered(path: Floats, numbers: NDArray[np.int64], apart: float) -> list[int]:
    """Which places get their number: the first and the last, and of the others what leaves room.

    Examples
    --------
    >>> numbered(np.array([[0, 0], [1, 0], [2, 0], [30, 0]]), np.array([0, 1, 2, 3]), 10.0)
    [1, 3]
    """
    places = np.flatnonzero(numbers)
    if len(places) == 0:
        return []
    step = -(-len(places) // MOST_NUMBERS)
    order = dict.fromkeys([int(places[0]), int(places[-1]), *places[::step].tolist()])
    chosen: list[int] = []
    for n in order:
        if not chosen or np.hypot(*(path[chosen] - path[n]).T).min() >= apart:
            chosen.append(n)
    return sorted(chosen)
