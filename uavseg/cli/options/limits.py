"""Options that say what flights keep away from and what each may take."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.flight.params.limits import LimitParams, SafetyParams
    from uavseg.jobs.source.source import Source

F = TypeVar("F", bound=Callable[..., Any])


def limit_options(command: F) -> F:
    """They arrive as `avoid` to `rally`: see `limits_of`, `safety_of` and `zones_of`."""
    options = [
        click.option(
            "--avoid",
            multiple=True,
            metavar="FILE|LO,HI",
            help="Keep-out zones that no leg enters: a file of polygons, or a range of intensity that is "
            "looked for in the raster. May be given several times.",
        ),
        click.option(
            "--avoid-margin",
            type=float,
            default=10.0,
            metavar="M",
            show_default=True,
            help="Least distance to keep-out zones.",
        ),
        click.option(
            "--allow-edge",
            is_flag=True,
            help="Fly over regions that touch the edge of the raster all the same; they may go on beyond it, "
            "or be a collar.",
        ),
        click.option(
            "--endurance",
            type=float,
            metavar="MIN",
            help="Minutes in the air on a full battery: the mission is divided into flights that fit.",
        ),
        click.option(
            "--reserve",
            type=float,
            default=20.0,
            metavar="PERCENT",
            show_default=True,
            help="Part of the endurance that is left at the end of each flight.",
        ),
        click.option(
            "--max-items",
            type=int,
            metavar="N",
            help="Items of a flight at most: the mission is divided likewise.  "
            "[default: 650 for ardupilot, else 500]",
        ),
        click.option(
            "--max-altitude",
            type=float,
            default=120.0,
            metavar="M",
            show_default=True,
            help="Refuse to fly higher above home, or above the ground where it is known.",
        ),
        click.option("--max-distance", type=float, metavar="M", help="Refuse to fly farther from home."),
        click.option(
            "--fence",
            default="50",
            metavar="M|none",
            show_default=True,
            help="Write a fence so far around each flight, which excludes keep-out zones.",
        ),
        click.option(
            "--rally",
            multiple=True,
            metavar="LAT,LON,M",
            help="A place to return to in an emergency, with a height above home. May be given "
            "several times.",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def limits_of(options: dict[str, Any]) -> LimitParams:
    """What each flight may take."""
    from uavseg.flight.params.limits import LimitParams

    return LimitParams(options["endurance"], options["reserve"], options["max_items"])


def safety_of(options: dict[str, Any]) -> SafetyParams:
    """What flights keep away from, and where they stay."""
    from uavseg.flight.mission.fence import RallyPoint
    from uavseg.flight.params.limits import SafetyParams

    return SafetyParams(
        options["avoid_margin"],
        _fence(options["fence"]),
        options["max_altitude"],
        options["max_distance"],
        tuple(RallyPoint(*_numbers(text)) for text in options["rally"]),
    )


def zones_of(options: dict[str, Any], raster: Source | None) -> list[Any]:
    """Polygons in degrees of the zones of `--avoid`."""
    from uavseg.jobs.flights.plan_regions import zone_polygons

    return zone_polygons([_zone(text) for text in options["avoid"]], raster)


def zone_files(options: dict[str, Any]) -> list[str]:
    """The files among the zones."""
    return [text for text in options["avoid"] if isinstance(_zone(text), str)]


def _zone(text: str) -> str | tuple[float, float]:
    """LO,HI as numbers, unless a file has that name."""
    parts = text.split(",")
    if len(parts) != 2 or Path(text).exists():
        return text
    try:
        return float(parts[0]), float(parts[1])
    except ValueError:
        return text


def _fence(text: str) -> float | None:
    if text.strip().lower() == "none":
        return None
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"--fence is a number of metres or none, not {text!r}") from None


def _numbers(text: str) -> tuple[float, float, float]:
    try:
        lat, lon, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"--rally is LAT,LON,M in degrees and metres, not {text!r}") from None
    return lat, lon, height
