"""Makes the libraries of kernels that come with the package: ``python -m uavseg._jit.build``.

Run it after a kernel was changed. It needs numba and a linker (``ld``), and about two minutes of processor
time for all kernels. What is current is kept; ``--all`` makes everything again. The same versions of numba,
llvmlite and the linker give the same bytes.
"""

import importlib
import multiprocessing
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from uavseg._jit import compiling, shipped
from uavseg._jit.warming import all_kernels

_LINK = [
    *("ld", "-shared", "-s", "-O1", "--gc-sections", "--build-id=none", "--hash-style=gnu", "--no-as-needed"),
    *("-z", "noseparate-code", "-z", "noexecstack", "-z", "relro", "-z", "now", "-z", "max-page-size=4096"),
]


def build(folder: Path, level: str, name: str) -> Path:
    """Make the library of one kernel for one level of processors, in a process that compiles for no other."""
    os.environ |= {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": "", "NUMBA_DISABLE_INTEL_SVML": "1"}
    module, _, attribute = name.rpartition(".")
    kernel = getattr(importlib.import_module(f"uavseg.{module}"), attribute)
    path = folder / level / shipped.library_name(kernel)
    library = _link(compiling.compile_for(kernel, level, ""))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(shipped.sealed(path.name, library))
    return path


def _link(content: bytes) -> bytes:
    """A shared library of an object file.

    It is linked with an empty library that has the name of libm: then it needs no certain version of glibc.
    """
    entry, code = content.split(b"\n", 1)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "kernel.o").write_bytes(code)
        (work / "nothing").write_text("{ local: *; };")
        (work / "exported").write_text(f"{{ global: {shipped.ENTRY}; local: *; }};")
        empty = ["-soname", "libm.so.6", "--version-script=nothing", "kernel.o", "-o", "libm.so"]
        subprocess.run([*_LINK, *empty], cwd=work, check=True)
        names = [f"--defsym={shipped.ENTRY}={entry.decode()}", "--version-script=exported"]
        subprocess.run([*_LINK, *names, "kernel.o", "libm.so", "-o", "kernel.so"], cwd=work, check=True)
        return (work / "kernel.so").read_bytes()


def build_all(folder: Path, everything: bool = False) -> list[Path]:
    """Make what is missing, or everything, and remove what belongs to no kernel."""
    names = {name: shipped.library_name(kernel) for name, kernel in all_kernels().items()}
    made = []
    for level in shipped.LEVELS:
        for path in (folder / level).glob("*.so"):
            if everything or path.name not in names.values():
                path.unlink()
        missing = [name for name, file in names.items() if not (folder / level / file).exists()]
        # A process for each level: numba reads the name of the processor when it is imported.
        with ProcessPoolExecutor(len(os.sched_getaffinity(0)), multiprocessing.get_context("spawn")) as pool:
            made += list(pool.map(partial(build, folder, level), missing))
    return made


if __name__ == "__main__":
    for path in build_all(shipped.FOLDER, "--all" in sys.argv[1:]):
        print(path.relative_to(shipped.FOLDER), path.stat().st_size)
