"""The fallback: where private parts of numba and llvmlite fail, on untested platforms, and on request."""

import ctypes
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numba.core.caching
import pytest

from uavseg._jit import compiling, messages

ROOT = Path(__file__).resolve().parents[2]


def fails(*arguments: Any, **options: Any) -> Any:
    raise RuntimeError("not on this machine\nand a second line")


BROKEN: dict[str, tuple[Any, str, Any]] = {
    "processor": (llvmlite.binding, "get_host_cpu_features", fails),
    "compiling": (compiling, "_compile", fails),
    "linking": (compiling, "_link", fails),
    "intermediate code": (type(numba.njit(fails)), "inspect_llvm", fails),
    "loading": (llvmlite.binding.ObjectFileRef, "from_data", fails),
    "address": (llvmlite.binding.ExecutionEngine, "get_function_address", lambda engine, name: 0),
    "ctypes": (ctypes, "CFUNCTYPE", fails),
}


@pytest.mark.parametrize("part", BROKEN)
def test_where_a_private_part_fails_numba_runs_the_kernel_and_one_note_says_so(
    cache: Path, notes: list[str], monkeypatch: pytest.MonkeyPatch, part: str, twice: Callable[..., int]
) -> None:
    owner, name, instead = BROKEN[part]
    monkeypatch.setattr(owner, name, instead)
    assert [twice() for _ in range(2)] == [42, 42]
    assert len(notes) == 1 and "\n" not in notes[0]
    assert notes[0].startswith(
        "kernels run through numba.njit, which gives the same results but starts more slowly"
    )
    assert "because no object file could be made of twice (" in notes[0]


def test_a_platform_that_is_not_tested_runs_through_numba(
    cache: Path, notes: list[str], monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    assert twice() == 42
    assert notes == [] and len(list(cache.glob("*.o"))) == 1  # UAVSEG_JIT=objects
    monkeypatch.delenv("UAVSEG_JIT")
    assert [twice() for _ in range(2)] == [42, 42]
    assert len(notes) == 1 and f"because {sys.platform}-riscv64 is not tested" in notes[0]
    assert len(list((cache / "numba").iterdir())) == 1


@pytest.mark.skipif(
    f"{sys.platform}-{platform.machine()}" != "linux-x86_64", reason="the platform that is tested"
)
def test_the_platform_that_is_tested_gets_object_files(
    cache: Path, notes: list[str], monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.delenv("UAVSEG_JIT")
    assert twice() == 42
    assert notes == [] and [path.suffix for path in cache.iterdir()] == [".o"]


def test_the_user_may_choose_numba_and_gets_no_note(
    cache: Path, notes: list[str], monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    assert twice() == 42
    assert notes == [] and [path.name for path in cache.iterdir()] == ["numba"]


def test_an_unknown_choice_is_ignored_with_a_note(
    cache: Path, notes: list[str], monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "fast")
    assert twice() == 42
    assert notes[0] == "UAVSEG_JIT=fast is ignored; expected objects, numba or baseline"


def test_in_python_the_note_is_a_warning(
    cache: Path, monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.setattr(messages, "on_note", None)
    monkeypatch.setattr(compiling, "_compile", fails)
    with pytest.warns(UserWarning, match=r"uavseg: kernels run through numba\.njit") as warned:
        assert [twice() for _ in range(2)] == [42, 42]
    assert len(warned) == 1


def test_a_cache_of_numba_that_fails_is_not_needed(
    cache: Path, monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    monkeypatch.setattr(numba.core.caching, "dumps", fails)
    assert twice() == 42
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


@pytest.mark.slow
def test_the_command_line_prints_the_note_once_and_all_ways_give_the_same_bytes(tmp_path: Path) -> None:
    command = ["divide", str(ROOT / "samples" / "quarry.tif"), "-o", "blocks.tif", "--overwrite"]
    told = run(tmp_path, command, "", ("-c", ON_ANOTHER_PLATFORM))
    assert [line.startswith(NOTE) for line in told.splitlines() if "note" in line] == [True]
    first = (tmp_path / "blocks.tif").read_bytes()
    for choice in ("numba", "objects", ""):  # through numba, compiled here, shipped
        assert "note" not in run(tmp_path, command, choice)
        assert (tmp_path / "blocks.tif").read_bytes() == first, choice


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


WAYS = ("objects", "numba", "", "baseline")  # compiled here, through numba, shipped in two builds


@pytest.mark.slow
@pytest.mark.parametrize(
    "commands, ways",
    [
        (COMMANDS.strip().splitlines(), ("", "baseline")),
        pytest.param(COMMANDS.strip().splitlines(), WAYS, marks=pytest.mark.thorough),
    ],
    ids=["as shipped", "all"],
)
def test_all_ways_to_run_kernels_give_the_same_bytes(
    tmp_path: Path, commands: list[str], ways: tuple[str, ...]
) -> None:
    written: dict[str, dict[str, bytes]] = {}
    for choice in ways:
        folder = tmp_path / "work"  # the same for all: a block map names its folder
        folder.mkdir()
        for line in commands:
            told = run(folder, line.format(samples=ROOT / "samples").split(), choice)
            assert "note: kernels" not in told and "Warning" not in told
        written[choice] = {path.name: path.read_bytes() for path in folder.iterdir()}
        folder.rename(tmp_path / f"way-{choice}")
    first = written[ways[0]]
    assert len(first) >= len(commands) and all(first.values())
    for choice in ways:
        assert first.keys() == written[choice].keys()
        different = [name for name, content in first.items() if content != written[choice][name]]
        assert (choice, different) == (choice, [])
