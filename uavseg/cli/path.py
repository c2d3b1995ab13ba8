"""`uavseg path`: the shortest way between two places of one region of a map."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._mission import home_position
from uavseg.cli._reading import map_stretch_option
from uavseg.cli._regions import opened_ros_map
from uavseg.cli._running import Reporter, Running, running_options
from uavseg.cli._segmenting import parsed_range, segmenting_options
from uavseg.errors import MissionError, OutputError, ParameterError

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission
    from uavseg.flight.params import PlanParams
    from uavseg.jobs.extract import ExtractParams
    from uavseg.occupancy.paths.find_path import PlannedPath
    from uavseg.raster.dataset import Dataset
    from uavseg.raster.geobox import GeoBox
    from uavseg.raster.intensity.stretch import Stretch, StretchSpec

_LINES = (".geojson", ".json")


@click.command("path")
@click.argument("map_", metavar="MAP")
@click.option("--range", "interval", required=True, metavar="LO,HI", help="What is passable, such as 0,0.45.")
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
    help="The path: .geojson, .waypoints or .plan; - is GeoJSON on stdout.",
)
@segmenting_options
@click.option("--nodata", type=float, metavar="V|nan", help="This value counts for nothing.")
@map_stretch_option
@click.option("--altitude", type=float, metavar="M", help="For a mission: metres above home.")
@click.option(
    "--home", metavar="LAT,LON[,M]|auto", help="For a mission: where the vehicle takes off; auto: the start."
)
@click.option("--speed", type=float, default=5.0, metavar="M_S", show_default=True, help="For a mission.")
@click.option("--firmware", type=click.Choice(["ardupilot", "px4"]), default="ardupilot", show_default=True)
@running_options
def command(
    map_: str,
    interval: str,
    start: str,
    goal: str,
    output: str,
    running: Running,
    **options: Any,
) -> None:
    """Find the shortest path over the cells of a region of MAP, from --start to --goal.

    MAP is a raster of probabilities, or the YAML file of a ROS map. The region is that of `uavseg extract`
    with the same --range. The path never enters a cell whose own value is outside of the range, and cuts no
    corner.
    """
    from uavseg.occupancy.paths.find_path import PathParams, find_path
    from uavseg.occupancy.paths.free_cells import FreeCells
    from uavseg.occupancy.ros.ros_map import is_ros_map

    reporter = running.reporter
    places = _parsed_place("--start", start), _parsed_place("--goal", goal)
    passable = parsed_range(interval)
    params = PathParams(options["clearance"], options["smooth"])
    flight = _flight(output, options)
    _check_target(output, running.overwrite)
    dataset, stretch = _opened(map_, options, running.resume)
    _check_place(dataset.geobox, flight)
    run = running.resuming(running.workers())
    reporter.begin(dataset, running.tile)
    free = FreeCells.of(dataset, passable, _params(stretch, running.tile, options), run, reporter.progress)
    reporter.finish()
    begun = time.perf_counter()
    way = find_path(free, *places, params, running.local_workers())
    for warning in way.warnings:
        reporter.warn(warning)
    mission = None if flight is None else _flown(way, flight, options["home"])
    _write(way, mission, output, running.overwrite)
    in_metres = way.geobox.crs is not None or is_ros_map(map_)
    _tell(way, output, "m" if in_metres else "units of the map", time.perf_counter() - begun, reporter)
    if mission is not None and not reporter.quiet:
        from uavseg.cli._mission import report

        report(mission, 1, output)


def _opened(path: str, options: dict[str, Any], resume: str | None) -> tuple[Dataset, Stretch | StretchSpec]:
    """The map, and the stretch that was named; its own if none was, and always that of a ROS map."""
    from uavseg.occupancy.probability_map import open_map, stretch_of
    from uavseg.occupancy.ros.ros_map import is_ros_map
    from uavseg.raster.intensity.stretch import parse_stretch

    if is_ros_map(path):
        dataset = opened_ros_map((path,), options, resume)
        return dataset, stretch_of(dataset)
    dataset, own = open_map(path, nodata=options["nodata"])
    return dataset, parse_stretch(options["stretch"]) if options["stretch"] else own


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
    from uavseg.flight import files
    from uavseg.flight.params import PlanParams

    try:
        files.check_mission_format(output)
    except MissionError:
        raise OutputError(f"{output}: a path is written to .geojson, .json, .waypoints or .plan") from None
    if options["altitude"] is None:
        raise ParameterError("a mission needs --altitude, in metres above home")
    home_position(options["home"], [(0.0, 0.0)])
    return PlanParams(options["altitude"], speed_m_s=options["speed"], firmware=options["firmware"])


def _check_target(output: str, overwrite: bool) -> None:
    from uavseg.atomic import check_target

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


def _params(stretch: Stretch | StretchSpec, tile: int | None, options: dict[str, Any]) -> ExtractParams:
    from uavseg.jobs.extract import ExtractParams
    from uavseg.segmentation.params import SegmentParams

    segment = SegmentParams(options["method"], options["threshold"], options["intensity_step"], "scan")
    return ExtractParams(segment, stretch, tile=tile)


def _flown(way: PlannedPath, flight: PlanParams, home: str | None) -> Mission:
    from uavseg.flight.along import fly_along
    from uavseg.occupancy.paths.path_geojson import path_lonlat

    lon, lat = path_lonlat(way)
    return fly_along(lon, lat, flight, home_position(home, [(float(lon[0]), float(lat[0]))]))


def _write(way: PlannedPath, mission: Mission | None, output: str, overwrite: bool) -> None:
    from uavseg.atomic import whole_file
    from uavseg.flight import files
    from uavseg.occupancy.paths.path_geojson import path_to_geojson

    if mission is not None:
        files.write_mission(mission, output, overwrite)
    elif output == "-":
        sys.stdout.write(path_to_geojson(way))
    else:
        with whole_file(output, overwrite) as temporary:
            temporary.write_text(path_to_geojson(way), encoding="utf-8", newline="\n")


def _tell(way: PlannedPath, output: str, unit: str, seconds: float, reporter: Reporter) -> None:
    """The short table at the end."""
    rows = {
        "path": f"{len(way.corners):,} corners -> {'stdout' if output == '-' else output}",
        "length": f"{way.length_m:,.3f} {unit} ({way.cells:,} cells)",
        "expanded": f"{way.expanded:,} cells in {seconds:.3f} s",
        "kept out of": f"{way.walls:,} cells of region {way.region} whose own value is outside of the range",
        "seconds": f"{reporter.seconds:.2f}",
    }
    for name, value in rows.items():
        reporter.say(f"  {name:<12}{value}")
