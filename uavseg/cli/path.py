"""`uavseg path`: the shortest path between two places of one region of a map."""

from pathlib import Path
from typing import TYPE_CHECKING

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import check_ranges, keep_inputs, shown, write_mission_output, write_text
from uavseg.errors import MissionError, OutputError, ParameterError
from uavseg.options.maps import PathOptions

if TYPE_CHECKING:
    from uavseg.flight.params.plan import PlanParams
    from uavseg.jobs.maps.path import PathFound

_LINES = (".geojson", ".json")


@job_command("path", PathOptions)
def command(options: PathOptions) -> None:
    """Find the shortest path over the cells of a region of MAP, from --start to --goal.

    MAP is a raster of probabilities, or the YAML file of a ROS map. The region is that of `uavseg extract`
    with the same --range and --refine. The path never enters a cell whose own value is outside of the range,
    and cuts no corner.
    """
    from uavseg.jobs.maps.path import path, path_request
    from uavseg.jobs.source.open_source import open_probability_map
    from uavseg.occupancy.paths.path_geojson import check_path_crs, path_lonlat, path_to_geojson
    from uavseg.output.atomic import check_target

    reporter = Reporter(options.messages, options.progress)
    output, overwrite = options.output, options.files.overwrite
    check_ranges(options.ranges, {})
    request, flight = path_request(options), _flight(options)
    if output != "-":
        check_target(output, overwrite)
    keep_inputs([output], options.map_)
    source = open_probability_map(options.map_, options.read)
    check_path_crs(source.geobox)
    if flight is not None and source.geobox.crs is None:
        why = "the map has no CRS, so nobody knows where to fly"
        raise MissionError(f"{why}; give it one with gdal_edit.py -a_srs")
    found = path(source, request, work_of(options.run, reporter))
    reporter.finish(found.warnings)
    mission, unwritten = None, []
    if flight is None or options.home is None:
        write_text(output, path_to_geojson(found.path), overwrite)
    else:
        from uavseg.flight.planning.along import fly_along

        lon, lat = path_lonlat(found.path)
        home = (float(lat[0]), float(lon[0])) if isinstance(options.home, str) else options.home
        mission = fly_along(lon, lat, flight, home)
        unwritten = write_mission_output(mission, output, overwrite)
    reporter.table(_rows(found, output) | {"seconds": f"{reporter.seconds:.2f}"})
    if mission is not None and not reporter.quiet:
        from uavseg.cli.mission_report import report

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
        formats = ".geojson, .json, .plan, .waypoints, .kmz, .csv or .kml"
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
        "path": f"{len(way.corners):,} corners -> {shown(output)}",
        "length": f"{way.length_m:,.3f} {unit} ({way.cells:,} cells)",
        "expanded": f"{way.expanded:,} cells in {found.search_s:.3f} s",
    }
    if way.walls:
        out = f"{way.walls:,} cells of region {way.region} whose own value is outside of the range"
        rows["kept out of"] = out
    return rows
