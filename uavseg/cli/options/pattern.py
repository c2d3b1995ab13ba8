"""Options about patterns and about photographs, as the words of `uavseg.jobs`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.jobs.words.pattern_words import PatternWords
    from uavseg.jobs.words.photo_words import PhotoWords

F = TypeVar("F", bound=Callable[..., Any])


def pattern_options(command: F) -> F:
    """The options about single patterns: see `pattern_words`."""
    options = [
        click.option(
            "--margin",
            type=float,
            metavar="M",
            help="Survey, corridor: regions are grown by it before they are covered. Orbit: distance of the "
            "circle from the region.  [default: 0]",
        ),
        click.option(
            "--crosshatch", is_flag=True, help="Survey: once more, in lines at a right angle to the first."
        ),
        click.option(
            "--turnaround",
            type=float,
            metavar="M",
            help="Survey: straight on without photographs before and after each line, for fixed wings.",
        ),
        click.option(
            "--offset",
            type=float,
            metavar="M",
            help="Perimeter: distance outward from the outline, negative inward.  [default: 0]",
        ),
        click.option(
            "--min-leg",
            type=float,
            metavar="M",
            help="Perimeter: no leg is shorter.  [default: what is flown in a second]",
        ),
        click.option(
            "--holes",
            type=click.Choice(["skip", "fly"]),
            help="Perimeter: whether the outlines of holes are flown.  [default: skip]",
        ),
        click.option(
            "--hold", type=float, metavar="S", help="Visit: seconds over each region.  [default: 0]"
        ),
    ]
    return _decorated(command, options)


def photo_options(command: F) -> F:
    """The options about photographs besides the name of a camera: see `photo_words`."""
    options = [
        click.option("--sensor", metavar="WxH", help="In place of --camera: its sensor in millimetres."),
        click.option("--image", metavar="WxH", help="With --sensor: the image in pixels."),
        click.option("--focal", type=float, metavar="MM", help="With --sensor: the focal length."),
        click.option(
            "--min-interval",
            type=float,
            metavar="S",
            help="With --sensor: shortest time between photographs; it limits the speed.  [default: 0]",
        ),
        click.option(
            "--trigger",
            type=click.Choice(["distance", "interval", "hover", "none"]),
            help="Photographs by distance, by time, in hover at a waypoint for each, or not by the mission.  "
            "[default: distance; hover on a visit]",
        ),
        click.option(
            "--shutter",
            metavar="1/S|S",
            help="Exposure time in seconds, such as 1/1000, by which motion blur limits the speed.  "
            "[default: 1/1000]",
        ),
    ]
    return _decorated(command, options)


def pattern_words(options: dict[str, Any]) -> PatternWords:
    """What was said about the pattern."""
    from dataclasses import fields

    from uavseg.jobs.words.pattern_words import PatternWords

    return PatternWords(**{one.name: options[one.name] for one in fields(PatternWords)})


def photo_words(options: dict[str, Any], overlap: list[float]) -> PhotoWords:
    """What was said about the camera and its photographs."""
    from uavseg.jobs.words.photo_words import PhotoWords

    return PhotoWords(
        sensor=parse_size("--sensor", options["sensor"]),
        image=parse_size("--image", options["image"]),
        overlap=overlap,
        shutter=parse_shutter(options["shutter"]),
        **{name: options[name] for name in ("camera", "focal", "min_interval", "gimbal_pitch", "trigger")},
    )


def parse_size(option: str, text: str | None) -> list[float] | None:
    """WxH as numbers."""
    if text is None:
        return None
    try:
        sides = [float(part) for part in text.lower().split("x")]
    except ValueError:
        sides = []
    if len(sides) != 2:
        raise ParameterError(f"{option} is WIDTHxHEIGHT, such as 13.2x8.8, not {text!r}")
    return sides


def parse_shutter(text: str | None) -> float | None:
    """1/1000 or 0.001 as seconds."""
    if text is None:
        return None
    above, slash, below = text.partition("/")
    with suppress(ValueError, ZeroDivisionError):
        divisor = float(below) if slash else 1.0
        if math.isfinite(divisor):
            return float(above) / divisor
    raise ParameterError(f"--shutter is seconds, such as 1/1000, not {text!r}")


def _decorated(command: F, options: Sequence[Callable[[F], F]]) -> F:
    for option in reversed(options):
        command = option(command)
    return command
