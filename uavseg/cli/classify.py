"""`uavseg classify`: a map of probabilities becomes free, unknown and occupied cells, and objects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import (
    LabelFile,
    check_distinct,
    check_targets,
    keep_inputs,
    largest,
    shown,
    transaction,
    write_label_output,
    write_region_output,
)
from uavseg.cli.options.access import access_options
from uavseg.cli.options.bands import band_option, formula_options, nodata_option
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.raster import (
    area,
    drawing,
    map_stretch_option,
    polarity_option,
    read_options,
    segment_params,
    segmenting_options,
)
from uavseg.cli.options.running import RunOptions, running_options
from uavseg.errors import OutputError

if TYPE_CHECKING:
    from uavseg.jobs.maps.classify import Classification, ClassifyRequest
    from uavseg.raster.formats.creation import CreationOptions
    from uavseg.raster.grid.geobox import GeoBox
    from uavseg.segmentation.params.segment import StateLimits


@click.command("classify", short_help="Find what is free, unknown and occupied in a map of probabilities.")
@click.argument("path", metavar="MAP")
@band_option
@formula_options
@nodata_option
@map_stretch_option
@polarity_option
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
@creation_option
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
@segmenting_options
@click.option(
    "--refine",
    type=click.Choice(["scan", "none"]),
    default="scan",
    show_default=True,
    help="Whether the borders of states are found to the cell, or stay those of blocks.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop objects of less; states stay as they are.")
@click.option(
    "--allow-lost-obstacles",
    is_flag=True,
    help="Write states in which obstacles of the map have no occupied cell, instead of refusing.",
)
@click.option("--simplify", type=float, metavar="METRES", help="Simplify the outlines of objects.")
@running_options
@access_options
def command(**options: Any) -> None:
    """Find what is free (1), unknown (2) and occupied (3) in MAP; 0 is nodata.

    MAP is a raster of probabilities, integers from 0 to the largest of their type or floats from 0 to 1, or
    the YAML file of a ROS map, read as Nav2 reads it. Objects have their area, bounding box and mean. A ROS
    map knows no nodata: such cells are written as unknown.

    Walls and poles of one or two cells, which the method of the paper loses, are restored where noise does
    not explain them. Where obstacles are lost all the same (--method paper, --refine none), nothing is
    written unless --allow-lost-obstacles is given.
    """
    from uavseg.jobs.maps.classify import classify
    from uavseg.jobs.source.open_source import open_probability_map

    run = RunOptions.of(options)
    target = options["output"] or f"{Path(options['path']).stem}.states.tif"
    request, read = _request(options), read_options(options)
    creation = creation_of(options, {options["labels"]: "uint32", target: "uint8"})
    labels = LabelFile(options["labels"], creation)
    _check_targets(target, options, run.overwrite)
    keep_inputs([*_files(target, options["mode"]), options["objects"], options["labels"]], options["path"])
    source = open_probability_map(options["path"], read)
    _check_place(target, options, source.geobox, run.overwrite)
    work = run.work()
    found = classify(source, request, work)
    run.reporter.finish(found.warnings)
    with transaction():
        _write_states(found, target, options["mode"], labels.creation, run)
        if found.objects is not None:
            write_label_output(found.objects, labels, work, run.overwrite)
        if found.objects is not None and options["objects"] is not None:
            write_region_output(found.objects, options["objects"], run.overwrite)
    rows = _rows(found, request.limits, target, options["objects"])
    run.reporter.table(rows | {"seconds": f"{run.reporter.seconds:.2f}"})


def _request(options: dict[str, Any]) -> ClassifyRequest:
    from uavseg.jobs.maps.classify import ClassifyRequest
    from uavseg.segmentation.params.segment import StateLimits

    return ClassifyRequest(
        StateLimits(options["free_below"], options["occupied_above"]),
        segment_params(options, options["refine"]),
        options["objects"] is not None or options["labels"] is not None,
        drawing(options),
        area(options["min_area"]),
        options["allow_lost_obstacles"],
    )


def _check_targets(target: str, options: dict[str, Any], overwrite: bool) -> None:
    """Nothing is computed that could not be written."""
    from uavseg.output.atomic import check_target

    if Path(target).suffix.lower() not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{target}: states are written to .tif, or to .yaml for a ROS map")
    check_target(target, overwrite)
    check_targets(options["objects"], options["labels"], overwrite)
    check_distinct(target, options["objects"], options["labels"])


def _files(target: str, mode: str) -> list[str]:
    """The states, and the image of a ROS map."""
    from uavseg.occupancy.ros.ros_map import image_path, is_ros_map

    return [target, str(image_path(target, mode))] if is_ros_map(target) else [target]


def _check_place(target: str, options: dict[str, Any], geobox: GeoBox, overwrite: bool) -> None:
    """Nothing is computed that has no place where it is to be written."""
    from uavseg.occupancy.ros.ros_map import check_ros_map, is_ros_map
    from uavseg.regions.formats import export

    if is_ros_map(target):
        check_ros_map(target, geobox, overwrite, options["mode"])
    if options["objects"] is not None:
        export.check_region_crs(options["objects"], geobox.wkt)


def _write_states(
    found: Classification, target: str, mode: str, creation: CreationOptions, run: RunOptions
) -> None:
    from uavseg.occupancy.ros.ros_map import is_ros_map
    from uavseg.occupancy.state_file import write_states

    write_states(target, found.image, found.geobox, run.overwrite, mode, creation)
    if is_ros_map(target) and found.cells[0]:
        run.reporter.warn(
            f"a ROS map knows no nodata: {found.cells[0]:,} cells without data are unknown in {target}"
        )


def _rows(found: Classification, limits: StateLimits, target: str, objects: str | None) -> dict[str, str]:
    """The short table at the end."""
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
        table["largest"] = largest(found.objects)
    table["limits"] = f"free up to {limits.free_below:g}, occupied above {limits.occupied_above:g}"
    table["restored"] = f"{found.restored:,} cells of thin obstacles"
    hazard, by_value = found.occupied_in_free, found.occupied_by_value
    table["hazard"] = f"{hazard:,} of {by_value:,} cells with v above the occupied limit are called free"
    table["unseen"] = f"{found.unknown_in_free:,} cells whose own v is unknown are called free"
    if found.lost_obstacles:
        table["lost"] = f"{found.lost_obstacles:,} obstacles without an occupied cell"
    table["stretch"] = found.source.stretch.name
    return table
