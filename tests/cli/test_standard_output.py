"""Standard output that is full or closed, and no home: one line each."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio

COMMANDS = {
    "info": ("info", "a.tif"),
    "suggest": ("suggest", "a.tif", "--json"),
    "extract": ("extract", "a.tif", "--range", "0.5,1", "-o", "-", "-q"),
    "path": ("path", "a.tif", "--range", "0,1", "--start", "10,50", "--goal", "90,60", "-o", "-", "-q"),
    "help": ("--help",),
    "version": ("--version",),
}
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full does not exist"),
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> Path:
    pixels = np.kron(np.array([[0, 200], [90, 30]], np.uint8), np.ones((32, 32), np.uint8))
    how = {"crs": "EPSG:32633", "transform": rasterio.Affine(2, 0, 0, 0, -2, 128)}
    with rasterio.open(tmp_path / "a.tif", "w", "GTiff", 64, 64, 1, dtype="uint8", **how) as file:
        file.write(pixels, 1)
    return tmp_path


def run(folder: Path, *words: str, **how: object) -> tuple[int, list[str]]:
    command = [sys.executable, "-m", "uavseg", *words]
    done = subprocess.run(command, cwd=folder, stderr=subprocess.PIPE, text=True, check=False, **how)  # type: ignore[call-overload]
    lines = [line for line in done.stderr.splitlines() if not line.startswith("uavseg: compiling")]
    return done.returncode, lines


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk_behind_standard_output_is_one_line(folder: Path, name: str) -> None:
    with Path("/dev/full").open("w") as full:
        code, lines = run(folder, *COMMANDS[name], stdout=full)
    assert code == 1
    [line] = lines
    assert line.startswith("uavseg: error: ") and line.endswith("No space left on device")


@pytest.mark.parametrize("name", ["info", "suggest", "extract", "path"])
def test_a_reader_that_left_is_one_line(folder: Path, name: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    code, lines = run(folder, *COMMANDS[name], stdout=writing)
    os.close(writing)
    assert (code, lines) == (
        1,
        ["uavseg: error: the standard output cannot be written to: its reader closed it"],
    )


@pytest.mark.parametrize("name", ["info", "suggest", "extract", "path"])
def test_closed_standard_output_is_one_line(folder: Path, name: str) -> None:
    code, lines = run(folder, *COMMANDS[name], preexec_fn=lambda: os.close(1))
    assert (code, len(lines)) == (1, 1)
    assert "standard output is closed" in lines[0]


def test_without_a_home_a_picture_is_drawn_and_nothing_else_said(folder: Path) -> None:
    cache = os.environ.get("UAVSEG_CACHE") or str(Path("~/.cache/uavseg").expanduser())
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    environment = kept | {"HOME": "/proc", "XDG_CACHE_HOME": "/proc", "UAVSEG_CACHE": cache}
    code, lines = run(folder, "preview", "a.tif", "-o", "p.png", env=environment)
    assert (code, lines) == (0, ["wrote p.png"])
    assert (folder / "p.png").exists()


def test_too_little_memory_for_the_libraries_is_one_line(folder: Path) -> None:
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (240_000 << 10,) * 2)

    code, lines = run(folder, "info", "a.tif", preexec_fn=limit, stdout=subprocess.DEVNULL)
    assert code == 1
    assert lines[-1].startswith("uavseg: error: ")
    assert not any("Traceback" in line for line in lines)
