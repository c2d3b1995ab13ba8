"""Makes the libraries of kernels: ``python -m build_kernels.libraries``, which building the package runs too.

It makes the library for this processor, with ``all`` those for all levels, with names of levels these. A
library that is current is kept; ``--again`` makes it again. It needs numba, and about half a minute of
processor time for what all levels share and a quarter for each. The same versions of numba and llvmlite give
the same bytes.
"""

import gc
import importlib
import multiprocessing
import os
import sys
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from build_kernels import elf
from uavseg._jit import compiling, shipped
from uavseg._jit.object_cache import checksum
from uavseg._jit.warming import all_kernels

# Numba translates without optimising, for no certain processor: LLVM optimises for each level afterwards.
_NUMBA = {
    "NUMBA_OPT": "0",
    "NUMBA_CPU_NAME": shipped.BASELINE,
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_DISABLE_INTEL_SVML": "1",
}


def build(levels: Sequence[str], again: bool = False) -> list[Path]:
    """Make the libraries of some levels where they are not current; the paths of those that were made."""
    symbols = {name: shipped.symbol_of(kernel) for name, kernel in all_kernels().items()}
    stale = [
        level
        for level in levels
        if again or not is_current(shipped.library_path(level), made_of(symbols.values()))
    ]
    if not stale:
        return []
    modules = [list(names) for _, names in groupby(symbols, lambda name: name.rpartition(".")[0])]
    modules.sort(key=len, reverse=True)  # the shortest last, so that processes end together
    # Processes of their own: numba reads its variables when it is imported.
    with ProcessPoolExecutor(
        len(os.sched_getaffinity(0)), multiprocessing.get_context("spawn"), _begin
    ) as pool:
        compiled = [
            item for part in pool.map(partial(_object_files, stale), modules) for item in part.items()
        ]
    for k, level in enumerate(stale):
        functions = {symbols[name]: files[k] for name, files in compiled}
        path = shipped.library_path(level)
        path.parent.mkdir(parents=True, exist_ok=True)
        library = elf.shared_library(functions, compiling.ENTRY)
        _write(path, sealed(path.name, made_of(functions), library))
    return [shipped.library_path(level) for level in stale]


def made_of(symbols: Iterable[str]) -> list[str]:
    """Return the parts of a library: its functions, and the texts of the modules that compile and link."""
    return [
        *symbols,
        *(Path(str(module.__file__)).read_text(encoding="utf-8") for module in (compiling, elf)),
    ]


def is_current(path: Path, made_of: Iterable[str]) -> bool:
    """Return whether a library is whole and made of these parts and no others."""
    try:
        content = path.read_bytes()
    except OSError:
        return False
    size = shipped.SEAL
    return shipped.is_intact(path.name, content) and content[-2 * size : -size] == _checksum_of(made_of)


def sealed(name: str, made_of: Iterable[str], library: bytes) -> bytes:
    """Append to a library the checksums of what it is made of and of all, where loaders do not look."""
    content = library + _checksum_of(made_of)
    return content + checksum(name, content)


def _checksum_of(parts: Iterable[str]) -> bytes:
    return checksum("parts", "\n".join(sorted(parts)).encode())


def _begin() -> None:
    """Prepare a process that compiles, before numba is imported."""
    os.environ.update(_NUMBA)
    gc.disable()  # it takes a tenth of the time


def _object_files(levels: Sequence[str], names: Sequence[str]) -> dict[str, list[bytes]]:
    """Compile some kernels of one module; the object files of each, one for each level."""
    helpers: dict[Any, Any] = {}
    made = {}
    for name in names:
        module, _, attribute = name.rpartition(".")
        kernel = getattr(importlib.import_module(f"uavseg.{module}"), attribute)
        text = compiling.intermediate_code(kernel, helpers)
        made[name] = [compiling.object_code(text, level, "", for_library=True) for level in levels]
    return made


def _write(path: Path, content: bytes) -> None:
    """Write a library at once: another process may load the one before, or make the same."""
    handle, temporary = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "wb") as file:
        file.write(content)
    Path(temporary).chmod(0o644)
    Path(temporary).replace(path)


if __name__ == "__main__":
    chosen = [word for word in sys.argv[1:] if word != "--again"] or [shipped.levels_here()[0]]
    for path in build(shipped.LEVELS if chosen == ["all"] else chosen, "--again" in sys.argv[1:]):
        print(path.name, path.stat().st_size)
