"""Progress, warnings and the final table of a command, on stderr; and how its job is run."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from uavseg.cli.terminal.say import say, saying_decisions

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.execution.progress_bar import Amount
    from uavseg.jobs.source.work import Work
    from uavseg.options.running import ProgressOptions, RunOptions, VerbosityOptions
    from uavseg.raster.grid.tiling import Window

_REDRAW_S = 0.1


class Reporter:
    """Progress, warnings and the final table of a command, on stderr."""

    def __init__(self, messages: VerbosityOptions, progress: ProgressOptions | None = None) -> None:
        quiet, chosen = messages.quiet, "none" if progress is None else progress.progress
        self.quiet, self.verbose = quiet, messages.verbose
        self._plain = chosen == "plain"
        self._bar = chosen == "auto" and not quiet and sys.stderr.isatty()
        self._percent = -1
        self._start = _seconds()
        self._begun = self._drawn = self._start
        if messages.verbose and not quiet:
            saying_decisions()
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


@contextmanager
def showing_phases(quiet: bool) -> Iterator[None]:
    """Context in which phases that take more than two seconds are shown on stderr, unless it is quiet."""
    from uavseg.execution.phases import watched
    from uavseg.execution.progress_bar import PhaseLine

    if quiet:
        yield
        return
    with PhaseLine() as line, watched(line):
        yield


def work_of(run: RunOptions, reporter: Reporter) -> Work:
    """Return how a job is run: by threads of this process, or by a cluster that is released with the command.

    Raises
    ------
    ParameterError
        If the number of threads is below 1.
    ClusterError
        If the scheduler does not answer or its workers do not fit.
    """
    from uavseg.execution import executors, phases
    from uavseg.jobs.source.work import Work

    cluster = _cluster(run)
    local = executors.threads(run.threads)
    phases.decided("%s", run.scheduler or f"{run.threads or executors.usable_cores()} threads")
    return Work(
        tile=run.tile,
        executor=cluster or local,
        local=local,
        progress=reporter.progress,
        checkpoint=run.resume,
        resumed=reporter.resumed,
        started=reporter.begin,
    )


def _cluster(run: RunOptions) -> Map | None:
    if run.scheduler is None:
        return None
    if run.threads is not None:
        raise click.UsageError("--threads are this machine's, --scheduler has its own; give one of the two")
    from uavseg.execution.cluster import dask

    cluster = dask(run.scheduler)
    click.get_current_context().call_on_close(cluster.close)
    return cluster
