"""How kernels are compiled: once for a machine with numba, afterwards loaded without it.

Importing numba and letting it set up costs half a second of processor time, as much as a small tile costs
altogether. So a kernel is compiled to an object file the first time that it is called on a machine, and
later runs load the machine code with llvmlite alone (a millisecond). A kernel is a plain loop nest: it takes
C-contiguous arrays and scalars, allocates nothing and raises nothing; then its code needs no Python, and
calling it releases the interpreter's lock.
"""

import contextlib
import ctypes
import hashlib
import os
import re
import sys
import tempfile
import threading
import types
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
_NUMBA_NAMES = {"b1": "boolean"}
_LIBRARY_CALLS = {"log", "exp", "erf", "sqrt", "floor", "ceil", "floorf", "memset", "memcpy", "memmove"}
_compiling = threading.Lock()

on_compile: Callable[[str], None] | None = None
"""Told the name of each kernel before it is compiled; the command line says so to its user."""


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

    def __call__(self, *values: Any) -> Any:
        if self._native is None:
            self._load()
        flat: list[Any] = []
        for argument, value in zip(self.arguments, values, strict=True):
            argument.flatten(value, flat)
        returned = _C_TYPES.get(self.result, ctypes.c_int64)()
        raised = ctypes.c_void_p()
        status = self._native(ctypes.addressof(returned), ctypes.addressof(raised), *flat)
        assert status in (0, -2), f"kernel {self.__name__} ended with status {status}"  # -2: it returned None
        return None if self.result == "void" else returned.value

    def _load(self) -> None:
        with _compiling:
            if self._native is not None:
                return
            path = _cache_folder() / f"{self.__name__}-{self._fingerprint()}.o"
            if path.exists():
                content = path.read_bytes()
            else:
                if on_compile is not None:
                    on_compile(self.__name__)
                content = _compile(self)
                _keep(path, content)
            name, code = content.split(b"\n", 1)
            self._code, address = _link(code, name.decode())
            flat = [c_type for argument in self.arguments for c_type in argument.c_types]
            self._native = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *flat)(address)

    def _fingerprint(self) -> str:
        """What the machine code depends on: byte code, constants, compiler and processor."""
        import llvmlite
        import llvmlite.binding as llvm

        parts = [self.signature, repr(_OPTIONS), llvmlite.__version__, sys.version, llvm.get_host_cpu_name()]
        parts.append(llvm.get_host_cpu_features().flatten())
        _describe(self.function, parts)
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20]


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
        if not self.ndim:
            flat.append(value)
            return
        if value.dtype != self.dtype or value.ndim != self.ndim or not value.flags.c_contiguous:
            raise TypeError(
                f"a kernel wants a C-contiguous {self.ndim}-D array of {self.dtype}, got {value.dtype}"
            )
        flat.append(value.__array_interface__["data"][0])
        flat.extend(value.shape)


def _describe(function: Callable[..., Any], parts: list[str]) -> None:
    """The byte code of a function and of what it calls, and the constants that it reads."""
    code = function.__code__
    parts += [code.co_code.hex(), repr((code.co_consts, code.co_varnames, code.co_names))]
    for name in code.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, Inlined):
            _describe(value.function, parts)
        elif isinstance(value, int | float):
            parts.append(f"{name}={value!r}")


def _cache_folder() -> Path:
    """Where machine code is kept: $UAVSEG_CACHE, the user's cache folder, or else a temporary folder."""
    named = os.environ.get("UAVSEG_CACHE")
    if named:
        folder = Path(named) / "kernels"
    elif sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA", tempfile.gettempdir())) / "uavseg" / "kernels"
    else:
        home = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
        folder = Path(home) / "uavseg" / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass  # a read-only home: compiled again in each process
    global _private_folder
    if _private_folder is None:
        _private_folder = tempfile.TemporaryDirectory(prefix="uavseg-kernels-")
    return Path(_private_folder.name)


_private_folder: tempfile.TemporaryDirectory[str] | None = None


def _keep(path: Path, content: bytes) -> None:
    """Write a file whole; not at all where there is no room for it: its kernel is compiled again then."""
    with contextlib.suppress(OSError):
        handle, temporary = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


def _link(code: bytes, name: str) -> tuple[Any, int]:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    return engine, engine.get_function_address(name)


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
    assert not outside, f"kernel {kernel.__name__} calls {sorted(outside)}: it may not allocate or raise"
    code: bytes = machine.emit_object(module)
    return b"\n".join([name.encode(), code])


# Counting references to the given arrays is compiled in, but they are borrowed: nothing is ever destroyed.
_DESTRUCTOR = r"declare void @NRT_MemInfo_call_dtor\([^)]*\)[^\n]*"
_OPTIONS = {"nogil": True, "error_model": "numpy", "forceinline": True}  # a call costs as much as 200 pixels
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
    scope: dict[str, Any] = {"carray": numba.carray, "loops": _jitted(kernel.function, {})}
    exec(source, scope)
    entry: Callable[..., Any] = scope[kernel.__name__]
    return entry


def _entry_types(kernel: Kernel) -> Any:
    from numba import types as nb

    def scalar(name: str) -> Any:
        return getattr(nb, _NUMBA_NAMES.get(name, np.dtype(name).name if name != "b1" else "boolean"))

    flat: list[Any] = []
    for argument in kernel.arguments:
        flat += [nb.CPointer(scalar(argument.scalar))] if argument.ndim else [scalar(argument.scalar)]
        flat += [nb.int64] * argument.ndim
    return (nb.void if kernel.result == "void" else scalar(kernel.result))(*flat)


def _jitted(function: Callable[..., Any], done: dict[Any, Any]) -> Any:
    """The function as numba sees it, with the helpers that it calls compiled too."""
    import numba

    if function not in done:
        scope = dict(function.__globals__)
        for name in function.__code__.co_names:
            if isinstance(scope.get(name), Inlined):
                scope[name] = _jitted(scope[name].function, done)
        plain = types.FunctionType(function.__code__, scope, function.__name__)
        done[function] = numba.njit(**_OPTIONS)(plain)
    return done[function]
