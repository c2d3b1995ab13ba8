"""`uavseg georeference`: a map of photographs by their pose."""

from __future__ import annotations

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.cli.write import shown
from uavseg.options.photographs import GeoreferenceOptions


@job_command("georeference", GeoreferenceOptions)
def command(options: GeoreferenceOptions) -> None:
    """Make a map of PHOTOs (files, or folders with their subfolders) by their pose, without photogrammetry.

    Tags are read as by `uavseg footprints`. Each pixel is of the photograph whose camera is nearest; ground
    that is hidden or near the horizon stays empty. The likely error in metres is said at the end, and is
    among the tags of the map. `uavseg extract` and `uavseg match` take the map as it is.
    """
    from uavseg.jobs.flights.georeference import georeference

    reporter = Reporter(options.messages, options.progress)
    found = georeference(options.photographs, options, reporter.progress)
    reporter.finish(found.warnings)
    rows, cols = found.geobox.shape
    reporter.table(
        {
            "photos": f"{len(found.photographs):,}",
            "map": f"{cols:,} x {rows:,} pixels of {100 * found.geobox.transform.a:g} cm "
            f"-> {shown(str(found.path))}",
            "error": f"likely {found.error_m:.1f} m, up to {found.edge_error_m:.1f} m at edges",
            "seconds": f"{reporter.seconds:.2f}",
        }
    )
