"""Layer of regions: translucent, coloured by class or else unlike neighbours, ids on the largest."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.plain_text import shown
from uavseg.plot.layers.class_colors import ClassColors
from uavseg.plot.page.frame import Frame
from uavseg.plot.page.map_furniture import area_text
from uavseg.plot.page.polygons import PolygonArray, PolygonTable, polygon_paths, simplified

_COLORS = ("#ff8c1a", "#19c3f0", "#f032e6", "#b5e61d", "#ffe119", "#5b7cff", "#2fd05f", "#ff9ec4")
_MAX_LABELS = 40
_MIN_LABEL_RADIUS = 6.0  # radius in points of the largest circle inside a region


def _total(areas: NDArray[Any]) -> float | None:
    """Sum of the areas that are known; None if the column holds something other than numbers."""
    return float(np.nansum(areas)) if areas.dtype.kind in "iuf" else None


def _is_name(own: Any) -> bool:
    """Whether an entry of a column is one number or text that is known."""
    return own is not None and np.ndim(own) == 0 and own == own


@dataclass(frozen=True, slots=True)
class Look:
    """Fill and line of regions, and what the legend says of them; without a name it has none."""

    alpha: float
    line: str
    name: str = ""


PLAIN = Look(0.3, "solid")
_LOOKS = (
    Look(0.4, "solid", "confidence of 0.8 and more"),
    Look(0.22, "dashed", "confidence of 0.5 to 0.8"),
    Look(0.08, "dotted", "confidence below 0.5"),
)
_BOUNDS = (0.8, 0.5)


@dataclass(frozen=True)
class RegionLayer:
    """Polygons in plot coordinates, with their ids.

    Parameters
    ----------
    ids : (n,) array
    polygons : (n,) object array of shapely geometries
    area_m2 : float or None
        Sum of their column `area_m2`, if they have one.
    classes : ClassColors, optional
        Their colours by class, if they have classes.
    looks : list of (Look, (n,) bool array), optional
        How those of each confidence are drawn; all alike by default.
    """

    ids: NDArray[Any]
    polygons: PolygonArray
    area_m2: float | None
    classes: ClassColors | None = None
    looks: list[tuple[Look, NDArray[np.bool_]]] | None = None

    @classmethod
    def of(cls, regions: Any, frame: Frame) -> "RegionLayer":
        """Regions of a file, of `Regions` or of a GeoDataFrame.

        Raises
        ------
        RegionError
            If the file cannot be read.
        """
        found = PolygonTable.of(regions)
        ids, areas = found.columns.get("id"), found.columns.get("area_m2")
        if ids is None or not all(map(_is_name, ids)):
            ids = np.arange(1, len(found.polygons) + 1)
        total = None if areas is None else _total(areas)
        looks = looks_of(found.columns, len(found.polygons))
        return cls(ids, found.in_plot(frame), total, ClassColors.of(found.columns, _COLORS), looks)

    def title_parts(self, has_crs: bool) -> list[str]:
        """The number of regions and their total area."""
        count = f"{len(self.ids)} region{'s' if len(self.ids) != 1 else ''}"
        return [count, area_text(self.area_m2)] if has_crs and self.area_m2 is not None else [count]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.collections import PathCollection

        seen = np.sqrt(shapely.area(self.polygons)) > 0.3 * point
        if not seen.any():
            return
        shapes = shapely.orient_polygons(simplified(self.polygons[seen], 0.2 * point))
        if self.classes is None:
            order: tuple[str, ...] = _COLORS
            colors = np.array(_COLORS)[assign_colors(shapes, 9 * point, len(_COLORS))]
        else:
            colors = self.classes.colors[seen]
            order = tuple(dict.fromkeys(self.classes.legend.values()))
            for name, color in self.classes.legend.items():
                ax.scatter([], [], s=40, marker="s", color=color, label=name.replace("$", r"\$"))
        paths = polygon_paths(shapes)
        for look, those in self.looks or [(PLAIN, np.ones(len(seen), bool))]:
            if look.name:
                ax.plot([], [], color="#555555", lw=1.4, ls=look.line, label=look.name)
            for color in order:
                own = (colors == color) & those[seen]
                group = [paths[k] for k in np.flatnonzero(own)]
                ax.add_collection(PathCollection(group, facecolor=color, alpha=look.alpha, lw=0, zorder=3))
                outlines = PathCollection(group, facecolor="none", edgecolor=color, lw=1.1, zorder=4)
                outlines.set_linestyle(look.line)
                ax.add_collection(outlines)
        _draw_labels(ax, self.ids[seen], shapes, point)


def assign_colors(shapes: PolygonArray, reach: float, count: int) -> NDArray[np.intp]:
    """Greedy graph colouring: an index for each shape that differs from its neighbours' if possible.

    Parameters
    ----------
    shapes : (n,) object array of shapely geometries
    reach : float
        Distance up to which the bounding boxes of two shapes make them neighbours.
    count : int
        Number of colours.

    Returns
    -------
    indices : (n,) intp array
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


def _draw_labels(ax: Any, ids: NDArray[Any], shapes: PolygonArray, point: float) -> None:
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.2, foreground="#111111")]
    for n in np.argsort(-shapely.area(shapes), kind="stable")[:_MAX_LABELS]:
        x, y, radius = _largest_circle(shapes[n], point)
        if radius < _MIN_LABEL_RADIUS * point and len(shapes) > 12:
            continue
        size = 7.0 if radius < 14 * point else 9.0
        name = shown(ids[n], False)
        text = ax.text(x, y, name, ha="center", va="center", size=size, color="white", weight="bold")
        text.set(path_effects=halo, zorder=7, clip_on=True)


def _largest_circle(shape: Any, point: float) -> tuple[float, float, float]:
    """Centre and radius of the largest circle inside a region."""
    part = max(shapely.get_parts(shape), key=shapely.area)
    circle = shapely.maximum_inscribed_circle(part, tolerance=point)
    x, y = shapely.get_coordinates(circle)[0]
    return float(x), float(y), float(shapely.length(circle))


def looks_of(columns: dict[str, NDArray[Any]], count: int) -> list[tuple[Look, NDArray[np.bool_]]]:
    """Return looks, each with the regions (n,) that have it; what has no known confidence is drawn plainly.

    Parameters
    ----------
    columns : dict of (n,) arrays
    count : int
        n.
    """
    values = columns.get("confidence", np.empty(0))
    if values.dtype.kind not in "iuf" or not np.isfinite(values).any():
        return [(PLAIN, np.ones(count, bool))]
    known = np.isfinite(values)
    rank = np.sum([values < bound for bound in _BOUNDS], axis=0)
    found = [(look, known & (rank == k)) for k, look in enumerate(_LOOKS)]
    return [(look, those) for look, those in (*found, (PLAIN, ~known)) if those.any()]
