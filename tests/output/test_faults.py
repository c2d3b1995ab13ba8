"""Commands that are killed, interrupted or out of disk at each system call that changes names.

Whenever that happens, a reader finds the outputs as they were, or all of the new ones, and never some of
both; the same command again gives what an undisturbed one gives, and leaves nothing else.
"""

import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

from uavseg.cli import main

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="processes are forked"),
]
RUNNER = Path(__file__).with_name("fault_runner.py")
COMMANDS = {
    "shp": "extract a.tif --range 0.5,1 -o o.shp",
    "gpkg": "extract a.tif --range 0.5,1 -o o.gpkg",
    "labels": "extract a.tif --range 0.5,1 -o o.geojson --labels o.tif",
    "vrt": "extract a.tif --range 0.5,1 -o o.fgb --labels o.vrt",
    "mission": "extract a.tif --range 0.5,1 -o o.kml --mission o.plan --altitude 60 --home auto",
    "objects": "classify a.tif --stretch dtype -o o.tif --objects o.shp",
    "ros": "classify lens.tif -o o.yaml --objects o.geojson",
    "simulate": "simulate lens --poses 1 -o o.tif --png o.png --truth t.tif",
    "plan": "plan r.geojson --altitude 60 --home auto -o o.plan",
}


def cases(*words: tuple[Any, ...], checked: set[tuple[str, bool]]) -> list[Any]:
    """Words that begin with a name of a command, without older outputs and over some; others are thorough."""
    return [
        pytest.param(
            *one,
            older,
            id="-".join(("there" if older else "absent", *map(str, one))),
            marks=[] if (one[0], older) in checked else pytest.mark.thorough,
        )
        for one in words
        for older in (False, True)
    ]


OTHERS = {  # the same outputs with other content
    "0.5,1": "0,0.4",
    "--stretch dtype": "--stretch dtype --occupied-above 0.7",
    "lens.tif -o": "lens.tif --occupied-above 0.7 --free-below 0.2 -o",
    "--poses 1": "--poses 2",
    "--altitude 60": "--altitude 50",
}
PARTS = {  # by the main file: what a reader takes with it
    "o.shp": ("o.shx", "o.dbf", "o.prj", "o.cpg", "o.qix"),
    "o.vrt": ("o.tiles/0000-0000.tif", "o.vrt.aux.xml"),
    "o.tif": ("o.tif.aux.xml",),
    "o.gpkg": ("o.gpkg-wal",),
    "o.yaml": ("o.pgm",),
}
STALE = ("o.qix", "o.vrt.aux.xml", "o.tif.aux.xml", "o.gpkg-wal")  # of an older output
MAINS = {*PARTS, "o.geojson", "o.fgb", "o.kml", "o.plan", "o.png", "t.tif"}


@dataclass(frozen=True)
class Seen:
    """A run with a fault, and the same command after it."""

    at: int
    code: int
    said: str
    found: dict[str, str]
    again: tuple[int, str] | None = None
    found_again: dict[str, str] | None = None


@dataclass(frozen=True)
class Runs:
    """What is there before a command and after it, and runs with faults."""

    before: dict[str, str]
    after: dict[str, str]
    seen: list[Seen]


def command(name: str) -> list[str]:
    return [*COMMANDS[name].split(), "-q", "--overwrite"]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a raster, a map and regions."""
    folder = tmp_path_factory.mktemp("inputs")
    rng = np.random.default_rng(0)
    image = np.kron(rng.integers(20, 230, (8, 8)), np.ones((20, 20))).astype(np.uint8)
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    with rasterio.open(folder / "a.tif", "w", "GTiff", 160, 160, 1, dtype="uint8", **place) as file:
        file.write(image, 1)
    for words in (
        f"extract {folder}/a.tif --range 0.5,1 -o {folder}/r.geojson",
        f"simulate lens --poses 2 -o {folder}/lens.tif",
    ):
        assert CliRunner().invoke(main, [*words.split(), "-q"]).exit_code == 0
    return folder


@pytest.fixture
def work() -> Iterator[Path]:
    """A folder in memory where there is one, so that hundreds of runs do not wait for a disk."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        yield Path(folder)


def runs(name: str, fault: str, inputs: Path, work: Path, older: bool, numbers: Any = None) -> Runs:
    """Run a command with a fault at each call, or with each of some numbers.

    `older` says whether outputs with other content are there, with files that do not fit the new ones.
    """
    source = work / "source"
    source.mkdir()
    for file in inputs.iterdir():
        (source / file.name).write_bytes(file.read_bytes())
    if older:
        words = COMMANDS[name]
        for one, other in OTHERS.items():
            words = words.replace(one, other)
        run_in(source, [*words.split(), "-q"])
        for stale in STALE:
            if any(stale in parts and (source / main).exists() for main, parts in PARTS.items()):
                (source / stale).write_text("older")
    spec = {
        "source": str(source),
        "work": str(work / "work"),
        "arguments": command(name),
        "fault": fault,
        "numbers": numbers,
    }
    ran = subprocess.run(
        [sys.executable, str(RUNNER)], input=json.dumps(spec), capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    first, *others = map(json.loads, ran.stdout.splitlines())
    return Runs(first["before"], first["after"], [Seen(**one) for one in others])


def run_in(folder: Path, words: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "uavseg", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def shown(found: dict[str, str]) -> dict[str, str]:
    """What a reader sees: what is not in a hidden folder."""
    return {name: content for name, content in found.items() if not name.startswith(".uavseg-")}


def mixtures(runs: Runs, found: dict[str, str]) -> Iterator[str]:
    """Main files of which one is old and another new, or that have parts which are not theirs."""
    present = [name for name in found if name in MAINS]
    for state in (runs.before, runs.after):
        if all(found[name] == state.get(name) for name in present):
            break
    else:
        yield f"{present} are of two runs"
    for name in present:
        files = (name, *PARTS.get(name, ()))
        if not any(
            all(found.get(file) == state.get(file) for file in files) for state in (runs.before, runs.after)
        ):
            yield f"{name} has parts that are not its own"


def assert_changes(runs: Runs) -> None:
    """The fault met more than one call, and the command changes something."""
    assert runs.before != runs.after and len(runs.seen) > 3
    assert not [name for name in runs.after if name.startswith(".uavseg-")]
    assert not [name for name in STALE if name in runs.after]


@pytest.mark.parametrize(
    ("name", "older"),
    cases(
        *((name,) for name in ("shp", "vrt", "gpkg", "labels", "objects", "ros")),
        checked={("shp", False), ("vrt", True)},
    ),
)
def test_a_run_that_is_killed_at_any_call(name: str, inputs: Path, work: Path, older: bool) -> None:
    found = runs(name, "SIGKILL", inputs, work, older)
    assert_changes(found)
    for seen in found.seen[:-1]:
        assert seen.code == -signal.SIGKILL
        assert list(mixtures(found, shown(seen.found))) == [], seen
        assert seen.again == [0, ""] and seen.found_again == found.after, seen
    assert found.seen[-1].code == 0 and found.seen[-1].found == found.after


@pytest.mark.parametrize(
    ("name", "older"),
    cases(
        *((name,) for name in ("shp", "simulate", "vrt", "objects", "plan")),
        checked={("shp", True), ("simulate", False)},
    ),
)
def test_an_error_at_any_call_leaves_everything_as_it_was(
    name: str, inputs: Path, work: Path, older: bool
) -> None:
    found = runs(name, "error", inputs, work, older)
    assert_changes(found)
    assert any(seen.code == 1 for seen in found.seen)
    for seen in found.seen:
        assert seen.found == (found.before if seen.code else found.after), seen
        if seen.code:
            assert seen.code == 1 and seen.said.startswith("uavseg: error: "), seen
            assert seen.said.count("\n") == 1 and "No space left on device" in seen.said


@pytest.mark.parametrize(
    ("name", "fault", "code", "word", "older"),
    cases(
        ("shp", "SIGTERM", 143, "terminated"),
        ("vrt", "SIGINT", 130, "interrupted"),
        ("plan", "SIGINT", 130, "interrupted"),
        checked={("shp", False), ("vrt", True), ("plan", True)},
    ),
)
def test_a_signal_at_any_call_leaves_all_or_nothing_and_tells_which(
    name: str, fault: str, code: int, word: str, inputs: Path, work: Path, older: bool
) -> None:
    found = runs(name, fault, inputs, work, older)
    assert_changes(found)
    for seen in found.seen[:-1]:
        assert seen.code == code, seen
        if seen.said == f"uavseg: {word}; nothing was written\n":
            assert seen.found == found.before, seen
        else:
            assert seen.said.startswith(f"uavseg: {word}; o.") and seen.said.endswith(" written\n"), seen
            assert seen.found == found.after, seen


@pytest.mark.parametrize(
    ("name", "older"),
    cases(*((name,) for name in COMMANDS), checked={("shp", True), ("vrt", False), ("ros", True)}),
)
def test_a_disk_that_is_full_after_any_size_leaves_everything_as_it_was(
    name: str, inputs: Path, work: Path, older: bool
) -> None:
    sizes = [0, 1, 10, 100, 200, 400, 600, 800, 1000, 1500, 2000, 3000, 5000, 8000, 20000, 50000, 90000]
    found = runs(name, "size", inputs, work, older, sizes)
    assert any(seen.code == 1 for seen in found.seen)
    for seen in found.seen:
        assert seen.found == (found.before if seen.code else found.after), seen
        assert seen.code in (0, 1), seen
