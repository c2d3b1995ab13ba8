"""Kernels that come with the package: current, whole, and with the results of compiled ones."""

import ctypes
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import llvmlite.binding as llvm
import numpy as np
import pytest

import uavseg
from build_kernels import elf, libraries as build
from uavseg._jit import compiling, shipped, warming
from uavseg._jit.kernels import Kernel

Load = Callable[[str], ModuleType]
ROOT = Path(uavseg.__file__).resolve().parents[1]
here = pytest.mark.skipif(not shipped.runs_here(), reason="kernels are shipped for x86-64 Linux")


@pytest.fixture(autouse=True)
def best(monkeypatch: pytest.MonkeyPatch) -> None:
    """What fits best, as without UAVSEG_JIT."""
    monkeypatch.delenv("UAVSEG_JIT", raising=False)


@pytest.fixture(params=shipped.LEVELS)
def library(request: pytest.FixtureRequest) -> Path:
    """The library of a level that was made; UAVSEG_BUILD_KERNELS=all asks for all."""
    path = shipped.library_path(request.param)
    if not path.exists() and os.environ.get("UAVSEG_BUILD_KERNELS") != "all":
        pytest.skip(f"not made: python -m build_kernels.libraries {request.param}")
    return path


@pytest.fixture
def libraries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of shipped kernels that is empty."""
    folder = tmp_path / "libraries"
    monkeypatch.setattr(shipped, "FOLDER", folder)
    return folder


@pytest.fixture
def module_of(tmp_path: Path) -> Load:
    """Makes a new module of a source text on each call, in the same file and with the same name."""

    def load(source: str) -> ModuleType:
        path = tmp_path / "changing.py"
        path.write_text(source)
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        exec(compile(source, str(path), "exec"), vars(module))  # not from a cache of byte code
        return module

    return load


@pytest.fixture
def twice_module(module_of: Load) -> ModuleType:
    """A module with the kernel `twice`."""
    return module_of(
        'from uavseg._jit import kernel\n\n\n@kernel("i8(i8)")\ndef twice(value):\n    return 2 * value\n'
    )


def object_file(kernel: Kernel, level: str = shipped.BASELINE) -> bytes:
    """The object file of a kernel of a test."""
    return compiling.object_code(compiling.intermediate_code(kernel, {}), level, "", for_library=True)


def ship(kernel: Kernel, folder: Path, level: str = shipped.BASELINE) -> Path:
    """Make the library of a kernel of a test."""
    path = folder / f"{level}.so"
    path.parent.mkdir(parents=True, exist_ok=True)
    symbol = shipped.symbol_of(kernel)
    library = elf.shared_library({symbol: object_file(kernel, level)}, compiling.ENTRY)
    build._write(path, build.sealed(path.name, [symbol], library))
    return path


@here
def test_the_library_of_this_processor_is_made() -> None:
    """Where this fails: `nox -s kernels`, or `python -m build_kernels.libraries`."""
    assert shipped.library_path(shipped.levels_here()[0]).exists()


@here
def test_every_kernel_is_shipped_as_it_is_now(library: Path) -> None:
    symbols = {shipped.symbol_of(kernel) for kernel in warming.all_kernels().values()}
    assert len(symbols) == len(warming.all_kernels()) > 80
    assert build.is_current(library, build.made_of(symbols))
    loaded = ctypes.CDLL(str(library))
    assert all(loaded[symbol] for symbol in symbols)


def test_a_library_with_other_kernels_is_not_current(tmp_path: Path) -> None:
    path = tmp_path / "x86-64.so"
    assert not build.is_current(path, ["a", "b"])
    path.write_bytes(build.sealed(path.name, ["a", "b"], b"code"))
    assert build.is_current(path, ["b", "a"])
    assert not build.is_current(path, ["a"]) and not build.is_current(path, ["a", "b", "c"])
    path.write_bytes(path.read_bytes().replace(b"code", b"coda"))
    assert not build.is_current(path, ["a", "b"])


@here
def test_no_shipped_kernel_names_a_file_of_the_machine_that_made_it(library: Path) -> None:
    assert re.search(rb"/[\w./+-]*\.py", library.read_bytes()) is None


@pytest.mark.slow
@here
def test_no_kernel_is_compiled_and_neither_numba_nor_llvmlite_is_loaded(tmp_path: Path) -> None:
    program = (
        "import sys; from uavseg._jit import messages, warming; "
        "messages.on_compile = messages.on_note = lambda text: sys.exit(text); "
        "found = warming.all_kernels(); [kernel.load() for kernel in found.values()]; "
        "assert all(kernel.is_shipped for kernel in found.values()); "
        "print({'numba', 'llvmlite'} & set(sys.modules))"
    )
    env = {**os.environ, "UAVSEG_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=env, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("set()\n", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@here
@pytest.mark.parametrize("choice", ["", "baseline", "objects", "numba"])
def test_all_ways_give_the_same_results(
    choice: str, cache: Path, monkeypatch: pytest.MonkeyPatch, module_of: Load, libraries: Path
) -> None:
    source = (
        "from math import exp, log\n\nfrom uavseg._jit import kernel\n\n\n"
        '@kernel("f8(f8[::1], f4[::1])")\n'
        "def total(values, halves):\n"
        "    found = 0.0\n"
        "    for k in range(values.shape[0]):\n"
        "        halves[k] = values[k] * 0.3 + halves[k] * 0.7\n"
        "        found += log(values[k]) * exp(-values[k]) + halves[k]\n"
        "    return found\n"
    )
    values = np.random.default_rng(7).uniform(0.01, 5, 1001)
    expected = None
    for way in ("numba", choice):
        monkeypatch.setenv("UAVSEG_JIT", way)
        total = module_of(source).total
        for level in shipped.LEVELS:
            ship(total, libraries, level)
        shipped._library.cache_clear()
        halves = np.arange(1001, dtype=np.float32)
        found = total(values, halves), halves.tobytes()
        assert total.is_shipped == (way in ("", "baseline"))
        expected = expected or found
        assert found == expected


@pytest.mark.slow
@here
def test_a_kernel_that_was_changed_is_compiled(
    cache: Path, compiled: list[str], module_of: Load, libraries: Path
) -> None:
    source = (
        "from uavseg._jit import inlined, kernel\n\nTIMES = 2\n\n\n"
        "@inlined\ndef times(value):\n    return value * TIMES\n\n\n"
        '@kernel("i8(i8)")\ndef scaled(value):\n    # a comment\n    return times(value)\n'
    )
    first = module_of(source).scaled
    ship(first, libraries)
    assert first(21) == 42 and first.is_shipped and compiled == []
    again = module_of(source.replace("    # a comment\n", "\n")).scaled  # moves nothing but lines
    assert shipped.symbol_of(again) == shipped.symbol_of(first)
    for old, new, value in (
        ("TIMES = 2", "TIMES = 3", 63),
        ("value * TIMES", "value + TIMES", 23),
        ("return times(value)", "return -times(value)", -42),
        ('"i8(i8)"', '"f8(f8)"', 42.0),
    ):
        changed = module_of(source.replace(old, new)).scaled
        assert changed(21) == value
        assert not changed.is_shipped
    assert compiled == ["scaled"] * 4


@here
@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "renamed", "folder", "no function"])
def test_a_damaged_library_is_not_loaded(
    cache: Path, compiled: list[str], twice_module: ModuleType, libraries: Path, damage: str
) -> None:
    path = ship(twice_module.twice, libraries)
    content = path.read_bytes()
    if damage == "folder":
        path.unlink()
        path.mkdir()
    elif damage == "renamed":  # the whole library of another level
        path.write_bytes(build.sealed("x86-64-v3.so", [], content[:-128]))
    elif damage == "no function":
        path.write_bytes(build.sealed(path.name, [], content[:-128].replace(b".twice-", b".twigs-")))
    else:
        middle = len(content) // 2
        flipped = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
        path.write_bytes({"cut": content[:-1], "flipped": flipped, "empty": b""}[damage])
    assert twice_module.twice(21) == 42
    assert not twice_module.twice.is_shipped and compiled == ["twice"]


@pytest.mark.slow
@here
def test_a_processor_gets_the_best_level_whose_features_it_has(
    libraries: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, twice_module: ModuleType
) -> None:
    for level in shipped.LEVELS:
        ship(twice_module.twice, libraries, level)
    v3, v4 = sorted(shipped._V3), sorted(shipped._V4)
    without_bmi2 = [flag for flag in v4 if flag != "bmi2"]
    cases = (
        *((v4, "x86-64-v4"), (v4[:-1], "x86-64"), ([*v3, "avx512f"], "x86-64-v3"), (v3, "x86-64-v3")),
        *((v3[1:], "x86-64"), (without_bmi2, "x86-64"), ([], "x86-64"), (None, "x86-64")),
    )
    for listed, level in cases:
        cpuinfo = tmp_path / "cpuinfo"
        cpuinfo.unlink(missing_ok=True)
        if listed is not None:
            cpuinfo.write_text(f"processor\t: 0\nflags\t\t: fpu {' '.join(listed)} sse\nbugs\t\t:\n")
        monkeypatch.setattr(shipped, "_CPUINFO", cpuinfo)
        shipped.levels_here.cache_clear()
        found = shipped.load(twice_module.twice)
        assert found is not None and Path(found[0]._name).name == f"{level}.so"
    shipped.levels_here.cache_clear()


@here
@pytest.mark.skipif(shutil.which("nm") is None, reason="reads the table of symbols")
def test_libraries_need_nothing_but_functions_of_the_c_library(library: Path) -> None:
    known = {"exp", "log", "erf", "sqrt", "floor", "ceil", "memset", "memcpy", "memmove"}
    listed = subprocess.run(
        ["nm", "-D", "--with-symbol-versions", library], capture_output=True, text=True, check=True
    )
    symbols = [line.split() for line in listed.stdout.splitlines()]
    assert {name for kind, name in (words[-2:] for words in symbols) if kind == "U"} <= known  # any glibc
    own = {shipped.symbol_of(kernel) for kernel in warming.all_kernels().values()}
    assert {words[-1] for words in symbols if words[-2] != "U"} == own


@here
def test_building_is_repeatable(tmp_path: Path, twice_module: ModuleType) -> None:
    made = [ship(twice_module.twice, tmp_path / str(k)).read_bytes() for k in range(2)]
    assert made[0] == made[1]


@here
def test_a_library_is_verified_and_loaded_once(
    twice_module: ModuleType, libraries: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(twice_module.twice, libraries)
    read: list[Path] = []
    content = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.append(path) or content(path))
    found = [shipped.load(twice_module.twice, baseline=True) for _ in range(3)]
    assert found[0] is not None and found == [found[0]] * 3
    assert read == [libraries / "x86-64.so"]


@pytest.mark.slow
@here
def test_building_makes_what_is_not_current_and_nothing_else(
    libraries: Path, twice_module: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "flight.avoid.free_space._relax"
    monkeypatch.setattr(build, "all_kernels", lambda: {name: warming.all_kernels()[name]})
    paths = build.build(shipped.LEVELS[1:])
    assert [path.name for path in paths] == ["x86-64-v3.so", "x86-64.so"]
    made = [path.read_bytes() for path in paths]
    assert build.build(shipped.LEVELS[1:]) == []
    paths[0].write_bytes(made[0][:-1])
    assert build.build(shipped.LEVELS[1:]) == paths[:1]
    assert [path.read_bytes() for path in paths] == made
    monkeypatch.setattr(build, "all_kernels", dict)
    assert build.build([shipped.BASELINE]) == paths[1:]


@here
def test_what_is_not_a_loop_nest_is_not_linked() -> None:
    """A variable, a thread's variable, an address of a function of another library."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(reloc="pic", codemodel="small")
    for text in (
        "@count = internal global i32 0\n"
        "define i32 @f() {\n%a = load i32, ptr @count\n%b = add i32 %a, 1\nstore i32 %b, ptr @count\n"
        "ret i32 %b\n}",
        "declare i32 @other()\ndefine ptr @f() {\nret ptr @other\n}",
    ):
        code = machine.emit_object(llvm.parse_assembly(text))
        with pytest.raises(ValueError, match=r"section of type 8|relocation of type"):
            elf.shared_library({"one": code}, "f")


@here
def test_no_file_name_gets_into_machine_code(module_of: Load) -> None:
    unpacking = module_of(  # arrays of another length are an error of numba, which names the file
        'from uavseg._jit import kernel\n\n\n@kernel("i8(i8[::1])")\n'
        "def unpacking(pair):\n    first, second = pair\n    return first - second\n"
    ).unpacking
    assert b"changing.py" not in object_file(unpacking)


@pytest.mark.parametrize(
    ("choice", "reason"),
    [("", "nothing that is shipped fits"), ("numba", "UAVSEG_JIT=numba asks")],
)
def test_without_numba_one_line_says_what_to_install(
    choice: str,
    reason: str,
    cache: Path,
    monkeypatch: pytest.MonkeyPatch,
    libraries: Path,
    twice_module: ModuleType,
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", choice)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(uavseg.UavsegError, match=rf"twice has to be compiled \({reason}.*uavseg\[compile\]"):
        twice_module.twice(21)


def test_an_unknown_choice_loads_what_fits_best(
    notes: list[str], monkeypatch: pytest.MonkeyPatch, libraries: Path, cache: Path, twice_module: ModuleType
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "fast")
    assert twice_module.twice(21) == 42
    assert notes == ["UAVSEG_JIT=fast is ignored; expected objects, numba or baseline"]
