"""Lazy import of pandas: pyogrio and pyarrow load it only where somebody uses it.

Both use pandas and geopandas where these are installed. pyogrio imports them to learn their versions,
pyarrow the first time it is given an array: a third of a second and 45 MB, of which most commands use
nothing. What each of the two does while it looks is changed here, and nothing else: pandas and geopandas
can be imported by anybody at any time, and both packages work with them from then on.
"""

import builtins
import importlib
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from importlib.abc import Loader
from importlib.machinery import ModuleSpec, PathFinder
from types import CodeType, ModuleType
from typing import Any


def install() -> None:
    """From here on, in this process; what is already loaded stays as it is."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


class _Finder:
    """Finds pyogrio's list of optional packages, pyarrow and pandas, each with a loader from below."""

    def __init__(self) -> None:
        self.hiding: int | None = None  # the thread for which pandas counts as not installed
        self.hidden = False  # pyarrow looked for pandas and did not find it

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name == "pandas" and self.hiding == threading.get_ident():
            self.hidden = True
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        spec = PathFinder.find_spec(name, path) if name in _LOADERS else None
        if spec is not None:
            spec.loader = _LOADERS[name](spec.loader, self)
        return spec


class _Loader(Loader):
    """Another loader, and something to do besides."""

    def __init__(self, loader: Any, finder: _Finder) -> None:
        self._loader = loader
        self._finder = finder

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        module: ModuleType | None = self._loader.create_module(spec)
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__loader__ = self._loader  # for whoever looks at it, as the spec's
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        self._load(module)

    def _load(self, module: ModuleType) -> None:
        self._loader.exec_module(module)


class _CompatLoader(_Loader):
    """Of `pyogrio._compat`: what it imports of pandas and geopandas is loaded when it is used."""

    def _load(self, module: ModuleType) -> None:
        code: CodeType = self._loader.get_code(module.__name__)
        vars(module)["__builtins__"] = vars(builtins) | {"__import__": _import_lazily}
        exec(code, vars(module))


def _import_lazily(name: str, *how: Any) -> Any:
    from importlib.metadata import PackageNotFoundError

    if name in ("pandas", "geopandas") and name not in sys.modules:
        with suppress(PackageNotFoundError):  # without metadata: imported, or not there at all
            return _Lazy(name)
    return builtins.__import__(name, *how)


class _Lazy(ModuleType):
    """A package that tells its version, and is imported when anything else of it is asked for."""

    def __init__(self, name: str) -> None:
        from importlib.metadata import version

        super().__init__(name)
        self.__version__ = version(name)

    def __getattr__(self, word: str) -> Any:
        return getattr(importlib.import_module(self.__name__), word)


class _ArrowLoader(_Loader):
    """Of `pyarrow`, whose Python part looks for pandas once, here, and does not find it.

    Its C++ part looks once as well, when it is first given Python objects, and cannot be shown pandas later:
    it is left to find pandas. Writers that load no pandas hand over numbers and buffers.
    """

    def _load(self, module: ModuleType) -> None:
        super()._load(module)
        if "pandas" in sys.modules:
            return
        import numpy

        self._finder.hiding = threading.get_ident()
        try:
            module.array(numpy.zeros(0))
        finally:
            self._finder.hiding = None


class _PandasLoader(_Loader):
    """Of `pandas`, which is shown to pyarrow as soon as it is there, if pyarrow has missed it before.

    Not otherwise: it may be pyarrow that imports pandas, with a lock that it would then wait for itself.
    """

    def _load(self, module: ModuleType) -> None:
        super()._load(module)
        if self._finder.hidden:
            with suppress(ImportError):  # of a release that pyarrow does not work with
                sys.modules["pyarrow"].array([]).to_pandas()


_LOADERS: dict[str, type[_Loader]] = {
    "pyogrio._compat": _CompatLoader,
    "pyarrow": _ArrowLoader,
    "pandas": _PandasLoader,
}
