"""Build backend: setuptools, after the kernels are compiled into `uavseg/_jit/libraries` by `build_kernels`.

On Linux with an x86-64 processor a wheel and an editable installation get the library of kernels for this
processor, which takes half a minute. ``UAVSEG_BUILD_KERNELS=all`` makes those for all levels of processors,
for a wheel that goes elsewhere, and an error where it cannot; ``none`` makes none. A wheel with libraries is
tagged for Linux on x86-64, for any Python; one without is pure. On other platforms, and where a library is
missing, numba compiles kernels where they run.
"""

import os
import platform
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

_IMPORTED = ("numpy", "rasterio", "shapely")  # by the modules that define kernels


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_compiler()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    return [*build_meta.get_requires_for_build_editable(config_settings), *_compiler()]


def build_wheel(folder: str, config_settings: Any = None, metadata_folder: str | None = None) -> str:
    _compile_kernels()
    settings = dict(config_settings or {})
    if any((Path(__file__).parent / "uavseg" / "_jit" / "libraries").glob("*.so")):
        given = settings.get("--build-option") or []
        options = [given] if isinstance(given, str) else list(given)
        settings["--build-option"] = [*options, "--plat-name", "linux_x86_64"]
    return build_meta.build_wheel(folder, settings, metadata_folder)


def build_editable(folder: str, config_settings: Any = None, metadata_folder: str | None = None) -> str:
    _compile_kernels()
    return build_meta.build_editable(folder, config_settings, metadata_folder)


def _compiler() -> list[str]:
    """Return the requirements of compiling, with the versions of pyproject.toml."""
    if _choice() == "none":
        return []
    project = tomllib.loads((Path(__file__).parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    imported = [text for text in project["dependencies"] if text.startswith(_IMPORTED)]
    return [*project["optional-dependencies"]["compile"], *imported]


def _choice() -> str:
    """Return which libraries are made: here (for this processor), all or none."""
    choice = os.environ.get("UAVSEG_BUILD_KERNELS") or "here"
    if choice not in ("here", "all", "none"):
        raise SystemExit(f"UAVSEG_BUILD_KERNELS={choice}: expected here, all or none")
    if (sys.platform, platform.machine()) == ("linux", "x86_64"):
        return choice
    if choice == "all":
        raise SystemExit(
            "UAVSEG_BUILD_KERNELS=all: kernels are compiled for all levels on x86-64 Linux alone"
        )
    return "none"


def _compile_kernels() -> None:
    choice = _choice()
    if choice == "none":
        return
    command = [sys.executable, "-m", "build_kernels.libraries", *(["all"] if choice == "all" else [])]
    done = subprocess.run(command, cwd=Path(__file__).parent, check=False)
    if done.returncode == 0:
        return
    if choice == "all":
        raise SystemExit("the kernels could not be compiled, see above")
    print(
        "uavseg: the kernels could not be compiled, see above. The package is built without them: where it "
        'runs it needs numba (pip install "uavseg[compile]"), which compiles a kernel when it is first used.',
        file=sys.stderr,
    )
