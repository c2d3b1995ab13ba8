"""`uavseg explore`: a robot drives through a scene until nothing that it can see is unknown."""

from pathlib import Path

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, showing_phases
from uavseg.cli.write import check_distinct, keep_inputs, transaction, write_text
from uavseg.errors import OutputError
from uavseg.options.maps import ExploreOptions


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
