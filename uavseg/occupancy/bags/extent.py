"""Extent of the map that scans need: a bounding box of their beams, in whole cells."""

import math
from dataclasses import dataclass, field

import numpy as np

from uavseg.errors import BagError
from uavseg.occupancy.mapping.beams import REACH_SIGMAS
from uavseg.occupancy.mapping.grid_file import MAX_CELLS
from uavseg.occupancy.mapping.scan import Scan
from uavseg.raster.grid.geobox import GeoBox, local_geobox


@dataclass(slots=True)
class Extent:
    """Bounding box of what scans observe, in metres."""

    low: list[float] = field(default_factory=lambda: [math.inf, math.inf])
    high: list[float] = field(default_factory=lambda: [-math.inf, -math.inf])

    def add(self, scan: Scan) -> None:
        """Add the sensor and the ends of its beams."""
        known = ~np.isnan(scan.ranges)
        ranges = scan.ranges[known]
        reach = np.where(np.isinf(ranges), scan.max_range_m, ranges + REACH_SIGMAS * scan.sigma_m)
        x, y, angles = scan.beams
        poses = [scan.pose] if scan.end is None else [scan.pose, scan.end]
        for axis, (places, along) in enumerate(((x, np.cos), (y, np.sin))):
            ends = places[known] + reach * along(angles[known])
            corners = [*ends.tolist(), *((pose.x, pose.y)[axis] for pose in poses)]
            self.low[axis] = min(self.low[axis], *corners)
            self.high[axis] = max(self.high[axis], *corners)

    def geobox(self, cell_m: float) -> GeoBox:
        """Whole cells around the box, at multiples of their side.

        Raises
        ------
        BagError
            If they are too many.
        """
        first = [math.floor(low / cell_m) for low in self.low]
        cols, rows = (math.floor(high / cell_m) - low + 1 for high, low in zip(self.high, first, strict=True))
        if rows * cols > MAX_CELLS:
            width, height = (high - low for high, low in zip(self.high, self.low, strict=True))
            raise BagError(
                f"the scans cover {width:,.0f} x {height:,.0f} m, {rows * cols:,} cells of {cell_m:g} m; at "
                f"most {MAX_CELLS:,} are possible: give a larger resolution or a smaller max range"
            )
        return local_geobox((rows, cols), cell_m, (first[0] * cell_m, first[1] * cell_m))
