"""Kernels as values: a loop nest with its signature, compiled when first called, or run by numba.njit."""

import contextlib
import ctypes
import importlib.util
import os
import platform
import shutil
import stat
import sys
import tempfile
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from uavseg._jit import compiling, messages, object_cache, shipped
from uavseg._jit.compiling import SEMANTICS, fingerprint, numba_signature, with_helpers
from uavseg._jit.loop_nest import C_TYPES, LoopNest
from uavseg.errors import MissingLibraryError

_TESTED = {"linux-x86_64"}
_SLOWER = "kernels run through numba.njit, which gives the same results but starts more slowly"
_compiling = threading.Lock()
_object_files_failed = False


def kernel(signature: str) -> Callable[[Callable[..., Any]], "Kernel"]:
    """Compile a loop nest, for instance ``@kernel("i8(u2[:,::1], f8)")``.

    The signature has the type of the result (or void) and of the arguments: i, u or f with a size in bytes,
    b1 for booleans; arrays are C-contiguous.
    """
    return partial(Kernel, signature=signature)


class Kernel(LoopNest):
    """A compiled loop nest; call it with arrays and numbers of the types of its signature."""

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        super().__init__(function, signature)
        self._native: Any = None
        self._code: Any = None  # keeps the machine code alive
        self.is_shipped = False  # the machine code came with the package
        self._dispatcher: Any = None  # numba's, where the kernel runs through the fallback

    def __call__(self, *values: Any) -> Any:
        pairs = zip(self.arguments, values, strict=True)
        if self._native is None:
            if self._dispatcher is None:
                self.load()
            if self._dispatcher is not None:
                return self._dispatcher(*[argument.for_numba(value) for argument, value in pairs])
        flat: list[Any] = []
        for argument, value in pairs:
            argument.flatten(value, flat)
        returned = C_TYPES.get(self.result, ctypes.c_int64)()
        raised = ctypes.c_void_p()
        status = self._native(ctypes.addressof(returned), ctypes.addressof(raised), *flat)
        assert status in (0, -2), f"kernel {self.__name__} ended with status {status}"  # -2: it returned None
        return None if self.result == "void" else returned.value

    def load(self) -> None:
        """Get the machine code: what came with the package, or else what is compiled on this machine."""
        with _compiling:
            if self._native is not None or self._dispatcher is not None or self._use_shipped():
                return
            _require_compiler(self.__name__)
            with messages.timing_compilation():
                self._compile()

    def _compile(self) -> None:
        global _object_files_failed
        if _object_files_wanted():
            try:
                self._use(*compiling.machine_code(self))
                return
            except Exception as error:  # private parts of two libraries: anything may be missing
                _object_files_failed = True
                reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
                why = f"because no object file could be made of {self.__name__} ({reason})"
                messages.note(f"{_SLOWER}, {why}")
        self._dispatcher = dispatcher(self)

    def load_shipped(self) -> bool:
        """Load the machine code that came with the package; whether there is some for this machine."""
        with _compiling:
            return self.is_shipped or (self._native is None and self._use_shipped())

    def _use_shipped(self) -> bool:
        choice = _choice()
        found = None if choice in ("numba", "objects") else shipped.load(self, choice == "baseline")
        if found is None:
            return False
        self._use(*found)
        self.is_shipped = True
        return True

    def _use(self, code: Any, address: int) -> None:
        self._code = code
        flat = [c_type for argument in self.arguments for c_type in argument.c_types]
        prototype = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *flat)
        self._native = prototype(address)


def _require_compiler(name: str) -> None:
    if importlib.util.find_spec("numba") is None:
        choice = _choice()
        reason = f"UAVSEG_JIT={choice} asks for it" if choice else "nothing that is shipped fits"
        raise MissingLibraryError(
            f"{name} has to be compiled ({reason}), and numba, which does it, is not installed; "
            'install it with: pip install "uavseg[compile]"'
        )


def _choice() -> str:
    """Return how the user asks for kernels to run; empty for what fits best."""
    choice = os.environ.get("UAVSEG_JIT", "")
    if choice not in ("", "objects", "numba", "baseline"):
        messages.note(f"UAVSEG_JIT={choice} is ignored; expected objects, numba or baseline")
        return ""
    return choice


def _object_files_wanted() -> bool:
    """Whether to use object files: unless the user or the platform is against it, or they failed before."""
    choice = _choice()
    if choice == "numba" or _object_files_failed:
        return False
    here = f"{sys.platform}-{platform.machine()}"
    if choice != "objects" and here not in _TESTED:
        why = f"because {here} is not tested (UAVSEG_JIT=numba runs them so without this note)"
        messages.note(f"{_SLOWER}, {why}")
        return False
    return True


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
    sums = [object_cache.checksum(file.name, file.read_bytes()) for file in files]
    return object_cache.checksum(name, b"\n".join(sums))


def _processor() -> str:
    """Return the processor's name and features, where llvmlite gives them."""
    with contextlib.suppress(Exception):
        import llvmlite.binding as llvm

        return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    return platform.processor()


def _njit(kernel: LoopNest, folder: Path | None) -> Callable[..., Any]:
    """The kernel compiled by numba for its signature, with a cache in a folder that has a file kernel.py."""
    import numba

    function = with_helpers(kernel.function, SEMANTICS, {})
    if folder is not None:
        function.__code__ = function.__code__.replace(co_filename=str(folder / "kernel.py"))
    signature = numba_signature(kernel, aligned=False)
    compiled: Callable[..., Any] = numba.njit(signature, cache=folder is not None, **SEMANTICS)(function)
    return compiled
