"""`uavseg extract`: rasters, or a block map, become regions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import (
    LabelFile,
    check_targets,
    keep_inputs,
    shown,
    summary_rows,
    transaction,
    write_plan_output,
    write_regions_and_labels,
)
from uavseg.cli.options.classes import (
    asked_ranges,
    avoid_notes,
    check_mission_classes,
    class_choice_options,
    class_options,
    class_rows,
)
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.each import answer_each, check_alone, each_options
from uavseg.cli.options.files import parse_file_options
from uavseg.cli.options.home_words import HomeCommand
from uavseg.cli.options.limits import zone_files
from uavseg.cli.options.mission import mission_options
from uavseg.cli.options.ranges import range_options
from uavseg.cli.options.raster import (
    area,
    drawing,
    drawing_options,
    flatten_option,
    length,
    min_confidence_option,
    read_options,
    reading_options,
    segment_params,
    segmenting_options,
)
from uavseg.cli.options.running import RunOptions, running_options
from uavseg.cli.options.stream import geojson_form, stream_options, stream_warnings
from uavseg.cli.options.style import style_kind, style_option

if TYPE_CHECKING:
    from uavseg.jobs.extract import ExtractRequest
    from uavseg.jobs.extract_classes import ClassesRequest
    from uavseg.jobs.flights.plan import PlanRequest
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.source.source import Source
    from uavseg.jobs.source.work import Work
    from uavseg.regions.formats.geojson import GeoJsonForm


@click.command("extract", cls=HomeCommand)
@reading_options
@range_options("The range of v, such as 0.55,1. Several are classes, named after their ranges.", many=True)
@class_options
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
@creation_option
@flatten_option
@segmenting_options
@click.option(
    "--refine",
    type=click.Choice(["tv", "scan", "none", "smooth", "pixels"]),
    show_default="tv; with --method paper scan, and none for classes",
    help="How boundaries are found to the pixel: by total variation, four scans or a local mean; those of "
    "classes by tv or none. Or pixels: every pixel by its own value, as a threshold and a polygonizer do.",
)
@click.option(
    "--detail",
    metavar="M|Npx",
    help="Leave out what is narrower, cut necks and close gaps that are; before holes are filled.",
)
@click.option(
    "--thin-lines",
    is_flag=True,
    help="Also find lines of 1 to 3 pixels (cracks, tracks) in one range by their contrast along 15 pixels.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop regions of less, after holes are filled.")
@click.option("--fill-holes", metavar="M2|Npx", help="Fill holes of less, before small regions are dropped.")
@min_confidence_option
@drawing_options
@click.option(
    "--mission", metavar="PATH", help="Also plan a mission over the regions: a file as of uavseg plan."
)
@class_choice_options("--mission-class")
@mission_options
@style_option
@stream_options
@each_options
@running_options
def command(**options: Any) -> None:
    """Extract the regions of RASTER... (many are one mosaic) whose mean intensity lies in a range.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names) or - (names on standard input). Its
    rasters are one mosaic, unless --each is given.

    RASTER may also be a block map from `uavseg divide`. With --mission, a flight over the regions is planned
    too; see `uavseg plan --help` for how.
    """
    from uavseg.jobs.each.each import RegionJob
    from uavseg.jobs.source.open_source import open_source
    from uavseg.raster.read.source_list import stem_of

    run = RunOptions.of(options)
    request, read = _request(options), read_options(options)
    if options["each"]:
        answer_each(
            options,
            RegionJob(read, lambda source, how: _regions(source, request, how)),
            ".regions.geojson",
            run,
        )
        return
    check_alone(options)
    target = options["output"] or f"{stem_of(options['rasters'][0])}.regions.geojson"
    form = geojson_form(options, target)
    mission, labels = options["mission"], options["labels"]
    label_file = LabelFile(labels, creation_of(options, {labels: "uint32"}))
    flight = None if mission is None else _flight(options)
    files = parse_file_options(options)
    check_targets(target, labels, run.overwrite)
    style = style_kind(options, target)
    _check_mission_target(mission, run.overwrite)
    keep_inputs([target, labels, mission], options["rasters"], zone_files(options), options["dem"])
    source = open_source(options["rasters"], read)
    _check_place(target, mission, source.geobox.wkt, form)
    work = run.work()
    found = _regions(source, request, work)
    from uavseg.regions.formats import export

    notes = [*stream_warnings(form, source.geobox.wkt), *export.format_notes(found.regions, target)]
    run.reporter.finish([*found.warnings, *notes])
    planned = None
    if flight is not None:
        from uavseg.cli.options.limits import zones_of
        from uavseg.cli.options.mission import report
        from uavseg.cli.options.verbosity import showing_phases
        from uavseg.jobs.flights.plan import plan
        from uavseg.jobs.flights.plan_regions import open_regions

        with showing_phases(run.reporter.quiet):
            planned = plan(open_regions(found.regions), flight, zones_of(options, source), source)
    paths: list[Path] = []
    unwritten: list[str] = []
    with transaction():
        if planned is not None:
            paths, unwritten = write_plan_output(planned, options["mission"], run.overwrite, files)
        write_regions_and_labels(found, target, label_file, work, run.overwrite, form, style)
    if planned is not None and not run.reporter.quiet:
        report(
            planned.missions, planned.regions, paths, [*planned.warnings, *unwritten, *avoid_notes(options)]
        )
    rows = {"regions": f"{len(found.regions):,} -> {shown(target)}", **class_rows(found, request)}
    rows |= summary_rows(found)
    run.reporter.table(rows | {"seconds": f"{run.reporter.seconds:.2f}"})


def _request(options: dict[str, Any]) -> ExtractRequest | ClassesRequest:
    from uavseg.segmentation.params.partition import ValueClasses

    asked, refine = asked_ranges(options), options["refine"]
    check_mission_classes(options, asked)
    how = (
        drawing(options),
        area(options["fill_holes"]),
        area(options["min_area"]),
        length(options["detail"]),
        options["min_confidence"],
    )
    if not isinstance(asked, ValueClasses):
        from uavseg.jobs.extract import ExtractRequest

        return ExtractRequest(asked, segment_params(options, refine), *how, options["thin_lines"])
    from uavseg.jobs.extract_classes import ClassesRequest, refuse_thin_lines
    from uavseg.jobs.segment_kinds import joint_params

    refuse_thin_lines(options["thin_lines"])
    return ClassesRequest(asked, joint_params(segment_params(options, None), refine), *how)


def _regions(source: Source, request: ExtractRequest | ClassesRequest, work: Work) -> Extraction:
    from uavseg.jobs.extract import ExtractRequest, extract

    if isinstance(request, ExtractRequest):
        return extract(source, request, work)
    from uavseg.jobs.extract_classes import extract_classes

    return extract_classes(source, request, work)


def _flight(options: dict[str, Any]) -> PlanRequest:
    """How to fly, checked before any work is done."""
    from uavseg.cli.options.mission import plan_request
    from uavseg.flight.formats import files

    files.check_mission_format(options["mission"])
    return plan_request(options)


def _check_mission_target(mission: str | None, overwrite: bool) -> None:
    from uavseg.output.atomic import check_target

    if mission is not None:
        check_target(mission, overwrite)


def _check_place(output: str, mission: str | None, wkt: str | None, form: GeoJsonForm) -> None:
    """Nothing is computed that has no place where it is to be written or flown."""
    from uavseg.errors import MissionError
    from uavseg.regions.formats import export
    from uavseg.regions.wgs84 import to_wgs84

    export.check_region_crs(output, wkt, form)
    if mission is None:
        return
    if wkt is None:
        raise MissionError(
            "the raster has no CRS, so nobody knows where to fly; give it one with gdal_edit.py -a_srs"
        )
    to_wgs84.check_on_earth(wkt)
