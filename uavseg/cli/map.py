"""`uavseg map`: a raster with regions and missions as a web page that needs no network."""

from __future__ import annotations

from typing import Any

import click

from uavseg.cli._write import keep_inputs
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
    ranges in thousandths of v. Regions are chosen by tick boxes and downloaded as GeoJSON.
    """
    from uavseg.jobs.field_map import FieldMapRequest, field_map
    from uavseg.jobs.open_source import open_source
    from uavseg.plot.web.field_map import (
        check_page_target,
        footprint_notes,
        page_of,
        read_flights,
        size_notes,
        write_page,
    )
    from uavseg.plot.web.region_features import read_collection

    run = RunOptions.of(options)
    output, regions, missions = options["output"], options["regions"], options["mission"]
    camera = options["camera"]
    check_page_target(output, run.overwrite)
    keep_inputs([output], options["rasters"], regions, missions, camera)
    request = FieldMapRequest(segment_params(options, None), options["size"])
    collection = None if regions is None else read_collection(regions)
    flights = read_flights(missions, camera) if missions else []
    found = field_map(open_source(options["rasters"], read_options(options)), request, run.work())
    content = page_of(found, collection, flights)
    write_page(content, output, run.overwrite)
    run.reporter.finish((*found.warnings, *footprint_notes(flights, camera), *size_notes(content)))
    rows, cols = found.image.shape
    run.reporter.table(
        {
            "page": f"{len(content) / 1e6:.2f} MB -> {output}",
            "picture": f"{cols} x {rows} pixels",
            "regions": "-" if collection is None else f"{len(collection['features']):,}",
            "missions": f"{len(flights)}",
            "seconds": f"{run.reporter.seconds:.2f}",
        }
    )
