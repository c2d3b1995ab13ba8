"""`uavseg classify`: a map of probabilities becomes free, unknown and occupied cells, and objects."""

from pathlib import Path
from typing import TYPE_CHECKING

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.errors import OutputError
from uavseg.options.maps import ClassifyOptions

if TYPE_CHECKING:
    from uavseg.jobs.maps.classify import Classification
    from uavseg.segmentation.params.segment import StateLimits


@job_command("classify", ClassifyOptions)
def command(options: ClassifyOptions) -> None:
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
    from uavseg.output.atomic import check_target
    from uavseg.regions.formats.export import check_region_crs

    reporter = Reporter(options.messages, options.progress)
    target = options.output or f"{Path(options.path).stem}.states.tif"
    request = classify_request(options)
    creation = write.creation_of(options.creation, {options.labels: "uint32", target: "uint8"})
    overwrite = options.files.overwrite
    if Path(target).suffix.lower() not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{target}: states are written to .tif, or to .yaml for a ROS map")
    check_target(target, overwrite)
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
    reporter.table(rows | {"seconds": f"{reporter.seconds:.2f}"})


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
