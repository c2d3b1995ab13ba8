"""Files that a command writes of regions: checked before any work, and written together."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli.terminal.say import Reporter, say, show, standard_output
from uavseg.errors import OutputError

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission
    from uavseg.jobs.flights.photographs import Footprints
    from uavseg.jobs.flights.plan import MissionPlan
    from uavseg.jobs.maps.compare import Comparison
    from uavseg.jobs.requests import RegionJob
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.source.work import Work
    from uavseg.options.flights import MissionFileOptions
    from uavseg.options.regions import ExtractOptions, LevelsOptions, MatchOptions, RangeOptions
    from uavseg.options.running import RegionOutputs, StorageOptions
    from uavseg.raster.formats.creation import CreationOptions
    from uavseg.regions.formats.text_writers import GeoJsonForm

    RegionOptions = ExtractOptions | LevelsOptions | MatchOptions

T = TypeVar("T")


def creation_of(stored: StorageOptions, targets: dict[str | None, str]) -> CreationOptions:
    """Return how the GeoTIFFs of a command are stored, by its outputs and the types of their pixels."""
    from uavseg.raster.formats.creation import creation_for

    return creation_for(stored.creation_options, targets)


def check_targets(output: str | None, labels: str | None, overwrite: bool) -> None:
    """Check, before any work, that outputs can be written and replace nothing."""
    from uavseg.regions.formats.export import check_labels, check_region_path

    if output is not None and output != "-":
        check_region_path(output, overwrite)
    if labels is not None:
        check_labels(labels, overwrite)


def check_distinct(*paths: str | None) -> None:
    """Refuse outputs that have the same name, with OutputError."""
    named = [Path(path).resolve() for path in paths if path and path != "-"]
    if len(set(named)) < len(named):
        raise OutputError("two outputs have the same name; give each its own")


def check_ranges(ranges: RangeOptions, classes: Mapping[str, Any]) -> None:
    """Refuse no range, or more than one kind of range or of classes, which are given by their options."""
    named = {"--range": ranges.range, "--values": ranges.values, "--percentile": ranges.percentile}
    given = [name for name, value in (named | dict(classes)).items() if value]
    if not given:
        others = "; or '--class' or '--classes'" if classes else ""
        raise click.UsageError(f"Missing option '--range' (v in 0..1), '--values' or '--percentile'{others}.")
    if len(given) > 1:
        several = isinstance(ranges.range, list) or classes.keys() & set(given)
        why = "do not go together; give a range, or classes in one way"
        why = why if several else "are ranges of different kinds; give one of them"
        raise click.UsageError(f"{' and '.join(given)} {why}")


def keep_inputs(outputs: Sequence[str | None], *inputs: Any) -> None:
    """Refuse an output that is one of the files that the command reads, with OutputError."""
    from uavseg.jobs.source import inputs as read

    read.keep_inputs(outputs, inputs)


def check_output(path: str, overwrite: bool, *inputs: Any) -> None:
    """Check, before any work, that a file can be written and is none that the command reads; - is stdout."""
    from uavseg.output.atomic import check_target

    if path != "-":
        check_target(path, overwrite)
    keep_inputs([path], *inputs)


def transaction() -> AbstractContextManager[None]:
    """Return a context whose files appear together at its end."""
    from uavseg.output import atomic

    return atomic.transaction()


def write_region_output(
    found: Extraction | Comparison | Footprints, target: str, overwrite: bool, form: GeoJsonForm | None = None
) -> None:
    """Write regions to a file, or to stdout where it is called -."""
    from uavseg.output.disk import noted_stream
    from uavseg.regions.formats import export
    from uavseg.regions.formats.text_writers import COLLECTION

    if target != "-":
        export.write_regions(found.regions, target, overwrite)
        return
    with noted_stream("stdout"), standard_output() as stream:
        export.write_regions(found.regions, stream, form=form or COLLECTION)


def write_label_output(
    found: Extraction, path: str | None, work: Work, overwrite: bool, creation: CreationOptions
) -> None:
    """Write the labels of regions, if asked for; the executor writes them where they are many tiles."""
    if path is None:
        return
    from uavseg.regions.formats import export

    run = work.executor if export.is_vrt(path) else work.local
    export.write_label_raster(path, found.rings, found.geobox, run, overwrite, creation)


def write_text(path: str, text: str, overwrite: bool) -> None:
    """Write a text file, or to the standard output where the path is -."""
    from uavseg.output.atomic import atomic_file
    from uavseg.output.disk import noted_stream

    if path == "-":
        with noted_stream("stdout"):
            show(text.rstrip("\n"))
    else:
        with atomic_file(path, overwrite) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def write_mission_output(mission: Mission, path: str, overwrite: bool) -> list[str]:
    """Write a mission; what its format cannot hold is returned as warnings."""
    from uavseg.flight.formats import files

    return warnings_of(lambda: files.write_mission(mission, path, overwrite))[1]


def write_plan_output(
    planned: MissionPlan, path: str, overwrite: bool, options: MissionFileOptions
) -> tuple[list[Path], list[str]]:
    """Write the missions of a plan; returns their files, and what the format cannot hold as warnings."""
    return warnings_of(lambda: planned.write(path, overwrite, **asdict(options)))


def warnings_of(write: Callable[[], T]) -> tuple[T, list[str]]:
    """Return what a function returns, and its warnings, each once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = write()
    return result, list(dict.fromkeys(str(one.message) for one in caught))


def shown(target: str) -> str:
    """Return a target by its name for people."""
    return "stdout" if target == "-" else target


def summary_rows(found: Extraction) -> dict[str, str]:
    """Return total area, largest region, stretch and band, for the table at the end."""
    count, kept = len(found.regions), found.irregular
    irregular = {} if kept is None else {"irregular": f"{kept:,} of {count:,} stay on pixel edges"}
    return {
        **_range_row(found),
        "total area": f"{found.regions.columns['area_m2'].sum():,.1f} {found.area_unit}",
        "largest": largest(found),
        **confidence_row(found),
        **irregular,
        "stretch": found.stretch.name,
        "band": found.band_names,
    }


def confidence_row(found: Extraction, kept: int | None = None) -> dict[str, str]:
    """Return how many regions were left out because of their confidence, if there is a minimum."""
    if found.below_minimum is None:
        return {}
    kept = len(found.regions) if kept is None else kept
    return {"too unsure": f"{found.below_minimum:,} of {found.below_minimum + kept:,} left out"}


def _range_row(found: Extraction) -> dict[str, str]:
    if found.detected is None:
        return {}
    from uavseg.raster.spectral.bands import values_text

    interval, axis = found.detected.interval, found.axis
    values = "" if axis is None else f": {values_text(found.detected.ends, axis.unit)}"
    return {"range": f"v {interval.low:.6g} to {interval.high:.6g}{values}"}


def largest(found: Extraction) -> str:
    """Return the region with most pixels, for people."""
    columns = found.regions.columns
    if not len(found.regions):
        return "-"
    return f"{columns['area_m2'][0]:,.1f} {found.area_unit} ({columns['pixels'][0]:,} pixels)"


class RegionFiles:
    """The regions, their labels and their style, which no command may write over its inputs or each other.

    `ending` is what follows the name of the first raster in that of the regions, where none is given;
    `inputs` are files that no output may replace, `others` those that the command writes beside.
    """

    def __init__(self, options: RegionOptions, ending: str, *inputs: Any, others: Any = ()) -> None:
        from uavseg.raster.read.source_list import stem_of

        outputs = options.outputs
        self.target = outputs.output or f"{stem_of(options.source.rasters[0])}{ending}"
        self.overwrite = options.files.overwrite
        self.form = geojson_form(outputs, self.target)
        self.labels, self.creation = outputs.labels, creation_of(options.creation, {outputs.labels: "uint32"})
        self.crs = named_crs(outputs, self.target)
        check_targets(self.target, outputs.labels, self.overwrite)
        self.style = _checked_style(outputs.style, self.target, self.overwrite)
        inputs = (options.source.rasters, options.read.aoi, *inputs)
        keep_inputs([self.target, outputs.labels, *others], *inputs)

    def check_crs(self, wkt: str | None) -> None:
        """Refuse regions that have no place where they are to be written."""
        from uavseg.regions.formats import export

        export.check_region_crs(self.target, wkt, self.form)

    def notes(self, found: Extraction, wkt: str | None) -> list[str]:
        """Return what a reader of the files cannot know."""
        from uavseg.regions.formats import export

        wkt = wkt if self.crs is None else self.crs.to_wkt("WKT2_2019")
        return [*_stream_warnings(self.form, wkt), *export.format_notes(found.regions, self.target)]

    def write(self, found: Extraction, work: Work) -> None:
        """Write all of them; what goes to stdout comes after all that can fail."""
        found = _in_crs(found, self.crs)
        if self.target != "-":
            write_region_output(found, self.target, self.overwrite)
        if self.style is not None:
            from uavseg.regions.formats.styles import write_style

            write_style(found.regions, self.target, self.style, self.overwrite)
        write_label_output(found, self.labels, work, self.overwrite, self.creation)
        if self.target == "-":
            write_region_output(found, self.target, self.overwrite, self.form)


def answer_each(options: RegionOptions, job: RegionJob, ending: str, reporter: Reporter) -> bool:
    """Run a job for each raster, list those that failed, and end with exit code 1 if there are any.

    `ending` is what follows {stem} in the names of outputs where none are given. False where --each is not
    given, and nothing is done. Options that do not go with it, or need it, are refused with UsageError.
    """
    each = options.each
    if not each.each:
        for given, flag in ((each.report, "--report"), (each.skip_existing, "--skip-existing")):
            if given:
                raise click.UsageError(f"{flag} is for each of many rasters; give it with --each")
        return False
    _check_each(options)
    from uavseg.execution import executors
    from uavseg.jobs.each.each import OutputNames, grouped_warnings, plan_tasks, run_each
    from uavseg.jobs.source.work import Work

    executors.threads(options.run.threads)  # an error before rasters are looked for
    target = options.outputs.output or f"{{stem}}{ending}"
    crs, find = named_crs(options.outputs, target), job.find
    job = replace(job, find=lambda source, work: _in_crs(find(source, work), crs))
    labels = options.outputs.labels
    names = OutputNames(
        regions=target,
        labels=labels,
        overwrite=options.files.overwrite,
        skip_existing=each.skip_existing,
        report=each.report,
        creation=creation_of(options.creation, {labels: "uint32"}),
    )
    tasks, skipped = plan_tasks(options.source.rasters, names)
    reporter.begin_each(len(tasks))
    work = Work(options.run.tile, progress=reporter.progress)
    outcomes = run_each(tasks, job, names, work, options.run.threads)
    reporter.finish(grouped_warnings(outcomes))
    done = [one for one in outcomes if one.error is None]
    rows = {"rasters": f"{len(done):,} of {len(outcomes):,} -> {names.regions}"}
    if skipped:
        rows["left out"] = f"{skipped:,}, whose outputs are there"
    rows["regions"] = f"{sum(one.regions or 0 for one in done):,}"
    reporter.timed_table(rows)
    failed = [one for one in outcomes if one.error is not None]
    for one in failed:
        say(f"uavseg: error: {one.failure}")
    if failed:
        click.get_current_context().exit(1)
    return True


def _check_each(options: RegionOptions) -> None:
    """Refuse options that do not go with --each, each with what to do instead."""
    outputs, run, mission = options.outputs, options.run, getattr(options, "mission", None)
    refused = (
        (outputs.style, "--style is for one source"),
        (mission, "--mission is for one source; plan over each output with uavseg plan"),
        (run.resume, "--resume is for one source; --skip-existing leaves out what is done"),
        (run.scheduler, "--scheduler is for one source; --each uses the threads of this machine"),
    )
    for given, text in refused:
        if given is not None:
            raise click.UsageError(f"{text}, or leave out --each")
    if outputs.output == "-":
        raise click.UsageError("--each writes files; name them, such as -o 'out/{stem}.gpkg'")
    if outputs.sequence or outputs.rs or outputs.geographic is not None:
        raise click.UsageError("--sequence, --rs and --projected are for -o -, and --each writes files")


def named_crs(outputs: RegionOutputs, target: str) -> Any:
    """Return the pyproj CRS in which regions are to be written; None: that of the raster.

    UsageError is raised for formats that are in longitude and latitude.
    """
    if outputs.crs is None:
        return None
    from uavseg.raster.geodesy.globe import crs_named

    keeps_crs = Path(target).suffix.lower() in (".gpkg", ".fgb", ".parquet", ".shp")
    if not keeps_crs and outputs.geographic is not False:
        raise click.UsageError(
            "GeoJSON and KML are in longitude and latitude; give --crs with .gpkg, .fgb, .parquet, .shp or "
            "--projected"
        )
    return crs_named(outputs.crs)


def _in_crs(found: Extraction, crs: Any) -> Extraction:
    if crs is None:
        return found
    from uavseg.regions.table import in_crs

    return replace(found, regions=in_crs(found.regions, crs))


def geojson_form(outputs: RegionOutputs, target: str) -> GeoJsonForm:
    """Return the form of GeoJSON on standard output.

    UsageError is raised if one is given and the output is a file, or a collection is to have RS.
    """
    from uavseg.regions.formats.text_writers import GeoJsonForm

    sequence, rs, geographic = outputs.sequence, outputs.rs, outputs.geographic
    if target != "-" and (rs or sequence is not None or geographic is not None):
        raise click.UsageError(
            "--sequence, --collection, --rs, --geographic and --projected are for standard output; give them "
            "with -o -"
        )
    if rs and sequence is False:
        raise click.UsageError("--rs is for sequences, and --collection is none; give one of the two")
    return GeoJsonForm(geographic is False, bool(sequence or rs), rs)


def _stream_warnings(form: GeoJsonForm, wkt: str | None) -> list[str]:
    """Return what a reader of a stream cannot know: the CRS of a sequence."""
    if not (form.sequence and form.projected) or wkt is None:
        return []
    from uavseg.regions.formats.text_writers import crs_name

    name = crs_name(wkt)
    known = name.removeprefix("urn:ogc:def:crs:").replace("::", ":") if name else "the CRS of the raster"
    return [
        f"a sequence does not name its CRS; these coordinates are in {known}: say so to its reader (ogr2ogr "
        "-a_srs, fio load --src-crs), or give --collection"
    ]


def _checked_style(style: str | None, target: str, overwrite: bool) -> str | None:
    """Return the style that is written beside a target, if one is; its file may be made."""
    if style is None:
        return None
    if target == "-":
        raise click.UsageError("--style is written beside a file of regions; give -o a name, or leave it out")
    from uavseg.regions.formats.styles import check_style

    check_style(target, style, overwrite)
    return style
