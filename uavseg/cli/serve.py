"""`uavseg serve`: the page of a raster from a local server, with exact regions and missions."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, show, work_of
from uavseg.options.pages import ServeOptions


@job_command("serve", ServeOptions)
def command(options: ServeOptions) -> None:
    """Serve the page of RASTER... (many are one mosaic) to a browser on this computer, until Ctrl-C.

    The page is that of `uavseg map`, with tiles in full resolution, exact regions of a range or like a
    sample, keep-out zones and home drawn on the map, and missions; with --photos, the footprints of
    photographs and what they missed. Its files are those that the commands write. They are in a folder of its
    own, which is deleted at the end; no other is written. Only programs of this computer that know the
    printed address are answered.
    """
    from uavseg.api.pages import MapServer
    from uavseg.jobs.source.open_source import open_source
    from uavseg.jobs.web_map.content import FieldMapRequest
    from uavseg.output.disk import written_here

    reporter = Reporter(options.messages, options.progress)
    request = FieldMapRequest(options.division.segment_params(), options.size.size)
    source = open_source(options.source.rasters, options.read)
    work, photos, mission = work_of(options.run, reporter), options.photos, options.mission
    with MapServer(source, request, work, options.port, photos=photos, mission=mission) as server:
        written_here().ended = "the server is closed, and the files of its jobs are deleted"
        reporter.finish(server.warnings)
        show(f"{server.url}")
        server.wait()
