"""Kernels: compiled once for a machine, then loaded without numba; the same calls through either engine."""

import ctypes
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import uavseg
from uavseg._jit import inlined, kernel

Load = Callable[[str], ModuleType]

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
from uavseg._jit import messages
import kernels
messages.on_compile = lambda name: print("compiling", name)
print(kernels.doubled(np.arange(4), np.ones((2, 3), np.int64), 3.6, True))
print("numba" in sys.modules)
"""


def answer(module: ModuleType) -> Any:
    return module.doubled(np.arange(4), np.ones((2, 3), np.int64), 3.6, False)


@pytest.mark.slow
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


@pytest.mark.slow
def test_arrays_are_changed_in_place_and_scalars_come_back(engine: str, cache: Path, module_of: Load) -> None:
    module = module_of(DOUBLED)
    values = np.arange(4)
    assert module.doubled(values, np.ones((2, 3), np.int64), 3.6, True) == -322
    assert values.tolist() == [0, 2, 4, 6]
    kept = cache if engine == "objects" else cache / "numba"
    assert [path.name.split("-")[0] for path in kept.iterdir()] == ["doubled"]  # and no temporary file


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain", "read-only", "unaligned", "empty"])
def test_any_memory_serves_that_is_contiguous(engine: str, cache: Path, kind: str, module_of: Load) -> None:
    square = np.ones((0, 3), np.int64) if kind == "empty" else np.ones((2, 3), np.int64)
    if kind == "read-only":
        square.flags.writeable = False
    if kind == "unaligned":
        square = np.frombuffer(bytearray(b"\0" + square.tobytes()), np.int64, offset=1).reshape(2, 3)
        assert not square.flags.aligned
    total = module_of(DOUBLED).doubled(np.arange(4), square, 3.6, False)
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


def test_numbers_are_converted_alike(engine: str, cache: Path, module_of: Load) -> None:
    module = module_of(NUMBERS)
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


@pytest.mark.slow
def test_the_same_kernel_is_not_compiled_again(
    engine: str, cache: Path, compiled: list[str], module_of: Load
) -> None:
    for _ in range(3):
        assert answer(module_of(DOUBLED)) == 322
    assert compiled == ["doubled"]


@pytest.mark.slow
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
    engine: str, cache: Path, compiled: list[str], old: str, new: str, total: int, module_of: Load
) -> None:
    assert old in DOUBLED
    assert answer(module_of(DOUBLED)) == 322
    assert answer(module_of(DOUBLED.replace(old, new))) == total
    kept = cache if engine == "objects" else cache / "numba"
    assert len(list(kept.iterdir())) == len(compiled) == 2


def test_an_array_of_another_kind_is_refused(engine: str, cache: Path, module_of: Load) -> None:
    doubled = module_of(DOUBLED).doubled
    classes = [np.arange(4, dtype=np.int32), np.arange(4, dtype=np.uint64), np.arange(4.0)]
    for wrong in (*classes, np.arange(8)[::2], np.arange(4)[::-1], np.arange(4).reshape(2, 2)):
        before = wrong.copy()
        with pytest.raises(TypeError, match="C-contiguous 1-D array of int64"):
            doubled(wrong, np.ones((2, 3), np.int64), 1.0, False)
        assert np.array_equal(wrong, before)


def test_a_transposed_array_and_a_missing_argument_are_refused(
    engine: str, cache: Path, module_of: Load
) -> None:
    doubled = module_of(DOUBLED).doubled
    with pytest.raises(TypeError, match="C-contiguous 2-D array of int64"):
        doubled(np.arange(4), np.ones((2, 3), np.int64).T, 1.0, False)
    with pytest.raises(ValueError):
        doubled(np.arange(4), np.ones((2, 3), np.int64), 1.0)


@pytest.mark.slow
def test_the_first_call_may_come_from_many_threads(
    engine: str, cache: Path, compiled: list[str], module_of: Load
) -> None:
    module = module_of(DOUBLED)
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


def test_a_kernel_lets_other_threads_run(engine: str, cache: Path, module_of: Load) -> None:
    waiting, most = module_of(WAITING).waiting, 10_000_000_000
    flag, waited = np.zeros(1, np.int64), np.zeros(2, np.int64)
    waiting(flag, waited, 0)
    worker = threading.Thread(target=waiting, args=(flag, waited, most))
    worker.start()
    while worker.is_alive() and waited[0] == 0:
        pass
    flag[0] = 1  # nobody could do this while the kernel held the lock
    worker.join()
    assert 0 < waited.sum() < most


def test_a_kernel_keeps_its_name_and_docstring() -> None:
    @kernel("void(u1[::1])")
    def fill(image: Any) -> None:
        """Fill it."""

    assert (fill.__name__, fill.__doc__) == ("fill", "Fill it.")


def test_a_helper_may_be_called_from_python_too() -> None:
    @inlined
    def twice(value: int) -> int:
        """Twice the value."""
        return 2 * value

    assert twice(4) == 8 and twice.__doc__ == "Twice the value."
