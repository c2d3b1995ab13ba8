"""`uavseg extract`: rasters, or a block map, become regions."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, showing_phases, work_of
from uavseg.errors import MissionError
from uavseg.options.regions import ExtractOptions
from uavseg.plain_text import first_of

if TYPE_CHECKING:
    from uavseg.jobs.requests import RegionJob

_LISTED = 12  # classes in the table at the end


@job_command("extract", ExtractOptions)
def command(options: ExtractOptions, reporter: Reporter) -> None:
    """Extract the regions of RASTER... (many are one mosaic) whose mean intensity lies in a range.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names), ITEM.json#ASSET (of STAC) or -
    (names on standard input). Its rasters are one mosaic, unless --each is given.

    RASTER may also be a block map from `uavseg divide`. With --mission, a flight over the regions is planned
    too; see `uavseg plan --help` for how.
    """
    write.check_ranges(options.ranges, {"--class": options.class_texts, "--classes": options.classes})
    from uavseg.jobs.requests import region_job
    from uavseg.jobs.source.open_source import open_source
    from uavseg.regions.formats.export import is_region_folder

    job = region_job(options)
    _check_classes(options, _class_names(job.request))
    if write.answer_each(options, job, ".regions.geojson", reporter):
        return
    if is_region_folder(options.outputs.output or ""):
        _write_partitions(options, job, reporter)
        return
    flight, avoid = None, options.flight.safety.avoid
    if options.mission is not None:
        from uavseg.flight.formats.files import file_options
        from uavseg.jobs.flights.request import mission_request

        file_options(options.mission, **asdict(options.flight.files))
        over, around = options.mission_classes or None, options.avoid_classes
        flight = mission_request(options.flight, options.mission, classes=over, avoid_classes=around)
    read = [zone for zone in avoid if isinstance(zone, str)], options.flight.terrain.dem
    files = write.RegionFiles(options, ".regions.geojson", *read, others=[options.mission])
    if options.mission is not None:
        write.check_output(options.mission, options.files.overwrite)
    source = open_source(options.source.rasters, job.read)
    files.check_crs(source.geobox.wkt)
    if flight is not None:
        _check_flyable(source.geobox.wkt)
    work = work_of(options.run, reporter)
    found = job.find(source, work)
    reporter.finish([*found.warnings, *files.notes(found, source.geobox.wkt)])
    planned = None
    if flight is not None:
        from uavseg.jobs.flights.plan import plan
        from uavseg.jobs.flights.request import open_regions, zone_polygons

        with showing_phases(reporter.quiet):
            zones, notes = zone_polygons(options.flight.safety, source)
            planned = plan(open_regions(found.regions), flight, zones, source, notes)
    paths: list[Path] = []
    unwritten: list[str] = []
    with write.transaction():
        if planned is not None and options.mission is not None:
            paths, unwritten = write.write_plan_output(
                planned, options.mission, files.overwrite, options.flight.files
            )
        files.write(found, work)
    if planned is not None and not reporter.quiet:
        from uavseg.cli.plan import report

        notes = [*planned.warnings, *unwritten]
        if options.avoid_classes and (options.sizes.min_area, options.sizes.fill_holes) != (None, None):
            names = ", ".join(options.avoid_classes)
            notes.append(
                f"regions of {names} that --min-area drops or --fill-holes fills are not kept out of"
            )
        report(planned.missions, planned.regions, paths, notes)
    rows = {"regions": f"{len(found.regions):,} -> {write.shown(files.target)}"}
    if known := _class_names(job.request):
        names = found.regions.columns["class"].tolist()
        rows["classes"] = first_of([f"{name} {names.count(name):,}" for name in known], _LISTED)
    rows |= write.summary_rows(found)
    reporter.timed_table(rows)


def _write_partitions(options: ExtractOptions, job: "RegionJob", reporter: Reporter) -> None:
    """Write the regions of one range to a folder of files, and nothing beside it."""
    from uavseg.jobs.extract import check_local, extract_partitions
    from uavseg.jobs.source.open_source import open_source

    outputs, target = options.outputs, options.outputs.output or ""
    refused = {"--labels": outputs.labels, "--style": outputs.style, "--mission": options.mission}
    refused |= {"--crs": outputs.crs}
    for name in [name for name, given in refused.items() if given is not None]:
        raise click.UsageError(f"{name} does not go with a folder of regions; leave it out, or write a file")
    write.geojson_form(outputs, target)
    write.keep_inputs([target], options.source.rasters)
    work, overwrite = work_of(options.run, reporter), options.files.overwrite
    request = check_local(job.request)
    source = open_source(options.source.rasters, job.read)
    found, written = extract_partitions(source, request, target, work, overwrite)
    reporter.finish(found.warnings)
    (pixels, area), unit = written.largest, found.area_unit
    rows = {"regions": f"{written.regions:,} in {written.files:,} files -> {target}"}
    rows |= write.summary_rows(found)
    rows["total area"] = f"{written.area:,.1f} {unit}"
    rows["largest"] = f"{area:,.1f} {unit} ({pixels:,} pixels)" if written.files else "-"
    rows |= write.confidence_row(found, written.regions)
    reporter.timed_table(rows)


def _class_names(request: Any) -> list[str]:
    classes = getattr(request, "classes", None)
    return [] if classes is None else [one.name for one in classes.classes]


def _check_classes(options: ExtractOptions, known: list[str]) -> None:
    """Refuse a mission over classes that were not asked for, or that does not say which it flies over."""
    named = [*options.mission_classes, *options.avoid_classes]
    if named and options.mission is None:
        raise click.UsageError("--mission-class and --avoid-class are for a mission; give --mission too")
    for name in named:
        if name not in known:
            there = f"the classes are {', '.join(known)}" if known else "give classes with --class"
            raise click.UsageError(f"there is no class {name}; {there}")
    if options.mission is not None and len(known) > 1 and not options.mission_classes:
        raise click.UsageError(
            f"say which class the mission flies over, such as --mission-class {known[0]!r}; "
            "--avoid-class names those it keeps out of"
        )


def _check_flyable(wkt: str | None) -> None:
    """Compute nothing over which nobody can fly."""
    from uavseg.regions.wgs84 import to_wgs84

    if wkt is None:
        why = "the raster has no CRS, so nobody knows where to fly"
        raise MissionError(f"{why}; give it one with gdal_edit.py -a_srs")
    to_wgs84.check_on_earth(wkt)
