"""Checks of arguments: each value against the annotation of its parameter, with a sentence where it fails."""

import collections.abc
import functools
import inspect
import math
import numbers
import os
import sys
import types
from collections.abc import Callable
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from uavseg.errors import ParameterError
from uavseg.plain_text import shown

F = TypeVar("F", bound=Callable[..., Any])
Check = Callable[[Any], bool]

_OPERATORS = ("__call__", "__getitem__")
_COUNTS = {1: "one", 2: "two", 3: "three", 4: "four"}


def checked(target: F) -> F:
    """Decorate a function, or a class, so that each argument fits the annotation of its parameter.

    Numbers are those of Python and of numpy; a bool is not one. A default fits always. Where an annotation
    says tuple, a list or an array of as many numbers will do. Classes that are imported for types only are
    not looked at: the function itself checks such a value. A call with an argument of a wrong kind is refused
    with a ParameterError.

    Examples
    --------
    >>> @checked
    ... def half(width: float) -> float:
    ...     return width / 2
    >>> half("3")
    Traceback (most recent call last):
    uavseg.errors.ParameterError: width is a number, not '3'
    """
    if isinstance(target, type):
        this = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
        signature = inspect.signature(target)
        signature = signature.replace(parameters=[this, *signature.parameters.values()])
        target.__init__ = _checked(target.__init__, signature, target.__module__)  # type: ignore[misc]
        return target
    return _checked(target, inspect.signature(target), target.__module__)


def _checked(target: F, signature: inspect.Signature, module: str) -> F:
    @functools.cache
    def checks() -> dict[str, tuple[Check, str]]:
        named = [(name, _resolved(found.annotation, module)) for name, found in signature.parameters.items()]
        return {name: _rule(kind) for name, kind in named if kind is not Any}

    @functools.wraps(target)
    def call(*args: Any, **kwargs: Any) -> Any:
        given = signature.bind(*args, **kwargs).arguments
        for name, (fits, wanted) in checks().items():
            value = given.get(name)
            if name in given and value is not signature.parameters[name].default and not fits(value):
                raise ParameterError(f"{name} is {wanted}, not {shown(value)}")
        return target(*args, **kwargs)

    return call  # type: ignore[return-value]


def _resolved(annotation: Any, module: str) -> Any:
    """Return an annotation as a type; Any where there is none, or one that is known to type checkers only."""
    if annotation is inspect.Parameter.empty:
        return Any
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, vars(sys.modules[module]))
    except NameError:
        return Any


def _parts(kind: Any) -> tuple[Any, ...]:
    """Return the members of a union, or the type itself; what numpy makes an array of is one."""
    is_union = get_origin(kind) in (Union, types.UnionType) and not _is_array_like(kind)
    return get_args(kind) if is_union else (kind,)


def _rule(kind: Any) -> tuple[Check, str]:
    """Return whether a value fits a type, and the type in words."""
    checks, words = zip(*map(_rule_of_one, _parts(kind)), strict=True)
    *others, last = dict.fromkeys(words)
    text = f"{', '.join(others)} or {last}" if others else last
    return lambda value: any(fits(value) for fits in checks), text


def _rule_of_one(kind: Any) -> tuple[Check, str]:
    origin, args = get_origin(kind), get_args(kind)
    if kind in _SIMPLE:
        return _SIMPLE[kind]
    if origin is Literal:
        return _is_text, "a text"  # whoever uses it says which words there are
    if origin in (tuple, collections.abc.Sequence):
        rules = [_rule(part) for part in args if part is not ...]
        items = f"{rules[0][1].removeprefix('a ')}s"
        if origin is tuple and args[-1] is not ...:
            each = [fits for fits, _ in rules]
            count = _COUNTS.get(len(args), str(len(args)))
            return lambda value: _is_sequence(value) and _all_fit(each, value), f"{count} {items}"
        return lambda value: _is_sequence(value) and all(map(rules[0][0], value)), f"a sequence of {items}"
    if origin is collections.abc.Callable:
        return callable, "a function"
    if _is_array_like(kind):
        return _holds_numbers, "an array of numbers"
    if getattr(origin, "__module__", "") == "numpy":
        return lambda value: hasattr(value, "ndim") and _holds_numbers(value), "an array of numbers"
    expected = origin or kind
    name = f"a {getattr(expected, '__name__', kind)}"
    if getattr(kind, "_is_protocol", False):
        names = [name for name in vars(kind) if not name.startswith("_") or name in _OPERATORS]
        return lambda value: not isinstance(value, str | type) and all(hasattr(value, n) for n in names), name
    return lambda value: not isinstance(expected, type) or isinstance(value, expected), name


def _all_fit(checks: list[Check], values: Any) -> bool:
    return len(values) == len(checks) and all(fits(value) for fits, value in zip(checks, values, strict=True))


def _is_number(value: Any) -> bool:
    if not _is_of(value, numbers.Real):
        return False
    try:
        return math.isfinite(value) or not isinstance(value, numbers.Rational)
    except OverflowError:  # a whole number that no float can hold
        return False


def _is_whole(value: Any) -> bool:
    return _is_of(value, numbers.Integral) and abs(int(value)) < 2**63


def _is_of(value: object, kind: type) -> bool:
    """Return whether a value is a number of a kind; True and False are none."""
    return isinstance(value, kind) and not isinstance(value, bool)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and "\0" not in value


def _is_sequence(value: Any) -> bool:
    if isinstance(value, str | bytes):
        return False
    return isinstance(value, collections.abc.Sequence) or getattr(value, "ndim", None) == 1


def _is_array_like(kind: Any) -> bool:
    return "_SupportsArray" in str(kind)


def _holds_numbers(value: Any) -> bool:
    import numpy as np

    if value is None or isinstance(value, str | bytes):
        return False
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except (TypeError, ValueError, OverflowError):  # rows of different lengths, or objects
        return False


_SIMPLE: dict[Any, tuple[Check, str]] = {
    float: (_is_number, "a number"),
    int: (_is_whole, "a whole number"),
    bool: (lambda value: type(value).__name__ in ("bool_", "bool"), "True or False"),
    str: (_is_text, "a text"),
    None: (lambda value: value is None, "None"),
    type(None): (lambda value: value is None, "None"),
    Any: (lambda value: True, "anything"),
    os.PathLike[str]: (lambda value: isinstance(value, os.PathLike) and _is_text(os.fspath(value)), "a path"),
}
