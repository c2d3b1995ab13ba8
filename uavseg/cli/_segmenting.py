"""Options of every command that divides a raster."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.segmentation.intervals import IntensityRange

Command = TypeVar("Command", bound=Callable[..., Any])


def segmenting_options(command: Command, method: str = "adaptive") -> Command:
    """Give a command --method, which is this one unless told otherwise, --threshold and --intensity-step."""
    for option in reversed(
        (
            click.option(
                "--method",
                type=click.Choice(["adaptive", "paper"]),
                default=method,
                show_default=True,
                help="Divide blocks by texture and intensity, or by texture alone as the paper does.",
            ),
            click.option(
                "--threshold",
                type=float,
                default=1.2,
                show_default=True,
                metavar="X",
                help="Divide where G_max / G_min is larger.",
            ),
            click.option(
                "--intensity-step",
                type=float,
                default=0.05,
                show_default=True,
                metavar="TAU",
                help="Adaptive: divide where the means of the children differ by more.",
            ),
        )
    ):
        command = option(command)
    return command


def parsed_range(text: str) -> IntensityRange:
    """LO,HI of --range as a range of v."""
    from uavseg.segmentation.intervals import IntensityRange

    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"--range is two numbers between commas, such as 0.55,1, not {text!r}") from None
    return IntensityRange(low, high)
