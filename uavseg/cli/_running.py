"""Options of every command that works through tiles: how they are cut, who works, what is told."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.parallel import Map

Command = TypeVar("Command", bound=Callable[..., Any])


def running_options(command: Command) -> Command:
    """Give a command --tile, --threads, --resume, --overwrite, -q, -v and --progress."""
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
        command = option(command)
    return command


def resuming(run: Map, folder: str | None, reporter: Reporter) -> Map:
    """A map that keeps finished tiles in the folder, if one was given."""
    if folder is None:
        return run
    from uavseg.resuming import kept

    return kept(run, folder, reporter.resumed)


class Reporter:
    """What a command says on stderr while it works and when it is done."""

    def __init__(self, quiet: bool, verbose: bool, progress: str) -> None:
        self.quiet = quiet
        self.verbose = verbose
        self._plain = progress == "plain"
        self._bar = progress == "auto" and not quiet and sys.stderr.isatty()
        self._percent = -1
        self._start = time.perf_counter()

    @property
    def seconds(self) -> float:
        """Since the command began."""
        return time.perf_counter() - self._start

    def progress(self, done: int, total: int) -> None:
        """Take in that `done` of `total` steps are done."""
        percent = 100 * done // max(total, 1)
        if percent <= self._percent:
            return
        self._percent = percent
        if self._plain:
            click.echo(f"progress {percent}", err=True)
        elif self._bar:
            filled = percent * 40 // 100
            click.echo(
                f"\r[{'#' * filled}{'.' * (40 - filled)}] {percent:3d} % {self.seconds:6.1f} s",
                err=True,
                nl=False,
            )

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
