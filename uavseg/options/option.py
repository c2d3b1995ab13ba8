"""Description of an option as metadata of a dataclass field, and values that are built from flat arguments.

A job has one frozen dataclass. Its fields are options, or groups of them that several jobs share. From it are
made the options of a command with their help, the fields that the local server takes, the table for QGIS and
the reference; the signatures of Python are tested against it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, fields, replace
from functools import cache
from typing import Any, TypeVar, dataclass_transform

from uavseg.dataclass import dataclass

T = TypeVar("T")
_TYPES = {"int": int, "float": float, "bool": bool}  # by annotation


@dataclass(frozen=True, slots=True)
class Option:
    """Description of an option.

    By default the type, which the text of the command line is converted to before `parse`, is that of the
    field; it is str with `parse`, or where a field may be of several types. `parse` raises `ParameterError`.
    """

    help: str  # for `--help` and the reference
    flags: tuple[str, ...] = ()  # by default "--name"
    type: type | None = None  # str, int, float or bool
    choices: tuple[str, ...] = ()  # the values that it takes, if these are few
    metavar: str = ""  # how its value is written, with its unit
    parse: Callable[[Any], Any] | None = None  # turns text into the value that Python takes
    multiple: bool = False  # may be repeated
    required: bool = False
    shown: str = ""  # the default in words, where it follows from other options
    minimum: int | None = None
    basic: bool = False  # `--help` lists it; `--help-all` lists all
    label: str = ""  # name in the dialogs of QGIS; empty: it is in none
    python: bool = True  # the Python function has it
    default: Any = None
    group: str = ""  # heading in `--help-all`


@dataclass(frozen=True, slots=True)
class Group:
    """Options that a job takes over from a group."""

    of: type  # a dataclass, whose docstring is the heading
    without: tuple[str, ...] = ()  # options that this job does not have
    python: bool = True  # the Python function has them
    changed: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # attributes by name of `Option`


def option(help: str, *flags: str, default: Any = None, **described: Any) -> Any:
    """Declare a field that is an option; see `Option`."""
    return field(default=default, metadata={"option": Option(help, flags, default=default, **described)})


def argument(metavar: str, default: Any = None, **described: Any) -> Any:
    """Declare a field that is a positional argument of the command."""
    found = Option("", type=str, metavar=metavar, default=default, python=False, basic=True, **described)
    return field(default=default, metadata={"argument": found})


def group(of: type, *without: str, python: bool = True, **changed: Any) -> Any:
    """Declare a field that is a group of options; see `Group`."""
    defaults = {name: one["default"] for name, one in changed.items() if "default" in one}
    return field(
        default_factory=lambda: of(**defaults), metadata={"group": Group(of, without, python, changed)}
    )


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Options:
    """Frozen dataclass of options, which are given by name."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)


@cache
def options_of(job: type) -> dict[str, Option]:
    """Return the options of a job by name, those of its groups among them, in their order."""
    return dict(_options(job))


def _options(job: type) -> Iterator[tuple[str, Option]]:
    heading = (job.__doc__ or "").partition("\n")[0].rstrip(".")
    inherited_last = sorted(fields(job), key=lambda one: one.name not in job.__annotations__)
    for one in inherited_last:
        if "option" in one.metadata:
            found = one.metadata["option"]
            kind = None if found.parse is not None else _TYPES.get(str(one.type).removesuffix(" | None"))
            yield one.name, replace(found, group=heading, type=found.type or kind or str)
        elif "group" in one.metadata:
            taken: Group = one.metadata["group"]
            for name, found in options_of(taken.of).items():
                if name not in taken.without:
                    described = {"python": found.python and taken.python, **taken.changed.get(name, {})}
                    yield name, replace(found, **described)


def arguments_of(job: type) -> dict[str, Option]:
    """Return the positional arguments of the command of a job by name."""
    result: dict[str, Option] = {}
    for one in fields(job):
        if "argument" in one.metadata:
            result[one.name] = one.metadata["argument"]
        elif "group" in one.metadata:
            result |= arguments_of(one.metadata["group"].of)
    return result


def build(job: type[T], values: Mapping[str, Any]) -> T:
    """Build the options of a job from flat arguments, by name; those that it does not have are left aside."""
    made: dict[str, Any] = {}
    for one in fields(job):  # type: ignore[arg-type]
        taken: Group | None = one.metadata.get("group")
        if taken is not None:
            known = options_of(taken.of).keys() | arguments_of(taken.of).keys()
            given = {name: values[name] for name in known - set(taken.without) if name in values}
            defaults = {name: one["default"] for name, one in taken.changed.items() if "default" in one}
            made[one.name] = build(taken.of, defaults | given)
        elif one.name in values:
            made[one.name] = values[one.name]
    return job(**made)
