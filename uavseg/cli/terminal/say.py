"""What a command prints: single printable lines, and what libraries say as warnings of its own."""

from __future__ import annotations

import errno
import logging
import os
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import click

from uavseg.errors import OutputError
from uavseg.plain_text import cause_of, one_line, printable


def say(text: str) -> None:
    """One line on stderr."""
    click.echo(one_line(text), err=True)


def show(text: str) -> None:
    """Lines of a result on stdout.

    Raises
    ------
    OutputError
        If stdout is closed or full.
    """
    with _written_out():
        click.echo("\n".join(map(printable, text.split("\n"))), file=_standard_output())


@contextmanager
def standard_output() -> Iterator[BinaryIO]:
    """Context manager that yields stdout for bytes.

    Raises
    ------
    OutputError
        If it is closed or full.
    """
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
    """Errors on writing to stdout as OutputError; what it still holds is dropped then."""
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
    """What `uavseg` logs; of an error that it did not expect, with where it came from."""
    say(f"uavseg: {'error: ' * (record.levelno >= logging.ERROR)}{record.getMessage()}")
    if record.exc_info:
        for line in "".join(traceback.format_exception(*record.exc_info)).splitlines():
            say(line)


@contextmanager
def library_messages() -> Iterator[None]:
    """Context manager in which warnings and logs of libraries are single lines, marked as theirs."""

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
