"""A state of its own for each test, an empty cache, and kernels made from source text."""

import importlib.util
from collections.abc import Callable
from itertools import count
from pathlib import Path
from types import ModuleType

import pytest

from uavseg._jit import kernels, messages

TWICE = """
from uavseg._jit import kernel


@kernel("i8(i8)")
def twice(value):
    return 2 * value
"""
names = count()


@pytest.fixture(autouse=True)
def state(monkeypatch: pytest.MonkeyPatch) -> None:
    """Object files are used, as if nothing had failed in this process before."""
    monkeypatch.setenv("UAVSEG_JIT", "objects")
    monkeypatch.setattr(kernels, "_object_files_failed", False)
    monkeypatch.setattr(messages, "_notes", set())


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
    monkeypatch.setattr(messages, "on_compile", told.append)
    return told


@pytest.fixture
def notes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The notes, in their order."""
    told: list[str] = []
    monkeypatch.setattr(messages, "on_note", told.append)
    return told


@pytest.fixture
def module_of(tmp_path: Path) -> Callable[[str], ModuleType]:
    """Makes a new module of a source text on each call; the text is in a file, where kernels look for it."""

    def load(source: str) -> ModuleType:
        path = tmp_path / f"kernels_{next(names)}.py"
        path.write_text(source)
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def twice(module_of: Callable[[str], ModuleType]) -> Callable[..., int]:
    """Multiplies 21 by 2, or by another factor, with a kernel that is new on each call."""

    def call(factor: int = 2) -> int:
        product: int = module_of(TWICE.replace("2 *", f"{factor} *")).twice(21)
        return product

    return call
