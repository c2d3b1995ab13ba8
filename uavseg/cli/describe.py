"""`uavseg describe`: measures of regions, or of the occupied objects of a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import keep_inputs
from uavseg.options.recognition import DescribeOptions

if TYPE_CHECKING:
    from uavseg.jobs.recognition.describe import Description


@job_command("describe", DescribeOptions)
def command(options: DescribeOptions) -> None:
    """Measure the shape, texture and bands of REGIONS, or of the occupied objects of MAP.

    REGIONS is a file of polygons, such as `uavseg extract` writes. MAP is a raster of probabilities or the
    YAML file of a ROS map; its objects also have the share of their outline that was seen.
    """
    from uavseg.jobs.recognition.describe import described

    write_described(options, described)


def write_described(options: Any, job: Callable[..., Description], *inputs: str) -> None:
    """Run a job that gives described regions, and write them; its names are counted in the table."""
    from uavseg.regions.formats.export import check_region_crs, check_region_path, write_regions

    reporter, target = Reporter(options.messages, options.progress), options.output
    check_region_path(target, options.files.overwrite)
    keep_inputs([target], options.source, options.raster, *inputs)
    found = job(options, work_of(options.run, reporter))
    reporter.finish(found.warnings)
    check_region_crs(target, found.regions.wkt)
    write_regions(found.regions, target, options.files.overwrite)
    names = Counter(found.regions.columns["name"].tolist() if inputs else ())
    counts = {name: f"{count:,}" for name, count in names.most_common(20)}
    reporter.table({"regions": f"{len(found.regions):,} -> {target}", **counts})
