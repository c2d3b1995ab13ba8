"""Runs that are killed, interrupted or out of disk, and rasters that are damaged in places."""

import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, RasterReadError

pytestmark = pytest.mark.slow

SIDE, BLOCK = 640, 64
FINE = ("--tile", 64)
RANGE = ("--range", "0.5,1")
PATIENCE_S = 60  # how long a test waits for what must happen


def patches(seed: int = 0, side: int = SIDE) -> np.ndarray:
    rng = np.random.default_rng(seed)
    coarse = np.kron(rng.integers(20, 230, (side // 20, side // 20)), np.ones((20, 20)))
    return (np.clip(coarse + rng.normal(0, 9, coarse.shape), 1, 255) * 200).astype(np.uint16)


def write(path: Path, image: np.ndarray, col: int = 0) -> Path:
    rows, cols = image.shape
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5 + 2 * col, 0, -2, 5e6), "nodata": 0}
    how = place | {"tiled": True, "blockxsize": BLOCK, "blockysize": BLOCK, "compress": "deflate"}
    with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype=image.dtype.name, **how) as file:
        file.write(image, 1)
    return path


def spoil(path: Path, row: int, col: int) -> None:
    """Overwrite bytes of one block, given by its row and column of blocks."""
    with rasterio.open(path) as file:
        offset = int(file.get_tag_item(f"BLOCK_OFFSET_{col}_{row}", "TIFF", bidx=1))
        size = file.block_size(1, row, col)
    data = bytearray(path.read_bytes())
    data[offset + 2 : offset + size] = bytes(size - 2)
    path.write_bytes(data)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with one raster."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.tif", patches())
    return tmp_path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, list(map(str, arguments)))


def done(*arguments: object) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result


def files() -> set[str]:
    return {path.name for path in Path().iterdir()}


def program(*arguments: object, script: str = "", **how: Any) -> subprocess.Popen[str]:
    python = [sys.executable, *(("-c", script) if script else ("-m", "uavseg"))]
    command = [*python, *map(str, arguments)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, **how)


SLOW = """
import time
from uavseg.cli import main
from uavseg.cli.terminal.say import Reporter
tell = Reporter.progress
def tell_slowly(self, done, total):
    tell(self, done, total)
    if 100 * done // total >= {percent}:
        time.sleep(0.3)
Reporter.progress = tell_slowly
main(prog_name="uavseg")
"""  # from some progress on, so that a signal meets the program at work


def stopped(percent: int, by: signal.Signals, *arguments: object) -> tuple[int, str]:
    """Exit code of a program that gets a signal once it tells this much progress, and what it said then."""
    with program(*arguments, "--progress", "plain", script=SLOW.format(percent=percent)) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("progress ") and int(line.split()[1]) >= percent:
                process.send_signal(by)
                break
        said = process.stderr.read()
        return process.wait(PATIENCE_S), "".join(
            line for line in said.splitlines(True) if not line.startswith("progress ")
        )


def resumed(result: Result) -> list[tuple[str, int, int]]:
    """Stage, tiles that were done before, and of how many."""
    lines = [line.split() for line in result.stderr.splitlines() if line.startswith("resumed: ")]
    return [(line[-1].strip("()"), int(line[1]), int(line[3])) for line in lines]


# Killed

EXTRACT = ("extract", "a.tif", *RANGE, "--tile", 128)


@pytest.mark.parametrize(("percent", "threads"), [(20, 1), (80, 2)])
def test_a_killed_run_goes_on_where_it_stopped_and_ends_with_the_same_bytes(
    percent: int, threads: int
) -> None:
    done(*EXTRACT, "-o", "whole.gpkg", "--labels", "whole.tif")
    before = files()
    how = (
        *EXTRACT,
        *FINE,
        "-o",
        "out.gpkg",
        "--labels",
        "labels.tif",
        "--resume",
        "kept",
        "--threads",
        threads,
    )
    code, said = stopped(percent, signal.SIGKILL, *how)
    assert code == -signal.SIGKILL and said == ""
    assert files() == before | {"kept"}
    stages = resumed(done(*how))
    for _, were_done, total in stages[:-1]:
        assert were_done == total
    assert stages and stages[-1][1] < 100
    assert Path("out.gpkg").read_bytes() == Path("whole.gpkg").read_bytes()
    assert Path("labels.tif").read_bytes() == Path("whole.tif").read_bytes()


def test_a_killed_division_goes_on_too() -> None:
    done("divide", "a.tif", "--tile", 64, "-o", "whole.tif")
    how = ("divide", "a.tif", "--tile", 64, "-o", "out.tif", "--resume", "kept")
    assert stopped(70, signal.SIGKILL, *how)[0] == -signal.SIGKILL
    stages = resumed(done(*how))
    assert [name for name, *_ in stages[:2]] == ["count_upper", "measure"] and stages[0][1:] == (100, 100)
    assert Path("out.tif").read_bytes() == Path("whole.tif").read_bytes()


def test_another_range_finds_the_raster_measured_and_another_tile_does_not() -> None:
    done(*EXTRACT, "--refine", "scan", "-o", "first.fgb", "--resume", "kept")
    other = ("extract", "a.tif", "--range", "0.2,0.4", "--refine", "scan")
    stages = resumed(done(*other, "--tile", 128, "-o", "second.fgb", "--resume", "kept"))
    assert [stage for stage in stages if stage[1]] == [("count_upper", 25, 25), ("measure", 25, 25)]
    stages = resumed(done(*other, "--tile", 192, "-o", "third.fgb", "--resume", "kept"))
    assert not {name for name, *_ in stages} & {"count_upper", "measure", "outline"}
    done(*other, "-o", "fresh.fgb")
    assert len({Path(f"{name}.fgb").read_bytes() for name in ("second", "third", "fresh")}) == 1


def test_a_raster_that_changed_is_worked_through_again() -> None:
    done(*EXTRACT, "-o", "first.fgb", "--resume", "kept")
    write(Path("a.tif"), patches(1))
    assert resumed(done(*EXTRACT, "-o", "second.fgb", "--resume", "kept")) == []
    done(*EXTRACT, "-o", "fresh.fgb")
    assert Path("second.fgb").read_bytes() == Path("fresh.fgb").read_bytes() != Path("first.fgb").read_bytes()


def test_threads_may_change_from_run_to_run() -> None:
    done(*EXTRACT, "-o", "first.fgb", "--resume", "kept", "--fill-holes", "50px")
    again = ("-o", "second.fgb", "--resume", "kept", "--fill-holes", "50px", "--threads", 3)
    stages = resumed(done(*EXTRACT, *again))
    assert len(stages) == 3 and all(were_done == total for _, were_done, total in stages)
    assert Path("second.fgb").read_bytes() == Path("first.fgb").read_bytes()


def test_a_block_map_s_raster_is_refined_with_what_was_kept() -> None:
    done("divide", "a.tif", "-o", "map.tif")
    how = ("extract", "map.tif", *RANGE, "--tile", 128, "--resume", "kept")
    done(*how, "-o", "first.fgb")
    assert resumed(done(*how, "-o", "second.fgb")) == [("outline", 25, 25)]
    assert Path("second.fgb").read_bytes() == Path("first.fgb").read_bytes()


def test_quiet_does_not_tell_what_was_resumed() -> None:
    for name in ("first.fgb", "second.fgb"):
        assert done(*EXTRACT, "-o", name, "--resume", "kept", "-q").stderr == ""


def test_what_cannot_be_resumed_from_is_refused() -> None:
    Path("file").write_text("mine")
    result = run(*EXTRACT, "-o", "out.fgb", "--resume", "file")
    assert result.exit_code == 1
    assert result.stderr == "uavseg: error: the folder file to resume from cannot be created: it is a file\n"
    assert files() == {"a.tif", "file"} and Path("file").read_text() == "mine"


def test_the_words_of_python_resume_too(folder: Path) -> None:
    plain = uavseg.extract("a.tif", range=(0.5, 1))
    for _ in range(2):
        again = uavseg.extract("a.tif", range=(0.5, 1), resume=folder / "kept", threads=2)
        assert again.equals(plain) and again.crs == plain.crs
    kept = {path: path.stat().st_mtime_ns for path in Path("kept").rglob("*.npz")}
    blocks = uavseg.divide("a.tif", resume="kept")
    stages = [path.name.split("-")[0] for path in Path("kept").iterdir()]
    assert sorted(stages) == ["count_upper", "divide", "measure", "outline"]
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert np.array_equal(blocks.ratios, uavseg.divide("a.tif").ratios)


def test_an_array_cannot_be_resumed() -> None:
    rioxarray = pytest.importorskip("rioxarray")
    with pytest.raises(ParameterError, match="to resume, give the file"):
        uavseg.extract(rioxarray.open_rasterio("a.tif"), range=(0.5, 1), resume="kept")


# Interrupted


@pytest.mark.parametrize(("threads", "extra"), [(1, ()), (2, ()), (2, ("--resume", "kept"))])
def test_an_interrupted_run_leaves_nothing_but_what_is_kept(threads: int, extra: tuple[str, ...]) -> None:
    how = (*EXTRACT, *FINE, "-o", "out.gpkg", "--labels", "labels.tif", "--threads", threads, *extra)
    kept = "; finished tiles are kept in kept" if extra else ""
    assert stopped(30, signal.SIGINT, *how) == (130, f"uavseg: interrupted; nothing was written{kept}\n")
    assert files() == {"a.tif", *extra[1:]}
    assert list(Path().rglob(".*")) == []  # no temporary folder of a file either


@pytest.mark.parametrize(
    ("by", "word"), [(signal.SIGTERM, "terminated"), (getattr(signal, "SIGHUP", None), "hung up")]
)
@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends a program without asking it")
def test_a_terminated_run_cleans_up_like_an_interrupted_one(by: signal.Signals, word: str) -> None:
    if signal.getsignal(by) is signal.SIG_IGN:
        pytest.skip(f"{by.name} is ignored here, as by nohup, and so it is by a run")
    how = (*EXTRACT, *FINE, "-o", "out.gpkg", "--labels", "labels.tif", "--threads", 2)
    assert stopped(30, by, *how) == (128 + by, f"uavseg: {word}; nothing was written\n")
    assert files() == {"a.tif"}


IGNORING = """
import os, signal, sys
signal.signal(signal.SIGHUP, signal.SIG_IGN)
from uavseg.cli import main
from uavseg.cli.terminal.say import Reporter
Reporter.begin = lambda *_: os.kill(os.getpid(), signal.SIGHUP)
main(prog_name="uavseg")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGHUP")
def test_a_signal_that_is_ignored_as_by_nohup_stays_ignored() -> None:
    with program(*EXTRACT, "-q", "-o", "out.fgb", script=IGNORING) as process:
        assert process.wait(PATIENCE_S) == 0
    assert files() == {"a.tif", "out.fgb"}


def test_nothing_goes_to_stdout_where_labels_cannot_be_written() -> None:
    done(*EXTRACT, "-q", "-o", "whole.fgb", "--labels", "whole.tif")
    size = Path("whole.tif").stat().st_size - 1
    before = files()
    command = [*map(str, EXTRACT), "-q", "-o", "-", "--labels", "labels.tif"]
    resource = pytest.importorskip("resource", reason="only Unix limits the size of files")
    ran = subprocess.run(
        [sys.executable, "-m", "uavseg", *command],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )
    assert ran.returncode == 1 and ran.stdout == ""
    assert files() == before


# Out of disk


def limited(size: int, *arguments: object) -> tuple[int, str]:
    """Exit code and words of a program that may write files of so many bytes at most."""
    resource = pytest.importorskip("resource", reason="only Unix limits the size of files")

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    with program(*arguments, preexec_fn=limit) as process:
        return process.wait(PATIENCE_S), process.stderr.read()  # type: ignore[union-attr]


def assert_told(outcome: tuple[int, str]) -> None:
    code, said = outcome
    assert code == 1
    others = ("_tiff", "uavseg: compiling")  # the first is libtiff's own word
    lines = [line for line in said.splitlines() if not line.startswith(others)]
    assert len(lines) == 1 and lines[0].startswith("uavseg: error: ")
    assert "cannot" in lines[0] and len(lines[0]) < 300


@pytest.mark.parametrize(
    "arguments",
    [
        ("divide", "a.tif", "-o", "map.tif"),
        (*EXTRACT, "-o", "out.fgb"),
        (*EXTRACT, "-o", "-", "--labels", "labels.tif"),
        ("preview", "a.tif", "-o", "a.png"),
    ],
)
def test_a_disk_that_is_full_is_reported_in_one_line(arguments: tuple[object, ...]) -> None:
    assert_told(limited(800, *arguments, "-q"))
    assert files() == {"a.tif"}


def test_so_it_is_for_what_is_kept_and_the_run_goes_on_with_more_room() -> None:
    how = (*EXTRACT, "-q", "-o", "out.fgb", "--resume", "kept")
    assert_told(limited(1500, *how))
    assert files() == {"a.tif", "kept"} and list(Path("kept").rglob(".*")) == []
    done(*how)
    done(*EXTRACT, "-o", "whole.fgb")
    assert Path("out.fgb").read_bytes() == Path("whole.fgb").read_bytes()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_so_it_is_for_standard_output() -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "uavseg", *map(str, EXTRACT), "-o", "-", "-q"]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert_told((result.returncode, result.stderr))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize(
    "words",
    [
        ("suggest", "a.tif", "-o", "a.png"),
        (*EXTRACT, "-o", "-", "--labels", "labels.tif"),
        (*EXTRACT, "-o", "-", "--mission", "fly.plan", "--altitude", 60, "--home", "auto"),
    ],
)
def test_no_file_appears_where_standard_output_cannot_be_written(words: tuple[object, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "uavseg", *map(str, words)]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert result.returncode != 0 and files() == {"a.tif"}


# Damaged in places

BAD = [(1, 2), (4, 4), (9, 0)]
WARNINGS = [
    f"uavseg: warning: a.tif cannot be read in rows {row} to {row + 64}, columns {col} to {col + 64}: "
    "its pixels there count as nodata"
    for row, col in ((64 * r, 64 * c) for r, c in BAD)
]


def with_holes(image: np.ndarray) -> np.ndarray:
    holed = image.copy()
    for row, col in BAD:
        holed[row * 64 : row * 64 + 64, col * 64 : col * 64 + 64] = 0
    return holed


def damaged(path: str = "a.tif") -> None:
    for block in BAD:
        spoil(Path(path), *block)


@pytest.mark.parametrize("command", ["extract", "divide", "info", "preview"])
@pytest.mark.parametrize("threads", [1, 3])
def test_a_damaged_raster_is_an_error_that_names_file_and_block(command: str, threads: int) -> None:
    damaged()
    options = {"extract": (*RANGE, "--tile", 64), "divide": ("-o", "map.tif"), "info": (), "preview": ()}[
        command
    ]
    working = () if command == "preview" else ("--threads", threads)
    result = run(command, "a.tif", *options, *working)
    assert result.exit_code == 1 and result.stdout == "" and len(result.stderr.splitlines()) == 1
    assert "a.tif cannot be read in rows 64 to 128, columns 128 to 192 (" in result.stderr
    assert "--skip-bad-tiles" in result.stderr and files() == {"a.tif"}


@pytest.mark.parametrize(("tile", "threads"), [(64, 3), (192, 1), (256, 3), (1024, 1)])
def test_skipped_blocks_are_nodata_and_listed_in_order(folder: Path, tile: int, threads: int) -> None:
    (folder / "holed").mkdir()
    write(folder / "holed" / "a.tif", with_holes(patches()))
    damaged()
    with chdir("holed"):  # a file of regions holds the name of its raster
        done("extract", "a.tif", *RANGE, "-o", "../holed.gpkg", "--labels", "../holed.tif")
    how = ("--skip-bad-tiles", "--tile", tile, "--threads", threads)
    result = done("extract", "a.tif", *RANGE, *how, "-o", "out.gpkg", "--labels", "labels.tif")
    assert [line for line in result.stderr.splitlines() if "warning" in line] == WARNINGS
    assert Path("out.gpkg").read_bytes() == Path("holed.gpkg").read_bytes()
    assert Path("labels.tif").read_bytes() == Path("holed.tif").read_bytes()


def test_every_command_that_reads_can_skip_them(folder: Path) -> None:
    damaged()
    listed: Callable[[Result], bool] = lambda result: all(line in result.stderr for line in WARNINGS)  # noqa: E731
    assert listed(done("divide", "a.tif", "-o", "map.tif", "--skip-bad-tiles"))
    assert listed(done("preview", "a.tif", "--skip-bad-tiles", "-o", "a.png"))
    told = done("info", "a.tif", "--skip-bad-tiles", "--json").stdout
    assert all(line.removeprefix("uavseg: warning: ") in told for line in WARNINGS)
    done("extract", "map.tif", *RANGE, "--skip-bad-tiles", "-o", "of_map.fgb")
    done("extract", "a.tif", *RANGE, "--skip-bad-tiles", "-o", "of_raster.fgb")
    assert Path("of_map.fgb").read_bytes() == Path("of_raster.fgb").read_bytes()


def test_a_resumed_run_lists_them_too() -> None:
    damaged()
    how = ("extract", "a.tif", *RANGE, "--tile", 256, "--skip-bad-tiles", "--resume", "kept")
    first, second = (done(*how, "-o", name).stderr.splitlines() for name in ("first.fgb", "second.fgb"))
    assert [line for line in first if "warning" in line] == WARNINGS
    assert [line for line in second if "warning" in line] == WARNINGS
    assert Path("second.fgb").read_bytes() == Path("first.fgb").read_bytes()


def test_a_run_that_failed_at_a_bad_block_goes_on_when_the_file_is_mended() -> None:
    whole = Path("a.tif").read_bytes()
    damaged()
    assert run(*EXTRACT, "--resume", "kept", "-o", "out.fgb").exit_code == 1
    Path("a.tif").write_bytes(whole)
    done(*EXTRACT, "--resume", "kept", "-o", "out.fgb")
    done(*EXTRACT, "-o", "fresh.fgb")
    assert Path("out.fgb").read_bytes() == Path("fresh.fgb").read_bytes()


def test_the_words_of_python_skip_and_warn() -> None:
    damaged()
    with pytest.raises(RasterReadError, match="rows 64 to 128, columns 128 to 192"):
        uavseg.extract("a.tif", range=(0.5, 1))
    with pytest.warns(UserWarning, match="count as nodata") as told:
        regions = uavseg.extract("a.tif", range=(0.5, 1), skip_bad_tiles=True)
    assert [str(one.message) for one in told if "nodata" in str(one.message)] == [
        line.removeprefix("uavseg: warning: ") for line in WARNINGS
    ]
    with pytest.warns(UserWarning, match="count as nodata"):
        blocks = uavseg.divide(uavseg.Dataset.open("a.tif"), skip_bad_tiles=True)
    write(Path("a.tif"), with_holes(patches()))
    assert regions.equals(uavseg.extract("a.tif", range=(0.5, 1)))
    assert np.array_equal(blocks.counts, uavseg.divide("a.tif").counts)


@pytest.mark.parametrize(
    ("word", "how"),
    [
        ("extract", {"range": (0.5, 1)}),
        ("levels", {"width": 0.5}),
        ("divide", {}),
        ("match", {"like": (400_940.0, 4_999_940.0, 90.0)}),
        # patches of any grey are no separate classes
        pytest.param("suggest", {}, marks=pytest.mark.filterwarnings("ignore:the classes overlap")),
        ("classify", {}),
        ("path", {"range": (0, 1), "start": (400_021, 4_999_979), "goal": (400_091, 4_999_979)}),
    ],
)
def test_every_word_of_python_warns_whoever_called_it(word: str, how: dict[str, Any]) -> None:
    damaged()
    dataset = uavseg.Dataset.open("a.tif", skip_bad_tiles=True)
    with pytest.warns(UserWarning, match="count as nodata") as told:
        getattr(uavseg, word)(dataset, **how, tile=256)
    lost = [one for one in told if "count as nodata" in str(one.message)]
    assert [f"uavseg: warning: {one.message}" for one in lost] == WARNINGS
    assert {one.filename for one in lost} == {__file__}
