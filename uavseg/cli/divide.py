"""`uavseg divide`: rasters become a block map."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import creation_of, keep_inputs
from uavseg.options.regions import DivideOptions


@job_command("divide", DivideOptions)
def command(options: DivideOptions) -> None:
    """Divide RASTER... (many are one mosaic, a YAML file is a ROS map) into blocks of uniform texture.

    The block map is a GeoTIFF of 8 x 8 pixel cells. Its first two bands are for looking at: the mean and the
    side of each leaf; `uavseg preview --leaves` draws the leaves. `uavseg extract` answers any range from it,
    without the raster or refined with it.
    """
    from uavseg.jobs.divide import divide
    from uavseg.jobs.source.open_source import open_source
    from uavseg.output.atomic import check_target
    from uavseg.segmentation.blocks.block_file import check_block_map_name, write_block_map

    reporter = Reporter(options.messages, options.progress)
    output, overwrite, rasters = options.output, options.files.overwrite, options.source.rasters
    check_block_map_name(output)
    creation = creation_of(options.creation, {output: "uint32"})
    check_target(output, overwrite)
    keep_inputs([output], rasters)
    segment = options.division.segment_params()
    found = divide(open_source(rasters, options.read), segment, work_of(options.run, reporter))
    write_block_map(output, found.saved, segment.division, overwrite, creation)
    reporter.finish(found.warnings)
    rows, cols = found.saved.blocks.blocks
    width = found.saved.origin.flatten
    unit = "pixels" if width is not None and width.endswith("px") else "m"
    flat = {} if width is None else {"slow light": f"taken away over {width.removesuffix('px')} {unit}"}
    reporter.table(
        blocks=f"{rows * cols:,} of 64 x 64 -> {output}",
        stretch=found.saved.stretch.name,
        band=found.saved.band_names,
        **flat,
        seconds=f"{reporter.seconds:.2f}",
    )
