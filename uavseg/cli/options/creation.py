"""How outputs are stored: --co for GeoTIFFs, --mode for ROS maps."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.raster.formats.creation import CreationOptions

F = TypeVar("F", bound=Callable[..., Any])


def creation_option(command: F) -> F:
    """Give a command --co, under the name that rio gives it; see `creation_of`."""
    return click.option(
        "--co",
        "creation_options",
        multiple=True,
        metavar="NAME=VALUE",
        help="How a GeoTIFF is stored: COMPRESS=DEFLATE, LZW, ZSTD, LZMA, PACKBITS or NONE, ZLEVEL, "
        "ZSTD_LEVEL, PREDICTOR, BIGTIFF; several times for several. Its pixels stay the same.",
    )(command)


def map_mode_option(command: F) -> F:
    """Give a command that writes a map of probabilities --mode."""
    return click.option(
        "--mode",
        type=click.Choice(["trinary", "scale", "raw"]),
        show_default="trinary",
        help="How the picture of a ROS map is to be read: three states; or all levels, as a .png (scale) or "
        "a .pgm of per cent (raw).",
    )(command)


def creation_of(options: dict[str, Any], targets: dict[str | None, str]) -> CreationOptions:
    """How the GeoTIFFs of a command are stored.

    Parameters
    ----------
    options : dict
        Those of the command.
    targets : dict
        Its outputs, or None, with the type of their pixels.

    Raises
    ------
    ParameterError
        As `creation_for`.
    """
    from uavseg.raster.formats.creation import creation_for

    return creation_for(options["creation_options"], targets)
