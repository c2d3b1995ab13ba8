"""Folders of rasters on the command line: a mosaic, or each by itself in one process."""

import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from rasterio.errors import NotGeoreferencedWarning

from uavseg.cli import main
from uavseg.execution.progress_bar import Amount, bar


def write(path: str, seed: int, col: int = 0, placed: bool = True) -> None:
    rng = np.random.default_rng(seed)
    image = np.kron(rng.integers(1, 255, (4, 4)), np.ones((24, 24))).astype(np.uint8)
    where = Affine(2, 0, 4e5, 0, -2, 5e6) @ Affine.translation(col, 0)
    place = {"crs": "EPSG:32618", "transform": where} if placed else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", "GTiff", 96, 96, 1, dtype="uint8", **place) as file:
            file.write(image, 1)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("tiles", "out"):
        Path(name).mkdir()
    for number in range(4):
        write(f"tiles/{number}.tif", number, 96 * number)


def run(*words: str, given: str | None = None) -> Result:
    return CliRunner().invoke(main, list(words), input=given)


EACH = ("--each", "--range", "0.5,1")


def outputs() -> list[str]:
    return sorted(os.listdir("out"))  # noqa: PTH208


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "suffix"),
    [
        pytest.param(("extract", "--range", "0.5,1"), "gpkg", marks=pytest.mark.slow),
        (("extract", "--range", "0.5,1", "--min-area", "50px", "--smooth-outline", "0.5"), "geojson"),
        pytest.param(("levels", "--width", "0.3"), "parquet", marks=pytest.mark.slow),
        pytest.param(
            ("match", "--like", "400096,4999904,70", "--similarity", "0.2", "--intensity", "inf"),
            "fgb",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_one_command_gives_the_bytes_of_many(words: tuple[str, ...], suffix: str) -> None:
    command, *how = words
    sources = ["tiles/0.tif", "tiles/1.tif"] if command == "match" else ["tiles"]
    if command == "match":
        write("tiles/1.tif", 1)  # the sample lies on both
    result = run(
        command, *sources, "--each", *how, "-o", f"out/{{stem}}.{suffix}", "--labels", "out/{stem}.tif"
    )
    assert result.exit_code == 0, result.output
    assert len(outputs()) == 2 * (2 if command == "match" else 4)
    for name in outputs():
        if name.endswith(f".{suffix}"):
            stem = Path(name).stem
            line = [command, f"tiles/{stem}.tif", *how, "-o", f"alone.{suffix}", "--labels", "alone.tif"]
            assert run(*line, "--overwrite").exit_code == 0
            assert Path("out", name).read_bytes() == Path(f"alone.{suffix}").read_bytes()
            assert Path("out", f"{stem}.tif").read_bytes() == Path("alone.tif").read_bytes()


@pytest.mark.slow
def test_a_folder_without_each_is_a_mosaic() -> None:
    whole = run("extract", "tiles", "--range", "0.5,1", "-o", "-").stdout
    names = [f"tiles/{number}.tif" for number in range(4)]
    assert whole == run("extract", *names, "--range", "0.5,1", "-o", "-").stdout
    assert whole == run("extract", "tiles/*.tif", "--range", "0.5,1", "-o", "-").stdout
    Path("list.txt").write_text("\n".join(names))
    assert whole == run("extract", "@list.txt", "--range", "0.5,1", "-o", "-").stdout
    assert whole == run("extract", "-", "--range", "0.5,1", "-o", "-", given="\n".join(names)).stdout
    assert whole.count('"type":"Feature",') > 2
    assert "tile" in run("info", "tiles").stdout
    assert (
        run("extract", "tiles", "--range", "0.5,1").exit_code == 0 and Path("tiles.regions.geojson").exists()
    )
    assert "-o tiles.0-" in run("suggest", "tiles/").stdout


@pytest.mark.slow
def test_failures_are_listed_at_the_end_and_the_others_written() -> None:
    Path("tiles/1.tif").write_bytes(b"no raster")
    write("tiles/2.tif", 2, placed=False)
    write("tiles/3.tif", 3, placed=False)
    result = run("extract", "tiles", *EACH, "-o", "out/{stem}.gpkg", "--report", "out/report.csv")
    assert result.exit_code == 1
    *_, table, last = result.stderr.splitlines()
    assert last.startswith("uavseg: error: tiles/1.tif cannot be opened as a raster")
    assert table.startswith("  seconds") and "  rasters     3 of 4 -> out/{stem}.gpkg" in result.stderr
    assert outputs() == ["0.gpkg", "2.gpkg", "3.gpkg", "report.csv"]
    report = Path("out/report.csv").read_text().splitlines()
    assert report[0] == "source,output,regions,area_m2,warnings,error" and len(report) == 5
    assert run("extract", "tiles", *EACH, "-o", "out/{stem}.fgb", "-q").stderr == f"{last}\n"


def test_equal_warnings_are_said_once() -> None:
    result = run("extract", "tiles", "--each", "--range", "0.9999,1", "-o", "out/{stem}.geojson")
    [line] = [line for line in result.stderr.splitlines() if "warning" in line]
    assert line.startswith("uavseg: warning: tiles/0.tif and 3 others: no region has a mean v in 0.9999..1")


@pytest.mark.slow
def test_nothing_is_overwritten_and_what_is_done_can_be_left_out() -> None:
    assert run("extract", "tiles/1.tif", *EACH, "-o", "out/{stem}.gpkg").exit_code == 0
    before = Path("out/1.gpkg").stat()
    result = run("extract", "tiles", *EACH, "-o", "out/{stem}.gpkg")
    assert result.exit_code == 1 and "out/1.gpkg exists (1 of 4 outputs do)" in result.stderr
    assert outputs() == ["1.gpkg"]
    result = run("extract", "tiles", *EACH, "-o", "out/{stem}.gpkg", "--skip-existing")
    assert result.exit_code == 0 and "  left out    1, whose outputs are there" in result.stderr
    assert len(outputs()) == 4 and Path("out/1.gpkg").stat() == before
    assert run("extract", "tiles", *EACH, "-o", "out/{stem}.gpkg", "--overwrite").exit_code == 0
    assert Path("out/1.gpkg").stat().st_ino != before.st_ino


def test_outputs_have_names_without_being_asked() -> None:
    assert run("levels", "tiles", "--each", "--width", "0.5").exit_code == 0
    assert sorted(path.name for path in Path().glob("*.geojson")) == [f"{n}.levels.geojson" for n in range(4)]


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (("-o", "-"), 2, "--each writes files"),
        (("-o", "out/{stem}.gpkg", "--mission", "fly.plan"), 2, "--mission is for one source"),
        (("-o", "out/{stem}.gpkg", "--resume", "done"), 2, "--resume is for one source"),
        (("-o", "out/{stem}.gpkg", "--scheduler", "tcp://h:1"), 2, "--scheduler is for one source"),
        (("-o", "out/{stem}.gpkg", "--rs"), 2, "are for -o -"),
        (("-o", "out/all.gpkg"), 1, "tiles/0.tif and tiles/1.tif would both be written to out/all.gpkg"),
        (("-o", "out/{steam}.gpkg"), 1, "{steam} is unknown"),
        (("-o", "out/{stem}.gpkg", "--threads", "0"), 1, "the number of threads is at least 1"),
        (("-o", "out/{stem}.gpkg", "--report", "out/r.txt"), 1, "a report is written to .csv"),
        (("-o", "none/{stem}.gpkg"), 1, "the folder none does not exist"),
    ],
)
def test_what_does_not_go_with_each(words: tuple[str, ...], code: int, text: str) -> None:
    result = run("extract", "tiles", *EACH, *words)
    assert result.exit_code == code and text in result.stderr and outputs() == []


@pytest.mark.parametrize("word", [("--report", "r.csv"), ("--skip-existing",)])
def test_what_goes_only_with_each(word: tuple[str, ...]) -> None:
    result = run("extract", "tiles", "--range", "0.5,1", *word)
    assert result.exit_code == 2 and "give it with --each" in result.stderr


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("out", "out is a folder without rasters"),
        ("x*.tif", "no file matches x*.tif"),
        ("@none.txt", "there is no file none.txt"),
        ("-", "the standard input names no rasters"),
    ],
)
@pytest.mark.parametrize(
    "command",
    [("extract", *EACH), ("extract", "--range", "0.5,1"), ("info",), ("divide", "-o", "b.tif")],
)
def test_names_without_rasters_are_one_line(command: tuple[str, ...], name: str, text: str) -> None:
    result = run(*command, name, given="")
    assert result.exit_code == 1 and text in result.stderr
    assert result.stderr.startswith("uavseg: error: ") and result.stderr.count("\n") == 1


def test_the_bar_counts_rasters() -> None:
    line = bar(0.25, 60, Amount(200, 0, "rasters"))
    assert line == "[######..................]  25 %  50/200 rasters  3:00 left"


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_says_what_was_written_and_what_not() -> None:
    for number in range(4, 400):
        os.link("tiles/0.tif", f"tiles/{number}.tif")
    line = [
        sys.executable,
        "-m",
        "uavseg",
        "extract",
        "tiles",
        *EACH,
        "-o",
        "out/{stem}.gpkg",
        "--threads",
        "2",
    ]
    paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True, env=environment) as ran:
        while len(list(Path("out").glob("*.gpkg"))) < 3 and ran.poll() is None:
            time.sleep(0.01)
        ran.send_signal(signal.SIGINT)
        said = ran.communicate()[1].splitlines()[-1]
    written = outputs()
    assert ran.returncode == 130 and 3 <= len(written) < 400
    assert all(name.endswith(".gpkg") for name in written)
    assert said.startswith("uavseg: interrupted; out/")
    assert f"; {400 - len(written)} of 400 outputs were not: out/" in said
