"""`uavseg serve`: the page of a raster from a local server, with exact regions and missions."""

from __future__ import annotations

from typing import Any

import click

from uavseg.cli.options.raster import read_options, reading_options, segment_params, segmenting_options
from uavseg.cli.options.running import RunOptions, computing_options
from uavseg.cli.terminal.say import show


@click.command("serve")
@reading_options
@click.option(
    "--port", default=0, metavar="N", help="Port of 127.0.0.1; 0 is any that is free.", show_default=True
)
@click.option(
    "--size", default=2048, show_default=True, help="Longest side of the picture of the raster, in pixels."
)
@segmenting_options
@computing_options
def command(**options: Any) -> None:
    """Serve the page of RASTER... (many are one mosaic) to a browser on this computer, until Ctrl-C.

    The page is that of `uavseg map`, with tiles in full resolution, exact regions of a range or like a
    sample, keep-out zones and home drawn on the map, and missions; its files are those that the commands
    write. They are in a folder of its own, which is deleted at the end; no other is written. Only programs
    of this computer that know the printed address are answered.
    """
    from uavseg.api.serve import MapServer
    from uavseg.jobs.source.open_source import open_source
    from uavseg.jobs.web_map.content import FieldMapRequest
    from uavseg.output.written import note_ended

    run = RunOptions.of(options)
    request = FieldMapRequest(segment_params(options, None), options["size"])
    source = open_source(options["rasters"], read_options(options))
    with MapServer(source, request, run.work(), options["port"]) as server:
        note_ended("the server is closed, and the files of its jobs are deleted")
        run.reporter.finish(server.warnings)
        show(f"{server.url}")
        server.wait()
