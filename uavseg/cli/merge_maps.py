"""`uavseg merge-maps`: maps of robots become one, cropped and turned as it is asked for."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, showing_phases
from uavseg.cli.write import creation_of, keep_inputs, transaction
from uavseg.options.maps import MergeMapsOptions


@job_command("merge-maps", MergeMapsOptions)
def command(options: MergeMapsOptions) -> None:
    """Merge MAPs that lie in one frame into one; a single MAP may be cropped and turned.

    A MAP is the YAML file of a ROS map, or a raster of probabilities in metres. The cells are those of the
    first MAP, as far as all of them reach. Where maps differ, the value farthest from 0.5 counts; what is
    occupied in one of them is occupied. Turning and other resolutions lose no obstacle.
    """
    from uavseg.jobs.maps.merge_maps import MergeRequest, merge_maps
    from uavseg.occupancy.map_file import check_map_path, shares_of
    from uavseg.occupancy.ros.ros_map import placement

    reporter = Reporter(options.messages)
    target, overwrite, mode = options.output, options.files.overwrite, options.mode.mode
    files = check_map_path(target, overwrite, mode)
    keep_inputs(files, *options.maps)
    creation_of(options.creation, {target: "float32"})
    request = MergeRequest(options.crop, options.unrotate, options.resolution)
    with showing_phases(reporter.quiet):
        found = merge_maps(options.maps, request)
    reporter.finish(found.warnings)
    with transaction():
        found.write(target, overwrite, options.creation.creation_options, mode)
    rows, cols = found.geobox.shape
    side, (x, y, yaw), _ = placement(found.geobox)
    reporter.table(
        maps=f"{len(options.maps):,}",
        map=f"{rows:,} x {cols:,} cells of {side:g} m from {x:g}, {y:g}, yaw {yaw:g}",
        cells=shares_of(found.probabilities),
        written=", ".join(files),
    )
