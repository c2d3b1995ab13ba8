"""Options that say how to fly, as one request; and what is reported of a mission."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli.options.files import file_options
from uavseg.cli.options.limits import limit_options, limits_of, safety_of
from uavseg.cli.options.pattern import pattern_options, pattern_words, photo_options, photo_words
from uavseg.cli.options.terrain import terrain_of, terrain_options
from uavseg.cli.options.vehicle import flight_table, vehicle_options
from uavseg.cli.terminal.say import say
from uavseg.errors import ParameterError, RegionError

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission
    from uavseg.jobs.flights.plan import Home, PlanRequest

F = TypeVar("F", bound=Callable[..., Any])


def mission_options(command: F) -> F:
    """The options that say how to fly, for every command that makes a mission.

    They arrive as `altitude`, `camera`, `gsd`, `overlap`, `gimbal_pitch`, `home`, `pattern`, `spacing`,
    `angle`, `speed`, `autopilot` and `tolerance`, and those of groups of their own: see `plan_request`.
    """
    options = [
        click.option(
            "--altitude",
            type=float,
            metavar="M",
            help="Height of the flight above home, or with --dem above the ground, in metres.",
        ),
        click.option(
            "--camera",
            metavar="NAME|FILE.json",
            help="Photograph with this camera: spacing, trigger distance and the highest speed follow. "
            "uavseg cameras lists them.",
        ),
        click.option(
            "--gsd",
            type=float,
            metavar="CM",
            help="Ground sampling distance, in place of --altitude: centimetres per pixel.",
        ),
        click.option(
            "--overlap",
            default="75,70",
            metavar="FRONT,SIDE",
            show_default=True,
            help="Overlap of photographs along lines and between them, in per cent.",
        ),
        click.option(
            "--gimbal-pitch",
            type=float,
            default=-90.0,
            metavar="DEG",
            show_default=True,
            help="Where the camera looks: -90 is straight down.",
        ),
        click.option(
            "--home",
            metavar="LAT,LON[,M]|auto",
            help="Where the vehicle starts, and metres above the sea; auto: outside of regions and zones.",
        ),
        click.option(
            "--pattern",
            type=click.Choice(["visit", "perimeter", "survey", "corridor", "orbit"]),
            help="A point in each region, its outline, parallel lines over it, lines along its middle, or a "
            "circle around it.  [visit, or survey with --spacing or a camera]",
        ),
        click.option(
            "--spacing", type=float, metavar="M", help="Metres between the lines of a survey or corridor."
        ),
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
            "--autopilot",
            type=click.Choice(["ardupilot", "px4", "generic"]),
            default="ardupilot",
            show_default=True,
            help="What the mission is for; generic: any, with what ArduPilot and PX4 both accept.",
        ),
        click.option(
            "--tolerance",
            type=float,
            metavar="M",
            help="How far outlines may be moved to save corners.  [default: 1 m, or a pixel where larger]",
        ),
    ]
    groups = (
        vehicle_options,
        terrain_options,
        limit_options,
        file_options,
        photo_options,
        pattern_options,
    )
    for option in (*reversed(groups), *reversed(options)):
        command = option(command)
    return command


def plan_request(options: dict[str, Any]) -> PlanRequest:
    """How to fly, from where and over which regions, from the values of `mission_options`."""
    from uavseg.jobs.flights.plan import PlanRequest
    from uavseg.jobs.words.flight_params import flight_params

    names = ("pattern", "spacing", "speed", "autopilot", "tolerance", "gsd", "vehicle")
    photos = photo_words(options, parse_overlap(options["overlap"]))
    flight = flight_params(
        options["altitude"],
        angle=parse_angle(options["angle"]),
        photos=photos,
        words=pattern_words(options),
        limits=limits_of(options),
        safety=safety_of(options),
        terrain=terrain_of(options),
        **{name: options[name] for name in names},
    )
    home = parse_home(options["home"])
    ids = parse_ids(options.get("ids"))
    return PlanRequest(
        flight,
        home,
        ids,
        options.get("largest"),
        options.get("where"),
        options["allow_edge"],
        options.get("mission_classes") or None,
        options.get("avoid_classes") or (),
    )


def parse_home(text: str | None) -> Home:
    """LAT,LON or LAT,LON,M as numbers, or auto."""
    if text is None:
        raise ParameterError("a mission needs --home LAT,LON, where the vehicle starts (or --home auto)")
    if text.strip().lower() == "auto":
        return "auto"
    try:
        numbers = tuple(float(part) for part in text.split("," if "," in text else None))
    except ValueError:
        numbers = ()
    if len(numbers) not in (2, 3):
        raise ParameterError(f"--home is LAT,LON or LAT,LON,M in degrees and metres, or auto, not {text!r}")
    return numbers


def parse_ids(text: str | None) -> list[int] | None:
    """Whole numbers between commas."""
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise RegionError(f"--ids is whole numbers between commas, as in 1,4,7, not {text!r}") from None


def parse_overlap(text: str) -> list[float]:
    """FRONT,SIDE as numbers."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ParameterError(f"--overlap is FRONT,SIDE in per cent, such as 75,70, not {text!r}") from None


def parse_angle(text: str) -> float | None:
    """Degrees, or None for auto."""
    if text.strip().lower() == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"--angle is a number of degrees or auto, not {text!r}") from None


def report(
    missions: Sequence[Mission], regions: int, paths: Sequence[str | Path], notes: Sequence[str]
) -> None:
    """Print estimates of missions on stderr, and notes on them."""
    from uavseg.flight.mission.estimate import estimate_text

    flights = [(Path(path).stem, mission.estimate) for mission, path in zip(missions, paths, strict=True)]
    for mission, path, (_, found) in zip(missions, paths, flights, strict=True):
        over = f"{regions} region{'s' * (regions != 1)}, " if len(paths) == 1 else ""
        estimate = estimate_text(found.distance_m, found.duration_s)
        say(f"{path}: {over}{len(mission.items)} items, {estimate}")
    for line in flight_table(flights):
        say(line)
    if missions[0].autopilot != "ardupilot" and str(paths[0]).lower().endswith(".waypoints"):
        say("note: PX4 will face north at each item of a .waypoints file; a .plan leaves it free")
    for note in notes:
        say(f"note: {note}")
