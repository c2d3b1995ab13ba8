"""`uavseg divide`: rasters become a block map."""

from __future__ import annotations

from typing import Any

import click

from uavseg.cli._write import keep_inputs
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.raster import (
    flatten_option,
    read_options,
    reading_options,
    segment_params,
    segmenting_options,
)
from uavseg.cli.options.running import RunOptions, running_options


@click.command("divide")
@reading_options
@click.option("-o", "--output", required=True, metavar="PATH.tif", help="The block map.")
@creation_option
@flatten_option
@segmenting_options
@running_options
def command(**options: Any) -> None:
    """Divide RASTER... (many are one mosaic, a YAML file is a ROS map) into blocks of uniform texture.

    The block map is a GeoTIFF of 8 x 8 pixel cells. Its first two bands are for looking at: the mean and the
    side of each leaf; `uavseg preview --leaves` draws the leaves. `uavseg extract` answers any range from it,
    without the raster or refined with it.
    """
    from uavseg.jobs.divide import DivideRequest, divide
    from uavseg.jobs.source.open_source import open_source
    from uavseg.output.atomic import check_target
    from uavseg.segmentation.blocks.block_file import check_block_map_name, write_block_map

    run = RunOptions.of(options)
    output = options["output"]
    check_block_map_name(output)
    creation = creation_of(options, {output: "uint32"})
    check_target(output, run.overwrite)
    keep_inputs([output], options["rasters"])
    request = DivideRequest(segment_params(options, None))
    found = divide(open_source(options["rasters"], read_options(options)), request, run.work())
    write_block_map(output, found.saved, request.segment.division, run.overwrite, creation)
    run.reporter.finish(found.warnings)
    rows, cols = found.saved.blocks.blocks
    flat = found.saved.origin.flatten
    light = {} if flat is None else {"slow light": f"taken away over {flat.removesuffix('px')} {_unit(flat)}"}
    run.reporter.table(
        {
            "blocks": f"{rows * cols:,} of 64 x 64 -> {output}",
            "stretch": found.saved.stretch.name,
            "band": found.saved.band_names,
            **light,
            "seconds": f"{run.reporter.seconds:.2f}",
        }
    )


def _unit(length: str) -> str:
    return "pixels" if length.endswith("px") else "m"
