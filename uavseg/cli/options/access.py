"""Options that say what the contents of files may name: --allow-path and --allow-network."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, TypeVar, cast

import click

Command = TypeVar("Command", bound=Callable[..., Any])


def access_options(command: Command) -> Command:
    """Give a command --allow-path and --allow-network, and run it under the access policy that they say."""

    @click.option(
        "--allow-path",
        multiple=True,
        type=click.Path(),
        metavar="DIR",
        help="The contents of files may name files in this folder, beside their own; may be repeated.",
    )
    @click.option(
        "--allow-network", is_flag=True, help="The contents of files may name addresses to read from."
    )
    @wraps(command)
    def run(*args: Any, allow_path: tuple[str, ...], allow_network: bool, **options: Any) -> Any:
        from uavseg.access import allowing

        with allowing(allow_path, allow_network), _proj_requests(allow_network):
            return command(*args, **options)

    return cast(Command, run)


@contextmanager
def _proj_requests(allowed: bool) -> Iterator[None]:
    """A block in which PROJ fetches no grids, unless that is allowed and its user has asked for it."""
    before = os.environ.get("PROJ_NETWORK")
    if not allowed:
        os.environ["PROJ_NETWORK"] = "OFF"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop("PROJ_NETWORK", None)
        else:
            os.environ["PROJ_NETWORK"] = before
