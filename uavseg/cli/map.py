"""`uavseg map`: a raster with regions and missions as a web page that needs no network."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.options.pages import MapOptions


@job_command("map", MapOptions)
def command(options: MapOptions) -> None:
    """Make one HTML file of RASTER... (many are one mosaic) that a browser shows without network: the raster,
    regions, missions, and a slider that extracts regions of a range at the scale of blocks.

    Its regions are those of `uavseg extract` from the block map that divide writes, with --refine none, for
    ranges in thousandths of v, of the intensity that --regions were made from where they say it and no other
    is chosen. Regions are chosen by tick boxes and downloaded as GeoJSON.
    """
    from uavseg.jobs.web_map.content import FieldMapRequest, field_map
    from uavseg.plot.web.field_map import PageFile
    from uavseg.raster.read.source_list import stem_of

    reporter = Reporter(options.messages, options.progress)
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
