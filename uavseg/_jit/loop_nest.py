"""Loop nests with their signatures: what kernels are compiled from, and the helpers that they call."""

import ctypes
import re
import types
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

_NAMES = {f"{kind[0]}{bits // 8}": f"c_{kind}{bits}" for kind in ("int", "uint") for bits in (8, 16, 32, 64)}
_NAMES |= {"b1": "c_bool", "f4": "c_float", "f8": "c_double"}
C_TYPES: dict[str, Any] = {name: getattr(ctypes, c_name) for name, c_name in _NAMES.items()}


class Inlined:
    """Mark a helper that kernels call; it is compiled into each of them."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.__doc__ = function.__doc__

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)


inlined = Inlined


class LoopNest:
    """A loop nest and its signature: what a kernel is compiled from."""

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        self.function = function
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self.signature = signature

    @cached_property
    def result(self) -> str:
        """Return the type of the result, or void."""
        return self.signature.partition("(")[0]

    @cached_property
    def arguments(self) -> "list[Argument]":
        """Return the arguments in their order."""
        texts = self.signature.partition("(")[2]
        return [Argument(text) for text in re.findall(r"\w+(?:\[[^\]]*\])?", texts)]


class Argument:
    """One argument of a kernel: a scalar, or an array that is handed over as its address and shape."""

    def __init__(self, text: str) -> None:
        self.scalar, _, axes = text.partition("[")
        self.ndim = axes.count(":") - axes.count("::") if axes else 0
        self.dtype = np.dtype(bool if self.scalar == "b1" else self.scalar)
        as_array = [ctypes.c_void_p] + [ctypes.c_int64] * self.ndim
        self.c_types = as_array if self.ndim else [C_TYPES[self.scalar]]

    def flatten(self, value: Any, flat: list[Any]) -> None:
        """Append the scalar, or the address and the shape of the array."""
        if not self.ndim:
            flat.append(value)
            return
        self.check(value)
        flat.append(value.__array_interface__["data"][0])
        flat.extend(value.shape)

    def check(self, array: Any) -> None:
        """Refuse an array that is not of the kernel's type and layout."""
        if array.dtype != self.dtype or array.ndim != self.ndim or not array.flags.c_contiguous:
            raise TypeError(f"expected a C-contiguous {self.ndim}-D array of {self.dtype}, got {array.dtype}")

    def for_numba(self, value: Any) -> Any:
        """The value as numba's dispatcher accepts it, converted as ctypes converts it for object code."""
        if not self.ndim:
            return self.c_types[0](value).value
        self.check(value)
        if value.flags.writeable:
            return value
        # The signature says writable, as a kernel may write to some of its arrays; it only reads this one.
        interface = value.__array_interface__
        writable = interface | {"data": (interface["data"][0], False)}
        return np.asarray(types.SimpleNamespace(__array_interface__=writable))
