"""Options of how much a command says on stderr: -q and -v."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import click

from uavseg.cli.terminal.say import saying_decisions

F = TypeVar("F", bound=Callable[..., Any])


def verbosity_options(command: F) -> F:
    """Give a command -q and -v; see `heed_verbose`."""
    for option in (
        click.option("-v", "--verbose", is_flag=True, help="Say what was decided, and how long it took."),
        click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors."),
    ):
        command = option(command)
    return command


def heed_verbose(quiet: bool, verbose: bool) -> None:
    """Print what the job of this command decides, if -v is given and -q is not."""
    if verbose and not quiet:
        saying_decisions()


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
