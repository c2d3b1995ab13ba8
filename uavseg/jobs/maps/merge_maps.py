"""Maps of robots merged into one, cropped to what is known, and turned so that their rows run along x."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MapError, ParameterError
from uavseg.execution.phases import decided, phase
from uavseg.jobs.source.open_source import open_probability_map
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.occupancy.map_file import write_map
from uavseg.occupancy.mapping.grid_file import check_cells
from uavseg.occupancy.merge_maps import PlacedMap, common_grid, cropped, merge
from uavseg.raster.formats.creation import creation_for
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.units import GREY_MAX


@dataclass(frozen=True, slots=True)
class MergeRequest:
    """What becomes of the grid of the first map.

    Parameters
    ----------
    crop : bool
        Whether the merged map ends where nothing beyond is known.
    unrotate : bool
        Whether its rows run along the x axis, a yaw of 0.
    resolution : float, optional
        Side of a cell in metres; by default that of the first map.

    Raises
    ------
    ParameterError
        If the resolution is not a number above 0.
    """

    crop: bool = False
    unrotate: bool = False
    resolution: float | None = None

    def __post_init__(self) -> None:
        if self.resolution is not None and not 0 < self.resolution < float("inf"):
            raise ParameterError(f"resolution is metres per cell, a number above 0, not {self.resolution:g}")


@dataclass(frozen=True, slots=True, eq=False)
class MergedMap:
    """A map that was made of others.

    Parameters
    ----------
    probabilities : (rows, cols) float32 array
        Exactly 0.5 where unknown.
    geobox : GeoBox
    disputed : int
        Cells that are free in one map and occupied in another, and hence occupied.
    warnings : tuple of str
    """

    probabilities: NDArray[np.float32]
    geobox: GeoBox
    disputed: int
    warnings: tuple[str, ...]

    def write(
        self,
        path: str | os.PathLike[str],
        overwrite: bool = False,
        creation_options: Mapping[str, Any] | Sequence[str] | None = None,
        mode: str | None = None,
    ) -> None:
        """Write the map; see `BuiltMap.write`."""
        creation = creation_for(creation_options, {os.fspath(path): "float32"})
        write_map(path, self.probabilities, self.geobox, overwrite, mode, creation=creation)


def merge_maps(sources: Sequence[Any], request: MergeRequest = MergeRequest()) -> MergedMap:
    """Merge maps of probabilities; see `occupancy.merge_maps`.

    Parameters
    ----------
    sources : sequence of paths, OccupancyGrids or other sources of `open_probability_map`
    request : MergeRequest

    Raises
    ------
    MapError
        If a map cannot be placed, or lies in another coordinate system than the first; if the merged map
        would have more than 100 million cells, or nothing of it is known and it is to be cropped.
    UavsegError
        If a map cannot be read.
    ParameterError
        If there is no map, or a block map among them.
    """
    if not sources:
        raise ParameterError("name at least one map")
    warnings: list[str] = []
    with phase("maps"):
        maps = [_read_map(source, warnings) for source in sources]
    geobox = common_grid(maps, request.unrotate, request.resolution)
    decided("%d x %d cells", *geobox.shape)
    with phase("merging"):
        probabilities, disputed = merge(maps, geobox)
    if request.crop:
        probabilities, geobox = cropped(probabilities, geobox)
    if disputed:
        cells = "1 cell is" if disputed == 1 else f"{disputed:,} cells are"
        warnings.append(f"{cells} free in one map and occupied in another; they count as occupied")
    return MergedMap(probabilities, geobox, disputed, tuple(warnings))


def _read_map(source: Any, warnings: list[str]) -> PlacedMap:
    if isinstance(source, str | os.PathLike) and Path(source).suffix.lower() in (".pgm", ".png", ".bmp"):
        raise MapError(f"{os.fspath(source)} is a picture without a position; give the .yaml of its map")
    opened = open_probability_map(source)
    if not isinstance(opened, ProbabilityMap):
        raise ParameterError(f"{opened.path} is a block map; name the map that it was made from")
    check_cells(opened.geobox.shape, opened.name)
    grey = opened.grey(TilePass([]))
    rows, cols = opened.geobox.shape
    tile = grey.read(Window(0, 0, rows, cols), 0)
    values = tile.grey[:rows, :cols].astype(np.float32) / np.float32(GREY_MAX)
    unknown = tile.grey[:rows, :cols] == GREY_MAX // 2 + 1  # the grey of exactly 0.5
    values[unknown | (tile.valid[:rows, :cols] == 0)] = 0.5
    warnings.extend(opened.warnings)
    return PlacedMap(opened.name, values, opened.geobox)
