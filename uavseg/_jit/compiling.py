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
ENTRY = "uavseg.kernel"
"""Name of the function of an object file."""
SEMANTICS = {"nogil": True, "error_model": "numpy"}
# A call costs as much as 200 pixels; nothing calls the functions from Python.
_OPTIONS = SEMANTICS | {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


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
    """Return whether the cache has the object file of a kernel, whole and trusted."""
    folder = object_cache.cache_folder()
    return folder is not None and object_cache.read(folder, _cached_name(kernel)) is not None


def _cached_name(kernel: LoopNest) -> str:
    """Return name of the object file of a kernel in the cache, for this compiler and processor."""
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

    processor, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    code = object_code(intermediate_code(kernel, {}), processor, features)
    return b"\n".join([ENTRY.encode(), code])


def intermediate_code(kernel: LoopNest, helpers: dict[Any, Any]) -> str:
    """Translate a kernel to LLVM's intermediate code, with a function `ENTRY` of addresses and lengths.

    `helpers` are those as numba has them, compiled once for all kernels that are given the same.
    """
    import numba

    loops = numba.njit(numba_signature(kernel), **_OPTIONS)(with_helpers(kernel.function, _OPTIONS, helpers))
    signature = loops.signatures[0]
    name = loops.overloads[signature].fndesc.llvm_func_name
    text = re.sub(
        _DESTRUCTOR,
        r"define internal void @NRT_MemInfo_call_dtor(ptr %0) { ret void }",
        loops.inspect_llvm(signature),
    )
    return f"{text}\n{_entry(kernel, name, text)}"


def _entry(kernel: LoopNest, name: str, text: str) -> str:
    """Return the function of addresses and lengths in LLVM's words.

    Numba takes an array as two references (to what owns its memory), the number of items, the size of one,
    the address, the lengths and the steps along the axes.
    """
    import llvmlite.binding as llvm

    loops = llvm.parse_assembly(text).get_function(name)
    types = [str(argument.type) for argument in loops.arguments]
    own, given, lines = ["ptr %a", "ptr %b"], ["ptr %a", "ptr %b"], []
    for k, argument in enumerate(kernel.arguments):
        if not argument.ndim:
            own.append(f"{types[len(given)]} %v{k}")
            given.append(own[-1])
            continue
        lengths = [f"%n{k}_{axis}" for axis in range(argument.ndim)]
        steps = [str(argument.dtype.itemsize)]
        for axis, length in reversed(list(enumerate(lengths))):
            steps.insert(0, f"%s{k}_{axis}")
            lines.append(f"{steps[0]} = mul i64 {steps[1]}, {length}")
        lines.append(f"%c{k} = sdiv i64 {steps[0]}, {steps[-1]}")
        own += [f"ptr %v{k}", *(f"i64 {length}" for length in lengths)]
        given += ["ptr null", "ptr null", f"i64 %c{k}", f"i64 {steps[-1]}", f"ptr %v{k}"]
        given += [f"i64 {word}" for word in (*lengths, *steps[1:])]
    if [word.split()[0] for word in given] != types:
        raise RuntimeError(f"numba takes {types} for {kernel.signature}")
    call = f'%status = call i32 @"{name}"({", ".join(given)})'
    body = "\n".join([*lines, call, "ret i32 %status"])
    return f"define i32 @{ENTRY}({', '.join(own)}) {{\n{body}\n}}\n"


def object_code(text: str, processor: str, features: str, for_library: bool = False) -> bytes:
    """Compile intermediate code to an object file.

    The text is that of `intermediate_code`; processor and features are as LLVM calls them, such as x86-64-v3.
    In a library, all of the code lies together.
    """
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if not function.is_declaration and function.name != ENTRY:
            function.linkage = "internal"
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=processor,
        features=features,
        opt=3,
        reloc="pic",
        codemodel="small" if for_library else "jitdefault",
        jit=not for_library,
    )
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = True
    for _ in range(2):  # the second time, loops are vectorised that were not in their final form before
        builder = llvm.create_pass_builder(machine, options)
        passes = builder.getModulePassManager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(module, builder)
    outside = {function.name for function in module.functions if function.is_declaration}
    outside = {call for call in outside if not call.startswith("llvm.")} - _LIBRARY_CALLS
    if outside:
        raise RuntimeError(f"it calls {sorted(outside)}, and a kernel may not allocate or raise")
    code: bytes = machine.emit_object(module)
    return code


def numba_signature(kernel: LoopNest, aligned: bool = True) -> Any:
    """Return the signature of a kernel in numba's types."""
    from numba import types as nb

    names = [kernel.result, *(argument.scalar for argument in kernel.arguments)]
    result, *types = [getattr(nb, _NUMBA_NAMES.get(name) or np.dtype(name).name) for name in names]
    given = zip(kernel.arguments, types, strict=True)
    return result(*(nb.Array(of, one.ndim, "C", aligned=aligned) if one.ndim else of for one, of in given))


def with_helpers(
    function: Callable[..., Any], options: dict[str, Any], done: dict[Any, Any]
) -> types.FunctionType:
    """Return a copy of a function that calls numba's versions of its helpers.

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
