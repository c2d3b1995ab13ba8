"""Layer of levels: each segment in the grey of its interval."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import RegionError
from uavseg.plot.page.frame import Frame
from uavseg.plot.page.polygons import PolygonArray, PolygonTable, polygon_paths, simplified

_LARGEST = 2.0**53


@dataclass(frozen=True)
class LevelsLayer:
    """Segments in plot coordinates, with the grey of their levels.

    Parameters
    ----------
    polygons : (n,) object array of shapely geometries
    levels : (n,) int64 array
        The darkest has the smallest number.
    greys : (n,) float64 array
        0 black to 1 white.
    """

    polygons: PolygonArray
    levels: NDArray[np.int64]
    greys: NDArray[np.float64]

    @classmethod
    def of(cls, source: Any, frame: Frame) -> "LevelsLayer":
        """Segments of a file that `uavseg levels` wrote, or of a GeoDataFrame.

        Raises
        ------
        RegionError
            If it cannot be read or has no column `level`.
        """
        found = PolygonTable.of(source)
        if "level" not in found.columns:
            raise RegionError("the segments to draw in grey have no column level; uavseg levels makes them")
        levels = _numbers("level", found.columns).astype(np.int64)
        return cls(found.in_plot(frame), levels, _greys(levels, found.columns))

    def title_parts(self, has_crs: bool) -> list[str]:
        """The number of segments and of levels."""
        count, levels = len(self.levels), len(np.unique(self.levels))
        return [f"{count:,} segment{'s' if count != 1 else ''} of {levels} level{'s' if levels != 1 else ''}"]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.collections import PathCollection

        seen = shapely.area(self.polygons) > (0.3 * point) ** 2
        for level in np.unique(self.levels[seen]):
            chosen = seen & (self.levels == level)
            color = str(self.greys[chosen][0])
            paths = polygon_paths(simplified(self.polygons[chosen], 0.2 * point))
            ax.add_collection(PathCollection(paths, facecolor=color, edgecolor=color, lw=0.3, zorder=2.2))


def _numbers(name: str, columns: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """A column that holds finite numbers, as texts too."""
    try:
        numbers = np.array([float(value) for value in columns[name]])
        if (np.abs(numbers) < _LARGEST).all():
            return numbers
    except (TypeError, ValueError, OverflowError):
        pass
    raise RegionError(f"the column {name} of the segments holds something other than numbers")


def _greys(levels: NDArray[np.int64], columns: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """The middle of each segment's interval; evenly spaced greys if the intervals are not given."""
    if "range_low" in columns and "range_high" in columns:
        low, high = (np.clip(_numbers(name, columns), 0, 1) for name in ("range_low", "range_high"))
        return (low + high) / 2
    apart = np.unique(levels)
    return np.searchsorted(apart, levels) / max(len(apart) - 1, 1)
