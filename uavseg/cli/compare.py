"""`uavseg compare`: what changed between two rasters or two maps of one place."""

from __future__ import annotations

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.options.regions import CompareOptions


@job_command("compare", CompareOptions)
def command(options: CompareOptions, reporter: Reporter) -> None:
    """Find what changed from BEFORE to AFTER, two rasters or two maps of probabilities of one place.

    With a range or classes, as of `uavseg extract`: what was gained and lost, on the finer of their grids.
    Without, they are maps, which are registered first, within 5 cells and 2 degrees. What is new or gone is
    free in the other map; what is first seen or not seen again is unknown there.
    """
    from uavseg.jobs.maps.compare import compare, compare_job, open_both
    from uavseg.regions.edit.small import as_area
    from uavseg.regions.formats import export

    output, png, overwrite = options.output, options.png, options.files.overwrite
    job, least = compare_job(options), as_area(options.min_area)
    write.check_targets(output, None, overwrite)
    write.check_distinct(output, png)
    write.keep_inputs([output, png], options.before, options.after, options.read.aoi)
    if png is not None:
        from uavseg.plot.page.page import check_png_target

        check_png_target(png, overwrite)
    before, after = open_both(options.before, options.after, job, options.read)
    export.check_region_crs(output, before.geobox.wkt)
    export.check_region_crs(output, after.geobox.wkt)
    found = compare(before, after, job, least, work_of(options.run, reporter))
    reporter.finish([*found.warnings, *export.format_notes(found.regions, output)])
    with write.transaction():
        if png is not None:
            from uavseg.plot.preview import preview

            preview(after.dataset, png, found.frame(), stretch=after.stretch, overwrite=overwrite)
        write.write_region_output(found, output, overwrite)
    rows = {"changes": f"{len(found.regions):,} -> {write.shown(output)}"}
    how, unit = found.registration, "m2"
    if how is not None:
        where = f"{how.shift[0]:.2f}, {how.shift[1]:.2f} cells and {how.angle_deg:.2f} degrees"
        rows["shift"] = f"{where}; {100 * how.share:.1f} % of the occupied cells lie on each other"
    else:
        unit = "square units" if found.regions.wkt is None else unit
        inside = [f"{name} {found.before[name]:,} to {found.after[name]:,}" for name in found.before]
        rows["pixels"] = f"{', '.join(inside)}, of {found.common:,} on the grid of {found.grid.upper()}"
    sums = [f"{name} {n:,} pixels, {area:,.2f} {unit}" for name, (n, area) in found.changes.items() if n]
    rows["sums"] = "; ".join(sums) or "no change"
    reporter.table(rows | {"seconds": f"{reporter.seconds:.2f}"})
