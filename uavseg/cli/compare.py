"""`uavseg compare`: what changed between two rasters or two maps of one place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, standard_output, work_of
from uavseg.cli.write import check_distinct, check_targets, keep_inputs, shown, transaction
from uavseg.options.regions import CompareOptions

if TYPE_CHECKING:
    from uavseg.jobs.maps.compare import Comparison

_LISTED = 8  # kinds of change in the table at the end


@job_command("compare", CompareOptions)
def command(options: CompareOptions) -> None:
    """Find what changed from BEFORE to AFTER, two rasters or two maps of probabilities of one place.

    With a range or classes, as of `uavseg extract`: what was gained and lost, on the finer of their grids.

    Without, they are maps, which are registered first, within 5 cells and 2 degrees. What is new or gone was
    seen free in the other map; what is first seen or not seen again is unknown there.
    """
    from uavseg.jobs.maps.compare import compare, open_both
    from uavseg.jobs.maps.requests import compare_request
    from uavseg.plot.page.page import check_png_target
    from uavseg.regions.formats import export

    reporter = Reporter(options.messages, options.progress)
    output, overwrite = options.output, options.files.overwrite
    request = compare_request(options)
    check_targets(output, None, overwrite)
    check_distinct(output, options.png)
    keep_inputs([output, options.png], options.before, options.after)
    if options.png is not None:
        check_png_target(options.png, overwrite)
    before, after = open_both(options.before, options.after, request, options.read)
    for source in (before, after):
        export.check_region_crs(output, source.geobox.wkt)
    found = compare(before, after, request, work_of(options.run, reporter))
    reporter.finish([*found.warnings, *export.format_notes(found.regions, output)])
    with transaction():
        if options.png is not None:
            from uavseg.plot.preview import preview

            preview(after.dataset, options.png, found.frame(), stretch=after.stretch, overwrite=overwrite)
        if output == "-":
            with standard_output() as stream:
                export.write_regions(found.regions, stream)
        else:
            export.write_regions(found.regions, output, overwrite)
    reporter.table(_rows(found, output) | {"seconds": f"{reporter.seconds:.2f}"})


def _rows(found: Comparison, output: str) -> dict[str, str]:
    """Return the short table at the end."""
    rows = {"changes": f"{len(found.regions):,} -> {shown(output)}"}
    if found.registration is not None:
        (x, y), angle = found.registration.shift, found.registration.angle_deg
        rows["shift"] = f"{x:.2f}, {y:.2f} cells and {angle:.2f} degrees from BEFORE to AFTER"
        rows["overlap"] = f"{100 * found.registration.share:.1f} % of the occupied cells"
    else:
        rows["grid"] = f"of {found.grid.upper()}, {found.common:,} pixels valid in both"
    unit = "m2" if found.in_metres else "square units"
    sums = [
        f"{name} {pixels:,} pixels ({area:,.2f} {unit})"
        for name, (pixels, area) in found.changes.items()
        if pixels or len(found.changes) <= _LISTED
    ]
    more = f" and {len(sums) - _LISTED} more" if len(sums) > _LISTED else ""
    rows["sums"] = ", ".join(sums[:_LISTED]) + more
    inside = [f"{name} {found.before[name]:,} to {found.after[name]:,}" for name in found.before]
    return rows | ({"pixels": ", ".join(inside[:_LISTED])} if inside else {})
