"""`uavseg explore` and `uavseg next-view`: a robot drives through a scene, or looks next in a map."""

from pathlib import Path

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, showing_phases, work_of
from uavseg.cli.write import check_distinct, keep_inputs, transaction, write_text
from uavseg.errors import OutputError
from uavseg.options.maps import ExploreOptions, NextViewOptions


@job_command("explore", ExploreOptions)
def command(options: ExploreOptions) -> None:
    """Explore a scene with a laser range finder: scan, go to the next view, until all is known.

    The scene is that of `uavseg simulate`, or MAP: a robot's map (YAML or raster), whose free cells the robot
    may enter and whose others are solid. It knows nothing of them but what it scans, every 0.25 m.
    """
    from uavseg.jobs.maps.explore import explore, explore_request
    from uavseg.occupancy.map_file import write_map
    from uavseg.plot.drive_animation import write_animation

    reporter = Reporter(options.messages)
    overwrite = options.files.overwrite
    _check_targets(options)
    with showing_phases(reporter.quiet):
        found = explore(options.scene, explore_request(options))
    reporter.finish(found.warnings)
    with transaction():
        write_text(options.output, found.to_geojson(), overwrite)
        if options.table:
            write_text(options.table, found.table(), overwrite)
        if options.map:
            grid = found.drive.grid
            write_map(options.map, grid.probabilities, grid.geobox, overwrite)
        if options.animation:
            write_animation(found.drive, options.animation, overwrite)
    drive = found.drive
    slowest = f"{1e3 * max(drive.seconds, default=0.0):.0f} ms"
    reporter.table(
        drive=f"{drive.metres[-1]:,.1f} m, {len(drive.poses):,} scans -> {options.output}",
        known=f"{100 * found.share:.2f} % of what could be known",
        choices=f"{len(drive.seconds):,}, the slowest in {slowest}",
    )


def _check_targets(options: ExploreOptions) -> None:
    from uavseg.occupancy.map_file import check_map_path
    from uavseg.output.atomic import check_target

    overwrite = options.files.overwrite
    for path, suffix, what in (
        (options.output, ".geojson", "a drive"),
        (options.table, ".csv", "the table of a drive"),
        (options.animation, ".gif", "an animation"),
    ):
        if path is None or path == "-":
            continue
        if Path(path).suffix.lower() != suffix:
            raise OutputError(f"{path}: {what} is written to {suffix}")
        check_target(path, overwrite)
    maps = check_map_path(options.map, overwrite) if options.map else []
    files = [path for path in (options.output, options.table, options.animation) if path and path != "-"]
    check_distinct(*files, *maps)
    keep_inputs([*files, *maps], options.scene)


@job_command("next-view", NextViewOptions)
def next_view(options: NextViewOptions) -> None:
    """Find the poses from which a robot at --pose would see what is unknown in MAP, the best first.

    MAP is a raster of probabilities, or the YAML file of a ROS map. Views stand on free cells and see borders
    of free and unknown ones; the best begins a short tour through all of them, which ends where unknown space
    goes on farthest.
    """
    from uavseg.jobs.maps.next_view import next_views, view_request
    from uavseg.jobs.source.open_source import open_probability_map
    from uavseg.occupancy.paths.path_geojson import check_path_crs
    from uavseg.output.atomic import check_target

    reporter = Reporter(options.messages, options.progress)
    request = view_request(options)
    if options.output != "-":
        check_target(options.output, options.files.overwrite)
    keep_inputs([options.output], options.map_)
    source = open_probability_map(options.map_, options.read)
    check_path_crs(source.geobox)
    found = next_views(source, request, work_of(options.run, reporter))
    reporter.finish(found.warnings)
    write_text(options.output, found.to_geojson(), options.files.overwrite)
    for rank, view in enumerate(found.views, start=1):
        about = view.properties
        place = f"{view.pose.x:.2f},{view.pose.y:.2f} heading {about['heading_deg']:.0f}"
        way = f"{about['distance_m']:.1f} m away, {about['frontier_m']:.1f} m of frontiers"
        worth = f"{about['gain_bits']:.0f} bits, score {about['score']:.2f}"
        reporter.say(f"  {rank:2d}  {place}: {way}, {worth}")
    reporter.say(f"  {len(found.views)} views -> {options.output}")
