"""How a command is run: tiles, workers and checkpoint, and what it reports on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli.options.verbosity import heed_verbose, verbosity_options
from uavseg.cli.terminal.say import say

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.execution.progress_bar import Amount
    from uavseg.jobs.source.work import Work
    from uavseg.raster.grid.tiling import Window

Command = Callable[..., Any]

_REDRAW_S = 0.1


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How a command is run: what `running_options` say.

    Parameters
    ----------
    tile : int or None
        Side of a tile in pixels.
    threads : int or None
        How many were asked for.
    scheduler : str or None
        Address of a cluster.
    resume : str or None
        The folder of finished tiles.
    overwrite : bool
        Whether files that are there may be replaced.
    reporter : Reporter
    """

    tile: int | None
    threads: int | None
    scheduler: str | None
    resume: str | None
    overwrite: bool
    reporter: Reporter

    @classmethod
    def of(cls, options: dict[str, Any]) -> RunOptions:
        """From the options of a command, which begins with this."""
        reporter = Reporter(options["quiet"], options["verbose"], options["progress"])
        names = ("tile", "threads", "scheduler", "resume")
        overwrite = options.get("overwrite", False)
        return cls(**{name: options[name] for name in names}, overwrite=overwrite, reporter=reporter)

    def work(self) -> Work:
        """How the job is run: by threads of this process, or by a cluster, which is released when the command
        ends.

        Raises
        ------
        ParameterError
            If the number of threads is below 1.
        ClusterError
            If the scheduler does not answer or its workers do not fit.
        """
        from uavseg.execution import executors, phases
        from uavseg.jobs.source.work import Work

        cluster = self._cluster()
        local = executors.threads(self.threads)
        phases.decided("%s", self.scheduler or f"{self.threads or executors.usable_cores()} threads")
        return Work(
            self.tile,
            cluster or local,
            local,
            self.reporter.progress,
            self.resume,
            self.reporter.resumed,
            self.reporter.begin,
        )

    def _cluster(self) -> Map | None:
        if self.scheduler is None:
            return None
        if self.threads is not None:
            raise click.UsageError(
                "--threads are this machine's, --scheduler has its own; give one of the two"
            )
        from uavseg.execution.cluster import dask

        cluster = dask(self.scheduler)
        click.get_current_context().call_on_close(cluster.close)
        return cluster


def running_options(command: Command) -> Command:
    """Give a command --tile, --threads, --scheduler, --resume, --overwrite, -q, -v and --progress.

    See `RunOptions`.
    """
    return _given(command, click.option("--overwrite", is_flag=True, help="Replace files that are there."))


def computing_options(command: Command) -> Command:
    """The same for a command that writes no file of the user: without --overwrite."""
    return _given(command)


def _given(command: Command, *overwrite: Any) -> Command:
    for option in reversed(
        (
            click.option(
                "--tile",
                type=int,
                metavar="PIXELS",
                help="Side of a tile, a multiple of 64; changes no result.",
            ),
            click.option(
                "--threads", type=int, metavar="N", help="Threads to work with.  [default: all cores]"
            ),
            click.option(
                "--scheduler",
                metavar="tcp://HOST:PORT",
                help="Let the workers of a dask.distributed scheduler do the work.",
            ),
            click.option(
                "--resume",
                type=click.Path(),
                metavar="DIR",
                help="Keep finished tiles in this folder, and take up those that are there, so that a run "
                "that was stopped goes on where it stopped. Remove the folder when you are done.",
            ),
            *overwrite,
            verbosity_options,
            click.option(
                "--progress",
                type=click.Choice(["auto", "plain", "none"]),
                default="auto",
                show_default=True,
                help="A bar on a terminal; plain: lines 'progress NN' on stderr, for programs.",
            ),
        )
    ):
        command = option(command)
    return command


class Reporter:
    """Progress, warnings and the final table of a command, on stderr."""

    def __init__(self, quiet: bool, verbose: bool, progress: str) -> None:
        self.quiet = quiet
        self.verbose = verbose
        self._plain = progress == "plain"
        self._bar = progress == "auto" and not quiet and sys.stderr.isatty()
        self._percent = -1
        self._start = _seconds()
        self._begun = self._drawn = self._start
        heed_verbose(quiet, verbose)
        self._amount: Amount | None = None

    @property
    def seconds(self) -> float:
        """Since the command began, without the time in which kernels were compiled."""
        return _seconds() - self._start

    def begin(self, windows: Sequence[Window]) -> None:
        """The work on the tiles of a source begins."""
        if self._bar:
            from uavseg.execution.progress_bar import Amount

            pixels = sum(window.rows * window.cols for window in windows)
            self._amount = Amount(len(windows), pixels)
            self._begun = _seconds()

    def begin_each(self, count: int) -> None:
        """The work on many rasters begins."""
        if self._bar:
            from uavseg.execution.progress_bar import Amount

            self._amount = Amount(count, 0, "rasters")
            self._begun = _seconds()

    def progress(self, done: int, total: int) -> None:
        """Take in that `done` of `total` steps are done."""
        if self._bar:
            self._draw(done / max(total, 1))
        percent = 100 * done // max(total, 1)
        if percent <= self._percent:
            return
        self._percent = percent
        if self._plain:
            click.echo(f"progress {percent}", err=True)

    def _draw(self, share: float) -> None:
        from uavseg.execution.progress_bar import bar

        now = _seconds()
        if now - self._drawn >= _REDRAW_S or share == 1:
            self._drawn = now
            click.echo(f"\r{bar(share, now - self._begun, self._amount)}\x1b[K", err=True, nl=False)

    def finish(self, warnings: Sequence[str] = ()) -> None:
        """The work is done: the bar goes, plain progress ends at 100, and warnings are printed."""
        if self._plain:
            self.progress(1, 1)
        elif self._bar and self._percent >= 0:
            click.echo("\r\x1b[K", err=True, nl=False)
        for warning in warnings:
            self.warn(warning)

    def resumed(self, stage: str, done: int, total: int) -> None:
        """Some tiles of a stage were found in the checkpoint."""
        self.say(f"resumed: {done:,} of {total:,} tiles were done ({stage})")

    def warn(self, text: str) -> None:
        """Something that the user should know."""
        if not self.quiet:
            say(f"uavseg: warning: {text}")

    def say(self, text: str) -> None:
        """A line, unless the command is quiet."""
        if not self.quiet:
            say(text)

    def table(self, rows: dict[str, str]) -> None:
        """The short table at the end."""
        for name, value in rows.items():
            self.say(f"  {name:<12}{value}")

    def detail(self, text: str) -> None:
        """A line where the command is verbose."""
        if self.verbose and not self.quiet:
            say(f"uavseg: {text}")


def _seconds() -> float:
    """A clock that stands still while kernels are compiled."""
    from uavseg.execution.phases import working_seconds

    return working_seconds()
