"""`uavseg map`: a raster with regions and missions as a web page that needs no network."""

from __future__ import annotations

from typing import Any

import click

from uavseg.cli.options.raster import read_options, reading_options, segment_params, segmenting_options
from uavseg.cli.options.running import RunOptions, running_options


@click.command("map")
@reading_options
@click.option(
    "--regions", type=click.Path(), help="Regions to show: a file that extract wrote, or any polygons."
)
@click.option(
    "--mission",
    multiple=True,
    type=click.Path(),
    help="Mission to show, in any format of uavseg plan. May be given several times.",
)
@click.option(
    "--camera",
    metavar="NAME|FILE.json",
    help="The camera of the missions, for the footprints of their photographs; uavseg cameras lists them.",
)
@click.option("-o", "--output", required=True, metavar="PATH.html", help="The page.")
@click.option(
    "--size", default=2048, show_default=True, help="Longest side of the picture of the raster, in pixels."
)
@segmenting_options
@running_options
def command(**options: Any) -> None:
    """Make one HTML file of RASTER... (many are one mosaic) that a browser shows without network: the raster,
    regions, missions, and a slider that extracts regions of a range at the scale of blocks.

    Its regions are those of `uavseg extract` from the block map that divide writes, with --refine none, for
    ranges in thousandths of v, of the intensity that --regions were made from where they say it and no other
    is chosen. Regions are chosen by tick boxes and downloaded as GeoJSON.
    """
    from uavseg.jobs.web_map.content import FieldMapRequest, field_map
    from uavseg.plot.web.page_file import PageFile

    run = RunOptions.of(options)
    request = FieldMapRequest(segment_params(options, None), options["size"])
    shown = options["regions"], options["mission"] or None, options["camera"]
    page = PageFile.prepared(options["output"], run.overwrite, options["rasters"], *shown)
    source = page.open_source(options["rasters"], read_options(options))
    found = field_map(source, request, run.work())
    size, notes = page.write(found)
    run.reporter.finish(notes)
    rows, cols = found.image.shape
    run.reporter.table(
        {
            "page": f"{size / 1e6:.2f} MB -> {options['output']}",
            "picture": f"{cols} x {rows} pixels",
            "intensity": f"{found.info.band_names}, stretch {found.info.stretch.name}",
            "regions": "-" if page.regions is None else f"{len(page.regions['features']):,}",
            "missions": f"{len(page.flights)}",
            "seconds": f"{run.reporter.seconds:.2f}",
        }
    )
