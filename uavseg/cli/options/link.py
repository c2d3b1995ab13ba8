"""Options and reports of the commands that talk to a vehicle."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli.options.running import Reporter
from uavseg.cli.options.verbosity import verbosity_options

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission

Command = TypeVar("Command", bound=Callable[..., Any])


def link_options(command: Command) -> Command:
    """Give a command --connect, --timeout, --progress, -q and -v."""
    options: list[Callable[[Command], Command]] = [
        click.option(
            "--connect",
            required=True,
            metavar="ADDRESS",
            help="Where the vehicle is: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or "
            "serial:DEVICE[:BAUD].",
        ),
        click.option(
            "--timeout",
            type=float,
            default=10.0,
            show_default=True,
            metavar="S",
            help="Seconds to wait for an answer, and without progress.",
        ),
        click.option(
            "--progress",
            type=click.Choice(["auto", "plain", "none"]),
            default="auto",
            show_default=True,
            help="A bar on a terminal; plain: lines 'progress NN' on stderr, for programs.",
        ),
        verbosity_options,
    ]
    for option in reversed(options):
        command = option(command)
    return command


def reporter_of(options: dict[str, Any]) -> Reporter:
    """The reporter that the options ask for."""
    return Reporter(options["quiet"], options["verbose"], options["progress"])


def vehicle_report(mission: Mission, vehicle: str) -> str:
    """What was transferred, and the vehicle."""
    parts = [f"{len(mission.items)} items"]
    if mission.fence:
        parts.append(f"a fence of {len(mission.fence)} shape{'s' * (len(mission.fence) > 1)}")
    if mission.rally:
        parts.append(f"{len(mission.rally)} rally point{'s' * (len(mission.rally) > 1)}")
    return f"{', '.join(parts)} ({vehicle})"
