"""A kernel is compiled once for a machine and afterwards loaded without numba."""

import importlib.util
import os
import subprocess
import sys
import threading
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import uavseg
from uavseg import _jit

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


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of machine code that is empty."""
    monkeypatch.setenv("UAVSEG_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "kernels"


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of kernels that were compiled, as they are."""
    told: list[str] = []
    monkeypatch.setattr(_jit, "on_compile", told.append)
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


def test_arrays_are_changed_in_place_and_scalars_come_back(cache: Path, tmp_path: Path) -> None:
    module = module_of(DOUBLED, tmp_path)
    values = np.arange(4)
    assert module.doubled(values, np.ones((2, 3), np.int64), 3.6, True) == -322
    assert values.tolist() == [0, 2, 4, 6]
    assert [path.name.split("-")[0] for path in cache.iterdir()] == ["doubled"]  # and no temporary file


def test_the_same_kernel_is_not_compiled_again(cache: Path, compiled: list[str], tmp_path: Path) -> None:
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
    cache: Path, compiled: list[str], tmp_path: Path, old: str, new: str, total: int
) -> None:
    assert old in DOUBLED
    assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert answer(module_of(DOUBLED.replace(old, new), tmp_path)) == total
    assert len(list(cache.iterdir())) == len(compiled) == 2


def test_an_array_of_another_kind_is_refused(cache: Path, tmp_path: Path) -> None:
    doubled = module_of(DOUBLED, tmp_path).doubled
    kinds = [np.arange(4, dtype=np.int32), np.arange(4, dtype=np.uint64), np.arange(4.0)]
    for wrong in (*kinds, np.arange(8)[::2], np.arange(4)[::-1], np.arange(4).reshape(2, 2)):
        before = wrong.copy()
        with pytest.raises(TypeError, match="C-contiguous 1-D array of int64"):
            doubled(wrong, np.ones((2, 3), np.int64), 1.0, False)
        assert np.array_equal(wrong, before)


def test_a_transposed_array_and_a_missing_argument_are_refused(cache: Path, tmp_path: Path) -> None:
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


def test_a_kernel_that_allocates_is_refused_when_it_is_compiled(cache: Path, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"kernel allocating calls .* may not allocate or raise"):
        module_of(ALLOCATING, tmp_path).allocating(3)
    assert list(cache.iterdir()) == []


def test_the_first_call_may_come_from_many_threads(cache: Path, compiled: list[str], tmp_path: Path) -> None:
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


def test_a_kernel_lets_other_threads_run(cache: Path, tmp_path: Path) -> None:
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


def test_where_the_user_s_folder_cannot_be_written_a_private_one_serves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled: list[str]
) -> None:
    (tmp_path / "home").write_text("a file, so that no folder can be made in it")
    monkeypatch.delenv("UAVSEG_CACHE", raising=False)
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.setattr(_jit, "_private_folder", None)
    assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert answer(module_of(DOUBLED, tmp_path)) == 322
    assert compiled == ["doubled"]  # once for the process
    assert list(tmp_path.glob("**/*.o")) == []


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
