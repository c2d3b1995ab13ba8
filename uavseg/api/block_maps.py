"""Block maps: the means of uniform blocks of a raster, from which ranges are answered."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from uavseg.access import Folders, allowing
from uavseg.api._values import warn, work
from uavseg.arguments import checked
from uavseg.jobs.divide import divide as run_divide
from uavseg.jobs.source.open_source import open_source
from uavseg.options.option import build
from uavseg.options.regions import DivideOptions

if TYPE_CHECKING:
    from uavseg.segmentation.blocks.block_map import BlockMap


@checked
def divide(
    source: Any,
    *,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    flatten: float | str | None = None,
    tile: int | None = None,
    threads: int | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    allow_path: Folders = (),
    allow_network: bool = False,
) -> BlockMap:
    """The block map of a raster, from which `uavseg.segmentation` answers any range.

    Parameters
    ----------
    source : path, sequence of paths, array, DataArray, open raster of rasterio, Dataset or OccupancyGrid
        The YAML file of a ROS map too.
    band, rgb, index, expr, band_names, nodata, stretch, flatten
    tile, threads : int, optional
    resume : path, optional
    skip_bad_tiles, allow_network : bool
    collar : {"auto", "keep"}
    allow_path : path or sequence of paths
        As of `extract`.
    """
    options = build(DivideOptions, locals())
    with allowing(allow_path, allow_network):
        found = run_divide(open_source(source, options.read), work=work(options.run))
    warn(found.warnings)
    return found.saved.blocks
