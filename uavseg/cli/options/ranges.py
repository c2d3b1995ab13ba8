"""Options of ranges: of v, of values in the raster's own units, or of percentiles."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.jobs.ranges.ranges import AnyRange

F = TypeVar("F", bound=Callable[..., Any])


def range_options(meaning: str, many: bool = False) -> Callable[[F], F]:
    """Give a command --range (several are a tuple), --values and --percentile; see `asked_range`."""

    def decorate(command: F) -> F:
        for option in reversed(
            (
                click.option("--range", "interval", metavar="LO,HI", multiple=many, help=meaning),
                click.option(
                    "--values",
                    metavar="LO,HI",
                    help="In place of --range: values in the raster's own units, after its scale and offset, "
                    "such as 20,40; 300, and ,35 are open.",
                ),
                click.option(
                    "--percentile",
                    metavar="LO,HI",
                    help="In place of --range: percentiles of all valid pixels, such as 90,100.",
                ),
            )
        ):
            command = option(command)
        return command

    return decorate


def asked_range(options: dict[str, Any]) -> AnyRange:
    """The range that was asked for in one of the three ways.

    Raises
    ------
    UsageError
        If there is none, or more than one.
    ParameterError
        If it is not a range.
    """
    from uavseg.jobs.ranges.range_words import parse_range

    given = {name: options[key] for name, key in _KEYS.items() if options[key] is not None}
    if not given:
        raise click.UsageError("Missing option '--range' (v in 0..1), '--values' or '--percentile'.")
    if len(given) > 1:
        raise click.UsageError(f"{' and '.join(given)} are ranges of different kinds; give one of them")
    [(name, text)] = given.items()
    return parse_range(name, text)


_KEYS = {"--range": "interval", "--values": "values", "--percentile": "percentile"}
