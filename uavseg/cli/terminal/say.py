"""What a command prints: lines, warnings of libraries, progress, a final table; and how its job is run."""

import errno
import logging
import os
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, BinaryIO

import click

from uavseg.errors import OutputError
from uavseg.plain_text import cause_of, one_line, printable

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.execution.progress_bar import Amount
    from uavseg.jobs.source.work import Work
    from uavseg.options.running import ProgressOptions, RunOptions, VerbosityOptions
    from uavseg.raster.grid.tiling import Window


def say(text: str) -> None:
    """Print one line on stderr."""
    click.echo(one_line(text), err=True)


def show(text: str) -> None:
    """Print lines of a result on stdout; raise OutputError if it is closed or full."""
    with _written_out():
        click.echo("\n".join(map(printable, text.split("\n"))), file=_standard_output())


@contextmanager
def standard_output() -> Iterator[BinaryIO]:
    """Enter a context that yields stdout for bytes; raise OutputError if it is closed or full."""
    with _written_out():
        stream = _standard_output().buffer
        yield stream
        stream.flush()


def _standard_output() -> Any:
    if sys.stdout is None:
        raise OutputError("the standard output is closed; name a file, or leave it open")
    return sys.stdout


@contextmanager
def _written_out() -> Iterator[None]:
    """Raise errors on writing to stdout as OutputError; what it still holds is dropped then."""
    try:
        yield
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123 - open until the end
        closed = error.errno == errno.EPIPE
        reason = "its reader closed it" if closed else cause_of(error)
        raise OutputError(f"the standard output cannot be written to: {reason}") from error


def saying_decisions() -> None:
    """Print what jobs log ("uavseg" and its children, at INFO) until the command ends."""
    logger, handler = logging.getLogger("uavseg"), logging.Handler(logging.INFO)
    handler.emit = _say_record  # type: ignore[method-assign]
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)

    def end() -> None:
        logger.removeHandler(handler)
        logger.setLevel(before)

    click.get_current_context().call_on_close(end)


def _say_record(record: logging.LogRecord) -> None:
    """Print what `uavseg` logs; of an unexpected error, with where it came from."""
    say(f"uavseg: {'error: ' * (record.levelno >= logging.ERROR)}{record.getMessage()}")
    if record.exc_info:
        for line in "".join(traceback.format_exception(*record.exc_info)).splitlines():
            say(line)


@contextmanager
def library_messages() -> Iterator[None]:
    """Enter a context in which warnings and logs of libraries are single lines, marked as theirs."""

    def tell(text: object) -> None:
        say(f"uavseg: warning: a library warns: {text}")

    def showwarning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if category.__name__ == "NotGeoreferencedWarning":
            return  # of rasterio; what it means for a raster is said elsewhere
        tell(cause_of(message) if isinstance(message, Warning) else message)

    def excepthook(_: object, error: BaseException, *__: object) -> None:
        if not isinstance(error, UnicodeDecodeError):
            tell(error)

    def unraisable(found: Any) -> None:
        # Messages of GDAL are taken for UTF-8. Where one quotes other bytes of a file, its error still comes.
        if not isinstance(found.exc_value, UnicodeDecodeError):
            tell(found.exc_value)

    def emit(record: logging.LogRecord) -> None:
        if record.name.partition(".")[0] == "uavseg":
            _say_record(record)
        else:
            tell(record.getMessage())

    handler = logging.Handler(logging.WARNING)
    handler.emit = emit  # type: ignore[method-assign]
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # without a home it tells where its cache is
    os.environ.setdefault("PROJ_DEBUG", "0")  # PROJ writes its errors to stderr and reports them as well
    before = warnings.showwarning, logging.lastResort, sys.unraisablehook, sys.excepthook
    warnings.showwarning, logging.lastResort, sys.unraisablehook = showwarning, handler, unraisable
    sys.excepthook = excepthook  # Cython calls it before the other
    try:
        yield
    finally:
        warnings.showwarning, logging.lastResort, sys.unraisablehook, sys.excepthook = before


_REDRAW_S = 0.1


class Reporter:
    """Progress, warnings and the final table of a command, on stderr."""

    def __init__(self, messages: "VerbosityOptions", progress: "ProgressOptions | None" = None) -> None:
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

    def begin(self, windows: "Sequence[Window]") -> None:
        """Begin to report work on the tiles of a source."""
        pixels = sum(window.rows * window.cols for window in windows)
        self.begin_each(len(windows), pixels, "tiles")

    def begin_each(self, count: int, pixels: int = 0, unit: str = "rasters") -> None:
        """Begin to report work on many rasters, or other units."""
        if self._bar:
            from uavseg.execution.progress_bar import Amount

            self._amount = Amount(count, pixels, unit)
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
        """End the report: remove the bar, end plain progress at 100, and print warnings."""
        if self._plain:
            self.progress(1, 1)
        elif self._bar and self._percent >= 0:
            click.echo("\r\x1b[K", err=True, nl=False)
        for warning in warnings:
            self.warn(warning)

    def resumed(self, stage: str, done: int, total: int) -> None:
        """Print that some tiles of a stage were found in the checkpoint."""
        self.say(f"resumed: {done:,} of {total:,} tiles were done ({stage})")

    def warn(self, text: str) -> None:
        """Print something that the user should know."""
        if not self.quiet:
            say(f"uavseg: warning: {text}")

    def say(self, text: str) -> None:
        """Print a line, unless the command is quiet."""
        if not self.quiet:
            say(text)

    def table(self, rows: dict[str, str] | None = None, /, **more: str) -> None:
        """Print the short table at the end."""
        for name, value in {**(rows or {}), **more}.items():
            self.say(f"  {name:<12}{value}")

    def timed_table(self, rows: dict[str, str] | None = None, /, **more: str) -> None:
        """Print the table with the seconds of the command below."""
        self.table(rows, **more, seconds=f"{self.seconds:.2f}")

    def detail(self, text: str) -> None:
        """Print a line where the command is verbose."""
        if self.verbose and not self.quiet:
            say(f"uavseg: {text}")


def _seconds() -> float:
    """Return a clock that stands still while kernels are compiled."""
    from uavseg.execution.executors import working_seconds

    return working_seconds()


@contextmanager
def showing_phases(quiet: bool) -> Iterator[None]:
    """Enter a context that shows phases of more than two seconds on stderr, unless it is quiet."""
    from uavseg.execution.executors import watched
    from uavseg.execution.progress_bar import PhaseLine

    if quiet:
        yield
        return
    with PhaseLine() as line, watched(line):
        yield


def work_of(run: "RunOptions", reporter: Reporter) -> "Work":
    """Return how a job is run: by threads of this process, or by a cluster that is released with the command.

    A ParameterError says that the number of threads is below 1, a ClusterError that the scheduler does not
    answer or its workers do not fit.
    """
    from uavseg.execution import executors
    from uavseg.jobs.source.work import Work

    cluster = _cluster(run)
    executors.keep_heap()
    local = executors.threads(run.threads)
    executors.decided("%s", run.scheduler or f"{run.threads or executors.usable_cores()} threads")
    return Work(
        tile=run.tile,
        executor=cluster or local,
        local=local,
        progress=reporter.progress,
        checkpoint=run.resume,
        resumed=reporter.resumed,
        started=reporter.begin,
    )


def _cluster(run: "RunOptions") -> "Map | None":
    if run.scheduler is None:
        return None
    if run.threads is not None:
        raise click.UsageError("--threads are this machine's, --scheduler has its own; give one of the two")
    from uavseg.execution.cluster import dask

    cluster = dask(run.scheduler)
    click.get_current_context().call_on_close(cluster.close)
    return cluster
