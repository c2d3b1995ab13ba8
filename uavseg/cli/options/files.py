"""Options of mission files, and their values."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.flight.formats.options import FileOptions

F = TypeVar("F", bound=Callable[..., Any])


def file_options(command: F) -> F:
    """Give a command the options of mission files: --editable and --dji-model."""
    command = click.option(
        "--dji-model",
        default="m3e",
        show_default=True,
        metavar="NAME",
        help="The aircraft of a .kmz: m3e, m3t, m3m, m4e, m4t, m30, m30t, m3d, m3td, m300-h20, m350-h30 ...",
    )(command)
    return click.option(
        "--editable",
        is_flag=True,
        help="In a .plan, survey items that QGroundControl can edit where a part is convex; the same flight.",
    )(command)


def parse_file_options(options: dict[str, Any]) -> FileOptions:
    """The values of `file_options`; of commands without them, the defaults."""
    from uavseg.flight.formats.options import FileOptions

    return FileOptions(options.get("editable", False), options.get("dji_model", FileOptions().dji_model))
