"""Ahead-of-time compilation of kernels with numba: an object cache on disk, and numba itself as the fallback.

Importing numba and letting it set up costs half a second of processor time, as much as a small tile costs
altogether. So a kernel is compiled to an object file the first time that it is called on a machine, and
later runs load the machine code with llvmlite alone (a millisecond). A kernel is a plain loop nest: it takes
C-contiguous arrays and scalars, allocates nothing and raises nothing; then its code needs no Python, and
calling it releases the interpreter's lock.

This uses private parts of numba and llvmlite. Where they fail for any reason, and on platforms that are not
tested, the same kernels run through ``numba.njit(cache=True)`` instead: the same results, after a slower
start, and one note. Two environment variables are for the user:

UAVSEG_CACHE
    The folder of the caches, instead of ``uavseg`` in the user's cache folder.
UAVSEG_JIT
    ``numba`` runs kernels through ``numba.njit`` everywhere, without a note; ``objects`` tries object files
    even on a platform that is not tested.

A cached file is used only if its checksum is right, and if it belongs to the user or to root and nobody else
can write to it. Otherwise its kernel is compiled again.
"""

import contextlib
import ctypes
import hashlib
import os
import platform
import re
import shutil
import stat
import sys
import tempfile
import threading
import types
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

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
_NUMBA_NAMES = {"b1": "boolean", "void": "void"}
_LIBRARY_CALLS = {"log", "exp", "erf", "sqrt", "floor", "ceil", "floorf", "memset", "memcpy", "memmove"}
_TESTED = {"linux-x86_64"}
_FORMAT = b"uavseg object cache, version 1"
_compiling = threading.Lock()
_object_files_failed = False
_notes: set[str] = set()

on_compile: Callable[[str], None] | None = None
"""Receives the name of each kernel before it is compiled; the command line tells its user."""

on_note: Callable[[str], None] | None = None
"""Receives one line when kernels run through the fallback; by default it becomes a Python warning."""


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
        with _compiling:
            if self._native is not None or self._dispatcher is not None:
                return
            if _object_files_wanted():
                try:
                    self._code, address = _object_code(self)
                    flat = [c_type for argument in self.arguments for c_type in argument.c_types]
                    prototype = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *flat)
                    self._native = prototype(address)
                    return
                except Exception as error:  # private parts of two libraries: anything may be missing
                    _object_files_failed = True
                    reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
                    _note(f"{_SLOWER}, because no object file could be made of {self.__name__} ({reason})")
            self._dispatcher = _numba_dispatcher(self)


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


_SLOWER = "kernels run through numba.njit, which gives the same results but starts more slowly"


def _object_files_wanted() -> bool:
    """Whether to use object files: unless the user or the platform is against it, or they failed before."""
    choice = os.environ.get("UAVSEG_JIT", "")
    if choice == "numba" or _object_files_failed:
        return False
    if choice not in ("", "objects"):
        _note(f"UAVSEG_JIT={choice} is ignored; expected numba or objects")
    here = f"{sys.platform}-{platform.machine()}"
    if choice != "objects" and here not in _TESTED:
        _note(f"{_SLOWER}, because {here} is not tested (UAVSEG_JIT=numba runs them so without this note)")
        return False
    return True


def _note(text: str) -> None:
    """Pass on a note, once in a process."""
    if text in _notes:
        return
    _notes.add(text)
    if on_note is not None:
        on_note(text)
    else:
        warnings.warn(f"uavseg: {text}", stacklevel=2)


def _announce(kernel: Kernel) -> None:
    if on_compile is not None:
        on_compile(kernel.__name__)


def _object_code(kernel: Kernel) -> tuple[Any, int]:
    """The machine code of a kernel from its object file, and its address; compiled where there is no file."""
    import llvmlite
    import llvmlite.binding as llvm

    compiler = [llvmlite.__version__, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    name = f"{kernel.__name__}-{_fingerprint(kernel, compiler)}"
    folder = _cache_folder()
    content = _read(folder, name) if folder is not None else None
    if content is not None:
        with contextlib.suppress(Exception):  # it does not link: compile again
            return _link(content)
    _announce(kernel)
    content = _compile(kernel)
    if folder is not None:
        _keep(folder, name, content)
    return _link(content)


def _fingerprint(kernel: Kernel, compiler: list[str]) -> str:
    """Hash of what the machine code depends on: byte code, constants, compiler and processor."""
    parts = [kernel.signature, repr(_OPTIONS), sys.version, *compiler]
    _describe(kernel.function, parts)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20]


def _describe(function: Callable[..., Any], parts: list[str]) -> None:
    """Append the byte code of a function and of what it calls, and the constants that it reads."""
    code = function.__code__
    parts += [code.co_code.hex(), repr((code.co_consts, code.co_varnames, code.co_names))]
    for name in code.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, Inlined):
            _describe(value.function, parts)
        elif isinstance(value, int | float):
            parts.append(f"{name}={value!r}")


def _cache_folder() -> Path | None:
    """The folder of the caches: $UAVSEG_CACHE, the user's cache folder, or else a temporary one.

    It belongs to the user or to root, and nobody else can write to it. None where no folder can be made:
    then kernels are compiled again in each process.
    """
    try:
        folder = _user_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
        if _owned(status) and status.st_mode & _WRITABLE_BY_OTHERS:
            folder.chmod(stat.S_IMODE(status.st_mode) & ~_WRITABLE_BY_OTHERS)
            status = folder.stat()
        if _trusted(status) and os.access(folder, os.W_OK):
            return folder
    except (OSError, RuntimeError):  # a read-only home, or none
        pass
    with contextlib.suppress(OSError):
        return _temporary_folder()
    return None


def _user_folder() -> Path:
    named = os.environ.get("UAVSEG_CACHE")
    if named:
        return Path(named) / "kernels"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", tempfile.gettempdir())) / "uavseg" / "kernels"
    home = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    return Path(home) / "uavseg" / "kernels"


def _temporary_folder() -> Path:
    """A folder under the system's temporary folder that nobody else can enter."""
    if hasattr(os, "geteuid"):
        folder = Path(tempfile.gettempdir()) / f"uavseg-{os.geteuid()}"
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700)
        with contextlib.suppress(OSError):
            status = folder.lstat()  # of a link itself: anybody can put one there
            if stat.S_ISDIR(status.st_mode) and _owned(status) and not status.st_mode & _OPEN_TO_OTHERS:
                return folder
    global _process_folder
    if _process_folder is None:
        _process_folder = tempfile.TemporaryDirectory(prefix="uavseg-kernels-")
    return Path(_process_folder.name)


_process_folder: tempfile.TemporaryDirectory[str] | None = None
_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_OPEN_TO_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def _owned(status: os.stat_result) -> bool:
    return not hasattr(os, "geteuid") or status.st_uid == os.geteuid()


def _trusted(status: os.stat_result) -> bool:
    """Whether a file or folder is the user's or root's, and nobody else can write to it."""
    if not hasattr(os, "geteuid"):
        return True
    return (_owned(status) or status.st_uid == 0) and not status.st_mode & _WRITABLE_BY_OTHERS


def _read(folder: Path, name: str) -> bytes | None:
    """The content of a cached object file; None where it is missing, damaged or not to be trusted."""
    try:
        with open(folder / f"{name}.o", "rb", opener=_open_itself) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode) or not _trusted(status):
                return None
            version, checksum, content = file.read().split(b"\n", 2)
    except (OSError, ValueError):
        return None
    return content if (version, checksum) == (_FORMAT, _checksum(name, content)) else None


def _open_itself(path: str, flags: int) -> int:
    """Open a file without following a link and without waiting at a pipe."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def _checksum(name: str, content: bytes) -> bytes:
    """Checksum of a content under its name, so that no file stands for another."""
    return hashlib.sha256(name.encode() + b"\n" + content).hexdigest().encode()


def _keep(folder: Path, name: str, content: bytes) -> None:
    """Write an object file whole; not at all where there is no room: its kernel is compiled again then."""
    with contextlib.suppress(OSError):
        handle, temporary = tempfile.mkstemp(dir=folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(b"\n".join([_FORMAT, _checksum(name, content), content]))
            Path(temporary).replace(folder / f"{name}.o")
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


def _link(content: bytes) -> tuple[Any, int]:
    """Load an object file into the process: what keeps it loaded, and the address of its function."""
    import llvmlite.binding as llvm

    name, code = content.split(b"\n", 1)
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    address = engine.get_function_address(name.decode())
    if not address:
        raise RuntimeError(f"the object file has no function {name.decode()}")
    return engine, address


def _compile(kernel: Kernel) -> bytes:
    """Name and object code of a kernel, as native code for this processor."""
    import llvmlite.binding as llvm
    import numba

    entry = numba.njit(_entry_types(kernel), nogil=True, error_model="numpy", **_BARE)(_entry(kernel))
    signature = entry.signatures[0]
    name = entry.overloads[signature].fndesc.llvm_func_name
    text = re.sub(
        _DESTRUCTOR,
        r"define internal void @NRT_MemInfo_call_dtor(ptr %0) { ret void }",
        entry.inspect_llvm(signature),
    )
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if not function.is_declaration and function.name != name:
            function.linkage = "internal"
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="jitdefault",
        jit=True,
    )
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    outside = {function.name for function in module.functions if function.is_declaration}
    outside = {call for call in outside if not call.startswith("llvm.")} - _LIBRARY_CALLS
    if outside:
        raise RuntimeError(f"kernel {kernel.__name__} calls {sorted(outside)}: it may not allocate or raise")
    code: bytes = machine.emit_object(module)
    return b"\n".join([name.encode(), code])


# Counting references to the given arrays is compiled in, but they are borrowed: nothing is ever destroyed.
_DESTRUCTOR = r"declare void @NRT_MemInfo_call_dtor\([^)]*\)[^\n]*"
_SEMANTICS = {"nogil": True, "error_model": "numpy"}
_OPTIONS = _SEMANTICS | {"forceinline": True}  # a call costs as much as 200 pixels
_BARE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _entry(kernel: Kernel) -> Callable[..., Any]:
    """A function of addresses and lengths that calls the kernel with arrays."""
    import numba

    names, calls = [], []
    for k, argument in enumerate(kernel.arguments):
        lengths = [f"n{k}_{axis}" for axis in range(argument.ndim)]
        names += [f"a{k}", *lengths]
        calls.append(f"carray(a{k}, ({', '.join(lengths)},))" if lengths else f"a{k}")
    source = f"def {kernel.__name__}({', '.join(names)}):\n    return loops({', '.join(calls)})\n"
    scope: dict[str, Any] = {"carray": numba.carray, "loops": _jitted(kernel.function, _OPTIONS)}
    exec(source, scope)
    entry: Callable[..., Any] = scope[kernel.__name__]
    return entry


def _entry_types(kernel: Kernel) -> Any:
    from numba import types as nb

    flat: list[Any] = []
    for argument in kernel.arguments:
        scalar = _numba_type(argument.scalar)
        flat += [nb.CPointer(scalar), *[nb.int64] * argument.ndim] if argument.ndim else [scalar]
    return _numba_type(kernel.result)(*flat)


def _numba_type(name: str) -> Any:
    from numba import types as nb

    return getattr(nb, _NUMBA_NAMES.get(name) or np.dtype(name).name)


def _jitted(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """The function as numba compiles it, with the helpers that it calls."""
    import numba

    return numba.njit(**options)(_with_helpers(function, options, {}))


def _with_helpers(
    function: Callable[..., Any], options: dict[str, Any], done: dict[Any, Any]
) -> types.FunctionType:
    """A copy of a function that calls numba's versions of its helpers."""
    import numba

    scope = dict(function.__globals__)
    for name in function.__code__.co_names:
        helper = scope.get(name)
        if isinstance(helper, Inlined):
            if helper not in done:
                done[helper] = numba.njit(**options)(_with_helpers(helper.function, options, done))
            scope[name] = done[helper]
    return types.FunctionType(function.__code__, scope, function.__name__)


def _numba_dispatcher(kernel: Kernel) -> Callable[..., Any]:
    """The fallback: the kernel through ``numba.njit``, from numba's cache where there is one."""
    folder = _cache_folder()
    if folder is not None:
        with contextlib.suppress(Exception):  # of a cache that fails, nothing is needed
            return _cached_dispatcher(kernel, folder / "numba")
    _announce(kernel)
    return _njit(kernel, None)


def _cached_dispatcher(kernel: Kernel, caches: Path) -> Callable[..., Any]:
    """The kernel from numba's cache in a folder of its own, whose files have a checksum in common."""
    import numba

    name = f"{kernel.__name__}-{_fingerprint(kernel, [numba.__version__, _processor()])}"
    folder = caches / name
    if _intact(folder):
        return _njit(kernel, folder)
    _announce(kernel)
    caches.mkdir(mode=0o700, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(dir=caches))
    try:
        (fresh / "kernel.py").write_text("# numba keeps its cache beside the source file of a function\n")
        dispatcher = _njit(kernel, fresh)
        (fresh / "checksum").write_bytes(_folder_checksum(fresh, name))
        shutil.rmtree(folder, ignore_errors=True)
        with contextlib.suppress(OSError):  # another process was faster
            fresh.rename(folder)
        return dispatcher
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _intact(folder: Path) -> bool:
    try:
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or not _trusted(status):
            return False
        return (folder / "checksum").read_bytes() == _folder_checksum(folder, folder.name)
    except OSError:
        return False


def _folder_checksum(folder: Path, name: str) -> bytes:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / "checksum")
    return _checksum(name, b"\n".join(_checksum(file.name, file.read_bytes()) for file in files))


def _processor() -> str:
    """The processor's name and features, where llvmlite gives them."""
    with contextlib.suppress(Exception):
        import llvmlite.binding as llvm

        return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    return platform.processor()


def _njit(kernel: Kernel, folder: Path | None) -> Callable[..., Any]:
    """The kernel compiled by numba for its signature, with a cache in a folder that has a file kernel.py."""
    import numba
    from numba import types as nb

    given = [
        nb.Array(_numba_type(argument.scalar), argument.ndim, "C", aligned=False)
        if argument.ndim
        else _numba_type(argument.scalar)
        for argument in kernel.arguments
    ]
    function = _with_helpers(kernel.function, _SEMANTICS, {})
    if folder is not None:
        function.__code__ = function.__code__.replace(co_filename=str(folder / "kernel.py"))
    signature = _numba_type(kernel.result)(*given)
    dispatcher: Callable[..., Any] = numba.njit(signature, cache=folder is not None, **_SEMANTICS)(function)
    return dispatcher
