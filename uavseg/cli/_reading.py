"""Options of every command that reads rasters: which bands, which pixels count, how they become grey."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])

map_stretch_option = click.option(
    "--stretch",
    metavar="STRETCH",
    help="For a map that holds no probabilities: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.  "
    "[default: dtype for integers, none for floats]",
)


def reading_options(command: Command) -> Command:
    """Give a command RASTER..., --band, --rgb, --nodata, --stretch and --skip-bad-tiles."""
    for option in reversed(
        (
            click.argument("rasters", metavar="RASTER...", nargs=-1, required=True),
            click.option("--band", type=click.IntRange(min=1), help="Use this band, counted from 1."),
            click.option("--rgb", metavar="R,G,B", callback=_three, help="Use the luminance of these bands."),
            click.option("--nodata", type=float, metavar="V|nan", help="This value counts for nothing."),
            click.option(
                "--stretch",
                default="auto",
                show_default=True,
                metavar="STRETCH",
                help="How intensity becomes v: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.",
            ),
            click.option(
                "--skip-bad-tiles",
                is_flag=True,
                help="Count blocks of a file that cannot be read as nodata, and list them at the end.",
            ),
        )
    ):
        command = option(command)
    return command


def _three(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[int, int, int] | None:
    """Three band numbers of a text."""
    if value is None:
        return None
    try:
        red, green, blue = (int(part) for part in value.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not three band numbers, such as 4,3,2", ctx, param) from error
    return red, green, blue
