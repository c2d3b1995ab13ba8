"""Option --co, creation options of the GeoTIFFs that a command writes, and its value."""

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
