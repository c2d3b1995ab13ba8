"""The fallback: kernels through ``numba.njit``, with numba's own cache kept under a checksum."""

import contextlib
import platform
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from uavseg._jit import messages, object_cache
from uavseg._jit.compiling import SEMANTICS, fingerprint, numba_type, with_helpers
from uavseg._jit.loop_nest import LoopNest


def dispatcher(kernel: LoopNest) -> Callable[..., Any]:
    """Return the fallback: the kernel through ``numba.njit``, from numba's cache where there is one."""
    folder = object_cache.cache_folder()
    if folder is not None:
        with contextlib.suppress(Exception):  # of a cache that fails, nothing is needed
            return _cached_dispatcher(kernel, folder / "numba")
    messages.announce(kernel.__name__)
    return _njit(kernel, None)


def _cached_dispatcher(kernel: LoopNest, caches: Path) -> Callable[..., Any]:
    """Return the kernel from numba's cache in a folder of its own, whose files have a checksum in common."""
    import numba

    name = f"{kernel.__name__}-{fingerprint(kernel, [numba.__version__, _processor()])}"
    folder = caches / name
    if _intact(folder):
        return _njit(kernel, folder)
    messages.announce(kernel.__name__)
    caches.mkdir(mode=0o700, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(dir=caches))
    try:
        (fresh / "kernel.py").write_text("# numba keeps its cache beside the source file of a function\n")
        compiled = _njit(kernel, fresh)
        (fresh / "checksum").write_bytes(_folder_checksum(fresh, name))
        shutil.rmtree(folder, ignore_errors=True)
        with contextlib.suppress(OSError):  # another process was faster
            fresh.rename(folder)
        return compiled
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _intact(folder: Path) -> bool:
    try:
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or not object_cache.trusted(status):
            return False
        return (folder / "checksum").read_bytes() == _folder_checksum(folder, folder.name)
    except OSError:
        return False


def _folder_checksum(folder: Path, name: str) -> bytes:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / "checksum")
    return object_cache.checksum(
        name, b"\n".join(object_cache.checksum(file.name, file.read_bytes()) for file in files)
    )


def _processor() -> str:
    """Return the processor's name and features, where llvmlite gives them."""
    with contextlib.suppress(Exception):
        import llvmlite.binding as llvm

        return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    return platform.processor()


def _njit(kernel: LoopNest, folder: Path | None) -> Callable[..., Any]:
    """The kernel compiled by numba for its signature, with a cache in a folder that has a file kernel.py."""
    import numba
    from numba import types as nb

    given = [
        nb.Array(numba_type(argument.scalar), argument.ndim, "C", aligned=False)
        if argument.ndim
        else numba_type(argument.scalar)
        for argument in kernel.arguments
    ]
    function = with_helpers(kernel.function, SEMANTICS, {})
    if folder is not None:
        function.__code__ = function.__code__.replace(co_filename=str(folder / "kernel.py"))
    signature = numba_type(kernel.result)(*given)
    compiled: Callable[..., Any] = numba.njit(signature, cache=folder is not None, **SEMANTICS)(function)
    return compiled
