"""`uavseg classify`, `describe`, `recognise` and `compare`: what a map or regions hold, and what changed."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.errors import OutputError
from uavseg.options.maps import ClassifyOptions, DescribeOptions, RecogniseOptions
from uavseg.options.regions import CompareOptions

if TYPE_CHECKING:
    from uavseg.jobs.maps.classify import Classification
    from uavseg.segmentation.params.segment import StateLimits


@job_command("classify", ClassifyOptions)
def command(options: ClassifyOptions, reporter: Reporter) -> None:
    """Find what is free (1), unknown (2) and occupied (3) in MAP; 0 is nodata.

    MAP is a raster of probabilities, integers from 0 to the largest of their type or floats from 0 to 1, or
    the YAML file of a ROS map, read as Nav2 reads it. Objects have their area, bounding box and mean. A ROS
    map knows no nodata: such cells are written as unknown.

    Walls and poles of one or two cells, which the method of the paper loses, are restored where noise does
    not explain them. Where obstacles are lost all the same (--method paper, --refine none), nothing is
    written unless --allow-lost-obstacles is given.
    """
    from uavseg.jobs.maps.classify import classify, classify_request
    from uavseg.jobs.source.open_source import open_probability_map
    from uavseg.occupancy.map_file import write_states
    from uavseg.occupancy.ros.ros_map import check_ros_map, image_path, is_ros_map
    from uavseg.regions.formats.export import check_region_crs

    target = options.output or f"{Path(options.path).stem}.states.tif"
    request = classify_request(options)
    creation = write.creation_of(options.creation, {options.labels: "uint32", target: "uint8"})
    overwrite = options.files.overwrite
    if Path(target).suffix.lower() not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{target}: states are written to .tif, or to .yaml for a ROS map")
    write.check_output(target, overwrite)
    write.check_targets(options.objects, options.labels, overwrite)
    write.check_distinct(target, options.objects, options.labels)
    mode = options.mode.mode or "trinary"
    files = [target, str(image_path(target, mode))] if is_ros_map(target) else [target]
    write.keep_inputs([*files, options.objects, options.labels], options.path)
    source = open_probability_map(options.path, options.read)
    if is_ros_map(target):
        check_ros_map(target, source.geobox, overwrite, mode)
    if options.objects is not None:
        check_region_crs(options.objects, source.geobox.wkt)
    work = work_of(options.run, reporter)
    found = classify(source, request, work)
    reporter.finish(found.warnings)
    with write.transaction():
        write_states(target, found.image, found.geobox, overwrite, mode, creation)
        if found.objects is not None:
            write.write_label_output(found.objects, options.labels, work, overwrite, creation)
        if found.objects is not None and options.objects is not None:
            write.write_region_output(found.objects, options.objects, overwrite)
    if is_ros_map(target) and found.cells[0]:
        cells = f"{found.cells[0]:,} cells without data are unknown in {target}"
        reporter.warn(f"a ROS map knows no nodata: {cells}")
    rows = _rows(found, request.limits, target, options.objects)
    reporter.timed_table(rows)


def _rows(found: "Classification", limits: "StateLimits", target: str, objects: str | None) -> dict[str, str]:
    rows, cols = found.geobox.shape
    names = {1: "free", 2: "unknown", 3: "occupied", 0: "no data"}
    shares = {
        name: f"{found.cells[state]:,} ({100 * found.cells[state] / (rows * cols):.1f} %)"
        for state, name in names.items()
        if state or found.cells[0]
    }
    table = {"states": f"{rows:,} x {cols:,} cells -> {target}", **shares}
    if found.objects is not None:
        where = "" if objects is None else f" -> {write.shown(objects)}"
        table["objects"] = f"{len(found.objects.regions):,}{where}"
        table["largest"] = write.largest(found.objects)
    table["limits"] = f"free up to {limits.free_below:g}, occupied above {limits.occupied_above:g}"
    table["restored"] = f"{found.restored:,} cells of thin obstacles"
    hazard, by_value = found.occupied_in_free, found.occupied_by_value
    table["hazard"] = f"{hazard:,} of {by_value:,} cells with v above the occupied limit are called free"
    table["unseen"] = f"{found.unknown_in_free:,} cells whose own v is unknown are called free"
    if found.lost_obstacles:
        table["lost"] = f"{found.lost_obstacles:,} obstacles without an occupied cell"
    table["stretch"] = found.source.stretch.name
    return table


@job_command("describe", DescribeOptions)
def describe(options: DescribeOptions, reporter: Reporter) -> None:
    """Measure the shape, texture and bands of REGIONS, or of the occupied objects of MAP.

    REGIONS is a file of polygons, such as `uavseg extract` writes. MAP is a raster of probabilities or the
    YAML file of a ROS map; its objects also have the share of their outline that was seen.
    """
    from uavseg.jobs.maps.recognition import described

    run_described(options, reporter, described)


def run_described(
    options: Any, reporter: Reporter, job: Callable[..., Any], library: str | None = None
) -> None:
    """Run a job that gives described regions and write them; with a library, count their names."""
    from uavseg.regions.formats import export

    target, overwrite = options.output, options.files.overwrite
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
def recognise(options: RecogniseOptions, reporter: Reporter) -> None:
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
    run_described(options, reporter, recognised, options.library)


@job_command("compare", CompareOptions)
def compare(options: CompareOptions, reporter: Reporter) -> None:
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
    reporter.timed_table(rows)
