"""Options of every command that makes a mission."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.errors import MissionError, ParameterError

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission
    from uavseg.flight.params import PlanParams
    from uavseg.regions.table import Regions

F = TypeVar("F", bound=Callable[..., Any])


def mission_options(command: F) -> F:
    """The options that say how to fly, for every command that makes a mission.

    They arrive as `altitude`, `home`, `pattern`, `spacing`, `angle`, `speed`, `firmware` and `tolerance`:
    see `mission_params` and `home_position`.
    """
    options = [
        click.option(
            "--altitude", type=float, metavar="M", help="Height of the flight above home, in metres."
        ),
        click.option(
            "--home",
            metavar="LAT,LON[,M]|auto",
            help="Where the vehicle starts, and metres above the sea; auto: inside the first chosen region.",
        ),
        click.option(
            "--pattern",
            type=click.Choice(["visit", "perimeter", "survey"]),
            help="A point in each region, its outline, or lines over it.  [visit, or survey with --spacing]",
        ),
        click.option("--spacing", type=float, metavar="M", help="Metres between the lines of a survey."),
        click.option(
            "--angle",
            default="auto",
            metavar="DEG|auto",
            show_default=True,
            help="Azimuth of the lines, clockwise from north; auto: the one that needs the fewest lines.",
        ),
        click.option(
            "--speed", type=float, default=5.0, metavar="M_S", show_default=True, help="Metres per second."
        ),
        click.option(
            "--firmware", type=click.Choice(["ardupilot", "px4"]), default="ardupilot", show_default=True
        ),
        click.option(
            "--tolerance",
            type=float,
            metavar="M",
            help="How far outlines may be moved to save corners.  [default: 1 m, or a pixel where larger]",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def mission_params(**flight: Any) -> PlanParams:
    """How to fly, from the values of `mission_options`."""
    from uavseg.flight.planner import PlanParams

    if flight["altitude"] is None:
        raise ParameterError("a mission needs --altitude, in metres above home")
    pattern = flight["pattern"] or ("visit" if flight["spacing"] is None else "survey")
    return PlanParams(
        altitude_m=flight["altitude"],
        pattern=pattern,
        spacing_m=flight["spacing"],
        angle_deg=parse_angle(flight["angle"]),
        speed_m_s=flight["speed"],
        firmware=flight["firmware"],
        tolerance_m=flight["tolerance"],
    )


def planned(regions: Regions, polygons: Sequence[Any], params: PlanParams, home: str | None) -> Mission:
    """A mission over regions whose polygons are given in degrees (lon, lat)."""
    from uavseg.flight.planner import plan

    points = list(zip(regions.columns["lon"].tolist(), regions.columns["lat"].tolist(), strict=True))
    return plan(polygons, points, params, home_position(home, points))


def home_position(text: str | None, points: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """LAT,LON or LAT,LON,M as numbers; auto is the first of the points (lon, lat)."""
    if text is None:
        raise ParameterError("a mission needs --home LAT,LON, where the vehicle starts (or --home auto)")
    if text.strip().lower() == "auto":
        if not points:
            raise MissionError("there is no region to fly to; choose at least one")
        return points[0][1], points[0][0]
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in (2, 3):
        raise ParameterError(f"--home is LAT,LON or LAT,LON,M in degrees and metres, or auto, not {text!r}")
    return numbers


def parse_angle(text: str) -> float | None:
    """Degrees, or None for auto."""
    if text.strip().lower() == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"--angle is a number of degrees or auto, not {text!r}") from None


def report(mission: Mission, regions: int, output: str) -> None:
    """Tell on stderr what the mission is, and what to mind."""
    minutes, seconds = divmod(round(mission.duration_s), 60)
    say = f"{output}: {regions} region{'s' * (regions != 1)}, {len(mission.items)} items"
    click.echo(f"{say}, {mission.distance_m / 1000:.2f} km, at least {minutes} min {seconds:02d} s", err=True)
    if mission.firmware == "px4" and output.lower().endswith(".waypoints"):
        click.echo(
            "note: PX4 will face north at each item of a .waypoints file; a .plan leaves it free", err=True
        )
    for warning in mission.warnings:
        click.echo(f"note: {warning}", err=True)
