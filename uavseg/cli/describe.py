"""`uavseg describe` and `uavseg recognise`: measures of regions or of a map's objects, and their names."""

from collections.abc import Callable
from typing import Any

import click

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.options.maps import DescribeOptions, RecogniseOptions


@job_command("describe", DescribeOptions)
def command(options: DescribeOptions) -> None:
    """Measure the shape, texture and bands of REGIONS, or of the occupied objects of MAP.

    REGIONS is a file of polygons, such as `uavseg extract` writes. MAP is a raster of probabilities or the
    YAML file of a ROS map; its objects also have the share of their outline that was seen.
    """
    from uavseg.jobs.maps.recognition import described

    run_described(options, described)


def run_described(options: Any, job: Callable[..., Any], library: str | None = None) -> None:
    """Run a job that gives described regions and write them; with a library, count their names."""
    from uavseg.regions.formats import export

    target, overwrite = options.output, options.files.overwrite
    reporter = Reporter(options.messages, options.progress)
    write.check_targets(target, None, overwrite)
    write.keep_inputs([target], options.source, options.raster, library)
    found = job(options, work_of(options.run, reporter))
    reporter.finish([*found.warnings, *export.format_notes(found.regions, target or "")])
    if target is not None:
        export.check_region_crs(target, found.regions.wkt)
        write.write_region_output(found, target, overwrite)
    names = found.regions.columns["name"].tolist() if library is not None else []
    counts = {name: f"{names.count(name):,}" for name in list(dict.fromkeys(names))[:20]}
    reporter.table({"regions": f"{len(found.regions):,} -> {write.shown(target or str(library))}", **counts})


@job_command("recognise", RecogniseOptions)
def recognise(options: RecogniseOptions) -> None:
    """Name REGIONS, or the occupied objects of MAP, by the nearest described examples of a library.

    The outline of each example is fitted to what was seen of an object, by position, rotation and size.
    Outline that borders on unknown space is not held against it. Where no name is probable enough, or nothing
    fits, the name is 'cannot tell'. With --learn NAME --ids N,..., regions become examples of the library
    instead; the file is written anew with what it held.
    """
    from uavseg.jobs.maps.recognition import recognised

    if (options.learn is None) != (options.ids is None):
        raise click.UsageError("--learn NAME and --ids N,... belong together")
    if (options.output is None) == (options.learn is None):
        raise click.UsageError("give either -o PATH, to name regions, or --learn NAME, to add examples")
    run_described(options, recognised, options.library)
