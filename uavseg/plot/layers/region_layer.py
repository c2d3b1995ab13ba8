"""Regions in a picture: translucent, coloured unlike their neighbours, the largest with their ids."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.plot.frame import Frame
from uavseg.plot.map_furniture import area_text
from uavseg.plot.polygons import Polygons, Shapes, outlines

COLORS = ("#ff8c1a", "#19c3f0", "#f032e6", "#b5e61d", "#ffe119", "#5b7cff", "#2fd05f", "#ff9ec4")
MOST_LABELS = 40
SMALLEST_LABELLED = 6.0  # radius in points of the widest place inside a region


@dataclass(frozen=True)
class RegionLayer:
    """Polygons on the sheet, with their ids.

    Parameters
    ----------
    ids : (n,) array
    polygons : (n,) object array of shapely geometries
    area_m2 : float or None
        Of all of them on the ground, if they say so.
    """

    ids: NDArray[Any]
    polygons: Polygons
    area_m2: float | None

    @classmethod
    def of(cls, regions: Any, frame: Frame) -> "RegionLayer":
        """Regions, or those of a GeoDataFrame or a file, brought to the sheet.

        Raises
        ------
        RegionError
            If the file cannot be read.
        """
        found = Shapes.of(regions)
        ids, areas = found.columns.get("id"), found.columns.get("area_m2")
        if ids is None or any(own is None or own != own for own in ids):
            ids = np.arange(1, len(found.polygons) + 1)
        return cls(ids, found.on_sheet(frame), None if areas is None else float(np.nansum(areas)))

    def told(self, on_globe: bool) -> list[str]:
        """How many there are, and how large they are together."""
        count = f"{len(self.ids)} region{'s' if len(self.ids) != 1 else ''}"
        return [count, area_text(self.area_m2)] if on_globe and self.area_m2 is not None else [count]

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        from matplotlib.collections import PathCollection

        seen = np.sqrt(shapely.area(self.polygons)) > 0.3 * unit
        if not seen.any():
            return
        shapes = shapely.orient_polygons(shapely.simplify(self.polygons[seen], 0.2 * unit))
        colors = np.array(COLORS)[distinct(shapes, 9 * unit, len(COLORS))]
        paths = outlines(shapes)
        for color in COLORS:
            group = [path for path, own in zip(paths, colors, strict=True) if own == color]
            ax.add_collection(PathCollection(group, facecolor=color, alpha=0.3, lw=0, zorder=3))
            ax.add_collection(PathCollection(group, facecolor="none", edgecolor=color, lw=1.1, zorder=4))
        _label(ax, self.ids[seen], shapes, unit)


def distinct(shapes: Polygons, reach: float, count: int) -> NDArray[np.intp]:
    """A number below `count` for each shape, other than its neighbours' where that can be had.

    Parameters
    ----------
    shapes : (n,) object array of shapely geometries
    reach : float
        How near the rectangle around a neighbour is.
    """
    left, bottom, right, top = shapely.bounds(shapes).T
    around = shapely.box(left - reach, bottom - reach, right + reach, top + reach)
    first, second = shapely.STRtree(shapes).query(around)
    earlier = second < first
    starts = np.searchsorted(first[earlier], np.arange(len(shapes) + 1))
    others = second[earlier]
    chosen = np.zeros(len(shapes), np.intp)
    for n in range(len(shapes)):
        taken = np.bincount(chosen[others[starts[n] : starts[n + 1]]], minlength=count)
        taken[: n % count] += 1 if not taken.any() else 0  # shapes without neighbours take turns
        chosen[n] = int(taken.argmin())
    return chosen


def _label(ax: Any, ids: NDArray[Any], shapes: Polygons, unit: float) -> None:
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.2, foreground="#111111")]
    for n in np.argsort(-shapely.area(shapes), kind="stable")[:MOST_LABELS]:
        x, y, radius = _widest(shapes[n], unit)
        if radius < SMALLEST_LABELLED * unit and len(shapes) > 12:
            continue
        size = 7.0 if radius < 14 * unit else 9.0
        text = ax.text(x, y, str(ids[n]), ha="center", va="center", size=size, color="white", weight="bold")
        text.set(path_effects=halo, zorder=7, clip_on=True)


def _widest(shape: Any, unit: float) -> tuple[float, float, float]:
    """The point inside a region that is farthest from its edge, and how far that is."""
    part = max(shapely.get_parts(shape), key=shapely.area)
    circle = shapely.maximum_inscribed_circle(part, tolerance=unit)
    x, y = shapely.get_coordinates(circle)[0]
    return float(x), float(y), float(shapely.length(circle))
