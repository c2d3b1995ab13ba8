"""Regions as a GeoDataFrame that shows itself in a notebook: facts and a drawing above the table."""

from html import escape
from typing import Any

import geopandas
import numpy as np
import shapely

_WIDTH, _HEIGHT = 360, 240  # pixels of the drawing, at most
_MOST_DRAWN = 2000  # regions
_STYLE = 'fill="#ffa500" fill-opacity="0.35" stroke="#c46a00" stroke-width="1" fill-rule="evenodd"'


class RegionFrame(geopandas.GeoDataFrame):  # type: ignore[misc]
    """A GeoDataFrame of regions; ``attrs["uavseg"]`` is what they were made from, and how."""

    def _repr_html_(self) -> str:
        table = super()._repr_html_() or ""
        return f"<div><p>{escape(self.summary)}</p>{_drawing(self.geometry.to_numpy())}{table}</div>"

    @property
    def summary(self) -> str:
        """One line: how many regions, their area, from what and with which range."""
        about = self.attrs.get("uavseg", {})
        count = f"{len(self):,} region{'s' * (len(self) != 1)}"
        unit = "m²" if self.crs is not None else "square units"
        parts = [count, f"{np.nansum(self['area_m2']):,.0f} {unit}"] if "area_m2" in self else [count]
        if "range" in about:
            low, high = about["range"]
            parts.append(f"v {low:g} to {high:g}")
        sources = about.get("sources", [])
        if sources:
            parts.append(sources[0] + (f" and {len(sources) - 1} more" if len(sources) > 1 else ""))
        parts.append("no CRS" if self.crs is None else self.crs.name)
        return ", ".join(parts)


def _drawing(polygons: Any) -> str:
    """Return the largest regions as SVG, north up; empty where nothing can be drawn."""
    polygons = polygons[:_MOST_DRAWN]
    if len(polygons) == 0:
        return ""
    left, bottom, right, top = shapely.total_bounds(polygons)
    width, height = right - left, top - bottom
    if not (0 < width < np.inf and 0 < height < np.inf):
        return ""
    scale = min(_WIDTH / width, _HEIGHT / height)
    drawn = shapely.simplify(polygons, 0.5 / scale, preserve_topology=False)
    to_page = shapely.transform(drawn, lambda xy: (xy - (left, top)) * (scale, -scale))
    paths = "".join(f'<path d="{_path(shape)}"/>' for shape in to_page if not shape.is_empty)
    size = f'width="{width * scale:.0f}" height="{height * scale:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}><g {_STYLE}>{paths}</g></svg>'


def _path(shape: Any) -> str:
    rings = [ring for part in shapely.get_parts(shape) for ring in (part.exterior, *part.interiors)]
    lines = ("L".join(f"{x:.1f} {y:.1f}" for x, y in ring.coords[:-1]) for ring in rings)
    return "".join(f"M{line}Z" for line in lines)
