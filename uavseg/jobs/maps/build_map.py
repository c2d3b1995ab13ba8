"""Maps of recorded bags: the scans of a robot, merged at the poses that it had."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uavseg.errors import ParameterError
from uavseg.execution.phases import decided, phase
from uavseg.occupancy.bags.merge_bag import BagTopics, MergeParams, ScanCounts, merge_bag
from uavseg.occupancy.map_file import write_map
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.raster.formats.creation import creation_for

DEFAULT_ODOM = "/odom"


@dataclass(frozen=True, slots=True, eq=False)
class BuiltMap:
    """The map of a bag.

    Parameters
    ----------
    grid : OccupancyGrid
        With its evidence; `grid.save` keeps it.
    frame : str
        In whose coordinates the map is, such as "odom" or "map".
    scans : ScanCounts
        How many were merged, and how many left out.
    warnings : tuple of str
    """

    grid: OccupancyGrid
    frame: str
    scans: ScanCounts
    warnings: tuple[str, ...]

    def write(
        self,
        path: str | os.PathLike[str],
        overwrite: bool = False,
        creation_options: Mapping[str, Any] | Sequence[str] | None = None,
        mode: str | None = None,
    ) -> None:
        """Write the map: .yaml with its image, as Nav2's map server reads them, or .tif of probabilities.

        Parameters
        ----------
        path : path
        overwrite : bool
            Whether files that are there may be replaced.
        creation_options : mapping or sequence of str, optional
            Of a .tif, such as {"COMPRESS": "ZSTD", "PREDICTOR": 3}; see `CreationOptions`.
        mode : {"trinary", "scale", "raw"}, optional
            Of a .yaml, by default "trinary"; the others keep all levels.

        Raises
        ------
        OutputExistsError, OutputError
            If a file exists, or cannot be written.
        ParameterError
            If a creation option is not allowed, or given for a .yaml; if a mode is given for a .tif.
        """
        creation = creation_for(creation_options, {os.fspath(path): "float32"})
        write_map(path, self.grid.probabilities, self.grid.geobox, overwrite, mode, creation=creation)


def topics_of(scan: str, odom: str | None, tf: bool) -> BagTopics:
    """The topics that words name: odometry, by default of /odom, or the tree of /tf.

    Raises
    ------
    ParameterError
        If both are asked for.
    """
    if tf and odom is not None:
        raise ParameterError("poses come from --odom or from --tf (odom and tf in Python), not from both")
    return BagTopics(scan, None if tf else odom or DEFAULT_ODOM)


def build_map(bag: str | os.PathLike[str], topics: BagTopics, params: MergeParams) -> BuiltMap:
    """Merge the scans of a recorded bag into a map; see `merge_bag`.

    Raises
    ------
    BagError
        If the bag cannot be read, lacks a topic, or no scan has a pose; if the map would be too large.
    """
    decided("scans of %s, poses of %s, cells of %g m", topics.scan, topics.odom or "/tf", params.resolution_m)
    with phase("scans"):
        found = merge_bag(bag, topics, params)
    decided("%d of %d scans merged in the frame %s", found.counts.merged, found.counts.total, found.frame)
    return BuiltMap(found.grid, found.frame, found.counts, found.warnings)
