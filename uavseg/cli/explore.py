"""`uavseg explore`, `next-view` and `path`: a robot drives through a scene, looks next or goes in a map."""

from pathlib import Path
from typing import TYPE_CHECKING

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, showing_phases, work_of
from uavseg.errors import MissionError, OutputError, ParameterError
from uavseg.options.maps import ExploreOptions, NextViewOptions, PathOptions

if TYPE_CHECKING:
    from uavseg.flight.params.plan import PlanParams
    from uavseg.jobs.maps.path import PathFound

_LINES = (".geojson", ".json", ".yaml", ".yml")


@job_command("explore", ExploreOptions)
def command(options: ExploreOptions, reporter: Reporter) -> None:
    """Explore a scene with a laser range finder: scan, go to the next view, until all is known.

    The scene is that of `uavseg simulate`, or MAP: a robot's map (YAML or raster), whose free cells the robot
    may enter and whose others are solid. It knows nothing of them but what it scans, every 0.25 m.
    """
    from uavseg.jobs.maps.explore import explore
    from uavseg.occupancy.map_file import write_map
    from uavseg.plot.drive_animation import write_animation

    overwrite = options.files.overwrite
    _check_targets(options)
    with showing_phases(reporter.quiet):
        found = explore(options)
    reporter.finish(found.warnings)
    with write.transaction():
        write.write_text(options.output, found.to_geojson(), overwrite)
        if options.table:
            write.write_text(options.table, found.table(), overwrite)
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
        write.check_output(path, overwrite)
    maps = check_map_path(options.map, overwrite) if options.map else []
    files = [path for path in (options.output, options.table, options.animation) if path and path != "-"]
    write.check_distinct(*files, *maps)
    write.keep_inputs([*files, *maps], options.scene)


@job_command("next-view", NextViewOptions)
def next_view(options: NextViewOptions, reporter: Reporter) -> None:
    """Find the poses from which a robot at --pose would see what is unknown in MAP, the best first.

    MAP is a raster of probabilities, or the YAML file of a ROS map. Views stand on free cells and see borders
    of free and unknown ones; the best begins a short tour through all of them, which ends where unknown space
    goes on farthest.
    """
    from uavseg.jobs.maps.explore import check_view, next_views
    from uavseg.jobs.source.open_source import open_probability_map
    from uavseg.occupancy.paths.path_text import check_path_crs

    check_view(options)
    write.check_output(options.output, options.files.overwrite, options.map_)
    source = open_probability_map(options.map_, options.read)
    check_path_crs(source.geobox)
    found = next_views(source, options, work_of(options.run, reporter))
    reporter.finish(found.warnings)
    write.write_text(options.output, found.to_geojson(), options.files.overwrite)
    for rank, view in enumerate(found.views, start=1):
        about = view.properties
        place = f"{view.pose.x:.2f},{view.pose.y:.2f} heading {about['heading_deg']:.0f}"
        way = f"{about['distance_m']:.1f} m away, {about['frontier_m']:.1f} m of frontiers"
        worth = f"{about['gain_bits']:.0f} bits, score {about['score']:.2f}"
        reporter.say(f"  {rank:2d}  {place}: {way}, {worth}")
    reporter.say(f"  {len(found.views)} views -> {options.output}")


@job_command("path", PathOptions)
def path(options: PathOptions, reporter: Reporter) -> None:
    """Find the shortest path over the cells of a region of MAP, from --start to --goal.

    MAP is a raster of probabilities, or the YAML file of a ROS map. The region is that of `uavseg extract`
    with the same --range and --refine. The path never enters a cell whose own value is outside of the range,
    and cuts no corner.
    """
    from uavseg.jobs.maps.path import path, path_request
    from uavseg.jobs.source.open_source import open_probability_map
    from uavseg.occupancy.paths import path_text
    from uavseg.occupancy.ros.ros_map import is_ros_map

    output, overwrite = options.output, options.files.overwrite
    write.check_ranges(options.ranges, {})
    request, flight = path_request(options), _flight(options)
    write.check_output(output, overwrite, options.map_)
    source = open_probability_map(options.map_, options.read)
    path_text.check_path_crs(source.geobox)
    if is_ros_map(output) and source.geobox.crs is not None:
        raise OutputError(f"{output}: waypoints are metres of a map without a CRS; name a .geojson")
    if flight is not None and source.geobox.crs is None:
        why = "the map has no CRS, so nobody knows where to fly"
        raise MissionError(f"{why}; give it one with gdal_edit.py -a_srs")
    found = path(source, request, work_of(options.run, reporter))
    reporter.finish(found.warnings)
    mission, unwritten = None, []
    if flight is None or options.home is None:
        as_text = path_text.path_to_waypoints if is_ros_map(output) else path_text.path_to_geojson
        write.write_text(output, as_text(found.path), overwrite)
    else:
        from uavseg.flight.planning.along import fly_along

        lon, lat = path_text.path_lonlat(found.path)
        home = (float(lat[0]), float(lon[0])) if isinstance(options.home, str) else options.home
        mission = fly_along(lon, lat, flight, home)
        unwritten = write.write_mission_output(mission, output, overwrite)
    reporter.timed_table(_rows(found, output))
    if mission is not None and not reporter.quiet:
        from uavseg.cli.plan import report

        report([mission], 1, [output], [*mission.warnings, *unwritten])


def _flight(options: PathOptions) -> "PlanParams | None":
    """Return how to fly, checked before any work is done; None where a line is written."""
    output = options.output
    if output == "-" or Path(output).suffix.lower() in _LINES:
        return None
    from uavseg.flight.formats import files
    from uavseg.flight.params.plan import PlanParams

    try:
        files.check_mission_format(output)
    except MissionError:
        formats = ".geojson, .json, .yaml, .plan, .waypoints, .kmz, .csv or .kml"
        raise OutputError(f"{output}: a path is written to {formats}") from None
    if options.altitude is None:
        raise ParameterError("a mission needs --altitude, in metres above home")
    if options.home is None:
        raise ParameterError("a mission needs --home LAT,LON, where the vehicle starts (or --home auto)")
    return PlanParams(options.altitude, speed_m_s=options.speed, autopilot=options.autopilot)


def _rows(found: "PathFound", output: str) -> dict[str, str]:
    way = found.path
    unit = "m" if found.in_metres else "units of the map"
    rows = {
        "path": f"{len(way.corners):,} corners -> {write.shown(output)}",
        "length": f"{way.length_m:,.3f} {unit} ({way.cells:,} cells)",
        "expanded": f"{way.expanded:,} cells in {found.search_s:.3f} s",
    }
    if way.walls:
        out = f"{way.walls:,} cells of region {way.region} whose own value is outside of the range"
        rows["kept out of"] = out
    return rows
