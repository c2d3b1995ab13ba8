"""Frozen dataclasses whose methods are shared.

`dataclasses.dataclass` compiles six methods for each class at each start, which takes half a millisecond, and
a start of `uavseg extract` defines 140 classes. Here the standard library finds the fields, and all classes
share one method of each name.
"""

import dataclasses
import reprlib
from functools import cache
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, *, frozen=False, eq=True, **how):
        """Make a class a dataclass, as `dataclasses.dataclass` does."""
        if cls is None:
            return lambda cls: dataclass(cls, frozen=frozen, eq=eq, **how)
        if not frozen or how.get("order"):
            return dataclasses.dataclass(frozen=frozen, eq=eq, **how)(cls)
        shared = _FROZEN | (_EQUAL if eq else {}) | (_STATE if how.get("slots") else {})
        for name, method in shared.items():
            if cls.__dict__.get(name) is None:
                setattr(cls, name, method)
        return dataclasses.dataclass(init=False, repr=False, eq=False, **how)(cls)


@cache
def _arguments(cls: type) -> "tuple[dataclasses.Field[Any], ...]":
    return tuple(one for one in dataclasses.fields(cls) if one.init)


@cache
def _positional(cls: type) -> tuple[str, ...]:
    return tuple(one.name for one in _arguments(cls) if not one.kw_only)


@cache
def _compared(cls: type) -> tuple[str, ...]:
    return tuple(one.name for one in dataclasses.fields(cls) if one.compare)


def _default(one: "dataclasses.Field[Any]") -> Any:
    """Return the default of an argument, `dataclasses.MISSING` where there is none."""
    return one.default if one.default_factory is dataclasses.MISSING else one.default_factory()


def _init(self: Any, /, *args: Any, **given: Any) -> None:
    cls: Any = type(self)
    names = _positional(cls)
    if len(args) > len(names):
        given_too = f"but {len(args)} were given"
        raise TypeError(f"{cls.__name__}() takes {len(names)} positional arguments {given_too}")
    for name, value in zip(names, args, strict=False):
        object.__setattr__(self, name, value)
    if given or len(args) < len(_arguments(cls)):
        _store_named(self, names[: len(args)], given)
    if hasattr(cls, "__post_init__"):
        self.__post_init__()


def _store_named(self: Any, stored: tuple[str, ...], given: dict[str, Any]) -> None:
    """Set the arguments that are not stored yet: those given by name, and defaults."""
    cls: Any = type(self)
    for one in _arguments(cls):
        if one.name not in stored:
            value = given.pop(one.name) if one.name in given else _default(one)
            if value is dataclasses.MISSING:
                raise TypeError(f"{cls.__name__}() missing required argument: {one.name!r}")
            object.__setattr__(self, one.name, value)
    for other in given:
        reason = "multiple values for" if other in stored else "an unexpected keyword"
        raise TypeError(f"{cls.__name__}() got {reason} argument {other!r}")


@reprlib.recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{one.name}={getattr(self, one.name)!r}" for one in dataclasses.fields(self) if one.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _eq(self: Any, other: Any) -> Any:
    if type(other) is not type(self):
        return NotImplemented
    return bool(_key(self) == _key(other))


def _hash(self: Any) -> int:
    return hash(_key(self))


def _key(self: Any) -> tuple[Any, ...]:
    cls: Any = type(self)
    return tuple([getattr(self, name) for name in _compared(cls)])


def _setattr(self: Any, name: str, value: Any) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _delattr(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _getstate(self: Any) -> list[Any]:
    return [getattr(self, one.name) for one in dataclasses.fields(self)]


def _setstate(self: Any, state: list[Any]) -> None:
    for one, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, one.name, value)


class _Signature:
    """The signature of a class, for `help` and editors, made when it is asked for."""

    def __get__(self, instance: object, owner: Any) -> Signature:
        parameters = []
        for one in sorted(_arguments(owner), key=lambda one: bool(one.kw_only)):
            default = _default(one)
            default = Parameter.empty if default is dataclasses.MISSING else default
            kind = Parameter.KEYWORD_ONLY if one.kw_only else Parameter.POSITIONAL_OR_KEYWORD
            parameters.append(Parameter(one.name, kind, default=default, annotation=one.type))
        return Signature(parameters, return_annotation=None)


_FROZEN: dict[str, Any] = {
    "__init__": _init,
    "__repr__": _repr,
    "__setattr__": _setattr,
    "__delattr__": _delattr,
}
_FROZEN |= {"__signature__": _Signature()}
_EQUAL = {"__eq__": _eq, "__hash__": _hash}
_STATE = {"__getstate__": _getstate, "__setstate__": _setstate}  # those of slots set attributes one by one
