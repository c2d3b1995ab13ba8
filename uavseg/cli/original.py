"""`uavseg original`: the original LBP/C, for comparison."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import creation_of, keep_inputs
from uavseg.options.regions import OriginalOptions


@job_command("original", OriginalOptions)
def command(options: OriginalOptions) -> None:
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
