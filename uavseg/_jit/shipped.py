"""Kernels that come with the package: a shared library for each level of x86-64 processors on Linux.

A library has a function for each kernel, named for it with a hash of the kernel's source text, so one that
was made of another text is not found. It ends with a checksum. Who may change it may change the Python files
beside it, so its owner and mode are not looked at. `build_kernels` makes them when the package is built.
"""

import contextlib
import ctypes
import hashlib
import linecache
import platform
import sys
from collections.abc import Callable
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any

from uavseg._jit.loop_nest import Inlined, LoopNest
from uavseg._jit.object_cache import checksum

FOLDER = Path(__file__).with_name("libraries")
BASELINE = "x86-64"
LEVELS = ("x86-64-v4", "x86-64-v3", BASELINE)
"""The best level first; names of processors in LLVM and of libraries."""
_FORMAT = "uavseg shipped kernel, version 2"
SEAL = len(checksum("", b""))
"""Bytes of the checksum at the end of a library."""
_CPUINFO = Path("/proc/cpuinfo")
# fmt: off
_V3 = frozenset({
    "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave", "popcnt", "sse4_2", "ssse3", "cx16"
})
_V4 = _V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
# fmt: on
_NEEDED = dict(zip(LEVELS, (_V4, _V3, frozenset[str]()), strict=True))


def load(kernel: LoopNest, baseline: bool = False) -> tuple[Any, int] | None:
    """Return the library that has a kernel for this processor, and the address of its function.

    None where no library has the kernel as it is now, or it is damaged or cannot be loaded. The `baseline`
    runs on every x86-64 processor.
    """
    symbol = symbol_of(kernel)
    if not runs_here() or not symbol:
        return None
    for level in (BASELINE,) if baseline else levels_here():
        library = _library(library_path(level))
        if library is not None:
            with contextlib.suppress(AttributeError):  # it was made without the kernel
                return library, ctypes.cast(library[symbol], ctypes.c_void_p).value or 0
    return None


def runs_here() -> bool:
    """Return whether libraries are made for this platform."""
    return sys.platform == "linux" and platform.machine() == "x86_64"


def library_path(level: str) -> Path:
    """Return the path of the library of a level."""
    return FOLDER / f"{level}.so"


@cache
def _library(path: Path) -> ctypes.CDLL | None:
    """Load a library once in a process; None where there is none, or it is damaged or of another platform."""
    try:
        return ctypes.CDLL(str(path)) if is_intact(path.name, path.read_bytes()) else None
    except OSError:
        return None


def symbol_of(kernel: LoopNest) -> str:
    """Return the name of a kernel's function in a library; empty where its source text cannot be read."""
    parts = [_FORMAT, kernel.signature]
    try:
        _describe(kernel.function, parts)
    except (LookupError, OSError, SyntaxError):
        return ""
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
    return f"{kernel.function.__module__.removeprefix('uavseg.')}.{kernel.__name__}-{digest}"


def _describe(function: Callable[..., Any], parts: list[str]) -> None:
    """Append the source of a function and its helpers (byte code depends on Python), and their constants."""
    parts.append(_source(function))
    for name in sorted(set(function.__code__.co_names)):
        value = function.__globals__.get(name)
        if isinstance(value, Inlined):
            _describe(value.function, parts)
        elif value is not None:
            parts.append(f"{name}={getattr(value, '__name__', None) or repr(value)}")


def _source(function: Callable[..., Any]) -> str:
    """Return the lines of a function of a module, without decorators, comments and empty lines."""
    code = function.__code__
    linecache.checkcache(code.co_filename)
    lines = linecache.getlines(code.co_filename, function.__globals__)[code.co_firstlineno - 1 :]
    start = next((k for k, line in enumerate(lines) if line.startswith("def ")), None)
    if start is None:
        raise LookupError(f"no source text of {function.__name__}")
    body = takewhile(lambda line: not line.strip() or line[0] in " \t)#", lines[start + 1 :])
    said = [line.rstrip() for line in [lines[start], *body] if not line.lstrip().startswith("#")]
    return "\n".join(line for line in said if line)


def is_intact(name: str, content: bytes) -> bool:
    """Return whether a library ends with the checksum of its name and content."""
    return content[-SEAL:] == checksum(name, content[:-SEAL])


@cache
def levels_here() -> tuple[str, ...]:
    """Return the levels whose features this processor has by the system's list of them, the best first."""
    try:
        with _CPUINFO.open(encoding="ascii", errors="replace") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        flags = ""
    present = set(flags.partition(":")[2].split())
    return tuple(level for level in LEVELS if present >= _NEEDED[level])
