"""The public function for pictures: the words of `uavseg preview`."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import warn
from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.jobs.source.open_source import open_pixels
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.jobs.source.work import Work
from uavseg.options.option import build
from uavseg.options.pages import PreviewOptions
from uavseg.plot.preview import preview as draw_raster
from uavseg.plot.preview_missions import preview_missions

_LAYERS = ("regions", "states", "leaves", "labels", "levels", "path")
_OF_RASTERS = (*_LAYERS, "band", "rgb", "index", "expr", "band_names", "nodata", "bounds", "aoi")


@checked
def preview(
    source: Any = None,
    output: str | os.PathLike[str] | None = None,
    *,
    regions: Any = None,
    mission: Any = None,
    states: Any = None,
    leaves: Any = None,
    labels: Any = None,
    levels: Any = None,
    path: Any = None,
    dem: Any = None,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    width: int = 1400,
    overwrite: bool = False,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Path:
    """Draw a raster with what was found in it, or missions alone, as a PNG picture.

    Parameters
    ----------
    source : path, sequence of paths, array, DataArray, open raster of rasterio or Dataset, optional
        Many paths are one mosaic; the YAML file of a ROS map is a raster too. Without it, missions are drawn
        on a blank map, with a profile of their heights below.
    output : path, optional
        The picture, .png; by default STEM.preview.png in the working directory.
    regions : path or GeoDataFrame, optional
    mission : Mission, path or sequence of these, optional
        What `uavseg.plan` gives, or mission files.
    states, leaves, labels, levels, path : optional
        What classify, divide, original (or another command with labels), levels and path wrote, as files;
        levels may be a GeoDataFrame, and path what `uavseg.path` gives.
    dem : path or sequence of paths, optional
        For missions without a raster: the ground below them.
    band, rgb, index, expr, band_names, nodata, stretch, skip_bad_tiles, collar
    bounds, aoi, warp, allow_path, allow_network
        As of `extract`.
    width : int
        Width of the picture in pixels, 200 to 8000.
    overwrite : bool
        Whether a picture that is there may be replaced.

    Returns
    -------
    output : Path

    Raises
    ------
    UavsegError
        If an input cannot be read or does not belong to the raster, or the picture may not be made.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.preview("tile.tif", regions="regions.gpkg")  # doctest: +SKIP
    """
    given = locals()
    with allowing(allow_path, allow_network):
        if source is None:
            if mission is None:
                raise ParameterError("there is nothing to draw: give a raster, or a mission")
            if warp or any(given[name] is not None for name in _OF_RASTERS):
                raise ParameterError("without a raster, missions alone are drawn; give source as well")
            target = output or f"{_stem(mission)}.preview.png"
            return preview_missions(mission, target, dem=dem, width_px=width, overwrite=overwrite)
        if dem is not None:
            raise ParameterError(
                "dem is for the profile of a mission without a raster; leave source or dem out"
            )
        read = build(PreviewOptions, given).read
        opened = open_pixels(source, replace(read, stretch=None))
        how: Any = read.spec
        if isinstance(opened, ProbabilityMap) and stretch == "auto":
            how = opened.stretch
        work = replace(Work(), bad_blocks=set())
        with work.reading_here():
            result = draw_raster(
                opened.dataset,
                output or f"{Path(opened.name).stem}.preview.png",
                mission=mission,
                **{name: given[name] for name in _LAYERS},
                stretch=how,
                collar="keep" if isinstance(opened, ProbabilityMap) else collar,
                width_px=width,
                overwrite=overwrite,
            )
    warn((*opened.warnings, *work.bad_block_warnings))
    return result


def _stem(mission: Any) -> str:
    first = mission[0] if isinstance(mission, list | tuple) and mission else mission
    if isinstance(first, str | os.PathLike):
        return Path(first).stem
    return str(getattr(first, "name", "") or "mission")
