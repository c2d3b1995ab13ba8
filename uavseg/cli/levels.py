"""`uavseg levels`: rasters, or a block map, divided into levels between breaks of v."""

from typing import TYPE_CHECKING

import click

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import RegionFiles, answer_each, shown, summary_rows, transaction
from uavseg.options.regions import LevelsOptions
from uavseg.plain_text import first_of

if TYPE_CHECKING:
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.segment_classes import LevelsRequest

_LISTED = 8  # levels in the table at the end


@job_command("levels", LevelsOptions)
def command(options: LevelsOptions) -> None:
    """Divide RASTER... (many are one mosaic) into levels of v: 0..P, P..2P, and so on up to 1.

    A segment is what adjacent pixels of one level make together; a value on an edge belongs to the level
    below it. Each segment has its level, counted from 0, and the interval of that level; adjacent segments
    share their borders. RASTER may also be a block map from `uavseg divide`, or the YAML file of a ROS map,
    which is never stretched. For another map of probabilities, say --stretch none.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names) or - (names on standard input). Its
    rasters are one mosaic, unless --each is given.
    """
    from uavseg.jobs.requests import region_job
    from uavseg.jobs.source.open_source import open_source

    reporter = Reporter(options.messages, options.progress)
    if (options.width is None) == (options.breaks is None):
        raise click.UsageError("give --width P, or --breaks V,V,... (or otsu, quantile)")
    job = region_job(options)
    if answer_each(options, job, ".levels.geojson", reporter):
        return
    files = RegionFiles(options, ".levels.geojson")
    source = open_source(options.source.rasters, job.read)
    files.check_crs(source.geobox.wkt)
    work = work_of(options.run, reporter)
    found = job.find(source, work)
    reporter.finish([*found.warnings, *files.notes(found, source.geobox.wkt)])
    with transaction():
        files.write(found, work)
    reporter.table(
        segments=f"{len(found.regions):,} -> {shown(files.target)}",
        levels=_levels_row(found, job.request),
        **summary_rows(found),
        seconds=f"{reporter.seconds:.2f}",
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
    from uavseg.jobs.ranges.level_breaks import BreakChoice
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
