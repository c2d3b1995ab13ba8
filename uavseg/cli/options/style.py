"""The option of styles for GIS programs, and the file that it names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])


def style_option(command: F) -> F:
    """Give a command --style; see `style_kind`."""
    return click.option(
        "--style",
        type=click.Choice(["qml", "sld"]),
        help="Also write a style for GIS programs beside the regions: STEM.qml for QGIS, or STEM.sld. "
        "A .gpkg carries its style in any case.",
    )(command)


def style_kind(options: dict[str, Any], target: str) -> str | None:
    """The kind of style that is written beside a target, if one is; its file may be made.

    Raises
    ------
    UsageError
        If the regions go to standard output, or to many files.
    OutputError
        If the file may not be made.
    """
    kind: str | None = options["style"]
    if kind is None:
        return None
    if target == "-":
        raise click.UsageError("--style is written beside a file of regions; give -o a name, or leave it out")
    from uavseg.regions.formats.style_files import check_style

    check_style(target, kind, options["overwrite"])
    return kind
