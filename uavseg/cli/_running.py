"""Options of every command that works through tiles: how they are cut, who works, what is told."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._progress import Amount, bar

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.raster.dataset import Dataset

Command = Callable[..., Any]

_REDRAW_S = 0.1


@dataclass(frozen=True, slots=True)
class Running:
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

    def workers(self) -> Map:
        """Who runs the work: threads of this process, or a cluster, which is let go when the command ends.

        Raises
        ------
        ParameterError
            If the number of threads is below 1.
        ClusterError
            If the scheduler does not answer or its workers do not fit.
        """
        if self.scheduler is None:
            return self.local_workers()
        if self.threads is not None:
            raise click.UsageError(
                "--threads are this machine's, --scheduler has its own; give one of the two"
            )
        from uavseg.execution.cluster import dask

        cluster = dask(self.scheduler)
        click.get_current_context().call_on_close(cluster.close)
        return cluster

    def local_workers(self) -> Map:
        """Threads of this process, whoever else works."""
        from uavseg.execution import executors

        return executors.threads(self.threads)

    def resuming(self, run: Map) -> Map:
        """A map that keeps finished tiles in the folder, if one was given."""
        if self.resume is None:
            return run
        from uavseg.execution.checkpoint import with_checkpoint

        return with_checkpoint(run, self.resume, self.reporter.resumed)


def running_options(command: Command) -> Command:
    """Give a command --tile, --threads, --scheduler, --resume, --overwrite, -q, -v and --progress.

    They arrive as one `Running`, called `running`.
    """

    @wraps(command)
    def run(
        tile: int | None,
        threads: int | None,
        scheduler: str | None,
        resume: str | None,
        overwrite: bool,
        quiet: bool,
        verbose: bool,
        progress: str,
        **others: Any,
    ) -> Any:
        reporter = Reporter(quiet, verbose, progress)
        return command(running=Running(tile, threads, scheduler, resume, overwrite, reporter), **others)

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
            click.option("--overwrite", is_flag=True, help="Replace files that are there."),
            click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors."),
            click.option("-v", "--verbose", is_flag=True, help="Say more."),
            click.option(
                "--progress",
                type=click.Choice(["auto", "plain", "none"]),
                default="auto",
                show_default=True,
                help="A bar on a terminal; plain: lines 'progress NN' on stderr, for programs.",
            ),
        )
    ):
        run = option(run)
    return run


class Reporter:
    """What a command says on stderr while it works and when it is done."""

    def __init__(self, quiet: bool, verbose: bool, progress: str) -> None:
        self.quiet = quiet
        self.verbose = verbose
        self._plain = progress == "plain"
        self._bar = progress == "auto" and not quiet and sys.stderr.isatty()
        self._percent = -1
        self._start = time.perf_counter()
        self._begun = self._drawn = self._start
        self._amount: Amount | None = None

    @property
    def seconds(self) -> float:
        """Since the command began."""
        return time.perf_counter() - self._start

    def begin(self, dataset: Dataset, tile: int | None) -> None:
        """The work on a raster begins, cut into tiles."""
        if self._bar:
            from uavseg.raster.dataset import windows_of

            rows, cols = dataset.geobox.shape
            self._amount = Amount(len(windows_of(dataset, tile)), rows * cols)
            self._begun = time.perf_counter()

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
        now = time.perf_counter()
        if now - self._drawn >= _REDRAW_S or share == 1:
            self._drawn = now
            click.echo(f"\r{bar(share, now - self._begun, self._amount)}\x1b[K", err=True, nl=False)

    def finish(self) -> None:
        """The work is done: the bar goes, plain progress ends at 100."""
        if self._plain:
            self.progress(1, 1)
        elif self._bar and self._percent >= 0:
            click.echo("\r\x1b[K", err=True, nl=False)

    def resumed(self, stage: str, done: int, total: int) -> None:
        """Some tiles of a stage were done by a run before this one."""
        self.say(f"resumed: {done:,} of {total:,} tiles were done ({stage})")

    def warn(self, text: str) -> None:
        """Something that the user should know."""
        if not self.quiet:
            click.echo(f"uavseg: warning: {text}", err=True)

    def say(self, text: str) -> None:
        """Something for everyone who did not ask for quiet."""
        if not self.quiet:
            click.echo(text, err=True)

    def detail(self, text: str) -> None:
        """Something for those who asked for more."""
        if self.verbose and not self.quiet:
            click.echo(f"uavseg: {text}", err=True)
