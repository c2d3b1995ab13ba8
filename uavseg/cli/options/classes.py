"""Options of commands that take classes of v: --class, --classes and several --range."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.segmentation.params import IntensityRange
    from uavseg.segmentation.partition import ValueClasses

F = TypeVar("F", bound=Callable[..., Any])


def class_options(command: F) -> F:
    """Give a command --range, --class and --classes; see `asked_ranges`."""
    for option in reversed(
        (
            click.option(
                "--range",
                "ranges",
                multiple=True,
                metavar="LO,HI",
                help="The range of v, such as 0.55,1. Several are classes, named after their ranges.",
            ),
            click.option(
                "--class",
                "class_texts",
                multiple=True,
                metavar="NAME=LO,HI",
                help="A class and its range of v, such as water=0,0.2; give one for each class. Each pixel is "
                "in one class at most; an end that two ranges share belongs to the lower one.",
            ),
            click.option(
                "--classes",
                "class_file",
                metavar="FILE",
                help="Classes from a .csv or .yaml file: name, range (or low and high), color as #rrggbb.",
            ),
        )
    ):
        command = option(command)
    return command


def asked_ranges(options: dict[str, Any]) -> IntensityRange | ValueClasses:
    """The one range, or the classes, that a command was given.

    Raises
    ------
    UsageError
        If there is neither, or more than one kind of them.
    UavsegError
        If they are not understood, or classes overlap.
    """
    from uavseg.cli.options.raster import parsed_range

    ranges, texts, file = options["ranges"], options["class_texts"], options["class_file"]
    if sum(map(bool, (ranges, texts, file is not None))) != 1:
        raise click.UsageError("give --range LO,HI, or classes as --class NAME=LO,HI or --classes FILE")
    if len(ranges) == 1:
        return parsed_range(ranges[0])
    from uavseg.jobs.words.class_words import classes_of_ranges, classes_of_texts, read_classes

    if file is not None:
        return read_classes(file)
    if texts:
        return classes_of_texts(texts)
    return classes_of_ranges([parsed_range(text) for text in ranges])
