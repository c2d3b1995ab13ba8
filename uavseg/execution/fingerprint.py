"""What tells values apart: a hash that is the same in every process, on every day."""

import hashlib
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np

Feed = Callable[[bytes], object]
_PLAIN = (bool, int, float, str, bytes, Fraction, np.dtype, np.generic)


def fingerprint(*values: Any) -> str:
    """A hash of values, of their types and of all that they hold: 32 hexadecimal digits.

    An object that has a method `fingerprint` is told by what that gives. Others are told by what they hold:
    dataclasses, arrays, sequences, numbers, texts, functions of a module (by their name) with their
    arguments, and plain objects.

    Raises
    ------
    TypeError
        If something in it cannot be told from others of its kind, such as a function without a name.

    Examples
    --------
    >>> fingerprint((1, 2)) == fingerprint((1, 2))
    True
    >>> fingerprint((1, 2)) == fingerprint((1, 2.0))
    False
    """
    hasher = hashlib.sha256()
    for value in values:
        _feed(hasher.update, value)
    return hasher.hexdigest()[:32]


def _feed(feed: Feed, value: Any) -> None:
    kind = type(value)
    _mark(feed, f"{kind.__module__}.{kind.__qualname__}")
    if value is None:
        return
    if isinstance(value, _PLAIN):
        _mark(feed, repr(value))
    elif isinstance(value, np.ndarray):
        _feed_array(feed, value)
    elif isinstance(value, tuple | list):
        _mark(feed, str(len(value)))
        for part in value:
            _feed(feed, part)
    elif isinstance(value, FunctionType):
        _mark(feed, _name(value))
    else:
        for part in _held(value):
            _feed(feed, part)


def _mark(feed: Feed, text: str) -> None:
    """A text with its length in front, so that neighbours cannot run into each other."""
    feed(f"{len(text)}:{text}".encode())


def _feed_array(feed: Feed, array: np.ndarray[Any, Any]) -> None:
    if array.dtype.hasobject:
        raise TypeError("an array of objects has no bytes of its own to tell it by")
    _mark(feed, f"{array.dtype.str}{array.shape}")
    feed(array.tobytes())


def _name(function: FunctionType) -> str:
    if "<" in function.__qualname__:
        raise TypeError(
            f"{function.__qualname__} is not a function of a module, so its name does not tell it"
        )
    return f"{function.__module__}.{function.__qualname__}"


def _held(value: Any) -> list[Any]:
    """What an object holds, in an order that is always the same."""
    if hasattr(value, "fingerprint"):
        return [value.fingerprint()]
    if isinstance(value, partial):
        return [value.func, value.args, sorted(value.keywords.items())]
    if is_dataclass(value):
        return [getattr(value, field.name) for field in fields(value)]
    if not hasattr(value, "__dict__"):
        raise TypeError(f"nothing tells one {type(value).__qualname__} from another")
    return sorted(vars(value).items())
