"""The public function for maps as web pages: the words of `uavseg map`."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import work
from uavseg.arguments import checked
from uavseg.jobs.web_map.content import FieldMapRequest, field_map
from uavseg.options.option import build
from uavseg.options.pages import MapOptions
from uavseg.plot.web.page_file import PageFile


@checked
def map_page(
    source: Any,
    output: str | os.PathLike[str],
    *,
    regions: Any = None,
    mission: Any = None,
    camera: Any = None,
    size: int = 2048,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    tile: int | None = None,
    threads: int | None = None,
    resume: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Path:
    """Make one HTML file that shows a raster, regions and missions in a browser without network.

    Parameters
    ----------
    source : path, sequence of paths, DataArray, open raster of rasterio, or Dataset
        Many paths are one mosaic. It has a coordinate system.
    output : path
        The page, .html.
    regions : path or GeoDataFrame, optional
        Where they say how their intensity was made of this raster, the slider shows that one, unless another
        is chosen.
    mission : Mission, path or sequence of these, optional
        What `uavseg.plan` gives, or mission files.
    camera : str, path or Camera, optional
        The camera of the missions, for the footprints of their photographs: a name that `uavseg cameras`
        lists, or a JSON file. By default that of what `uavseg.plan` gives; a file does not hold it.
    size : int
        Longest side of the picture of the raster in pixels, 64 to 8192.
    method, threshold, intensity_step
        How blocks are divided, for the slider of the page; as of `extract`.
    overwrite : bool
        Whether a page that is there may be replaced.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    output : Path

    Raises
    ------
    UavsegError
        If an input cannot be read or has no place on a map in Web Mercator, or the page may not be made.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.map_page("tile.tif", "map.html", regions="regions.gpkg")  # doctest: +SKIP
    """
    options = build(MapOptions, locals())
    request = FieldMapRequest(options.division.segment_params(), size)
    with allowing(allow_path, allow_network):
        page = PageFile.prepared(output, overwrite, source, regions, mission, camera)
        found = field_map(page.open_source(source, options.read), request, work(options.run))
        _, notes = page.write(found)
    for warning in notes:
        warnings.warn(warning, stacklevel=3)
    return page.path
