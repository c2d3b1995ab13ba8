"""Files that a command writes of regions: checked before any work, and written together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli.write import LabelFile, check_targets, keep_inputs, write_regions_and_labels

if TYPE_CHECKING:
    from uavseg.cli.terminal.reporter import Reporter
    from uavseg.jobs.requests import RegionJob
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.source.work import Work
    from uavseg.options.outputs import EachOptions, RegionOutputs
    from uavseg.options.regions import ExtractOptions, LevelsOptions, MatchOptions
    from uavseg.regions.formats.geojson import GeoJsonForm

    RegionOptions = ExtractOptions | LevelsOptions | MatchOptions


class RegionFiles:
    """The regions, their labels and their style.

    Parameters
    ----------
    options : ExtractOptions, LevelsOptions or MatchOptions
    ending : str
        What follows the name of the first raster in that of the regions, where none is given.
    inputs : object
        Files that no output may replace.
    others : sequence of str
        Other files that the command writes.

    Raises
    ------
    UavsegError
        If a file may not be made.
    """

    def __init__(
        self, options: RegionOptions, ending: str, *inputs: Any, others: Sequence[str | None] = ()
    ) -> None:
        from uavseg.raster.read.source_list import stem_of

        outputs = options.outputs
        self.target = outputs.output or f"{stem_of(options.source.rasters[0])}{ending}"
        self.overwrite = options.files.overwrite
        self.form = geojson_form(outputs, self.target)
        self.labels = LabelFile.of(outputs.labels, options.creation)
        check_targets(self.target, outputs.labels, self.overwrite)
        self.style = _checked_style(outputs.style, self.target, self.overwrite)
        keep_inputs([self.target, outputs.labels, *others], options.source.rasters, *inputs)

    def check_crs(self, wkt: str | None) -> None:
        """Refuse regions that have no place where they are to be written."""
        from uavseg.regions.formats import export

        export.check_region_crs(self.target, wkt, self.form)

    def notes(self, found: Extraction, wkt: str | None) -> list[str]:
        """Return what a reader of the files cannot know."""
        from uavseg.regions.formats import export

        return [*_stream_warnings(self.form, wkt), *export.format_notes(found.regions, self.target)]

    def write(self, found: Extraction, work: Work) -> None:
        """Write all of them; what goes to stdout comes last."""
        write_regions_and_labels(found, self.target, self.labels, work, self.overwrite, self.form, self.style)

    @property
    def shown(self) -> str:
        """The target by its name for people."""
        return "stdout" if self.target == "-" else self.target


def check_alone(options: EachOptions) -> None:
    """Refuse what is for many rasters where --each is not given.

    Raises
    ------
    UsageError
        If it is given.
    """
    for given, flag in ((options.report, "--report"), (options.skip_existing, "--skip-existing")):
        if given:
            raise click.UsageError(f"{flag} is for each of many rasters; give it with --each")


def answer_each(options: RegionOptions, job: RegionJob, ending: str, reporter: Reporter) -> None:
    """Run a job for each raster, list those that failed, and end with exit code 1 if there are any.

    Parameters
    ----------
    options : ExtractOptions, LevelsOptions or MatchOptions
    job : RegionJob
    ending : str
        What follows {stem} in the names of outputs where none are given.
    reporter : Reporter

    Raises
    ------
    UsageError
        If an option does not go with --each.
    UavsegError
        If the outputs cannot be as they are named.
    """
    _check_each(options)
    from uavseg.cli.terminal.say import say
    from uavseg.execution import executors
    from uavseg.jobs.each.each import OutputNames, grouped_warnings, plan_tasks, run_each
    from uavseg.jobs.source.work import Work

    executors.threads(options.run.threads)  # an error before rasters are looked for
    target = options.outputs.output or f"{{stem}}{ending}"
    labels = LabelFile.of(options.outputs.labels, options.creation)
    names = OutputNames(
        regions=target,
        labels=labels.path,
        overwrite=options.files.overwrite,
        skip_existing=options.each.skip_existing,
        report=options.each.report,
        creation=labels.creation,
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
    reporter.table(rows | {"seconds": f"{reporter.seconds:.2f}"})
    failed = [one for one in outcomes if one.error is not None]
    for one in failed:
        say(f"uavseg: error: {one.failure}")
    if failed:
        click.get_current_context().exit(1)


def _check_each(options: RegionOptions) -> None:
    """Refuse options that do not go with --each, each with what to do instead."""
    outputs, run = options.outputs, options.run
    refused = (
        (outputs.style, "--style is for one source; a .gpkg carries its style, so give it as the output"),
        (
            getattr(options, "mission", None),
            "--mission is for one source; plan over each output with uavseg plan",
        ),
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


def geojson_form(outputs: RegionOutputs, target: str) -> GeoJsonForm:
    """Return the form of GeoJSON on standard output.

    Raises
    ------
    UsageError
        If one is given and the output is a file, or a collection is to have RS.
    """
    from uavseg.regions.formats.geojson import GeoJsonForm

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
    from uavseg.regions.formats.geojson import crs_name

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
