"""Evidence that is revised by contradiction: occupied cells are forgotten when scans see through them.

A scan contradicts an occupied cell if beams cross it and none returns within 3 sigma of it. Its free evidence
is held back; after so many contradicting scans in a row, that of all of them takes the place of the cell's. A
return at the cell confirms it. Beams that graze a wall cross its edge and return behind: so contradicted
cells are forgotten only in a group that reaches beyond the edge of what stands, or is unknown.
"""

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.occupancy.mapping.log_odds import MAX_LOG_ODDS, Float32s
from uavseg.raster.grid.tiling import Window

MARGIN = 8  # cells that are looked at outside of those that a scan observes
_EDGE = 2  # cells: thickness of the edge of what stands
_MAX_SCANS = 1_000_000
_SQUARE = np.ones((3, 3), bool)


@dataclass(frozen=True, slots=True)
class Fading:
    """How evidence of a grid fades, see `OccupancyGrid`; ParameterError if a number is not possible."""

    clamp: float = MAX_LOG_ODDS
    half_life: float | None = None
    forget_after: float | None = None

    def __post_init__(self) -> None:
        limits = {
            "clamp": (1e-3, MAX_LOG_ODDS),
            "half_life": (1, _MAX_SCANS),
            "forget_after": (1, _MAX_SCANS),
        }
        for name, (low, high) in limits.items():
            if (number := getattr(self, name)) is not None and not low <= number <= high:
                raise ParameterError(f"{name} is {low:g} to {high:g}, not {number:g}")


class Contradictions:
    """Scans in a row that contradicted each cell of a map of a shape, and their log-odds."""

    def __init__(self, shape: tuple[int, int], forget_after: float) -> None:
        self._forget_after = forget_after
        self._counts, self._held = np.zeros(shape, np.uint32), np.zeros(shape, np.float32)

    def revised(self, at: Window, before: Float32s, odds: Float32s, after: Float32s, beside: int) -> Float32s:
        """Return log-odds of a window, from those before a scan, of it alone, and after."""
        from scipy import ndimage

        counts, held = self._counts[at.slices], self._held[at.slices]
        occupied, is_hit = before > 0, odds > 0
        through = occupied & (odds < 0) & ~ndimage.binary_dilation(is_hit, _SQUARE, beside)
        counts[through] += 1
        held[through] += odds[through]
        counts[is_hit | ~occupied], held[is_hit | ~occupied] = 0, 0
        due = counts >= self._forget_after
        stands = ndimage.binary_dilation((occupied & ~due) | (after == 0), _SQUARE, _EDGE)
        groups, number = ndimage.label(due, _SQUARE)
        gone = (
            due
            & (odds < 0)
            & (np.bincount(groups[due & through & ~stands], minlength=number + 1) > 0)[groups]
        )
        revised = np.where(occupied & (odds < 0), before, after)
        revised[gone] = np.maximum(held[gone], -MAX_LOG_ODDS)
        counts[gone], held[gone] = 0, 0
        return revised
