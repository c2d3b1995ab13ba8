"""`uavseg divide`, `levels` and `original`: the block map of rasters, levels of v, and the original LBP/C."""

from typing import TYPE_CHECKING

import click

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.options.regions import DivideOptions, LevelsOptions, OriginalOptions
from uavseg.plain_text import first_of

if TYPE_CHECKING:
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.segment_classes import LevelsRequest

_LISTED = 8  # levels in the table at the end


@job_command("divide", DivideOptions)
def command(options: DivideOptions, reporter: Reporter) -> None:
    """Divide RASTER... (many are one mosaic, a YAML file is a ROS map) into blocks of uniform texture.

    The block map is a GeoTIFF of 8 x 8 pixel cells. Its first two bands are for looking at: the mean and the
    side of each leaf; `uavseg preview --leaves` draws the leaves. `uavseg extract` answers any range from it,
    without the raster or refined with it.
    """
    from uavseg.jobs.divide import divide
    from uavseg.jobs.source.open_source import open_source
    from uavseg.segmentation.blocks.block_file import check_block_map_name, write_block_map

    output, overwrite, rasters = options.output, options.files.overwrite, options.source.rasters
    check_block_map_name(output)
    creation = write.creation_of(options.creation, {output: "uint32"})
    write.check_output(output, overwrite, rasters)
    division = options.division.segment_params().division
    found = divide(open_source(rasters, options.read), work_of(options.run, reporter))
    write_block_map(output, found.saved, division, overwrite, creation)
    reporter.finish(found.warnings)
    rows, cols = found.saved.blocks.blocks
    width = found.saved.origin.flatten
    unit = "pixels" if width is not None and width.endswith("px") else "m"
    flat = {} if width is None else {"slow light": f"taken away over {width.removesuffix('px')} {unit}"}
    reporter.timed_table(
        blocks=f"{rows * cols:,} of 64 x 64 -> {output}",
        stretch=found.saved.stretch.name,
        band=found.saved.band_names,
        **flat,
    )


@job_command("levels", LevelsOptions)
def levels(options: LevelsOptions, reporter: Reporter) -> None:
    """Divide RASTER... (many are one mosaic) into levels of v: 0..P, P..2P, and so on up to 1.

    A segment is what adjacent pixels of one level make together; a value on an edge belongs to the level
    below it. Each segment has its level, counted from 0, and the interval of that level; adjacent segments
    share their borders. RASTER may also be a block map from `uavseg divide`, or the YAML file of a ROS map,
    which is never stretched. For another map of probabilities, say --stretch none.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names), ITEM.json#ASSET (of STAC) or -
    (names on standard input). Its rasters are one mosaic, unless --each is given.
    """
    from uavseg.jobs.requests import region_job
    from uavseg.jobs.source.open_source import open_source

    if (options.width is None) == (options.breaks is None):
        raise click.UsageError("give --width P, or --breaks V,V,... (or otsu, quantile)")
    job = region_job(options)
    if write.answer_each(options, job, ".levels.geojson", reporter):
        return
    files = write.RegionFiles(options, ".levels.geojson")
    source = open_source(options.source.rasters, job.read)
    files.check_crs(source.geobox.wkt)
    work = work_of(options.run, reporter)
    found = job.find(source, work)
    reporter.finish([*found.warnings, *files.notes(found, source.geobox.wkt)])
    with write.transaction():
        files.write(found, work)
    reporter.timed_table(
        segments=f"{len(found.regions):,} -> {write.shown(files.target)}",
        levels=_levels_row(found, job.request),
        **write.summary_rows(found),
    )


def _width(found: "Extraction", width: float) -> str:
    """Return the width of a level in v, and in values where they are known."""
    if found.axis is None:
        return f"{width:g} of v"
    first, last = found.axis.values([0, width]).tolist()
    unit = f" {found.axis.unit}" if found.axis.unit else " in values"
    return f"{width:g} of v ({abs(last - first):.6g}{unit})"


def _levels_row(found: "Extraction", request: "LevelsRequest") -> str:
    """Return how many levels there are, for the table at the end."""
    from uavseg.jobs.segment_classes import BreakChoice
    from uavseg.segmentation.params.segment import Levels

    there = len(set(found.regions.columns["level"].tolist()))
    wanted = request.levels
    if isinstance(wanted, BreakChoice):
        ends = (found.regions.columns[name].tolist() for name in ("range_low", "range_high"))
        intervals = sorted(set(zip(*ends, strict=True)))
        bounds = [f"{low:.7g}..{high:.7g}" for low, high in intervals]
        return f"{there:,} by {wanted.rule}: {first_of(bounds, _LISTED)}"
    each = f", each {_width(found, wanted.width)} wide" if isinstance(wanted, Levels) else ""
    return f"{there:,} of {wanted.count:,} are there{each}"


@job_command("original", OriginalOptions)
def original(options: OriginalOptions, reporter: Reporter) -> None:
    """Segment RASTER... (many are one mosaic) by texture alone, as Ojala and Pietikäinen did in 1999.

    The baseline: blocks are divided, adjacent regions of like texture merged, boundary pixels classified one
    by one. All of the image is held in memory, at most 4096 x 4096 pixels. RASTER may be the YAML file of a
    ROS map. `uavseg preview --labels` draws the segments.
    """
    from uavseg.jobs.original import original
    from uavseg.jobs.source.open_source import open_source
    from uavseg.raster.formats.geotiff import check_geotiff_name, write_label_geotiff
    from uavseg.raster.grid.tiling import Window
    from uavseg.segmentation.lbpc import LbpcParams

    output, overwrite, rasters = options.output, options.files.overwrite, options.source.rasters
    names = ("threshold", "untested", "radius", "sweeps")
    request = LbpcParams(stop=options.merge_stop, **{name: getattr(options, name) for name in names})
    check_geotiff_name(output, "a label raster")
    creation = write.creation_of(options.creation, {output: "uint32"})
    write.check_output(output, overwrite, rasters)
    found = original(open_source(rasters, options.read), request, work_of(options.run, reporter))
    geobox = found.source.geobox
    tiles = [(Window(0, 0, *geobox.shape), found.labels)]
    write_label_geotiff(output, tiles, geobox, overwrite, creation=creation)
    reporter.finish(found.warnings)
    reporter.timed_table(
        segments=f"{int(found.labels.max()):,} -> {output}",
        stretch=found.source.stretch.name,
        band=found.source.band_names,
    )
