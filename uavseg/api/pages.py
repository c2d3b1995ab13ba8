"""Web pages for the field: one file, and a local server."""

from __future__ import annotations

import os
import tempfile
import threading
from contextvars import Context, copy_context
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import job_function, warn, work
from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.execution.executors import threads as thread_pool
from uavseg.flight.camera.camera import cameras
from uavseg.jobs.source.open_source import open_source, raster_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import Work
from uavseg.jobs.web_map.content import CellTiles, FieldMapRequest, field_map, has_map_tiles
from uavseg.options.flights import Paths
from uavseg.options.option import build
from uavseg.options.pages import MapOptions, ServeOptions
from uavseg.plot.web.field_map import PageFile, page_of
from uavseg.server.local_server import Answer, LocalServer, Tasks
from uavseg.server.site import Flown, Site

NO_TILES = (
    "without tiles the picture is all there is when the map is zoomed: they need rio-tiler "
    "(pip install 'uavseg[serve]')"
)


class MapServer:
    """A local server of maps, that answers until it is closed; port 0 is any that is free."""

    def __init__(
        self,
        source: Source,
        request: FieldMapRequest,
        work: Work,
        port: int = 0,
        photos: Paths = None,
        mission: Any = None,
    ) -> None:
        flown = None if photos is None and mission is None else Flown.of(photos, mission)
        raster = raster_of(source, "a block map holds no picture; name the raster that it was made from")
        found = field_map(raster, replace(request, all_cells=True), work)
        cells = None if found.fits_page else CellTiles.of(found)
        cleaned = raster.cleaned(work.over(raster).silent)  # found already
        tiles = cleaned if has_map_tiles(cleaned) else None
        self.warnings = found.warnings if tiles else (*found.warnings, NO_TILES)
        if flown is not None:
            self.warnings = (*self.warnings, *flown.warnings)
        names = [one.name for one in cameras()]
        areas = None if cells is None else [float(f"{area:.10g}") for area in cells.areas]  # by their codes
        offered = {"tiles": tiles is not None, "cameras": names, "areas": areas}
        if flown is not None:
            offered |= {"footprints": flown.footprints, "gaps": flown.gaps is not None}
        page = page_of(found, None, flown.missions if flown else [], offered)
        self._folder = tempfile.TemporaryDirectory(prefix="uavseg-serve-", ignore_cleanup_errors=True)
        self._tasks = Tasks(Path(self._folder.name))
        found = replace(found, cells=None)  # in the page, or in tiles
        gaps = flown.gaps if flown else None
        site = Site(raster, request, found, page, self._tasks, tiles, cells, gaps)
        try:
            self._server = LocalServer(partial(_within, copy_context(), site), port)
        except (OSError, OverflowError) as error:
            self._folder.cleanup()
            raise ParameterError(f"port {port} cannot be used ({error}); 0 is any that is free") from error
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """The address of the page: who knows it, may use the server."""
        return self._server.url

    def wait(self) -> None:
        """Wait until the server is closed, or Ctrl-C."""
        while self._thread.is_alive():
            self._thread.join(0.5)

    def close(self) -> None:
        """Stop jobs and the server; the files of results are deleted."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
        self._tasks.stop_all()
        self._folder.cleanup()

    def __enter__(self) -> MapServer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _within(context: Context, site: Site, method: str, path: str, body: bytes) -> Answer:
    """Return the answer, with the access to files that was allowed when the server was made."""
    return context.copy().run(site.answer, method, path, body)


@job_function
def serve(
    source: Any,
    *,
    port: int = 0,
    photos: Paths = None,
    mission: Any = None,
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
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> MapServer:
    """Serve the page of a raster to a browser on this computer, with exact regions and missions.

    Parameters
    ----------
    source, size, method, threshold, intensity_step
        As of `map_page`.
    port : int
        Of 127.0.0.1; 0 is any that is free.
    photos : path or sequence of paths, optional
        Photographs that came back from a flight, files or folders: the page shows their footprints.
    mission : path or Mission, optional
        With `photos`, the mission that was flown: the page shows what they missed, as regions.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    server : MapServer
        Its `url` is the address; it answers until `close` is called, or the end of a `with` block.

    Raises
    ------
    UavsegError
        If the raster or the photographs cannot be read, the raster has no place on a map in Web Mercator, or
        the port is not free.

    Examples
    --------
    >>> import uavseg
    >>> with uavseg.serve("tile.tif") as server:  # doctest: +SKIP
    ...     print(server.url)
    ...     server.wait()
    """
    options = build(ServeOptions, locals())
    request = FieldMapRequest(options.division.segment_params(), size)
    run = thread_pool(threads)
    raster = open_source(source, options.read)
    return MapServer(raster, request, Work(tile, run, run), port, photos, mission)


@checked
def map_page(
    source: Any,
    output: str | os.PathLike[str],
    *,
    regions: Any = None,
    mission: Any = None,
    camera: Any = None,
    installable: bool = False,
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
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
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
    installable : bool
        Whether to write STEM.sw.js and STEM.webmanifest beside the page: from a web server (https), a browser
        keeps it at the first visit, shows it without network, and can install it.
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
        page = PageFile.prepared(output, overwrite, source, regions, mission, camera, installable)
        found = field_map(page.open_source(source, options.read), request, work(options.run))
        _, notes = page.write(found)
    warn(notes)
    return page.path
