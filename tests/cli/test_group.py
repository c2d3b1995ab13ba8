"""The group: what it offers, how it starts, and how it ends when something is wrong."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

import uavseg
from uavseg.cli import main
from uavseg.errors import UavsegError

COMMANDS = ["extract", "divide", "plan", "info", "preview"]
HEAVY = {
    "numpy",
    "rasterio",
    "numba",
    "llvmlite",
    "shapely",
    "geopandas",
    "pandas",
    "matplotlib",
    "pyproj",
    "pyogrio",
}


def test_help_names_every_command() -> None:
    for flag in ("--help", "-h"):
        result = CliRunner().invoke(main, [flag])
        assert result.exit_code == 0 and result.stderr == ""
        assert all(f"  {command}  " in result.stdout for command in COMMANDS)


@pytest.mark.parametrize(
    ("word", "meant"),
    [("extrakt", "extract"), ("mtach", "match"), ("nextview", "next-view"), ("Plan", "plan")],
)
def test_a_name_that_is_nearly_a_command_is_answered_by_it(word: str, meant: str) -> None:
    result = CliRunner().invoke(main, [word, "tile.tif"])
    assert result.exit_code == 2 and f"No such command '{word}'. Did you mean '{meant}'?" in result.stderr


def test_a_name_like_no_command_is_refused() -> None:
    result = CliRunner().invoke(main, ["zzzzzz"])
    assert result.exit_code == 2 and "No such command 'zzzzzz'." in result.stderr
    assert "Did you mean" not in result.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command: str) -> None:
    result = CliRunner().invoke(main, [command, "--help"])
    assert result.exit_code == 0 and result.stderr == ""
    assert result.stdout.startswith("Usage: uavseg " + command)
    assert "-o, --output" in result.stdout or command == "info"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_explained(command: str) -> None:
    found = main.get_command(click.Context(main), command)
    assert found is not None
    bare = [p.name for p in found.params if isinstance(p, click.Option) and not p.help]
    assert bare == []


def test_the_version() -> None:
    result = CliRunner().invoke(main, ["--version"])
    assert (result.exit_code, result.stdout) == (0, f"uavseg {uavseg.__version__}\n")


@pytest.mark.parametrize("arguments", [["fly"], ["extract", "--unknown"], ["--unknown"]])
def test_wrong_usage_ends_with_2(arguments: list[str]) -> None:
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2 and "Usage: " in result.stderr


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (UavsegError("the sky is grey; wait"), 1, "uavseg: error: the sky is grey; wait\n"),
        (KeyboardInterrupt(), 130, "uavseg: interrupted; nothing was written\n"),
    ],
)
def test_errors_are_one_line(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, said: str
) -> None:
    @click.command("fail")
    def fail() -> None:
        raise error

    monkeypatch.setattr(type(main), "get_command", lambda self, ctx, name: fail)
    result = CliRunner().invoke(main, ["fail"])
    assert (result.exit_code, result.stderr, result.stdout) == (code, said, "")


def test_our_own_mistakes_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command("fail")
    def fail() -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(type(main), "get_command", lambda self, ctx, name: fail)
    assert isinstance(CliRunner().invoke(main, ["fail"]).exception, ZeroDivisionError)


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    root = str(Path(uavseg.__file__).parents[1])
    how = os.environ | {"PYTHONPATH": root}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=how, timeout=120)


def test_python_m_uavseg_is_uavseg() -> None:
    done = python("-m", "uavseg", "--help")
    assert (
        done.returncode == 0
        and done.stderr == ""
        and done.stdout.startswith("Usage: uavseg [OPTIONS] COMMAND")
    )


@pytest.mark.parametrize("word", ["import uavseg", "import uavseg.cli", "from uavseg.cli import main"])
def test_starting_brings_in_nothing_heavy(word: str) -> None:
    done = python("-c", f"{word}; import sys; print(*{{name.split('.')[0] for name in sys.modules}})")
    assert done.returncode == 0, done.stderr
    assert not HEAVY & set(done.stdout.split())


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_brings_in_nothing_heavy(command: str) -> None:
    code = (
        "import sys; from uavseg.cli import main; main(['COMMAND', '--help'], standalone_mode=False);"
        "print('modules:', *{name.split('.')[0] for name in sys.modules})"
    )
    done = python("-c", code.replace("COMMAND", command))
    assert done.returncode == 0, done.stderr
    assert not (HEAVY - {"numpy"}) & set(done.stdout.split("modules:")[1].split())
