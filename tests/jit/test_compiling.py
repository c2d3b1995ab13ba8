"""Object files: which kernels get one, and that an object file which does not link is replaced."""

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

import uavseg
from uavseg._jit import Kernel, object_cache

Load = Callable[[str], ModuleType]

ALLOCATING = """
import numpy as np
from uavseg._jit import kernel


@kernel("i8(i8)")
def allocating(n):
    return np.zeros(n, np.int64).sum()
"""


@pytest.mark.slow
def test_a_kernel_that_allocates_gets_no_object_file(cache: Path, notes: list[str], module_of: Load) -> None:
    assert module_of(ALLOCATING.replace("zeros", "ones")).allocating(3) == 3
    assert len(notes) == 1
    assert "no object file could be made of allocating (RuntimeError: it calls ['NRT_" in notes[0]
    assert "a kernel may not allocate or raise" in notes[0]
    assert list(cache.glob("*.o")) == []


def all_kernels() -> Iterator[Kernel]:
    """Every kernel of the package, not yet compiled or loaded."""
    for found in pkgutil.walk_packages(uavseg.__path__, "uavseg."):
        if found.name.endswith("__main__"):
            continue
        module = importlib.import_module(found.name)
        for value in vars(module).values():
            if isinstance(value, Kernel) and value.function.__module__ == found.name:
                yield Kernel(value.function, value.signature)


@pytest.mark.slow
@pytest.mark.thorough
def test_no_kernel_of_the_package_needs_the_fallback(notes: list[str]) -> None:
    kernels = list(all_kernels())
    for kernel in kernels:
        kernel.load()
    assert len(kernels) > 60 and notes == []
    assert [kernel.__name__ for kernel in kernels if kernel._dispatcher is not None] == []


def test_an_object_file_that_does_not_link_is_compiled_again(
    cache: Path,
    compiled: list[str],
    notes: list[str],
    twice: Callable[..., int],
) -> None:
    assert twice() == 42
    (path,) = cache.glob("*.o")
    object_cache.store(cache, path.stem, b"another_name\n" + path.read_bytes().split(b"\n", 3)[3])
    assert twice() == 42
    assert compiled == ["twice", "twice"] and notes == []
