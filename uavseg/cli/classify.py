"""`uavseg classify`: a map of probabilities becomes free, unknown and occupied cells, and objects."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._reading import map_stretch_option
from uavseg.cli._regions import (
    area,
    check_targets,
    largest,
    opened_ros_map,
    shown,
    tell,
    write_labels,
    write_regions,
)
from uavseg.cli._running import Reporter, Running, running_options
from uavseg.cli._segmenting import segmenting_options
from uavseg.errors import OutputError, ParameterError

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.jobs.classify import Classification
    from uavseg.jobs.extract import ExtractParams
    from uavseg.segmentation.intervals import StateLimits
    from uavseg.segmentation.source import GreySource


@click.command("classify", short_help="Find what is free, unknown and occupied in a map of probabilities.")
@click.argument("path", metavar="MAP")
@click.option("--band", type=click.IntRange(min=1), help="Use this band, counted from 1.")
@click.option("--nodata", type=float, metavar="V|nan", help="This value counts for nothing.")
@map_stretch_option
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="The states: .tif, or .yaml for a ROS map with a .pgm beside it.  [default: STEM.states.tif here]",
)
@click.option(
    "--objects",
    metavar="PATH",
    help="Also write what is occupied, object by object: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is "
    "GeoJSON on stdout.",
)
@click.option(
    "--labels",
    metavar="PATH",
    help="Also write the ids of the objects as a raster: one .tif, or a .vrt over a folder of tiles.",
)
@click.option(
    "--mode",
    type=click.Choice(["trinary", "scale", "raw"]),
    default="trinary",
    show_default=True,
    help="How the picture of a ROS map is to be read; for scale it is a .png.",
)
@click.option(
    "--free-below",
    type=float,
    default=0.498,
    show_default=True,
    metavar="V",
    help="Free is what has at most this v.",
)
@click.option(
    "--occupied-above",
    type=float,
    default=0.502,
    show_default=True,
    metavar="V",
    help="Occupied is what has a larger v.",
)
@partial(segmenting_options, method="paper")
@click.option(
    "--refine",
    type=click.Choice(["scan", "none"]),
    default="scan",
    show_default=True,
    help="Whether the borders of states are found to the cell, or stay those of blocks.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop objects of less; states stay as they are.")
@click.option("--simplify", type=float, metavar="METRES", help="Simplify the outlines of objects.")
@running_options
def command(
    path: str,
    output: str | None,
    objects: str | None,
    labels: str | None,
    running: Running,
    **options: Any,
) -> None:
    """Find what is free (1), unknown (2) and occupied (3) in MAP; 0 is nodata.

    MAP is a raster of probabilities, integers from 0 to the largest of their type or floats from 0 to 1, or
    the YAML file of a ROS map, read as Nav2 reads it. Objects have their area, bounding box and mean. A ROS
    map knows no nodata: such cells are written as unknown.
    """
    from uavseg.jobs.classify import classify
    from uavseg.occupancy.ros.ros_map import is_ros_map
    from uavseg.segmentation.intervals import StateLimits

    reporter = running.reporter
    target = output or f"{Path(path).stem}.states.tif"
    limits = StateLimits(options["free_below"], options["occupied_above"])
    params = _params(running.tile, options)
    _check(target, objects, labels, running.overwrite)
    source = _opened(path, options, running.resume)
    _check_place(target, options["mode"], objects, source, running.overwrite)
    run = running.workers()
    reporter.begin(source.dataset, running.tile)
    wanted = objects is not None or labels is not None
    kept = running.resuming(run)
    if not is_ros_map(path):
        source = _stretched(source, options["stretch"], running.tile, kept)
    found = classify(source, limits, params, wanted, kept, reporter.progress)
    reporter.finish()
    for warning in found.about.warnings:
        reporter.warn(warning)
    _write_states(found, target, options["mode"], running.overwrite, reporter)
    if found.objects is not None and objects is not None:
        write_regions(found.objects, objects, running.overwrite)
    if found.objects is not None and labels is not None:
        write_labels(found.objects, labels, run, running)
    _tell(found, limits, target, objects, reporter)


def _params(tile: int | None, options: dict[str, Any]) -> ExtractParams:
    from uavseg.jobs.extract import ExtractParams
    from uavseg.segmentation.params import SegmentParams

    return ExtractParams(
        SegmentParams(options["method"], options["threshold"], options["intensity_step"], options["refine"]),
        min_area=area(options["min_area"]),
        simplify_m=options["simplify"],
        tile=tile,
    )


def _check(target: str, objects: str | None, labels: str | None, overwrite: bool) -> None:
    """Nothing is computed that could not be written."""
    from uavseg.atomic import check_target

    if Path(target).suffix.lower() not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{target}: states are written to .tif, or to .yaml for a ROS map")
    check_target(target, overwrite)
    check_targets(objects, labels, overwrite)
    named = [Path(name).resolve() for name in (target, objects, labels) if name and name != "-"]
    if len(set(named)) < len(named):
        raise OutputError("two outputs have the same name; give each its own")


def _opened(path: str, options: dict[str, Any], resume: str | None) -> GreySource:
    from uavseg.occupancy.probability_map import open_map, stretch_of
    from uavseg.occupancy.ros.ros_map import is_ros_map
    from uavseg.segmentation.blocks.block_file import is_block_map
    from uavseg.segmentation.source import GreySource

    if is_ros_map(path):
        dataset = opened_ros_map((path,), options, resume)
        return GreySource(dataset, stretch_of(dataset))
    if is_block_map(path):
        raise ParameterError(
            f"{path} is a block map; states are refined with the map, so give the map itself"
        )
    return GreySource(*open_map(path, options["band"], options["nodata"]))


def _stretched(source: GreySource, stretch: str | None, tile: int | None, map: Map) -> GreySource:
    """The map as probabilities, where it holds something else."""
    from uavseg.raster.intensity.stretch import fit
    from uavseg.raster.tile_pass import TilePass
    from uavseg.segmentation.source import GreySource

    if stretch is None:
        return source
    dataset = source.dataset
    return GreySource(dataset, fit(dataset, stretch, TilePass.over(dataset, tile, map)))


def _check_place(target: str, mode: str, objects: str | None, source: GreySource, overwrite: bool) -> None:
    """Nothing is computed that has no place where it is to be written."""
    from uavseg.occupancy.ros.ros_map import check_ros_map, is_ros_map
    from uavseg.regions.formats import export

    if is_ros_map(target):
        check_ros_map(target, source.dataset.geobox, overwrite, mode)
    if objects is not None:
        export.check_region_crs(objects, source.dataset.geobox.wkt)


def _write_states(found: Classification, target: str, mode: str, overwrite: bool, reporter: Reporter) -> None:
    from uavseg.jobs.classify import write_states
    from uavseg.occupancy.ros.ros_map import is_ros_map

    write_states(target, found, overwrite, mode)
    if is_ros_map(target) and found.cells[0]:
        reporter.warn(
            f"a ROS map knows no nodata: {found.cells[0]:,} cells without data are unknown in {target}"
        )


def _tell(
    found: Classification, limits: StateLimits, target: str, objects: str | None, reporter: Reporter
) -> None:
    rows, cols = found.geobox.shape
    names = {1: "free", 2: "unknown", 3: "occupied", 0: "no data"}
    shares = {
        name: f"{found.cells[state]:,} ({100 * found.cells[state] / (rows * cols):.1f} %)"
        for state, name in names.items()
        if state or found.cells[0]
    }
    table = {"states": f"{rows:,} x {cols:,} cells -> {target}", **shares}
    if found.objects is not None:
        where = "" if objects is None else f" -> {shown(objects)}"
        table["objects"] = f"{len(found.objects.regions):,}{where}"
        table["largest"] = largest(found.objects, "m2")
    table["limits"] = f"free up to {limits.free_below:g}, occupied above {limits.occupied_above:g}"
    hazard, by_value = found.occupied_in_free, found.occupied_by_value
    table["hazard"] = f"{hazard:,} of {by_value:,} cells with v above the occupied limit are called free"
    table["stretch"] = found.about.stretch.name
    table["seconds"] = f"{reporter.seconds:.2f}"
    tell(table, reporter)
