"""`uavseg path`: the shortest path between two places of one region of a map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import keep_inputs, shown, write_mission_output
from uavseg.cli.options.access import access_options
from uavseg.cli.options.bands import band_option, formula_options, nodata_option
from uavseg.cli.options.home_words import HomeCommand
from uavseg.cli.options.mission import parse_home
from uavseg.cli.options.ranges import asked_range, range_options
from uavseg.cli.options.raster import (
    map_stretch_option,
    polarity_option,
    read_options,
    segment_params,
    segmenting_options,
)
from uavseg.cli.options.running import RunOptions, running_options
from uavseg.cli.terminal.say import show
from uavseg.errors import MissionError, OutputError, ParameterError

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission
    from uavseg.flight.params.plan import PlanParams
    from uavseg.jobs.maps.path import PathFound, PathRequest
    from uavseg.occupancy.paths.find_path import PlannedPath
    from uavseg.raster.grid.geobox import GeoBox

_LINES = (".geojson", ".json")


@click.command("path", cls=HomeCommand)
@click.argument("map_", metavar="MAP")
@range_options("What is passable in v, such as 0,0.45.")
@click.option(
    "--start", required=True, metavar="X,Y", help="In the map's coordinates (lon,lat if those are)."
)
@click.option("--goal", required=True, metavar="X,Y", help="Where to.")
@click.option(
    "--clearance",
    type=float,
    default=0.0,
    metavar="M",
    help="Metres from the centre of a cell to everything else.  [default: none]",
)
@click.option("--smooth", is_flag=True, help="Pull the path tight, at any angle.")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="PATH",
    help="The path: .geojson; as a mission .plan, .waypoints, .kmz, .csv or .kml; - is GeoJSON on stdout.",
)
@segmenting_options
@click.option(
    "--refine",
    type=click.Choice(["pixels", "scan"]),
    show_default="pixels; with --method paper scan",
    help="What makes a region: cells by their own value, or as in the paper by the mean of their block too.",
)
@band_option
@formula_options
@nodata_option
@map_stretch_option
@polarity_option
@click.option("--altitude", type=float, metavar="M", help="For a mission: metres above home.")
@click.option(
    "--home", metavar="LAT,LON[,M]|auto", help="For a mission: where the vehicle takes off; auto: the start."
)
@click.option("--speed", type=float, default=5.0, metavar="M_S", show_default=True, help="For a mission.")
@click.option(
    "--autopilot",
    type=click.Choice(["ardupilot", "px4", "generic"]),
    default="ardupilot",
    show_default=True,
    help="For a mission.",
)
@running_options
@access_options
def command(**options: Any) -> None:
    """Find the shortest path over the cells of a region of MAP, from --start to --goal.

    MAP is a raster of probabilities, or the YAML file of a ROS map. The region is that of `uavseg extract`
    with the same --range and --refine. The path never enters a cell whose own value is outside of the range,
    and cuts no corner.
    """
    from uavseg.jobs.maps.path import path
    from uavseg.jobs.source.open_source import open_probability_map

    run = RunOptions.of(options)
    output = options["output"]
    request, read = _request(options), read_options(options)
    flight = _flight(output, options)
    _check_target(output, run.overwrite)
    keep_inputs([output], options["map_"])
    source = open_probability_map(options["map_"], read)
    _check_place(source.geobox, flight)
    found = path(source, request, run.work())
    run.reporter.finish(found.warnings)
    mission = None if flight is None else _flown(found.path, flight, options["home"])
    unwritten = _write(found.path, mission, output, run.overwrite)
    run.reporter.table(_rows(found, output) | {"seconds": f"{run.reporter.seconds:.2f}"})
    if mission is not None and not run.reporter.quiet:
        from uavseg.cli.options.mission import report

        report([mission], 1, [output], [*mission.warnings, *unwritten])


def _request(options: dict[str, Any]) -> PathRequest:
    from uavseg.jobs.maps.path import PathRequest, path_params
    from uavseg.occupancy.paths.find_path import PathParams

    start, goal = (_parsed_place(f"--{name}", options[name]) for name in ("start", "goal"))
    return PathRequest(
        asked_range(options),
        start,
        goal,
        PathParams(options["clearance"], options["smooth"]),
        path_params(segment_params(options, None), options["refine"]),
    )


def _parsed_place(option: str, text: str) -> tuple[float, float]:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(
            f"{option} is X,Y in the map's coordinates, such as 12.5,40, not {text!r}"
        ) from None
    return x, y


def _flight(output: str, options: dict[str, Any]) -> PlanParams | None:
    """How to fly, checked before any work is done; None where a line is wanted."""
    if output == "-" or Path(output).suffix.lower() in _LINES:
        return None
    from uavseg.flight.formats import files
    from uavseg.flight.params.plan import PlanParams

    try:
        files.check_mission_format(output)
    except MissionError:
        raise OutputError(
            f"{output}: a path is written to .geojson, .json, .plan, .waypoints, .kmz, .csv or .kml"
        ) from None
    if options["altitude"] is None:
        raise ParameterError("a mission needs --altitude, in metres above home")
    parse_home(options["home"])
    return PlanParams(options["altitude"], speed_m_s=options["speed"], autopilot=options["autopilot"])


def _check_target(output: str, overwrite: bool) -> None:
    from uavseg.output.atomic import check_target

    if output != "-":
        check_target(output, overwrite)


def _check_place(geobox: GeoBox, flight: PlanParams | None) -> None:
    """Nothing is computed that has no place where it is to be written or flown."""
    from uavseg.occupancy.paths import path_geojson

    path_geojson.check_path_crs(geobox)
    if flight is not None and geobox.crs is None:
        raise MissionError(
            "the map has no CRS, so nobody knows where to fly; give it one with gdal_edit.py -a_srs"
        )


def _flown(way: PlannedPath, flight: PlanParams, home: str | None) -> Mission:
    from uavseg.flight.planning.along import fly_along
    from uavseg.occupancy.paths.path_geojson import path_lonlat

    lon, lat = path_lonlat(way)
    position = parse_home(home)
    return fly_along(lon, lat, flight, (float(lat[0]), float(lon[0])) if position == "auto" else position)


def _write(way: PlannedPath, mission: Mission | None, output: str, overwrite: bool) -> list[str]:
    """Write a path or a mission; what the format of a mission cannot hold is returned as warnings."""
    from uavseg.occupancy.paths.path_geojson import path_to_geojson
    from uavseg.output.atomic import atomic_file
    from uavseg.output.written import noted_stream

    if mission is not None:
        return write_mission_output(mission, output, overwrite)
    if output == "-":
        with noted_stream("stdout"):
            show(path_to_geojson(way).rstrip("\n"))
    else:
        with atomic_file(output, overwrite) as temporary:
            temporary.write_text(path_to_geojson(way), encoding="utf-8", newline="\n")
    return []


def _rows(found: PathFound, output: str) -> dict[str, str]:
    """The short table at the end."""
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
