"""Warming: every kernel is found, and those that are not shipped are compiled by several processes."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

import uavseg
from uavseg._jit import shipped, warming
from uavseg._jit.kernels import Kernel

ROOT = Path(uavseg.__file__).resolve().parents[1]
SMALL = (
    "raster.intensity.stretch._count_u1",
    "regions.outline.rings._gather",
    "flight.avoid.free_space._relax",
)


def test_every_kernel_of_the_package_is_found() -> None:
    found = warming.all_kernels()
    made = {
        kernel
        for kernel in gc.get_objects()
        if type(kernel) is Kernel and kernel.function.__module__.startswith("uavseg.")
    }
    assert made == set(found.values())
    files = [path for path in (ROOT / "uavseg").rglob("*.py") if "_jit" not in path.parts]
    assert sum(path.read_text(encoding="utf-8").count("kernel(") for path in files) >= len(found) > 80


@pytest.mark.slow
@pytest.mark.parametrize("way", ["objects", "numba"])
def test_processes_compile_what_is_not_there_and_later_ones_find_it(way: str, tmp_path: Path) -> None:
    program = (
        "from uavseg._jit import warming; "
        f"found = {{name: kernel for name, kernel in warming.all_kernels().items() if name in {SMALL}}}; "
        "steps = []; counts = warming.warm(found, 2, steps.append); "
        "print(dict(counts), steps == sorted(steps), steps[-1])"
    )
    env = {**os.environ, "UAVSEG_CACHE": str(tmp_path), "UAVSEG_JIT": way, "PYTHONPATH": str(ROOT)}
    said = [
        subprocess.run(
            [sys.executable, "-c", program], env=env, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert said == [
        "{'shipped': 0, 'kept': 0, 'compiled': 3} True 3\n",
        "{'shipped': 0, 'kept': 3, 'compiled': 0} True 3\n",
    ]


@pytest.mark.skipif(not shipped.runs_here(), reason="nothing is shipped")
def test_what_is_shipped_is_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("UAVSEG_JIT")
    found = {
        name: Kernel(kernel.function, kernel.signature) for name, kernel in warming.all_kernels().items()
    }
    steps: list[int] = []
    assert warming.warm(found, 2, steps.append) == {"shipped": len(found), "kept": 0, "compiled": 0}
    assert steps[-1] == len(found)
