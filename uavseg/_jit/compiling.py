"""Machine code of kernels: compiled by numba to an object file without Python, linked by llvmlite."""

import contextlib
import hashlib
import re
import sys
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from uavseg._jit import messages, object_cache
from uavseg._jit.loop_nest import Inlined, LoopNest

_NUMBA_NAMES = {"b1": "boolean", "void": "void"}
_LIBRARY_CALLS = {"log", "exp", "erf", "sqrt", "floor", "ceil", "floorf", "memset", "memcpy", "memmove"}
# Counting references to the given arrays is compiled in, but they are borrowed: nothing is ever destroyed.
_DESTRUCTOR = r"declare void @NRT_MemInfo_call_dtor\([^)]*\)[^\n]*"
SEMANTICS = {"nogil": True, "error_model": "numpy"}
_OPTIONS = SEMANTICS | {"forceinline": True}  # a call costs as much as 200 pixels
_BARE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def machine_code(kernel: LoopNest) -> tuple[Any, int]:
    """The machine code of a kernel from its object file, and its address; compiled where there is no file."""
    name = _cached_name(kernel)
    folder = object_cache.cache_folder()
    content = object_cache.read(folder, name) if folder is not None else None
    if content is not None:
        with contextlib.suppress(Exception):  # it does not link: compile again
            return _link(content)
    messages.announce(kernel.__name__)
    content = _compile(kernel)
    if folder is not None:
        object_cache.store(folder, name, content)
    return _link(content)


def is_cached(kernel: LoopNest) -> bool:
    """Whether the cache has the object file of a kernel, whole and trusted."""
    folder = object_cache.cache_folder()
    return folder is not None and object_cache.read(folder, _cached_name(kernel)) is not None


def _cached_name(kernel: LoopNest) -> str:
    """Name of the object file of a kernel in the cache, for this compiler and processor."""
    import llvmlite
    import llvmlite.binding as llvm

    compiler = [llvmlite.__version__, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    return f"{kernel.__name__}-{fingerprint(kernel, compiler)}"


def fingerprint(kernel: LoopNest, compiler: list[str]) -> str:
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
        elif isinstance(value, int | float | np.generic):
            parts.append(f"{name}={value!r}")


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


def _compile(kernel: LoopNest) -> bytes:
    """Name and object code of a kernel, for this processor."""
    import llvmlite.binding as llvm

    return compile_for(kernel, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def compile_for(kernel: LoopNest, processor: str, features: str) -> bytes:
    """Name and object code of a kernel for a processor that LLVM has a name for, such as x86-64-v3.

    For another processor than this one, NUMBA_CPU_NAME and NUMBA_CPU_FEATURES name it too, from before numba
    is imported.
    """
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
        cpu=processor,
        features=features,
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


def _entry(kernel: LoopNest) -> Callable[..., Any]:
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


def _entry_types(kernel: LoopNest) -> Any:
    from numba import types as nb

    flat: list[Any] = []
    for argument in kernel.arguments:
        scalar = numba_type(argument.scalar)
        flat += [nb.CPointer(scalar), *[nb.int64] * argument.ndim] if argument.ndim else [scalar]
    return numba_type(kernel.result)(*flat)


def numba_type(name: str) -> Any:
    """Numba's type of a scalar, from its name in a signature."""
    from numba import types as nb

    return getattr(nb, _NUMBA_NAMES.get(name) or np.dtype(name).name)


def _jitted(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """The function as numba compiles it, with the helpers that it calls."""
    import numba

    return numba.njit(**options)(with_helpers(function, options, {}))


def with_helpers(
    function: Callable[..., Any], options: dict[str, Any], done: dict[Any, Any]
) -> types.FunctionType:
    """A copy of a function that calls numba's versions of its helpers.

    It has no file name: numba may write that of the machine on which it compiles into the machine code.
    """
    import numba

    scope = dict(function.__globals__)
    for name in function.__code__.co_names:
        helper = scope.get(name)
        if isinstance(helper, Inlined):
            if helper not in done:
                done[helper] = numba.njit(**options)(with_helpers(helper.function, options, done))
            scope[name] = done[helper]
    return types.FunctionType(function.__code__.replace(co_filename="kernel"), scope, function.__name__)
