"""`uavseg extract`: rasters, or a block map, become regions."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._reading import reading_options
from uavseg.cli._running import Reporter, resuming, running_options, workers
from uavseg.cli._segmenting import segmenting_options
from uavseg.cli.plan import mission_options
from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission
    from uavseg.parallel import Map
    from uavseg.regions.extract import ExtractParams
    from uavseg.regions.extraction import Extraction
    from uavseg.segmentation.blockfile import SavedBlocks
    from uavseg.segmentation.segments import IntensityRange


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
    type=click.Choice(["scan", "none", "smooth"]),
    default="scan",
    show_default=True,
    help="How boundaries are found to the pixel.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop regions of less.")
@click.option("--fill-holes", metavar="M2|Npx", help="Fill holes of less, before small regions are dropped.")
@click.option(
    "--simplify", type=float, metavar="METRES", help="Simplify outlines; shared borders stay shared."
)
@click.option("--mission", metavar="PATH", help="Also plan a mission over the regions: .plan or .waypoints.")
@mission_options
@running_options
def command(
    rasters: tuple[str, ...],
    interval: str,
    output: str | None,
    labels: str | None,
    mission: str | None,
    tile: int | None,
    threads: int | None,
    scheduler: str | None,
    resume: str | None,
    overwrite: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
    **options: Any,
) -> None:
    """Extract the regions of RASTER... (many are one mosaic) whose mean intensity lies in a range.

    RASTER may also be a block map from `uavseg divide`. With --mission, a flight over the regions is planned
    too; see `uavseg plan --help` for how.
    """
    reporter = Reporter(quiet, verbose, progress)
    target = output or f"{Path(rasters[0]).stem}.regions.geojson"
    wanted = _parsed_range(interval)
    params = _params(tile, options)
    flight = _flight(mission, options)
    _check_targets(target, labels, mission, overwrite)
    saved, dataset = _opened(rasters, options, params, reporter)
    _check_place(target, mission, saved.geobox.wkt if saved is not None else dataset.geobox.wkt)
    run = workers(threads, scheduler)
    if dataset is not None:
        reporter.begin(dataset, tile)
    found = _extracted(saved, dataset, wanted, params, resuming(run, resume, reporter), reporter)
    reporter.finish()
    for warning in found.warnings:
        reporter.warn(warning)
    if len(found.regions) == 0:
        reporter.warn(
            f"no region has a mean v in {wanted.low:g}..{wanted.high:g}; uavseg info shows which v there are"
        )
    made = None if flight is None else _planned(found, flight, options["home"])
    _write(found, target, overwrite)
    if labels is not None:
        _write_labels(found, labels, run, threads, overwrite)
    if made is not None:
        _write_mission(made, len(found.regions), mission, overwrite, reporter)
    _tell(found, target, reporter)


def _parsed_range(text: str) -> IntensityRange:
    from uavseg.segmentation.segments import IntensityRange

    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"--range is two numbers between commas, such as 0.55,1, not {text!r}") from None
    return IntensityRange(low, high)


def _params(tile: int | None, options: dict[str, Any]) -> ExtractParams:
    from uavseg.raster.stretch import parse_stretch
    from uavseg.regions.cleaning import parse_area
    from uavseg.regions.extract import ExtractParams
    from uavseg.segmentation.pipeline import SegmentParams

    def area(text: str | None) -> Any:
        return None if text is None else parse_area(text)

    return ExtractParams(
        SegmentParams(options["method"], options["threshold"], options["intensity_step"], options["refine"]),
        parse_stretch(options["stretch"]),
        area(options["fill_holes"]),
        area(options["min_area"]),
        options["simplify"],
        tile,
    )


def _flight(mission: str | None, options: dict[str, Any]) -> Any:
    """How to fly, checked before any work is done."""
    if mission is None:
        return None
    from uavseg.cli.plan import home_position, mission_params
    from uavseg.flight import files

    files.check_format(mission)
    home_position(options["home"], [(0.0, 0.0)])
    return mission_params(**options)


def _check_targets(output: str, labels: str | None, mission: str | None, overwrite: bool) -> None:
    """Nothing that is there is touched, and nothing is computed that could not be written."""
    from uavseg.atomic import check_target

    if output != "-":
        from uavseg.regions.export import check

        check(output, overwrite)
    if mission is not None:
        check_target(mission, overwrite)
    if labels is not None:
        from uavseg.regions.labels import check_labels

        check_labels(labels, overwrite)


def _check_place(output: str, mission: str | None, wkt: str | None) -> None:
    """Nothing is computed that has no place where it is to be written or flown."""
    from uavseg.errors import MissionError
    from uavseg.regions import export, wgs84

    export.check_crs(output, wkt)
    if mission is None:
        return
    if wkt is None:
        raise MissionError(
            "the raster has no CRS, so nobody knows where to fly; give it one with gdal_edit.py -a_srs"
        )
    wgs84.check_crs(wkt)


def _opened(
    rasters: tuple[str, ...], options: dict[str, Any], params: ExtractParams, reporter: Reporter
) -> tuple[SavedBlocks | None, Any]:
    """A block map and its raster if that is at hand, or a raster alone; no pixel is read."""
    from uavseg.raster.dataset import Dataset
    from uavseg.segmentation.blockfile import is_block_map, load

    if len(rasters) > 1 or not is_block_map(rasters[0]):
        how = (options["band"], options["rgb"], options["nodata"], options["skip_bad_tiles"])
        return None, Dataset.open(rasters, *how)
    if options["band"] or options["rgb"] or options["nodata"] is not None or options["stretch"] != "auto":
        raise ParameterError("a block map has its bands, nodata and stretch already; leave these options out")
    saved = load(rasters[0])
    if params.segment.refine == "none":
        return saved, None
    origin = saved.origin
    paths = origin.found(rasters[0])
    if paths is None:
        reporter.warn(f"{origin.rasters[0]} is not where it was, so regions end at block edges")
        return saved, None
    return saved, Dataset.open(paths, origin.band, origin.rgb, origin.nodata, options["skip_bad_tiles"])


def _extracted(
    saved: SavedBlocks | None,
    dataset: Any,
    wanted: IntensityRange,
    params: ExtractParams,
    run: Map,
    reporter: Reporter,
) -> Extraction:
    from uavseg.raster.skipping import BadBlock, listing
    from uavseg.regions.extract import extract, extract_from_blocks

    if saved is None:
        bad: set[BadBlock] = set()
        found = extract(dataset, wanted, params, listing(run, bad), reporter.progress)
        return replace(found, warnings=(*found.warnings, *map(str, sorted(bad))))
    return extract_from_blocks(saved, dataset, wanted, params, run, reporter.progress)


def _write(found: Extraction, target: str, overwrite: bool) -> None:
    from uavseg.regions import export

    export.write(found.regions, sys.stdout.buffer if target == "-" else target, overwrite)


def _write_labels(found: Extraction, path: str, run: Map, threads: int | None, overwrite: bool) -> None:
    from uavseg.regions.labels import is_tiled, write_labels

    here = run if is_tiled(path) else workers(threads, None)  # a single file is painted where it is written
    write_labels(path, found, here, overwrite)


def _planned(found: Extraction, flight: Any, home: str | None) -> Mission:
    from uavseg.cli.plan import planned
    from uavseg.regions.wgs84 import geometries

    return planned(found.regions, list(geometries(found.regions)), flight, home)


def _write_mission(made: Mission, regions: int, path: Any, overwrite: bool, reporter: Reporter) -> None:
    from uavseg.cli.plan import report
    from uavseg.flight import files

    files.write(made, path, overwrite)
    if not reporter.quiet:
        report(made, regions, path)


def _tell(found: Extraction, target: str, reporter: Reporter) -> None:
    """The short table at the end."""
    columns = found.regions.columns
    unit = "m2" if found.regions.wkt is not None else "square units"
    largest = (
        f"{columns['area_m2'][0]:,.1f} {unit} ({columns['pixels'][0]:,} pixels)"
        if len(found.regions)
        else "-"
    )
    rows = {
        "regions": f"{len(found.regions):,} -> {'stdout' if target == '-' else target}",
        "total area": f"{columns['area_m2'].sum():,.1f} {unit}",
        "largest": largest,
        "stretch": found.stretch.name,
        "band": found.band_names,
        "seconds": f"{reporter.seconds:.2f}",
    }
    for name, value in rows.items():
        reporter.say(f"  {name:<12}{value}")
