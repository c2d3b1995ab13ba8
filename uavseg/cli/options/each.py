"""Options of commands that answer for each of many rasters, and how such a command is run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli.options.creation import creation_of
from uavseg.cli.options.running import RunOptions
from uavseg.cli.terminal.say import say

if TYPE_CHECKING:
    from uavseg.jobs.each.each import OutputNames, RegionJob
    from uavseg.jobs.each.each_report import Outcome

F = TypeVar("F", bound=Callable[..., Any])


def each_options(command: F) -> F:
    """Give a command --each, --report and --skip-existing; see `answer_each`."""
    for option in reversed(
        (
            click.option(
                "--each",
                is_flag=True,
                help="Each raster by itself, to an output of its own: -o 'out/{stem}.gpkg'. {stem} is its "
                "name without folder and extension, {name} with its extension, {suffix} the extension, "
                "{parent} the name of its folder, {number} its place. What fails does not stop the others.",
            ),
            click.option(
                "--report", metavar="PATH.csv", help="With --each: also a table of what came out of each."
            ),
            click.option(
                "--skip-existing",
                is_flag=True,
                help="With --each: leave out rasters whose output is there, so that a run goes on.",
            ),
        )
    ):
        command = option(command)
    return command


def check_alone(options: dict[str, Any]) -> None:
    """Check that what is for many rasters is not given without --each.

    Raises
    ------
    UsageError
        If it is.
    """
    for name, option in (("report", "--report"), ("skip_existing", "--skip-existing")):
        if options[name]:
            raise click.UsageError(f"{option} is for each of many rasters; give it with --each")


def answer_each(options: dict[str, Any], job: RegionJob, ending: str, run: RunOptions) -> None:
    """Run a job for each raster, list those that failed, and end with exit code 1 if there are any.

    Parameters
    ----------
    options : dict
        Those of the command.
    job : RegionJob
    ending : str
        What follows {stem} in the names of outputs where none are given.
    run : RunOptions

    Raises
    ------
    UsageError
        If an option does not go with --each.
    UavsegError
        If the outputs cannot be as they are named.
    """
    _check_options(options)
    from uavseg.execution import executors
    from uavseg.jobs.each.each import OutputNames, grouped_warnings, plan_tasks, run_each
    from uavseg.jobs.source.work import Work

    executors.threads(run.threads)  # an error before rasters are looked for
    target = options["output"] or f"{{stem}}{ending}"
    labels = options["labels"]
    creation = creation_of(options, {labels: "uint32"})
    kept = options["skip_existing"], options["report"]
    names = OutputNames(target, labels, run.overwrite, *kept, creation)
    tasks, skipped = plan_tasks(options["rasters"], names)
    run.reporter.begin_each(len(tasks))
    work = Work(run.tile, progress=run.reporter.progress)
    found = run_each(tasks, job, names, work, run.threads)
    run.reporter.finish(grouped_warnings(found))
    run.reporter.table(_rows(found, names, skipped) | {"seconds": f"{run.reporter.seconds:.2f}"})
    failed = [one for one in found if one.error is not None]
    for one in failed:
        say(f"uavseg: error: {one.failure}")
    if failed:
        click.get_current_context().exit(1)


def _check_options(options: dict[str, Any]) -> None:
    """Options that do not go with --each, each with what to do instead."""
    refused = {
        "style": "--style is for one source; a .gpkg carries its style, so give it as the output",
        "mission": "--mission is for one source; plan over each output with uavseg plan",
        "resume": "--resume is for one source; --skip-existing leaves out what is done",
        "scheduler": "--scheduler is for one source; --each uses the threads of this machine",
    }
    for name, text in refused.items():
        if options.get(name) is not None:
            raise click.UsageError(f"{text}, or leave out --each")
    if options["output"] == "-":
        raise click.UsageError("--each writes files; name them, such as -o 'out/{stem}.gpkg'")
    if any(options.get(name) for name in ("sequence", "rs")) or options.get("geographic") is not None:
        raise click.UsageError("--sequence, --rs and --projected are for -o -, and --each writes files")


def _rows(found: Sequence[Outcome], names: OutputNames, skipped: int) -> dict[str, str]:
    """The short table at the end."""
    done = [one for one in found if one.error is None]
    regions = sum(one.regions or 0 for one in done)
    rows = {"rasters": f"{len(done):,} of {len(found):,} -> {names.regions}"}
    if skipped:
        rows["left out"] = f"{skipped:,}, whose outputs are there"
    return rows | {"regions": f"{regions:,}"}
