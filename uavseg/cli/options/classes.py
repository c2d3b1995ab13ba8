"""Options of commands that take classes of v: --class, --classes and several --range."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.jobs.ranges.ranges import AnyRange
    from uavseg.jobs.result.result import Extraction
    from uavseg.segmentation.params.partition import ValueClasses

F = TypeVar("F", bound=Callable[..., Any])


def class_options(command: F) -> F:
    """Give a command --class and --classes; see `asked_ranges`."""
    for option in reversed(
        (
            click.option(
                "--class",
                "class_texts",
                multiple=True,
                metavar="NAME=LO,HI",
                help="A class and its range of v, such as water=0,0.2; give one for each class. Each pixel "
                "is in one class at most; an end that two ranges share belongs to the lower one.",
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


def class_choice_options(name: str) -> Callable[[F], F]:
    """Give a command an option that chooses classes to fly over, and --avoid-class; see `plan_request`.

    Parameters
    ----------
    name : str
        Of the option, such as --class.
    """

    def wrap(command: F) -> F:
        for option in (
            click.option(
                "--avoid-class",
                "avoid_classes",
                multiple=True,
                metavar="NAME",
                help="Regions of this class are keep-out zones. May be given several times.",
            ),
            click.option(
                name,
                "mission_classes",
                multiple=True,
                metavar="NAME",
                help="Fly over regions of this class only. May be given several times.",
            ),
        ):
            command = option(command)
        return command

    return wrap


def check_mission_classes(options: dict[str, Any], asked: AnyRange | ValueClasses) -> None:
    """Check that a mission over classes names those that it flies over, and none that was not asked for.

    Raises
    ------
    UsageError
        If it does not.
    """
    from uavseg.segmentation.params.partition import ValueClasses

    known = [one.name for one in asked.classes] if isinstance(asked, ValueClasses) else []
    named = [*options["mission_classes"], *options["avoid_classes"]]
    if named and options["mission"] is None:
        raise click.UsageError("--mission-class and --avoid-class are for a mission; give --mission too")
    for name in named:
        if name not in known:
            there = f"the classes are {', '.join(known)}" if known else "give classes with --class"
            raise click.UsageError(f"there is no class {name}; {there}")
    if options["mission"] is not None and len(known) > 1 and not options["mission_classes"]:
        raise click.UsageError(
            f"say which class the mission flies over, such as --mission-class {known[0]!r}; "
            "--avoid-class names those it keeps out of"
        )


def avoid_notes(options: dict[str, Any]) -> list[str]:
    """What a pilot should know of keep-out zones that are regions of classes."""
    if not options["avoid_classes"] or (options["min_area"] is None and options["fill_holes"] is None):
        return []
    return [
        f"regions of {', '.join(options['avoid_classes'])} that --min-area drops or --fill-holes fills are "
        "not kept out of"
    ]


def asked_ranges(options: dict[str, Any]) -> AnyRange | ValueClasses:
    """The one range, or the classes, that a command was given.

    Raises
    ------
    UsageError
        If there is neither, or more than one kind of them.
    UavsegError
        If they are not understood, or classes overlap.
    """
    from uavseg.cli.options.ranges import asked_range

    ranges, texts, file = options["interval"], options["class_texts"], options["class_file"]
    one = {
        "--range": ranges,
        "--values": options["values"],
        "--percentile": options["percentile"],
        "--class": texts,
        "--classes": file,
    }
    given = [name for name, value in one.items() if value]
    if not given:
        raise click.UsageError(
            "Missing option '--range' (v in 0..1), '--values' or '--percentile'; or '--class' or '--classes'."
        )
    if (len(given) > 1 and any(name in given for name in ("--class", "--classes"))) or len(ranges) > 1 < len(
        given
    ):
        raise click.UsageError(
            f"{' and '.join(given)} do not go together; give a range, or classes in one way"
        )
    if not texts and not file and len(ranges) < 2:
        return asked_range(options | {"interval": ranges[0] if ranges else None})
    from uavseg.jobs.words.class_words import classes_of_ranges, classes_of_texts, read_classes

    if file:
        return read_classes(file)
    return classes_of_texts(texts) if texts else classes_of_ranges(ranges)


_LISTED = 12  # classes in the table at the end


def class_rows(found: Extraction, request: Any) -> dict[str, str]:
    """The row of classes in the table at the end, with the regions of each; empty without classes."""
    classes = getattr(request, "classes", None)
    if classes is None:
        return {}
    names = found.regions.columns["class"].tolist()
    counts = [f"{one.name} {names.count(one.name):,}" for one in classes.classes]
    more = f" and {len(counts) - _LISTED} more" if len(counts) > _LISTED else ""
    return {"classes": ", ".join(counts[:_LISTED]) + more}
