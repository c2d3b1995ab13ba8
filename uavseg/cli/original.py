"""`uavseg original`: the original LBP/C, for comparison."""

from __future__ import annotations

from typing import Any

import click

from uavseg.cli._write import keep_inputs
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.raster import read_options, reading_options
from uavseg.cli.options.running import RunOptions, running_options


@click.command("original")
@reading_options
@click.option("-o", "--output", required=True, metavar="LABELS.tif", help="The labels of the segments.")
@creation_option
@click.option(
    "--threshold",
    type=float,
    default=1.2,
    show_default=True,
    metavar="X",
    help="Divide where G_max / G_min is larger.",
)
@click.option(
    "--merge-stop",
    type=float,
    default=2.0,
    show_default=True,
    metavar="Y",
    help="Stop merging where MI / (largest MI before) is larger.",
)
@click.option(
    "--untested",
    type=float,
    default=0.1,
    show_default=True,
    metavar="SHARE",
    help="Of all possible merges, during which that is not tested.",
)
@click.option(
    "--radius", type=int, default=11, show_default=True, metavar="PIXELS", help="Of the disc around a pixel."
)
@click.option(
    "--sweeps", type=int, default=32, show_default=True, metavar="N", help="Over the pixels along boundaries."
)
@running_options
def command(**options: Any) -> None:
    """Segment RASTER... (many are one mosaic) by texture alone, as Ojala and Pietikäinen did in 1999.

    The baseline: blocks are divided, adjacent regions of like texture merged, boundary pixels classified one
    by one. All of the image is held in memory, at most 4096 x 4096 pixels. RASTER may be the YAML file of a
    ROS map. `uavseg preview --labels` draws the segments.
    """
    from uavseg.jobs.original import original
    from uavseg.jobs.source.open_source import open_source
    from uavseg.output.atomic import check_target
    from uavseg.raster.formats.geotiff import check_geotiff_name, write_label_geotiff
    from uavseg.raster.grid.tiling import Window
    from uavseg.segmentation.baseline.lbpc import LbpcParams

    run = RunOptions.of(options)
    output = options["output"]
    names = ("threshold", "merge_stop", "untested", "radius", "sweeps")
    request, read = LbpcParams(*(options[name] for name in names)), read_options(options)
    check_geotiff_name(output, "a label raster")
    creation = creation_of(options, {output: "uint32"})
    check_target(output, run.overwrite)
    keep_inputs([output], options["rasters"])
    found = original(open_source(options["rasters"], read), request, run.work())
    geobox = found.source.geobox
    tiles = [(Window(0, 0, *geobox.shape), found.labels)]
    write_label_geotiff(output, tiles, geobox, run.overwrite, creation=creation)
    run.reporter.finish(found.warnings)
    run.reporter.table(
        {
            "segments": f"{int(found.labels.max()):,} -> {output}",
            "stretch": found.source.stretch.name,
            "band": found.source.band_names,
            "seconds": f"{run.reporter.seconds:.2f}",
        }
    )
