"""What jobs decide is logged, and printed with -v; times leave out the compiling of kernels."""

import logging
import re
import time
from contextlib import chdir
from pathlib import Path

import pytest
from click.testing import CliRunner

import uavseg
from tests.occupancy.bags.write_bags import Drive, write_ros1
from uavseg._jit import messages
from uavseg.cli import main
from uavseg.cli.terminal.say import Reporter
from uavseg.execution.executors import phase, steps_done, watched, working_seconds
from uavseg.execution.progress_bar import PhaseLine, ProgressLine
from uavseg.options.running import VerbosityOptions

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
QUARRY = str(SAMPLES / "quarry.tif")
PLAN = ("plan", "r.geojson", "--pattern", "perimeter", "--altitude", "50", "--home", "auto", "--largest", "1")


def test_times_leave_out_compiling(caplog: pytest.LogCaptureFixture) -> None:
    begun = time.perf_counter()
    before, reporter = messages.compiling_seconds(), Reporter(VerbosityOptions(quiet=True))
    with caplog.at_level(logging.INFO, "uavseg"), phase("slow"), messages.timing_compilation():
        time.sleep(0.25)
    compiled_s, reported_s = messages.compiling_seconds() - before, reporter.seconds
    rest_s = time.perf_counter() - begun - compiled_s  # of this test, which a busy machine may stop for long
    assert compiled_s >= 0.25 and reported_s <= rest_s
    [text] = [record.getMessage() for record in caplog.records]
    [seconds] = re.fullmatch(r"phase slow: (\d+\.\d\d) s", text).groups()
    assert float(seconds) <= rest_s + 0.005


def test_the_clock_goes_on() -> None:
    first = working_seconds()
    time.sleep(0.01)
    assert working_seconds() - first >= 0.009


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "facts"),
    [
        (
            ("extract", QUARRY, "--range", "0.511,1"),
            ("stretch dtype -> 0..255", "phase refinement and outlines", "tiles of"),
        ),
        (("levels", QUARRY, "--width", "0.2"), ("stretch dtype -> 0..255", "phase refinement and outlines")),
        (("suggest", QUARRY, "--threads", "1"), ("1 threads", "blocks of 64", "phase count of regions")),
        (("divide", QUARRY, "-o", "blocks.tif"), ("phase division", "9 x 10 blocks")),
        (("info", QUARRY), ("phase count",)),
        pytest.param(
            (*PLAN, "-o", "b.plan"),
            ("1 of 4 regions, 0 keep-out zones", "perimeter from 49.459", "phase route"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            ("check", "a.plan"),
            ("phase reading", "checked for ardupilot, 0 keep-out", "phase paper check"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            ("preview", "a.plan"),
            ("missions: 1, with no ground", "phase profiles", "phase picture"),
            marks=pytest.mark.slow,
        ),
        (("preview", QUARRY), ("phase layers", "phase picture", "band 1, grey: dtype -> 0..255")),
        (("simulate", "lens", "--poses", "2", "-o", "m.tif"), ("2 poses of 151 beams", "phase scans")),
        (
            ("build-map", "run.bag", "-o", "m.tif"),
            ("poses of /odom, cells of 0.05 m", "merged"),
        ),
    ],
)
def test_verbose_says_what_was_decided(
    tmp_path: Path, words: tuple[str, ...], facts: tuple[str, ...]
) -> None:
    with chdir(tmp_path):
        _make_inputs(words)
        done = CliRunner().invoke(main, [*words, "-v"])
        assert done.exit_code == 0, done.output
        quiet = CliRunner().invoke(
            main, [*words, *(() if words[0] in ("info", "suggest", "check") else ("--overwrite",))]
        )
        silent = CliRunner().invoke(main, [*words, "-v", "-q"])
    said = [line for line in done.stderr.splitlines() if line.startswith("uavseg: ")]
    for fact in facts:
        assert any(fact in line for line in said), (fact, said)
    assert not [line for line in quiet.stderr.splitlines() if line.startswith("uavseg: ")]
    assert done.stdout == quiet.stdout
    assert words[0] in ("info", "suggest") or "uavseg: phase" not in silent.stderr


def _make_inputs(words: tuple[str, ...]) -> None:
    """The files that a command reads."""
    if words[0] == "build-map":
        write_ros1(Path("run.bag"), Drive(1, 3).everything())
    if {"a.plan", "r.geojson"} & set(words):
        line = ("extract", QUARRY, "--range", "0.55,1", "--min-area", "500", "-o", "r.geojson")
        assert CliRunner().invoke(main, line).exit_code == 0
        assert CliRunner().invoke(main, [*PLAN, "-o", "a.plan"]).exit_code == 0


@pytest.mark.slow
def test_python_logs_the_same(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "uavseg"):
        uavseg.extract(QUARRY, (0.511, 1), threads=1)
    logged = [record.getMessage() for record in caplog.records if record.name.startswith("uavseg")]
    done = CliRunner().invoke(
        main, ["extract", QUARRY, "--range", "0.511,1", "-o", "-", "-v", "--threads", "1"]
    )
    times = re.compile(r"\d+\.\d+ s$")
    printed = [
        line.removeprefix("uavseg: ") for line in done.stderr.splitlines() if line.startswith("uavseg: ")
    ]
    assert [times.sub("", line) for line in printed] == [times.sub("", line) for line in logged]


def test_python_is_silent_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    uavseg.extract(QUARRY, (0.511, 1))
    assert capsys.readouterr() == ("", "")


def test_true_draws_a_bar(capsys: pytest.CaptureFixture[str]) -> None:
    uavseg.extract(QUARRY, "0.511,1", progress=True)
    drawn = capsys.readouterr().err
    assert drawn.endswith("\n") and "100 %" in drawn.rpartition("\r")[2]
    uavseg.extract(QUARRY, "0.511,1", progress=False)
    assert capsys.readouterr().err == ""


def test_a_bar_is_not_drawn_for_each_step(capsys: pytest.CaptureFixture[str]) -> None:
    line = ProgressLine()
    for done in range(1, 10_001):
        line(done, 10_000)
    assert capsys.readouterr().err.count("\r") < 100


def test_a_phase_that_takes_long_is_shown_with_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    line = PhaseLine()
    with watched(line), phase("union of regions"):
        steps_done(3, 12)
        now[0] += 29.9
        line.draw_if_due()
        assert not capsys.readouterr().err
        now[0] += 0.2
        line.draw_if_due()
        line.draw_if_due()
        assert capsys.readouterr().err == "uavseg: union of regions: 25 %, 0:30\n"
        now[0] += 30
        line.draw_if_due()
        assert capsys.readouterr().err == "uavseg: union of regions: 25 %, 1:00\n"
    now[0] += 60
    line.draw_if_due()
    steps_done(1, 1)  # nobody watches
    assert not capsys.readouterr().err
