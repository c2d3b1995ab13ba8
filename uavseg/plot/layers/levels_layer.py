"""Levels in a picture: every segment in the grey of its interval."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import RegionError
from uavseg.plot.frame import Frame
from uavseg.plot.polygons import Polygons, Shapes, outlines


@dataclass(frozen=True)
class LevelsLayer:
    """Segments on the sheet, with the grey of their levels.

    Parameters
    ----------
    polygons : (n,) object array of shapely geometries
    levels : (n,) int64 array
        The darkest has the least number.
    greys : (n,) float64 array
        0 black to 1 white.
    """

    polygons: Polygons
    levels: NDArray[np.int64]
    greys: NDArray[np.float64]

    @classmethod
    def of(cls, source: Any, frame: Frame) -> "LevelsLayer":
        """Segments of a file that `uavseg levels` wrote, or of a GeoDataFrame, brought to the sheet.

        Raises
        ------
        RegionError
            If it cannot be read or has no levels.
        """
        found = Shapes.of(source)
        if "level" not in found.columns:
            raise RegionError("the segments to draw in grey have no column level; uavseg levels makes them")
        levels = np.asarray(found.columns["level"], np.int64)
        return cls(found.on_sheet(frame), levels, _greys(levels, found.columns))

    def told(self, on_globe: bool) -> list[str]:
        """How many segments there are, of how many levels."""
        count, levels = len(self.levels), len(np.unique(self.levels))
        return [f"{count:,} segment{'s' if count != 1 else ''} of {levels} level{'s' if levels != 1 else ''}"]

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        from matplotlib.collections import PathCollection

        seen = np.sqrt(shapely.area(self.polygons)) > 0.3 * unit
        for level in np.unique(self.levels[seen]):
            chosen = seen & (self.levels == level)
            color = str(self.greys[chosen][0])
            paths = outlines(shapely.simplify(self.polygons[chosen], 0.2 * unit))
            ax.add_collection(PathCollection(paths, facecolor=color, edgecolor=color, lw=0.3, zorder=2.2))


def _greys(levels: NDArray[np.int64], columns: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """The middle of each segment's interval; evenly spread levels where the interval is not told."""
    if "range_low" in columns and "range_high" in columns:
        ends = [np.asarray(columns[name], np.float64) for name in ("range_low", "range_high")]
        return np.clip((ends[0] + ends[1]) / 2, 0, 1)
    apart = np.unique(levels)
    return np.searchsorted(apart, levels) / max(len(apart) - 1, 1)
