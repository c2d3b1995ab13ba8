"""Mapping job: the scans of a recorded bag, merged into a map at the poses of the robot."""

import os

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.occupancy.bags.merge_bag import BagTopics, MergeParams, ScanCounts, merge_bag
from uavseg.occupancy.map_file import WritableMap
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.raster.grid.geobox import GeoBox

DEFAULT_ODOM = "/odom"


@dataclass(frozen=True, slots=True, eq=False)
class BuiltMap(WritableMap):
    """The map of a bag, in the coordinate `frame` that its poses are in, such as "odom" or "map".

    `grid.save` keeps the log-odds; `scans` counts merged and omitted ones.
    """

    grid: OccupancyGrid
    frame: str
    scans: ScanCounts
    warnings: tuple[str, ...]

    @property
    def probabilities(self) -> NDArray[np.float32]:
        """Return the probabilities of the cells, (rows, cols)."""
        return self.grid.probabilities

    @property
    def geobox(self) -> GeoBox:
        """Return the position of the cells."""
        return self.grid.geobox


def topics_of(scan: str, odom: str | None, tf: bool) -> BagTopics:
    """Choose the topics: poses from odometry, by default of /odom, or from the tree of /tf, not from both."""
    if tf and odom is not None:
        raise ParameterError("poses come from --odom or from --tf (odom and tf in Python), not from both")
    return BagTopics(scan, None if tf else odom or DEFAULT_ODOM)


def build_map(bag: str | os.PathLike[str], topics: BagTopics, params: MergeParams) -> BuiltMap:
    """Merge the scans of a recorded bag into a map; see `merge_bag`."""
    decided("scans of %s, poses of %s, cells of %g m", topics.scan, topics.odom or "/tf", params.resolution_m)
    with phase("scans"):
        merged = merge_bag(bag, topics, params)
    scans = merged.counts
    decided("%d of %d scans merged in the frame %s", scans.merged, scans.total, merged.frame)
    return BuiltMap(grid=merged.grid, frame=merged.frame, scans=scans, warnings=merged.warnings)
