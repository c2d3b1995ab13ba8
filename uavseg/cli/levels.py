"""`uavseg levels`: rasters, or a block map, divided into levels of equal width."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._reading import reading_options
from uavseg.cli._regions import (
    area,
    check_targets,
    drawing_options,
    largest,
    opened,
    opened_ros_map,
    shown,
    tell,
    write_labels,
    write_regions,
)
from uavseg.cli._running import Reporter, Running, running_options
from uavseg.cli._segmenting import segmenting_options

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.jobs.extract import ExtractParams
    from uavseg.jobs.result import Extraction
    from uavseg.segmentation.blocks.block_file import SavedBlocks
    from uavseg.segmentation.intervals import Levels


@click.command("levels", short_help="Divide a raster into levels of equal width, and each into segments.")
@reading_options
@click.option("--width", type=float, required=True, metavar="P", help="Width of a level in v, such as 0.1.")
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="The segments: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
    "[default: STEM.levels.geojson here]",
)
@click.option(
    "--labels",
    metavar="PATH",
    help="Also write the labels of the segments as a raster: one .tif, or a .vrt over a folder of tiles.",
)
@segmenting_options
@click.option(
    "--min-area", metavar="M2|Npx", help="Merge segments of less into their neighbours, or drop them."
)
@click.option(
    "--small",
    type=click.Choice(["merge", "drop"]),
    default="merge",
    show_default=True,
    help="What becomes of small segments. Merge: one after the other, the smallest first, becomes part of "
    "the neighbour with the longest common border (then the nearest mean); one that has grown enough stays.",
)
@drawing_options
@running_options
def command(
    rasters: tuple[str, ...],
    width: float,
    output: str | None,
    labels: str | None,
    running: Running,
    **options: Any,
) -> None:
    """Divide RASTER... (many are one mosaic) into levels of v: 0..P, P..2P, and so on up to 1.

    A segment is what adjacent blocks of one level make together; a value on an edge belongs to the level
    below it. Each segment has its level, counted from 0, and the interval of that level; its borders are
    those of blocks. RASTER may also be a block map from `uavseg divide`, which answers by itself, or the YAML
    file of a ROS map, which is never stretched. For another map of probabilities, say --stretch none.
    """
    from uavseg.occupancy.ros.ros_map import is_ros_map
    from uavseg.regions.formats import export
    from uavseg.segmentation.intervals import Levels

    reporter = running.reporter
    target = output or f"{Path(rasters[0]).stem}.levels.geojson"
    wanted = Levels(width)
    ros = [raster for raster in rasters if is_ros_map(raster)]
    params = _params(running.tile, options | ({"stretch": "none"} if ros else {}))
    check_targets(target, labels, running.overwrite)
    if ros:
        saved, dataset = None, opened_ros_map(rasters, options, running.resume)
    else:
        saved, dataset = opened(rasters, options, "none", reporter)
    export.check_region_crs(target, saved.geobox.wkt if saved is not None else dataset.geobox.wkt)
    run = running.workers()
    if dataset is not None:
        reporter.begin(dataset, running.tile)
    found = _found(saved, dataset, wanted, params, running.resuming(run), reporter)
    reporter.finish()
    for warning in found.warnings:
        reporter.warn(warning)
    if len(found.regions) == 0:
        reporter.warn("no segment is left: no pixel is valid, or all segments are smaller than --min-area")
    write_regions(found, target, running.overwrite)
    if labels is not None:
        write_labels(found, labels, run, running)
    _tell(found, wanted, target, reporter)


def _params(tile: int | None, options: dict[str, Any]) -> ExtractParams:
    from uavseg.jobs.extract import ExtractParams
    from uavseg.raster.intensity.stretch import parse_stretch
    from uavseg.segmentation.params import SegmentParams

    return ExtractParams(
        SegmentParams(options["method"], options["threshold"], options["intensity_step"], "none"),
        parse_stretch(options["stretch"]),
        min_area=area(options["min_area"]),
        simplify_m=options["simplify"],
        tile=tile,
        smooth_m=options["smooth_outline"],
        small=options["small"],
    )


def _found(
    saved: SavedBlocks | None,
    dataset: Any,
    levels: Levels,
    params: ExtractParams,
    run: Map,
    reporter: Reporter,
) -> Extraction:
    from uavseg.jobs.levels import extract_levels, levels_from_blocks
    from uavseg.raster.bad_blocks import BadBlock, listing

    if saved is not None:
        return levels_from_blocks(saved, levels, params)
    bad: set[BadBlock] = set()
    found = extract_levels(dataset, levels, params, listing(run, bad), reporter.progress)
    return replace(found, warnings=(*found.warnings, *map(str, sorted(bad))))


def _tell(found: Extraction, levels: Levels, target: str, reporter: Reporter) -> None:
    columns = found.regions.columns
    unit = "m2" if found.regions.wkt is not None else "square units"
    there = len(set(columns["level"].tolist()))
    rows = {
        "segments": f"{len(found.regions):,} -> {shown(target)}",
        "levels": f"{there:,} of {levels.count:,} are there, each {levels.width:g} of v wide",
        "total area": f"{columns['area_m2'].sum():,.1f} {unit}",
        "largest": largest(found, unit),
        "stretch": found.stretch.name,
        "band": found.band_names,
        "seconds": f"{reporter.seconds:.2f}",
    }
    tell(rows, reporter)
