"""`uavseg serve` as a program: it ends by a signal, says so, and leaves nothing."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

import uavseg
from tests.server.asking import fetch
from uavseg.cli import main

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends a program without asking it")
@pytest.mark.parametrize(
    ("number", "word"),
    [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated"), (signal.SIGHUP, "hung up")],
)
@pytest.mark.parametrize("busy", [False, True])
def test_a_signal_closes_the_server(number: signal.Signals, word: str, busy: bool, tmp_path: Path) -> None:
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip(f"{number.name} is ignored here")
    words = [sys.executable, "-m", "uavseg", "serve", str(SAMPLE), "--size", "64", "-q"]
    environment = os.environ | {"TMPDIR": str(tmp_path), "PYTHONPATH": str(SAMPLE.parents[1])}
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=tmp_path
    ) as process:
        assert process.stdout and process.stderr
        url = process.stdout.readline().strip()
        assert fetch(url)[0] == 200
        [folder] = tmp_path.glob("uavseg-serve-*")
        if busy:
            assert fetch(f"{url}jobs/extract", {"low": 0.3, "high": 1})[0] == 202
            while not list(folder.iterdir()):
                time.sleep(0.005)
        process.send_signal(number)
        assert process.wait(30) == 128 + number
        said = process.stderr.read().splitlines()
        assert process.stdout.read() == ""
    assert said[-1:] == [f"uavseg: {word}; the server is closed, and the files of its jobs are deleted"]
    assert not any("Traceback" in line for line in said)
    assert list(tmp_path.glob("uavseg-serve-*")) == []


def test_there_is_nothing_to_overwrite() -> None:
    result = CliRunner().invoke(main, ["serve", str(SAMPLE), "--overwrite"])
    assert result.exit_code == 2
    assert "No such option: --overwrite" in result.output or "No such option '--overwrite'" in result.output
