"""Stable content hash of values, identical across processes."""

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
    """Hash of values, of their types and of all their content, as 32 hexadecimal digits.

    An object with a method `fingerprint` is hashed by what the method returns. Dataclasses, arrays,
    sequences, numbers, strings and plain objects are hashed by their content, functions of a module by their
    name, and partial functions by their arguments too.

    Raises
    ------
    TypeError
        If a value has no content to hash, such as a lambda or an array of objects.

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
        for part in _content(value):
            _feed(feed, part)


def _mark(feed: Feed, text: str) -> None:
    """Feed a text with its length in front, so that no two sequences of texts give the same bytes."""
    feed(f"{len(text)}:{text}".encode())


def _feed_array(feed: Feed, array: np.ndarray[Any, Any]) -> None:
    if array.dtype.hasobject:
        raise TypeError("an array of objects has no bytes of its own to hash")
    _mark(feed, f"{array.dtype.str}{array.shape}")
    feed(array.tobytes())


def _name(function: FunctionType) -> str:
    if "<" in function.__qualname__:
        raise TypeError(
            f"{function.__qualname__} is not a function of a module, so its name does not identify it"
        )
    return f"{function.__module__}.{function.__qualname__}"


def _content(value: Any) -> list[Any]:
    """What an object holds, in a fixed order."""
    if hasattr(value, "fingerprint"):
        return [value.fingerprint()]
    if isinstance(value, partial):
        return [value.func, value.args, sorted(value.keywords.items())]
    if is_dataclass(value):
        return [getattr(value, field.name) for field in fields(value)]
    if not hasattr(value, "__dict__"):
        raise TypeError(f"a {type(value).__qualname__} has no content to hash")
    return sorted(vars(value).items())
