"""One job over many sources: each has its own outputs, and those that fail do not stop the others.

Sources of few tiles run side by side, a thread for each. Larger ones follow one after another, with their
tiles side by side. Which of the two makes no difference to a result.
"""

import csv
import os
from collections.abc import Sequence
from contextlib import closing, suppress
from contextvars import copy_context
from dataclasses import replace
from functools import partial
from pathlib import Path

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import OUT_OF_MEMORY, OutputError, OutputExistsError, RasterReadError, UavsegError
from uavseg.execution.executors import Progress, can_fork, fork_each, serial, threads, usable_cores
from uavseg.jobs.requests import RegionJob
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.source.source import Blocks, Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.output.atomic import atomic_file, check_target, output_errors, transaction
from uavseg.output.disk import recording_written, written_here
from uavseg.output.targets import check_distinct_outputs, existing_files, outputs_of
from uavseg.plain_text import cause_of, one_line
from uavseg.raster.access.opening import gdal_env
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.read.source_list import expand_sources
from uavseg.regions.formats import export
from uavseg.regions.formats.export import check_labels, check_region_path, write_label_raster

NOT_RUN = "it was not begun: the run was stopped"
_HEADER = ("source", "output", "regions", "area_m2", "warnings", "error")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came out of one source: how many regions, or the error why there are none."""

    source: str
    output: str
    regions: int | None = None
    area_m2: float | None = None  # in total; in the units of the raster where it has no CRS
    warnings: tuple[str, ...] = ()
    error: str | None = None

    @property
    def failure(self) -> str:
        """The error as one clause that names the source."""
        text = self.error or ""
        return text if text.startswith(f"{self.source} ") else f"{self.source} failed: {text}"


def write_report(outcomes: Sequence[Outcome], path: str, overwrite: bool = False) -> None:
    """Write what came out of each source as CSV (RFC 4180, UTF-8).

    The columns are source, output, regions, area_m2, warnings (separated by "; ") and error. It says nothing
    of the time a source took, so that the same run gives the same bytes. An OutputError says that it cannot
    be written.
    """
    with (
        atomic_file(path, overwrite) as part,
        part.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file,
    ):
        table = csv.writer(file)
        table.writerow(_HEADER)
        for one in outcomes:
            area = None if one.area_m2 is None else float(f"{one.area_m2:.12g}")
            table.writerow((one.source, one.output, one.regions, area, "; ".join(one.warnings), one.error))


@dataclass(frozen=True, slots=True)
class OutputNames:
    """Where the results of many sources go."""

    regions: str  # template of the files of regions, see `fill_template`
    labels: str | None = None  # template of the rasters of their labels
    overwrite: bool = False  # whether files that are there may be replaced
    skip_existing: bool = False  # whether sources are left out whose outputs are all there
    report: str | None = None  # a table of all outcomes, see `write_report`
    creation: CreationOptions = DEFAULT


@dataclass(frozen=True, slots=True)
class SourceTask:
    """A source and its outputs."""

    source: str
    output: str
    labels: str | None = None

    @property
    def outputs(self) -> tuple[str, ...]:
        """All of them."""
        return (self.output,) if self.labels is None else (self.output, self.labels)


Tasks = Sequence[SourceTask]


def plan_tasks(sources: Sequence[Path_], names: OutputNames) -> tuple[list[SourceTask], int]:
    """Return the sources with their outputs, checked before anything is computed.

    Folders, patterns and lists stand for their rasters, see `expand_sources`. The second result is the number
    of sources that are left out, because their outputs are there. A RasterReadError says that there is no
    source, an OutputError that two outputs have the same name, or that one is there and may not be replaced,
    or would replace an input.
    """
    rasters = expand_sources(sources)
    if not rasters:
        raise RasterReadError("there is no raster to read; name some, or a folder of them")
    outputs = outputs_of(names.regions, rasters)
    labels = [None] * len(rasters) if names.labels is None else outputs_of(names.labels, rasters)
    tasks = list(map(SourceTask, rasters, outputs, labels))
    own = [task.outputs for task in tasks]
    if names.skip_existing:
        tasks = [task for task in tasks if not all(existing_files(Path(name)) for name in task.outputs)]
    _check_outputs(tasks, names.overwrite)
    check_distinct_outputs(rasters, own)
    outputs = [name for task in tasks for name in task.outputs]
    if names.report is not None:
        if Path(names.report).suffix.lower() != ".csv":
            raise OutputError(f"{names.report}: a report is written to .csv")
        check_target(names.report, names.overwrite)
        if os.path.realpath(names.report) in map(os.path.realpath, outputs):
            raise OutputError(f"{names.report} is an output and the report; give each a name of its own")
    keep_inputs([*outputs, names.report], rasters)
    return tasks, len(rasters) - len(tasks)


def run_each(
    tasks: Tasks, job: RegionJob, names: OutputNames, work: Work = SERIAL, count: int | None = None
) -> list[Outcome]:
    """Run a job for each task; each output appears whole when it is finished.

    The report is written in the end, also of a run that is stopped. The tile size and the progress of `work`
    are used; `count` is the number of threads, by default one for each core. Outcomes are in the order of the
    tasks, with their errors. An OutputError says that the report cannot be written.
    """
    outcomes: dict[SourceTask, Outcome] = {}  # kept as they come, so that they are known after a stop
    run = threads(count)
    written_here().planned += [str(Path(name)) for task in tasks for name in task.outputs]
    alone = replace(work, executor=serial, local=serial, progress=None)
    progress = work.progress or (lambda done, total: None)
    context = copy_context()
    most = usable_cores() if count is None else count
    one = partial(_outcome, job=job, names=names, work=alone, most=most)

    def received(task: SourceTask, found: Outcome | None) -> None:
        if found is not None:
            outcomes[task] = found
            progress(len(outcomes), len(tasks))

    def in_copy(task: SourceTask) -> tuple[Outcome | None, list[str]]:
        found = None
        with recording_written() as written, suppress(KeyboardInterrupt):
            found = one(task)
        return found, written.files

    def received_of_copy(task: SourceTask, answer: tuple[Outcome | None, list[str]]) -> None:
        written_here().files += answer[1]
        received(task, answer[0])

    try:
        if most > 1 and len(tasks) > 1 and can_fork():
            received(tasks[0], one(tasks[0]))  # which loads what copies need, and compiles it if it is not
            fork_each(in_copy, tasks[1:], most, received_of_copy)
        else:
            with closing(run(lambda task: context.copy().run(one, task), tasks)) as finished:
                for task, found in zip(tasks, finished, strict=True):
                    received(task, found)
        done = len(outcomes)
        for task in tasks:
            if task in outcomes:
                continue
            part = partial(_within, progress, done, len(tasks))
            found = _outcome(task, job, names, replace(work, executor=run, local=run, progress=part), None)
            assert found is not None, "only where tiles are limited, a task is put off"
            outcomes[task] = found
            done += 1
            progress(done, len(tasks))
    finally:
        answers = [outcomes.get(task) or Outcome(task.source, task.output, error=NOT_RUN) for task in tasks]
        if names.report is not None:
            write_report(answers, names.report, names.overwrite)
    return answers


def grouped_warnings(outcomes: Sequence[Outcome]) -> list[str]:
    """Return the warnings of all sources, each text once with the first source and the number of others."""
    owners: dict[str, list[str]] = {}
    for outcome in outcomes:
        for text in outcome.warnings:
            owners.setdefault(text, []).append(outcome.source)
    more = {text: len(sources) - 1 for text, sources in owners.items()}
    others = {text: f" and {n:,} other{'s' * (n > 1)}" if n else "" for text, n in more.items()}
    return [f"{sources[0]}{others[text]}: {text}" for text, sources in owners.items()]


def _check_outputs(tasks: Sequence[SourceTask], overwrite: bool) -> None:
    there: list[str] = []
    for task in tasks:
        try:
            with output_errors(", ".join(task.outputs)):
                check_region_path(task.output, overwrite)
                if task.labels is not None:
                    check_labels(task.labels, overwrite)
        except OutputExistsError as error:
            there.append(str(error).partition(";")[0])
    if there:
        raise OutputExistsError(
            f"{there[0]} ({len(there):,} of {len(tasks):,} outputs do); give --overwrite (overwrite=True) to "
            "replace them, or --skip-existing (skip_existing=True) to leave out what is done"
        )


def _outcome(
    task: SourceTask, job: RegionJob, names: OutputNames, work: Work, most: int | None
) -> Outcome | None:
    """Return what comes out of a task; None if it has more tiles than this, and nothing was done."""
    try:
        with gdal_env():  # once for all that is read
            source = job.opened(task.source, job.read)
            tiles = 1 if isinstance(source, Blocks) else len(source.dataset.windows(work.tile))
            if most is not None and tiles > most:
                return None
            return _answered(task, source, job, names, work)
    except (UavsegError, OSError, MemoryError) as error:
        return Outcome(task.source, task.output, error=_text_of(error))


def _answered(task: SourceTask, source: Source, job: RegionJob, names: OutputNames, work: Work) -> Outcome:
    export.check_region_crs(task.output, source.geobox.wkt)
    found = job.find(source, work)
    with transaction():
        export.write_regions(found.regions, task.output, names.overwrite)
        if task.labels is not None:
            how = found.geobox, work.local, names.overwrite, names.creation
            write_label_raster(task.labels, found.rings, *how)
    area = float(found.regions.columns["area_m2"].sum())
    notes = *found.warnings, *export.format_notes(found.regions, task.output)
    return Outcome(task.source, task.output, len(found.regions), area, notes)


def _text_of(error: BaseException) -> str:
    if isinstance(error, UavsegError):
        return str(error)
    if isinstance(error, MemoryError):
        return OUT_OF_MEMORY
    named = os.fsdecode(error.filename) if isinstance(error, OSError) and error.filename else ""
    return one_line(f"{named}: {cause_of(error)}" if named else cause_of(error))


def _within(progress: Progress, done: int, count: int, part: int, parts: int) -> None:
    progress(done * parts + min(part, parts), count * parts)
