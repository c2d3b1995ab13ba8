"""`uavseg map` and `uavseg serve`: the page of a raster, in one file or from a local server."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, show, work_of
from uavseg.options.pages import MapOptions, ServeOptions


@job_command("map", MapOptions)
def command(options: MapOptions, reporter: Reporter) -> None:
    """Make one HTML file of RASTER... (many are one mosaic) that a browser shows without network: the raster,
    regions, missions, and a slider that extracts regions of a range at the scale of blocks.

    Its regions are those of `uavseg extract` from the block map that divide writes, with --refine none, for
    ranges in thousandths of v, of the intensity that --regions were made from where they say it and no other
    is chosen. Regions are chosen by tick boxes and downloaded as GeoJSON.
    """
    from uavseg.jobs.web_map.content import FieldMapRequest, field_map
    from uavseg.plot.web.field_map import PageFile
    from uavseg.raster.read.source_list import stem_of

    request = FieldMapRequest(options.division.segment_params(), options.size.size)
    rasters, overwrite = options.source.rasters, options.files.overwrite
    output = options.output or f"{stem_of(rasters[0])}.map.html"
    page = PageFile.prepared(output, overwrite, rasters, options.regions, options.mission, options.camera)
    source = page.open_source(rasters, options.read)
    found = field_map(source, request, work_of(options.run, reporter))
    size, notes = page.write(found)
    reporter.finish(notes)
    rows, cols = found.image.shape
    reporter.table(
        page=f"{size / 1e6:.2f} MB -> {output}",
        picture=f"{cols} x {rows} pixels",
        intensity=f"{found.info.band_names}, stretch {found.info.stretch.name}",
        regions="-" if page.regions is None else f"{len(page.regions['features']):,}",
        missions=f"{len(page.flights)}",
        seconds=f"{reporter.seconds:.2f}",
    )


@job_command("serve", ServeOptions)
def serve(options: ServeOptions, reporter: Reporter) -> None:
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

    request = FieldMapRequest(options.division.segment_params(), options.size.size)
    source = open_source(options.source.rasters, options.read)
    work, photos, mission = work_of(options.run, reporter), options.photos, options.mission
    with MapServer(source, request, work, options.port, photos=photos, mission=mission) as server:
        written_here().ended = "the server is closed, and the files of its jobs are deleted"
        reporter.finish(server.warnings)
        show(f"{server.url}")
        server.wait()
