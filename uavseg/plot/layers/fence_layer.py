"""Layer of a fence: areas to stay inside of, keep-out zones, and rally points."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.plot.page.frame import Frame

if TYPE_CHECKING:
    from uavseg.flight.mission.fence import Fence
    from uavseg.flight.mission.mission import Mission

INSIDE_COLOR, KEEP_OUT_COLOR, RALLY_COLOR, HALO_COLOR = "#1b7f3b", "#b00020", "#1b7f3b", "#ffffff"
CIRCLE_CORNERS = 72

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FenceLayer:
    """The fences of missions in plot coordinates, each shape once.

    Parameters
    ----------
    inside, keep_out : tuple of (n, 2) float64 arrays
        Outlines of inclusions and of exclusions.
    rally : (n, 2) float64 array
    """

    inside: tuple[Floats, ...]
    keep_out: tuple[Floats, ...]
    rally: Floats

    @classmethod
    def of(cls, missions: Sequence["Mission"], frame: Frame) -> "FenceLayer":
        """The fences and rally points of missions."""
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
        """All corners and rally points, (n, 2)."""
        return np.concatenate([*self.inside, *self.keep_out, self.rally])

    def title_parts(self, has_crs: bool) -> list[str]:
        """Nothing: the legend names what is drawn."""
        return []

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.patches import Polygon

        for ring in self.inside:
            ax.add_patch(Polygon(ring, fill=False, ec=HALO_COLOR, lw=2.6, alpha=0.7, zorder=4.6))
            line = Polygon(
                ring, fill=False, ec=INSIDE_COLOR, ls=(0, (7, 3)), lw=1.2, zorder=4.7, label="fence"
            )
            ax.add_patch(line)
        for ring in self.keep_out:
            ax.add_patch(Polygon(ring, fc=KEEP_OUT_COLOR, alpha=0.16, lw=0, zorder=4.6))
            hatched = Polygon(
                ring, fill=False, ec=KEEP_OUT_COLOR, lw=1.2, alpha=0.75, hatch="////", zorder=4.7
            )
            hatched.set_label("keep-out zone")
            ax.add_patch(hatched)
        if len(self.rally):
            ax.scatter(
                *self.rally.T,
                s=70,
                marker="^",
                color=RALLY_COLOR,
                edgecolor=HALO_COLOR,
                lw=1.0,
                zorder=5.9,
                label="rally point",
            )


def _outlines(shapes: Iterable["Fence"], frame: Frame) -> Iterable[Floats]:
    from uavseg.flight.mission.fence import FenceCircle
    from uavseg.flight.mission.plane import Plane

    turns = np.linspace(0, 2 * np.pi, CIRCLE_CORNERS, endpoint=False)
    for shape in shapes:
        if isinstance(shape, FenceCircle):
            east, north = shape.radius_m * np.sin(turns), shape.radius_m * np.cos(turns)
            lon, lat = Plane(shape.lat, shape.lon).lonlat_from_xy(east, north)
        else:
            lat, lon = np.array(shape.vertices).T
        yield frame.plot_from_lonlat(lon, lat)
