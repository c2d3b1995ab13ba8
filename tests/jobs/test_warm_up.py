"""`uavseg warm-up` and `uavseg.warm_up`: everything is loaded, and one line says what was done."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

import uavseg
from uavseg._jit import object_cache, warming
from uavseg._jit.kernels import Kernel
from uavseg.cli import main
from uavseg.errors import OutputError, ParameterError

LINE = r"(\d+) kernels are ready in [\d.]+ s: (\d+) came .*, (\d+) were compiled before, (\d+) now; 8 .*\n"


def test_one_line_says_what_was_done() -> None:
    done = CliRunner().invoke(main, ["warm-up"])
    found = re.fullmatch(LINE, done.stderr)
    assert found is not None and done.exit_code == 0 and done.stdout == ""
    kernels, *parts = map(int, found.groups())
    assert kernels == len(warming.all_kernels()) == sum(parts)


def test_quiet_says_nothing_and_progress_ends_at_100() -> None:
    assert CliRunner().invoke(main, ["warm-up", "-q"]).output == ""
    lines = CliRunner().invoke(main, ["warm-up", "--progress", "plain", "-q"]).stderr.splitlines()
    steps = [int(line.removeprefix("progress ")) for line in lines]
    assert steps == sorted(steps) and steps[-1] == 100


def test_both_faces_do_the_same() -> None:
    done = CliRunner().invoke(main, ["warm-up"])
    without_time = re.sub(r" in [\d.]+ s", "", str(uavseg.warm_up()))
    assert re.sub(r" in [\d.]+ s", "", done.stderr) == f"{without_time}\n"


def test_no_process_is_an_error() -> None:
    done = CliRunner().invoke(main, ["warm-up", "--processes", "0"])
    assert done.exit_code == 1
    assert done.stderr == "uavseg: error: the number of processes is at least 1, not 0\n"
    with pytest.raises(ParameterError, match="at least 1, not -2"):
        uavseg.warm_up(processes=-2)


@pytest.mark.slow
def test_a_cache_that_cannot_be_kept_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def doubled(value):  # type: ignore[no-untyped-def]
        return 2 * value

    monkeypatch.setenv("UAVSEG_JIT", "objects")
    monkeypatch.setattr(object_cache, "cache_folder", lambda: None)
    kernel = Kernel(doubled, "i8(i8)")
    monkeypatch.setattr(warming, "all_kernels", lambda: {"doubled": kernel})
    with pytest.raises(
        OutputError, match=r"1 kernels were compiled, but no folder can keep them; .* UAVSEG_CACHE"
    ):
        uavseg.warm_up()
