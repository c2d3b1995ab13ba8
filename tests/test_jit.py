"""Kernels: compiled once for a machine, then loaded without numba; numba itself is the fallback."""

import ctypes
import importlib
import importlib.util
import os
import pkgutil
import platform
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite.binding
import numba
import numba.core.caching
import numpy as np
import pytest

import uavseg
from uavseg import _jit

ROOT = Path(__file__).resolve().parents[1]

DOUBLED = """
from uavseg._jit import inlined, kernel

TIMES = 2
OFFSET = 0.5


@inlined
def scaled(value):
    return value * TIMES


@kernel("i8(i8[::1], i8[:,::1], f8, b1)")
def doubled(values, square, more, negative):
    total = 0
    for k in range(values.shape[0]):
        values[k] = scaled(values[k])
        total += values[k]
    for r in range(square.shape[0]):
        for c in range(square.shape[1]):
            total += 100 * r * square[r, c] + c * square[r, c]
    total += int(more + OFFSET)
    return -total if negative else total
"""
RUN = """
import sys
import numpy as np
from uavseg import _jit
import kernels
_jit.on_compile = lambda name: print("compiling", name)
print(kernels.doubled(np.arange(4), np.ones((2, 3), np.int64), 3.6, True))
print("numba" in sys.modules)
"""
names = count()


@pytest.fixture(autouse=True)
def state(monkeypatch: pytest.MonkeyPatch) -> None:
    """Object files are used, as if nothing had failed in this process before."""
    monkeypatch.setenv("UAVSEG_JIT", "objects")
    monkeypatch.setattr(_jit, "_object_files_failed", False)
    monkeypatch.setattr(_jit, "_notes", set())


@pytest.fixture(params=["objects", "numba"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """How kernels run: from object files, or through the fallback."""
    name: str = request.param
    monkeypatch.setenv("UAVSEG_JIT", name)
    return name


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of machine code that is empty."""
    monkeypatch.setenv("UAVSEG_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "kernels"


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of kernels that are compiled, in their order."""
    told: list[str] = []
    monkeypatch.setattr(_jit, "on_compile", told.append)
    return told


@pytest.fixture
def notes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The notes, in their order."""
    told: list[str] = []
    monkeypatch.setattr(_jit, "on_note", told.append)
    return told


def module_of(source: str, folder: Path) -> ModuleType:
    """A module of its own for every call; its source is in a file, where kernels look for it."""
    path = folder / f"kernels_{next(names)}.py"
    path.write_text(source)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def answer(module: ModuleType) -> Any:
    return module.doubled(np.arange(4), np.ones((2, 3), np.int64), 3.6, False)


def test_a_kernel_is_compiled_in_one_process_and_loaded_without_numba_in_the_next(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(DOUBLED)
    root = Path(uavseg.__file__).resolve().parents[1]
    here = {
        **os.environ,
        "UAVSEG_CACHE": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(root), str(tmp_path)]),
    }
    lines = []
    for _ in range(2):
        run = subprocess.run(
            [sys.executable, "-c", RUN], env=here, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stderr
        lines.append(run.stdout.split("\n")[:-1])
    assert lines == [["compiling doubled", "-322", "True"], ["-322", "False"]]


def test_arrays_are_changed_in_place_and_scalars_come_back(engine: str, cache: Path, tmp_path: Path) -> None:
    module = module_of(DOUBLED, tmp_path)
    values = np.arange(4)
    assert module.doubled(values, np.ones((2, 3), np.int64), 3.6, True) == -322
    assert values.tolist() == [0, 2, 4, 6]
    kept = cache if engine == "objects" else cache / "numba"
    assert [path.name.split("-")[0] for path in kept.iterdir()] == ["doubled"]  # and no temporary file


@pytest.mark.parametrize("kind", ["plain", "read-only", "unaligned", "empty"])
def test_any_memory_serves_that_is_contiguous(engine: str, cache: Path, tmp_path: Path, kind: str) -> None:
    square = np.ones((0, 3), np.int64) if kind == "empty" else np.ones((2, 3), np.int64)
    if kind == "read-only":
        square.flags.writeable = False
    if kind == "unaligned":
        square = np.frombuffer(bytearray(b"\0" + square.tobytes()), np.int64, offset=1).reshape(2, 3)
        assert not square.flags.aligned
    total = module_of(DOUBLED, tmp_path).doubled(np.arange(4), square, 3.6, False)
    assert total == 322 - (306 if kind == "empty" else 0)


NUMBERS = """
from uavseg._jit import kernel


@kernel("u8(u8, i8, i2, u1)")
def integers(a, b, c, d):
    return a + (b < 0) + (c == -5) + (d == 250)


@kernel("f4(f4)")
def small(value):
    return value


@kernel("b1(f8)")
def positive(value):
    return value > 0


@kernel("f8(f8)")
def inverse(value):
    return 1 / value
"""


def test_numbers_are_converted_alike(engine: str, cache: Path, tmp_path: Path) -> None:
    module = module_of(NUMBERS, tmp_path)
    largest = np.iinfo(np.uint64).max
    assert module.integers(largest - 3, -1, -5, 250) == largest
    assert module.integers(0, np.int64(-1), 65531, -6) == 3  # they wrap, as in C
    assert module.integers(np.uint64(7), True, np.int16(-5), np.uint8(250)) == 9
    assert module.small(0.1) == float(np.float32(0.1)) == module.small(np.float32(0.1))
    answers = [module.positive(1), module.positive(np.float64(-1)), module.inverse(0), module.inverse(True)]
    assert answers == [True, False, np.inf, 1] and [type(value) for value in answers] == 2 * [bool] + 2 * [
        float
    ]
    for call in (lambda: module.integers(1.5, 0, 0, 0), lambda: module.small("1")):
        with pytest.raises((TypeError, ctypes.ArgumentError)):
            call()


def test_the_same_kernel_is_not_compiled_again(
    engine: str, cache: Path, compiled: list[str], tmp_path: Path
) -> None:
    for _ in range(3):
        assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert compiled == ["doubled"]


@pytest.mark.parametrize(
    "old, new, total",
    [
        ("TIMES = 2", "TIMES = 3", 328),
        ("OFFSET = 0.5", "OFFSET = 0.25", 321),
        ("return value * TIMES", "return value * TIMES + 1", 326),
        ("100 * r", "10 * r", 52),
    ],
    ids=["constant", "float", "helper", "body"],
)
def test_a_changed_source_is_compiled_anew(
    engine: str, cache: Path, compiled: list[str], tmp_path: Path, old: str, new: str, total: int
) -> None:
    assert old in DOUBLED
    assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert answer(module_of(DOUBLED.replace(old, new), tmp_path)) == total
    kept = cache if engine == "objects" else cache / "numba"
    assert len(list(kept.iterdir())) == len(compiled) == 2


def test_an_array_of_another_kind_is_refused(engine: str, cache: Path, tmp_path: Path) -> None:
    doubled = module_of(DOUBLED, tmp_path).doubled
    kinds = [np.arange(4, dtype=np.int32), np.arange(4, dtype=np.uint64), np.arange(4.0)]
    for wrong in (*kinds, np.arange(8)[::2], np.arange(4)[::-1], np.arange(4).reshape(2, 2)):
        before = wrong.copy()
        with pytest.raises(TypeError, match="C-contiguous 1-D array of int64"):
            doubled(wrong, np.ones((2, 3), np.int64), 1.0, False)
        assert np.array_equal(wrong, before)


def test_a_transposed_array_and_a_missing_argument_are_refused(
    engine: str, cache: Path, tmp_path: Path
) -> None:
    doubled = module_of(DOUBLED, tmp_path).doubled
    with pytest.raises(TypeError, match="C-contiguous 2-D array of int64"):
        doubled(np.arange(4), np.ones((2, 3), np.int64).T, 1.0, False)
    with pytest.raises(ValueError):
        doubled(np.arange(4), np.ones((2, 3), np.int64), 1.0)


ALLOCATING = """
import numpy as np
from uavseg._jit import kernel


@kernel("i8(i8)")
def allocating(n):
    return np.zeros(n, np.int64).sum()
"""


def test_a_kernel_that_allocates_gets_no_object_file(cache: Path, notes: list[str], tmp_path: Path) -> None:
    assert module_of(ALLOCATING.replace("zeros", "ones"), tmp_path).allocating(3) == 3
    assert len(notes) == 1
    assert "kernel allocating calls ['NRT_" in notes[0] and "it may not allocate or raise" in notes[0]
    assert list(cache.glob("*.o")) == []


def all_kernels() -> Iterator[_jit.Kernel]:
    """Every kernel of the package, not yet compiled or loaded."""
    for found in pkgutil.walk_packages(uavseg.__path__, "uavseg."):
        if found.name.endswith("__main__"):
            continue
        module = importlib.import_module(found.name)
        for value in vars(module).values():
            if isinstance(value, _jit.Kernel) and value.function.__module__ == found.name:
                yield _jit.Kernel(value.function, value.signature)


def test_no_kernel_of_the_package_needs_the_fallback(notes: list[str]) -> None:
    kernels = list(all_kernels())
    for kernel in kernels:
        kernel._load()
    assert len(kernels) > 60 and notes == []
    assert [kernel.__name__ for kernel in kernels if kernel._dispatcher is not None] == []


def test_the_first_call_may_come_from_many_threads(
    engine: str, cache: Path, compiled: list[str], tmp_path: Path
) -> None:
    module = module_of(DOUBLED, tmp_path)
    start, answers = threading.Barrier(6), []

    def call() -> None:
        start.wait(20)
        answers.append(answer(module))

    workers = [threading.Thread(target=call) for _ in range(6)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert answers == 6 * [322]
    assert compiled == ["doubled"]


WAITING = """
from uavseg._jit import kernel


@kernel("void(i8[::1], i8[::1], i8)")
def waiting(flag, waited, most):
    for k in range(most):
        if flag[0] != 0:
            break
        waited[k & 1] += 1  # for all the compiler knows, this may be the flag
"""


def test_a_kernel_lets_other_threads_run(engine: str, cache: Path, tmp_path: Path) -> None:
    waiting, most = module_of(WAITING, tmp_path).waiting, 10_000_000_000
    flag, waited = np.zeros(1, np.int64), np.zeros(2, np.int64)
    waiting(flag, waited, 0)
    worker = threading.Thread(target=waiting, args=(flag, waited, most))
    worker.start()
    while worker.is_alive() and waited[0] == 0:
        pass
    flag[0] = 1  # nobody could do this while the kernel held the lock
    worker.join()
    assert 0 < waited.sum() < most


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No folder for caches at home; the folder for temporary files is this one, and empty."""
    (tmp_path / "home").write_text("a file, so that no folder can be made in it")
    monkeypatch.delenv("UAVSEG_CACHE", raising=False)
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.setattr(_jit, "_process_folder", None)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


posix = pytest.mark.skipif(
    not hasattr(os, "geteuid"), reason="files have an owner and a mode on POSIX systems"
)


@posix
def test_where_the_user_s_folder_cannot_be_written_a_private_one_serves(
    engine: str, homeless: Path, compiled: list[str], tmp_path: Path
) -> None:
    for _ in range(3):
        assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert compiled == ["doubled"]
    folder = homeless / f"uavseg-{os.geteuid()}"
    assert list(homeless.iterdir()) == [folder]
    assert folder.stat().st_mode & 0o777 == 0o700
    assert list(folder.iterdir()) != [] and list(tmp_path.glob("*.o")) == []


def open_to_others(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o750)


def a_link(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(folder.parent / "elsewhere")


@posix
@pytest.mark.parametrize("made", [open_to_others, a_link, Path.touch], ids=["open", "link", "file"])
def test_a_temporary_folder_that_others_may_have_made_is_not_used(
    homeless: Path, compiled: list[str], tmp_path: Path, made: Callable[[Path], None]
) -> None:
    taken = homeless / f"uavseg-{os.geteuid()}"
    made(taken)
    before = {path: path.lstat().st_mtime_ns for path in homeless.rglob("*")}
    for _ in range(2):
        assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert compiled == ["doubled"]  # once for the process, in a folder of its own
    assert {path: path.lstat().st_mtime_ns for path in before} == before
    used = _jit._cache_folder()
    assert used is not None and used != taken and used.stat().st_mode & 0o777 == 0o700


@posix
@pytest.mark.parametrize("place", ["temporary", "home"])
def test_a_folder_of_somebody_else_is_not_used(
    homeless: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    taken = tmp_path / "cache" / "kernels" if place == "home" else homeless / "uavseg-4321"
    taken.mkdir(mode=0o700, parents=True)
    if os.geteuid() == 0:
        os.chown(taken, 1234, -1)  # what root has made is trusted
    if place == "home":
        monkeypatch.setenv("UAVSEG_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "geteuid", lambda: 4321)
    used = _jit._cache_folder()
    assert used is not None and used != taken and used.is_relative_to(homeless)
    assert list(taken.iterdir()) == []


def test_without_any_folder_a_kernel_is_compiled_in_each_process(
    engine: str, homeless: Path, compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    assert _jit._cache_folder() is None
    assert [answer(module_of(DOUBLED, tmp_path)) for _ in range(2)] == [322, 322]
    assert compiled == ["doubled", "doubled"]


@posix
def test_the_user_s_own_folder_is_closed_to_the_writing_of_others(cache: Path, tmp_path: Path) -> None:
    cache.mkdir(parents=True)
    cache.chmod(0o777)
    assert _jit._cache_folder() == cache
    assert cache.stat().st_mode & 0o777 == 0o755


def test_the_cache_lies_where_the_user_keeps_caches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled: list[str]
) -> None:
    monkeypatch.delenv("UAVSEG_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    answer(module_of(DOUBLED, tmp_path))
    assert len(list((tmp_path / "caches" / "uavseg" / "kernels").glob("doubled-*.o"))) == 1


def test_a_full_disk_keeps_no_machine_code_and_stops_no_work(
    cache: Path, compiled: list[str], tmp_path: Path
) -> None:
    resource = pytest.importorskip("resource", reason="only Unix limits the size of files")
    module, again = module_of(DOUBLED, tmp_path), module_of(DOUBLED, tmp_path)
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, usual[1]))
    try:
        assert answer(module) == answer(again)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert len(compiled) == 2 and list(cache.iterdir()) == []


def test_a_kernel_keeps_its_name_and_docstring() -> None:
    @_jit.kernel("void(u1[::1])")
    def fill(image: Any) -> None:
        """Fill it."""

    assert (fill.__name__, fill.__doc__) == ("fill", "Fill it.")


def test_a_helper_may_be_called_from_python_too() -> None:
    @_jit.inlined
    def twice(value: int) -> int:
        """Twice the value."""
        return 2 * value

    assert twice(4) == 8 and twice.__doc__ == "Twice the value."


# What lies in the cache may be damaged, or somebody else's.


TWICE = """
from uavseg._jit import kernel


@kernel("i8(i8)")
def twice(value):
    return 2 * value
"""


def twice(folder: Path) -> Any:
    return module_of(TWICE, folder).twice(21)


def damage(path: Path, change: Callable[[bytes], bytes]) -> None:
    path.write_bytes(change(path.read_bytes()))


def flip_in_the_middle(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0x10]) + content[middle + 1 :]


def another_s(path: Path) -> None:
    """The file of another kernel, whole, under this name."""
    assert module_of(TWICE.replace("2 *", "3 *"), path.parents[2]).twice(21) == 63
    (found,) = set(path.parent.glob("*.o")) - {path}
    found.replace(path)


def linked(path: Path) -> None:
    """A link to a file that is whole."""
    path.rename(path.with_suffix(".kept"))
    path.symlink_to(path.with_suffix(".kept"))


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def a_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: damage(path, lambda content: b""),
    "cut": lambda path: damage(path, lambda content: content[: len(content) // 2]),
    "one byte short": lambda path: damage(path, lambda content: content[:-1]),
    "longer": lambda path: damage(path, lambda content: content + b"\0"),
    "zeros": lambda path: damage(path, lambda content: bytes(len(content))),
    "zeros at the end": lambda path: damage(path, lambda content: content[:-512] + bytes(512)),
    "a bit": lambda path: damage(path, flip_in_the_middle),
    "header": lambda path: damage(path, lambda content: content.replace(b"version 1", b"version 0", 1)),
    "no header": lambda path: damage(path, lambda content: content.split(b"\n", 2)[2]),
    "another's": another_s,
    "link": linked,
    "writable by the group": lambda path: path.chmod(0o620),
    "writable by all": lambda path: path.chmod(0o666),
    "unreadable": lambda path: path.chmod(0),
    "pipe": a_pipe,
}


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_object_file_is_compiled_again(
    cache: Path, compiled: list[str], notes: list[str], tmp_path: Path, kind: str
) -> None:
    if kind in {"writable by the group", "writable by all", "pipe"} and not hasattr(os, "geteuid"):
        pytest.skip("a matter of POSIX systems")
    if kind == "unreadable" and getattr(os, "geteuid", lambda: 0)() == 0:
        pytest.skip("root reads everything")
    assert twice(tmp_path) == 42
    (path,) = cache.glob("*.o")
    DAMAGES[kind](path)
    compiled.clear()
    assert [twice(tmp_path) for _ in range(3)] == 3 * [42]
    assert compiled == ["twice"]  # and replaced by a whole one
    assert not path.is_symlink() and path.stat().st_mode & 0o777 == 0o600
    assert notes == []


def test_a_folder_in_the_place_of_an_object_file_stops_no_work(
    cache: Path, compiled: list[str], notes: list[str], tmp_path: Path
) -> None:
    assert twice(tmp_path) == 42
    (path,) = cache.glob("*.o")
    a_folder(path)
    assert [twice(tmp_path) for _ in range(2)] == [42, 42]
    assert compiled == 3 * ["twice"] and notes == []
    assert list(cache.iterdir()) == [path]


def test_every_changed_byte_and_every_length_is_noticed(tmp_path: Path) -> None:
    content = b"name\n" + bytes(range(256)) + b"\n\n" + bytes(64)
    _jit._keep(tmp_path, "kernel-1", content)
    assert _jit._read(tmp_path, "kernel-1") == content
    path = tmp_path / "kernel-1.o"
    whole = path.read_bytes()
    for at in range(len(whole)):
        for bit in (1, 128):
            path.write_bytes(whole[:at] + bytes([whole[at] ^ bit]) + whole[at + 1 :])
            assert _jit._read(tmp_path, "kernel-1") is None, f"bit {bit} of byte {at}"
        path.write_bytes(whole[:at])
        assert _jit._read(tmp_path, "kernel-1") is None, f"{at} bytes"
        path.write_bytes(whole[:at] + bytes(len(whole) - at))
        assert (_jit._read(tmp_path, "kernel-1") is None) == any(whole[at:]), f"zeros from {at}"
    path.write_bytes(whole)
    assert _jit._read(tmp_path, "kernel-1") == content


@posix
def test_only_files_of_the_user_and_of_root_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _jit._keep(tmp_path, "kernel-1", b"content")
    owner = (tmp_path / "kernel-1.o").stat().st_uid
    assert _jit._read(tmp_path, "kernel-1") == b"content"
    monkeypatch.setattr(os, "geteuid", lambda: 4321)
    assert _jit._read(tmp_path, "kernel-1") == (b"content" if owner == 0 else None)
    if owner == 0:
        os.chown(tmp_path / "kernel-1.o", 1234, -1)
        assert _jit._read(tmp_path, "kernel-1") is None
        os.chown(tmp_path / "kernel-1.o", 4321, -1)
        assert _jit._read(tmp_path, "kernel-1") == b"content"


def emptied(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


NUMBA_DAMAGES: dict[str, Callable[[Path], object]] = {
    "index": lambda folder: damage(next(folder.rglob("*.nbi")), lambda content: content[:-7]),
    "index of zeros": lambda folder: damage(next(folder.rglob("*.nbi")), lambda content: bytes(len(content))),
    "code": lambda folder: damage(next(folder.rglob("*.nbc")), flip_in_the_middle),
    "cut code": lambda folder: damage(next(folder.rglob("*.nbc")), lambda content: content[:100]),
    "no code": lambda folder: next(folder.rglob("*.nbc")).unlink(),
    "source": lambda folder: damage(folder / "kernel.py", lambda content: content + b"# more\n"),
    "checksum": lambda folder: (folder / "checksum").write_bytes(b"0"),
    "no checksum": lambda folder: (folder / "checksum").unlink(),
    "writable by all": lambda folder: folder.chmod(0o777),
    "empty": emptied,
}


@pytest.mark.parametrize("kind", NUMBA_DAMAGES)
def test_a_damaged_cache_of_numba_is_compiled_again(
    cache: Path, compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    assert twice(tmp_path) == 42
    (folder,) = (cache / "numba").iterdir()
    NUMBA_DAMAGES[kind](folder)
    compiled.clear()
    assert [twice(tmp_path) for _ in range(3)] == 3 * [42]
    assert compiled == ["twice"]
    assert list((cache / "numba").iterdir()) == [folder] and folder.stat().st_mode & 0o777 == 0o700


def test_a_file_in_the_place_of_numba_s_caches_stops_no_work(
    cache: Path, compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    cache.mkdir(parents=True)
    (cache / "numba").write_text("")
    assert [twice(tmp_path) for _ in range(2)] == [42, 42]
    assert (cache / "numba").read_text() == ""


# Private parts of numba and llvmlite may change or go, and some platforms nobody has tried.


def fails(*arguments: Any, **options: Any) -> Any:
    raise RuntimeError("not on this machine\nand a second line")


BROKEN: dict[str, tuple[Any, str, Any]] = {
    "processor": (llvmlite.binding, "get_host_cpu_features", fails),
    "compiling": (_jit, "_compile", fails),
    "linking": (_jit, "_link", fails),
    "intermediate code": (type(numba.njit(fails)), "inspect_llvm", fails),
    "loading": (llvmlite.binding.ObjectFileRef, "from_data", fails),
    "address": (llvmlite.binding.ExecutionEngine, "get_function_address", lambda engine, name: 0),
    "ctypes": (ctypes, "CFUNCTYPE", fails),
}


@pytest.mark.parametrize("part", BROKEN)
def test_where_a_private_part_fails_numba_runs_the_kernel_and_one_note_says_so(
    cache: Path, notes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    owner, name, instead = BROKEN[part]
    monkeypatch.setattr(owner, name, instead)
    assert [twice(tmp_path) for _ in range(2)] == [42, 42]
    assert len(notes) == 1 and "\n" not in notes[0]
    assert notes[0].startswith(
        "kernels run through numba.njit, which gives the same results but starts more slowly"
    )
    assert "because no object file could be made of twice (" in notes[0]


def test_an_object_file_that_does_not_link_is_compiled_again(
    cache: Path, compiled: list[str], notes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert twice(tmp_path) == 42
    (path,) = cache.glob("*.o")
    _jit._keep(cache, path.stem, b"another_name\n" + path.read_bytes().split(b"\n", 3)[3])
    assert twice(tmp_path) == 42
    assert compiled == ["twice", "twice"] and notes == []


def test_a_platform_that_is_not_tested_runs_through_numba(
    cache: Path, notes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    assert twice(tmp_path) == 42
    assert notes == [] and len(list(cache.glob("*.o"))) == 1  # UAVSEG_JIT=objects
    monkeypatch.delenv("UAVSEG_JIT")
    assert [twice(tmp_path) for _ in range(2)] == [42, 42]
    assert len(notes) == 1 and f"because {sys.platform}-riscv64 is not tested" in notes[0]
    assert len(list((cache / "numba").iterdir())) == 1


@pytest.mark.skipif(
    f"{sys.platform}-{platform.machine()}" != "linux-x86_64", reason="the platform that is tested"
)
def test_the_platform_that_is_tested_gets_object_files(
    cache: Path, notes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("UAVSEG_JIT")
    assert twice(tmp_path) == 42
    assert notes == [] and [path.suffix for path in cache.iterdir()] == [".o"]


def test_the_user_may_choose_numba_and_gets_no_note(
    cache: Path, notes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    assert twice(tmp_path) == 42
    assert notes == [] and [path.name for path in cache.iterdir()] == ["numba"]


def test_an_unknown_choice_is_ignored_with_a_note(
    cache: Path, notes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "fast")
    assert twice(tmp_path) == 42
    assert notes[0] == "UAVSEG_JIT=fast is ignored; expected numba or objects"


def test_in_python_the_note_is_a_warning(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_jit, "on_note", None)
    monkeypatch.setattr(_jit, "_compile", fails)
    with pytest.warns(UserWarning, match=r"uavseg: kernels run through numba\.njit") as warned:
        assert [twice(tmp_path) for _ in range(2)] == [42, 42]
    assert len(warned) == 1


def test_a_cache_of_numba_that_fails_is_not_needed(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    monkeypatch.setattr(numba.core.caching, "dumps", fails)
    assert twice(tmp_path) == 42
    assert list((cache / "numba").iterdir()) == []


NOTE = "uavseg: note: kernels run through numba.njit"
ON_ANOTHER_PLATFORM = """
import platform
import sys

platform.machine = lambda: "riscv64"
from uavseg.cli import main

main(sys.argv[1:])
"""


def run(folder: Path, arguments: list[str], jit: str, program: tuple[str, ...] = ("-m", "uavseg")) -> str:
    """Run a command in a folder; what it says on stderr."""
    done = subprocess.run(
        [sys.executable, *program, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), "UAVSEG_JIT": jit},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_the_command_line_prints_the_note_once(tmp_path: Path) -> None:
    command = ["suggest", str(ROOT / "samples" / "quarry.tif")]
    told = run(tmp_path, command, "", ("-c", ON_ANOTHER_PLATFORM)).splitlines()
    assert [line.startswith(NOTE) for line in told if "compiling" not in line] == [True]
    for choice in ("numba", "objects"):
        assert [line for line in run(tmp_path, command, choice).splitlines() if "compiling" not in line] == []


COMMANDS = """
extract {samples}/quarry.tif --range 0.55,1 -o bright.geojson --mission quarry.plan --altitude 60 --home auto
extract {samples}/shore.tif --range 0.5,1 -o land.gpkg --labels labels.tif --smooth-outline 1 --simplify 1
extract {samples}/fields_rgb.tif --range 0.54,1 -o fields.geojson --method paper --fill-holes 10px
extract {samples}/quarry.tif --range 0.2,0.5 -o smooth.geojson --refine smooth
levels {samples}/quarry.tif --width 0.2 --min-area 50 -o levels.geojson
divide {samples}/quarry.tif -o blocks.tif
match {samples}/fields_rgb.tif --like 548225,6471890,4 -o like.geojson
original {samples}/thermal.tif -o original.tif
simulate circles -o map.tif --truth truth.tif
classify map.tif --stretch none -o states.tif --objects objects.geojson
path map.tif --range 0,0.45 --start 0.745,1.515 --goal 2.075,0.445 --smooth --clearance 0.05 -o path.geojson
"""


@pytest.mark.slow
def test_the_fallback_gives_the_same_bytes(tmp_path: Path) -> None:
    written: dict[str, dict[str, bytes]] = {}
    for choice in ("objects", "numba"):
        folder = tmp_path / "work"  # the same for both: a block map names its folder
        folder.mkdir()
        for line in COMMANDS.strip().splitlines():
            told = run(folder, line.format(samples=ROOT / "samples").split(), choice)
            assert "note: kernels" not in told and "Warning" not in told
        written[choice] = {path.name: path.read_bytes() for path in folder.iterdir()}
        folder.rename(tmp_path / choice)
    assert len(written["numba"]) >= 13 and all(written["numba"].values())
    assert written["objects"].keys() == written["numba"].keys()
    different = [name for name, content in written["objects"].items() if content != written["numba"][name]]
    assert different == []
