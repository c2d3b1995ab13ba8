"""All kernels of the package, and getting their machine code before it is needed."""

import contextlib
import importlib
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from uavseg._jit import compiling, messages
from uavseg._jit.kernels import Kernel

PACKAGES = ("raster", "segmentation", "regions", "occupancy", "flight")
_DEFINES_KERNELS = re.compile(r"^from uavseg\._jit import .*\bkernel\b", re.MULTILINE)
_CHILD = "import sys; from uavseg._jit.warming import prepare; prepare(sys.argv[1:])"


def all_kernels() -> dict[str, Kernel]:
    """Return all kernels of the package by module and name, such as "segmentation.components._label_u1".

    Modules that define none are not imported: the others need numpy and shapely alone.
    """
    root = Path(__file__).parents[1]
    result = {}
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        if _DEFINES_KERNELS.search(path.read_text(encoding="utf-8")):
            name = ".".join(path.relative_to(root).with_suffix("").parts)
            module = importlib.import_module(f"uavseg.{name}")
            for attribute, value in vars(module).items():
                if isinstance(value, Kernel) and value.function.__module__ == module.__name__:
                    result[f"{name}.{attribute}"] = value
    return result


def warm(kernels: dict[str, Kernel], processes: int, progress: Callable[[int], None]) -> Counter[str]:
    """Load kernels, after those that need it are compiled into the cache by several processes at once.

    Return how many were "shipped" with the package, "kept" in the cache and "compiled"; `progress` receives
    the number of kernels that are ready.
    """
    counts = Counter({"shipped": 0, "kept": 0, "compiled": 0})
    rest = [name for name, kernel in kernels.items() if not kernel.load_shipped()]
    counts["shipped"] = done = len(kernels) - len(rest)
    progress(done)
    compiled = set()
    if processes > 1 and len(rest) > 1:
        for line in _lines_of([rest[k::processes] for k in range(processes)]):
            state, _, name = line.partition(" ")
            if name in rest:
                done += 1
                progress(done)
                if state == "compiled":
                    compiled.add(name)
    for name in rest:
        if _load(kernels[name]):
            compiled.add(name)
    counts["compiled"], counts["kept"] = len(compiled), len(rest) - len(compiled)
    progress(len(kernels))
    return counts


def states(kernels: dict[str, Kernel]) -> Counter[str]:
    """How many kernels are "shipped" with the package, "kept" in the cache or "missing"; none is compiled."""
    result = Counter({"shipped": 0, "kept": 0, "missing": 0})
    for kernel in kernels.values():
        state = "shipped" if kernel.load_shipped() else "missing"
        with contextlib.suppress(ImportError):  # without llvmlite nothing that is cached can be loaded
            state = "kept" if state == "missing" and compiling.is_cached(kernel) else state
        result[state] += 1
    return result


def prepare(names: Sequence[str]) -> None:
    """Load kernels, compiling those that the cache does not have; print a line for each."""
    messages.on_note = lambda text: None  # the parent process has the same notes
    for name in names:
        module, _, attribute = name.rpartition(".")
        compiled = _load(getattr(importlib.import_module(f"uavseg.{module}"), attribute))
        print(f"{'compiled' if compiled else 'kept'} {name}\n", end="", flush=True)  # at once


def _load(kernel: Kernel) -> bool:
    """Load a kernel; whether it had to be compiled."""
    announced: list[str] = []
    before, messages.on_compile = messages.on_compile, announced.append
    try:
        kernel.load()
    finally:
        messages.on_compile = before
    return bool(announced)


def _lines_of(shares: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield lines that processes print, each of which prepares its share, in the order in which they come."""
    folders = str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")
    here = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders))}
    reading, writing = os.pipe()
    command = [sys.executable, "-c", _CHILD]
    with contextlib.ExitStack() as running, os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
        with os.fdopen(writing, "w") as pipe:
            for share in shares:
                child = subprocess.Popen([*command, *share], stdout=pipe, stderr=subprocess.DEVNULL, env=here)
                running.enter_context(child)  # waits for it
                running.callback(child.terminate)
        for line in lines:
            yield line.rstrip("\n")
