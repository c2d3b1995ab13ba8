"""Options of a flight at a constant height above the ground: --dem, --terrain and what goes with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.flight.params.terrain import TerrainParams

F = TypeVar("F", bound=Callable[..., Any])


def terrain_options(command: F) -> F:
    """The options of a flight above the ground: `dem`, `terrain`, `terrain_tolerance`, `climb`, `descent`."""
    options = [
        click.option(
            "--dem",
            multiple=True,
            metavar="DEM.tif",
            help="Fly --altitude above the ground of this elevation model, not above home; may be repeated, "
            "for a mosaic.",
        ),
        click.option(
            "--terrain",
            type=click.Choice(["frame", "absolute", "relative"]),
            help="Heights above the sea or above home from --dem, with points added where the ground bends; "
            "frame: above the terrain that the vehicle knows itself (ArduPilot).  [absolute with --dem]",
        ),
        click.option(
            "--terrain-tolerance",
            type=float,
            metavar="M",
            help="How far the height above the ground may differ.  [default: 5, or a quarter of the height]",
        ),
        click.option(
            "--climb",
            type=float,
            metavar="M_S",
            help="How fast the vehicle climbs in forward flight; steeper legs are flown slower.  "
            "[default: 2.5, or 3 for px4]",
        ),
        click.option(
            "--descent",
            type=float,
            metavar="M_S",
            help="How fast it descends.  [default: 1.5]",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def terrain_of(options: dict[str, Any]) -> TerrainParams | None:
    """How the flight follows the ground, from the values of `terrain_options`."""
    from uavseg.flight.params.terrain import terrain_params

    return terrain_params(
        options["dem"] or None,
        options["terrain"],
        options["terrain_tolerance"],
        options["climb"],
        options["descent"],
    )
