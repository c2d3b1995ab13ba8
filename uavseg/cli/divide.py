"""`uavseg divide` and `uavseg original`: the block map of rasters, and the original LBP/C, for comparison."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import creation_of, keep_inputs
from uavseg.options.regions import DivideOptions, OriginalOptions


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


@job_command("original", OriginalOptions)
def original(options: OriginalOptions) -> None:
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
    from uavseg.segmentation.lbpc import LbpcParams

    reporter = Reporter(options.messages, options.progress)
    output, overwrite, rasters = options.output, options.files.overwrite, options.source.rasters
    names = ("threshold", "untested", "radius", "sweeps")
    request = LbpcParams(stop=options.merge_stop, **{name: getattr(options, name) for name in names})
    check_geotiff_name(output, "a label raster")
    creation = creation_of(options.creation, {output: "uint32"})
    check_target(output, overwrite)
    keep_inputs([output], rasters)
    found = original(open_source(rasters, options.read), request, work_of(options.run, reporter))
    geobox = found.source.geobox
    tiles = [(Window(0, 0, *geobox.shape), found.labels)]
    write_label_geotiff(output, tiles, geobox, overwrite, creation=creation)
    reporter.finish(found.warnings)
    reporter.table(
        segments=f"{int(found.labels.max()):,} -> {output}",
        stretch=found.source.stretch.name,
        band=found.source.band_names,
        seconds=f"{reporter.seconds:.2f}",
    )
