"""`uavseg extract`: rasters, or a block map, become regions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._mission import mission_options
from uavseg.cli._reading import reading_options
from uavseg.cli._regions import (
    area,
    check_targets,
    drawing_options,
    largest,
    opened,
    shown,
    tell,
    write_labels,
    write_regions,
)
from uavseg.cli._running import Reporter, Running, running_options
from uavseg.cli._segmenting import parsed_range, segmenting_options

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.flight.mission import Mission
    from uavseg.jobs.extract import ExtractParams
    from uavseg.jobs.result import Extraction
    from uavseg.segmentation.blocks.block_file import SavedBlocks
    from uavseg.segmentation.intervals import IntensityRange


@click.command("extract")
@reading_options
@click.option("--range", "interval", required=True, metavar="LO,HI", help="The range of v, such as 0.55,1.")
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="The regions: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
    "[default: STEM.regions.geojson here]",
)
@click.option(
    "--labels",
    metavar="PATH",
    help="Also write the labels of the regions as a raster: one .tif, or a .vrt over a folder of tiles.",
)
@segmenting_options
@click.option(
    "--refine",
    type=click.Choice(["tv", "scan", "none", "smooth"]),
    show_default="tv; scan with --method paper",
    help="How boundaries are found to the pixel: by total variation, four scans or a local mean.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop regions of less, after holes are filled.")
@click.option("--fill-holes", metavar="M2|Npx", help="Fill holes of less, before small regions are dropped.")
@drawing_options
@click.option("--mission", metavar="PATH", help="Also plan a mission over the regions: .plan or .waypoints.")
@mission_options
@running_options
def command(
    rasters: tuple[str, ...],
    interval: str,
    output: str | None,
    labels: str | None,
    mission: str | None,
    running: Running,
    **options: Any,
) -> None:
    """Extract the regions of RASTER... (many are one mosaic) whose mean intensity lies in a range.

    RASTER may also be a block map from `uavseg divide`. With --mission, a flight over the regions is planned
    too; see `uavseg plan --help` for how.
    """
    reporter = running.reporter
    target = output or f"{Path(rasters[0]).stem}.regions.geojson"
    wanted = parsed_range(interval)
    params = _params(running.tile, options)
    flight = _flight(mission, options)
    _check_targets(target, labels, mission, running.overwrite)
    saved, dataset = opened(rasters, options, params.segment.refine, reporter)
    _check_place(target, mission, saved.geobox.wkt if saved is not None else dataset.geobox.wkt)
    run = running.workers()
    if dataset is not None:
        reporter.begin(dataset, running.tile)
    found = _extracted(saved, dataset, wanted, params, running.resuming(run), reporter)
    reporter.finish()
    for warning in found.warnings:
        reporter.warn(warning)
    if len(found.regions) == 0:
        reporter.warn(
            f"no region has a mean v in {wanted.low:g}..{wanted.high:g}; uavseg info shows which v there are"
        )
    made = None if flight is None else _planned(found, flight, options["home"])
    write_regions(found, target, running.overwrite)
    if labels is not None:
        write_labels(found, labels, run, running)
    if made is not None:
        _write_mission(made, len(found.regions), mission, running.overwrite, reporter)
    _tell(found, target, reporter)


def _params(tile: int | None, options: dict[str, Any]) -> ExtractParams:
    from uavseg.jobs.extract import ExtractParams
    from uavseg.raster.intensity.stretch import parse_stretch
    from uavseg.segmentation.params import SegmentParams

    return ExtractParams(
        SegmentParams(options["method"], options["threshold"], options["intensity_step"], options["refine"]),
        parse_stretch(options["stretch"]),
        area(options["fill_holes"]),
        area(options["min_area"]),
        options["simplify"],
        tile,
        options["smooth_outline"],
    )


def _flight(mission: str | None, options: dict[str, Any]) -> Any:
    """How to fly, checked before any work is done."""
    if mission is None:
        return None
    from uavseg.cli._mission import home_position, mission_params
    from uavseg.flight import files

    files.check_format(mission)
    home_position(options["home"], [(0.0, 0.0)])
    return mission_params(**options)


def _check_targets(output: str, labels: str | None, mission: str | None, overwrite: bool) -> None:
    """Nothing that is there is touched, and nothing is computed that could not be written."""
    from uavseg.atomic import check_target

    check_targets(output, labels, overwrite)
    if mission is not None:
        check_target(mission, overwrite)


def _check_place(output: str, mission: str | None, wkt: str | None) -> None:
    """Nothing is computed that has no place where it is to be written or flown."""
    from uavseg.errors import MissionError
    from uavseg.regions.formats import export
    from uavseg.regions.wgs84 import to_wgs84

    export.check_region_crs(output, wkt)
    if mission is None:
        return
    if wkt is None:
        raise MissionError(
            "the raster has no CRS, so nobody knows where to fly; give it one with gdal_edit.py -a_srs"
        )
    to_wgs84.check_on_earth(wkt)


def _extracted(
    saved: SavedBlocks | None,
    dataset: Any,
    wanted: IntensityRange,
    params: ExtractParams,
    run: Map,
    reporter: Reporter,
) -> Extraction:
    from uavseg.jobs.extract import extract, extract_from_blocks
    from uavseg.raster.bad_blocks import BadBlock, listing

    if saved is None:
        bad: set[BadBlock] = set()
        found = extract(dataset, wanted, params, listing(run, bad), reporter.progress)
        return replace(found, warnings=(*found.warnings, *map(str, sorted(bad))))
    return extract_from_blocks(saved, dataset, wanted, params, run, reporter.progress)


def _planned(found: Extraction, flight: Any, home: str | None) -> Mission:
    from uavseg.cli._mission import planned
    from uavseg.regions.wgs84.to_wgs84 import wgs84_geometries

    return planned(found.regions, list(wgs84_geometries(found.regions)), flight, home)


def _write_mission(made: Mission, regions: int, path: Any, overwrite: bool, reporter: Reporter) -> None:
    from uavseg.cli._mission import report
    from uavseg.flight import files

    files.write(made, path, overwrite)
    if not reporter.quiet:
        report(made, regions, path)


def _tell(found: Extraction, target: str, reporter: Reporter) -> None:
    """The short table at the end."""
    unit = "m2" if found.regions.wkt is not None else "square units"
    rows = {
        "regions": f"{len(found.regions):,} -> {shown(target)}",
        "total area": f"{found.regions.columns['area_m2'].sum():,.1f} {unit}",
        "largest": largest(found, unit),
        "stretch": found.stretch.name,
        "band": found.band_names,
        "seconds": f"{reporter.seconds:.2f}",
    }
    tell(rows, reporter)
