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


@dataclass(frozen=True, slots=True)
class Option:
    """Description of an option.

    Parameters
    ----------
    help : str
        What it does, for `--help` and the reference.
    flags : tuple of str
        Names on the command line; "--name" by default. Empty: a positional argument.
    type : type
        str, int, float or bool; what the text of the command line is converted to before `parse`. By default
        that of the field, and str with `parse` or where a field may be of several types.
    choices : tuple of str
        The values that it takes, if these are few.
    metavar : str
        How its value is written, with its unit.
    parse : callable, optional
        Turns text into the value that Python takes; raises `ParameterError`.
    multiple : bool
        Whether it may be repeated.
    shown : str
        The default in words, where it follows from other options.
    basic : bool
        Whether `--help` lists it; `--help-all` lists all.
    label : str
        Name in the dialogs of QGIS; empty: it is in none.
    python : bool
        Whether the Python function has it.
    default : object
        Value where it is not given.
    group : str
        Heading in `--help-all`.
    """

    help: str
    flags: tuple[str, ...] = ()
    type: type | None = None
    choices: tuple[str, ...] = ()
    metavar: str = ""
    parse: Callable[[Any], Any] | None = None
    multiple: bool = False
    required: bool = False
    shown: str = ""
    minimum: int | None = None
    basic: bool = False
    label: str = ""
    python: bool = True
    default: Any = None
    group: str = ""


@dataclass(frozen=True, slots=True)
class Group:
    """Options that a job takes over from a group.

    Parameters
    ----------
    of : type
        The dataclass of the group; its docstring is the heading.
    without : tuple of str
        Options that this job does not have.
    python : bool
        Whether the Python function has them.
    changed : mapping of str to dict
        Attributes of `Option` that differ for this job, by the name of the option.
    """

    of: type
    without: tuple[str, ...] = ()
    python: bool = True
    changed: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


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
            yield one.name, replace(found, group=heading, type=found.type or _type_of(str(one.type), found))
        elif "group" in one.metadata:
            taken: Group = one.metadata["group"]
            for name, found in options_of(taken.of).items():
                if name not in taken.without:
                    described = {"python": found.python and taken.python, **taken.changed.get(name, {})}
                    yield name, replace(found, **described)


def _type_of(annotation: str, described: Option) -> type:
    if described.parse is not None:
        return str
    return {"int": int, "float": float, "bool": bool}.get(annotation.removesuffix(" | None"), str)


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
            made[one.name] = build(taken.of, _group_values(taken, values))
        elif one.name in values:
            made[one.name] = values[one.name]
    return job(**made)


def _group_values(taken: Group, values: Mapping[str, Any]) -> dict[str, Any]:
    known = options_of(taken.of).keys() | arguments_of(taken.of).keys()
    defaults = {name: one["default"] for name, one in taken.changed.items() if "default" in one}
    return defaults | {name: values[name] for name in known - set(taken.without) if name in values}
