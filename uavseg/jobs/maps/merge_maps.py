"""Map merging job: maps of robots become one, cropped to its known cells and unrotated on request."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.arrays import Float32s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.source.open_source import map_of, open_probability_map
from uavseg.jobs.source.source import Pixels
from uavseg.occupancy.map_file import WritableMap
from uavseg.occupancy.mapping.grid_io import check_cells
from uavseg.occupancy.several_maps import PlacedMap, common_grid, cropped, merge
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.units import GREY_MAX

_LEAST_M = 1e-6  # the side of a cell: far smaller ones make more cells than there are numbers


@dataclass(frozen=True, slots=True, eq=False)
class MergedMap(WritableMap):
    """A map merged from others."""

    probabilities: Float32s  # (rows, cols): exactly 0.5 where unknown
    geobox: GeoBox
    disputed: int  # cells that are free in one map and occupied in another, and hence occupied
    warnings: tuple[str, ...]


def merge_maps(
    sources: Sequence[Any], crop: bool = False, unrotate: bool = False, resolution: float | None = None
) -> MergedMap:
    """Merge maps of probabilities, sources of `open_probability_map`; see `occupancy.several_maps`.

    The grid is that of the first map, extended; with `crop` only as far as cells are known, with `unrotate`
    with a yaw of 0, or of another `resolution`, the side of a cell in metres.
    """
    if resolution is not None and not _LEAST_M <= resolution < float("inf"):
        raise ParameterError(f"resolution is metres per cell, {_LEAST_M:f} or more, not {resolution:g}")
    if not sources:
        raise ParameterError("name at least one map")
    warnings: list[str] = []
    with phase("maps"):
        maps = [read_map(source, warnings) for source in sources]
    geobox = common_grid(maps, unrotate, resolution)
    decided("%d x %d cells", *geobox.shape)
    with phase("merging"):
        probabilities, disputed = merge(maps, geobox)
    if crop:
        probabilities, geobox = cropped(probabilities, geobox)
    if disputed:
        cells = "1 cell is" if disputed == 1 else f"{disputed:,} cells are"
        warnings.append(f"{cells} free in one map and occupied in another; they count as occupied")
    return MergedMap(probabilities=probabilities, geobox=geobox, disputed=disputed, warnings=tuple(warnings))


def read_map(source: Any, warnings: list[str]) -> PlacedMap:
    """Read a whole map of probabilities, exactly 0.5 where it is unknown; `warnings` grow."""
    if isinstance(source, str | os.PathLike) and Path(source).suffix.lower() in (".pgm", ".png", ".bmp"):
        raise MapError(f"{os.fspath(source)} is a picture without a position; give the .yaml of its map")
    opened = map_of(open_probability_map(source), "name the map that it was made from")
    warnings.extend(opened.warnings)
    return placed_map(opened)


def placed_map(opened: Pixels) -> PlacedMap:
    """Read a whole map of probabilities; cells without data are unknown. MapError if it is too large."""
    check_cells(opened.geobox.shape, opened.name)
    grey = opened.grey(TilePass([]))
    rows, cols = opened.geobox.shape
    tile = grey.read(Window(0, 0, rows, cols), 0)
    values = tile.grey[:rows, :cols].astype(np.float32) / np.float32(GREY_MAX)
    unknown = tile.grey[:rows, :cols] == GREY_MAX // 2 + 1  # the grey of exactly 0.5
    values[unknown | (tile.valid[:rows, :cols] == 0)] = 0.5
    return PlacedMap(name=opened.name, probabilities=values, geobox=opened.geobox)
