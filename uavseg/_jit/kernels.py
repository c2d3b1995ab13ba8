"""Kernels as values: a loop nest with its signature, which is compiled when it is first called."""

import ctypes
import os
import platform
import re
import sys
import threading
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from uavseg._jit import messages

_C_TYPES: dict[str, Any] = {
    "b1": ctypes.c_bool,
    "i1": ctypes.c_int8,
    "i2": ctypes.c_int16,
    "i4": ctypes.c_int32,
    "i8": ctypes.c_int64,
    "u1": ctypes.c_uint8,
    "u2": ctypes.c_uint16,
    "u4": ctypes.c_uint32,
    "u8": ctypes.c_uint64,
    "f4": ctypes.c_float,
    "f8": ctypes.c_double,
}
_TESTED = {"linux-x86_64"}
_SLOWER = "kernels run through numba.njit, which gives the same results but starts more slowly"
_compiling = threading.Lock()
_object_files_failed = False


class Inlined:
    """A function that kernels may call; see `inlined`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.__doc__ = function.__doc__

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)


def inlined(function: Callable[..., Any]) -> Inlined:
    """Mark a helper that kernels call; it is compiled into each of them."""
    return Inlined(function)


def kernel(signature: str) -> Callable[[Callable[..., Any]], "Kernel"]:
    """Compile a loop nest, for instance ``@kernel("i8(u2[:,::1], f8)")``.

    Parameters
    ----------
    signature : str
        Type of the result (or void) and of the arguments: i, u or f with a size in bytes, b1 for booleans;
        arrays are C-contiguous.
    """

    def wrap(function: Callable[..., Any]) -> Kernel:
        return Kernel(function, signature)

    return wrap


class Kernel:
    """A compiled loop nest; call it with arrays and numbers of the types of its signature."""

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        self.function = function
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self.signature = signature
        result, arguments = re.fullmatch(r"(\w+)\((.*)\)", signature).groups()  # type: ignore[union-attr]
        self.result = result
        self.arguments = [_Argument(text) for text in re.findall(r"\w+(?:\[[^\]]*\])?", arguments)]
        self._native: Any = None
        self._code: Any = None  # keeps the machine code alive
        self._dispatcher: Any = None  # numba's, where the kernel runs through the fallback

    def __call__(self, *values: Any) -> Any:
        if self._native is None:
            if self._dispatcher is None:
                self._load()
            if self._dispatcher is not None:
                return self._call_through_numba(values)
        flat: list[Any] = []
        for argument, value in zip(self.arguments, values, strict=True):
            argument.flatten(value, flat)
        returned = _C_TYPES.get(self.result, ctypes.c_int64)()
        raised = ctypes.c_void_p()
        status = self._native(ctypes.addressof(returned), ctypes.addressof(raised), *flat)
        assert status in (0, -2), f"kernel {self.__name__} ended with status {status}"  # -2: it returned None
        return None if self.result == "void" else returned.value

    def _call_through_numba(self, values: tuple[Any, ...]) -> Any:
        given = [argument.for_numba(value) for argument, value in zip(self.arguments, values, strict=True)]
        return self._dispatcher(*given)

    def _load(self) -> None:
        global _object_files_failed
        from uavseg._jit import compiling, fallback  # which need the classes of this module

        with _compiling:
            if self._native is not None or self._dispatcher is not None:
                return
            if _object_files_wanted():
                try:
                    self._code, address = compiling.machine_code(self)
                    flat = [c_type for argument in self.arguments for c_type in argument.c_types]
                    prototype = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *flat)
                    self._native = prototype(address)
                    return
                except Exception as error:  # private parts of two libraries: anything may be missing
                    _object_files_failed = True
                    reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
                    messages.note(
                        f"{_SLOWER}, because no object file could be made of {self.__name__} ({reason})"
                    )
            self._dispatcher = fallback.dispatcher(self)


class _Argument:
    """One argument of a kernel: a scalar, or an array that is handed over as its address and shape."""

    def __init__(self, text: str) -> None:
        self.scalar, _, axes = text.partition("[")
        self.ndim = axes.count(":") - axes.count("::") if axes else 0
        self.dtype = np.dtype(bool if self.scalar == "b1" else self.scalar)
        self.c_types = (
            [ctypes.c_void_p] + [ctypes.c_int64] * self.ndim if self.ndim else [_C_TYPES[self.scalar]]
        )

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


def _object_files_wanted() -> bool:
    """Whether to use object files: unless the user or the platform is against it, or they failed before."""
    choice = os.environ.get("UAVSEG_JIT", "")
    if choice == "numba" or _object_files_failed:
        return False
    if choice not in ("", "objects"):
        messages.note(f"UAVSEG_JIT={choice} is ignored; expected numba or objects")
    here = f"{sys.platform}-{platform.machine()}"
    if choice != "objects" and here not in _TESTED:
        messages.note(
            f"{_SLOWER}, because {here} is not tested (UAVSEG_JIT=numba runs them so without this note)"
        )
        return False
    return True
