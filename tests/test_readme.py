"""The commands and the example of the README run."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest

from uavseg.cli import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")


def lines(page: str) -> list[str]:
    """Lines of the shell that a page shows, those that set up an environment aside."""
    blocks = re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if not line.startswith("python3 ")]


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 150
    first = re.findall(r"uavseg extract [^`\n]*", README)[0]
    assert first == "uavseg extract samples/quarry.tif --range 0.55,1"  # what a newcomer types first


def test_the_pages_show_every_command() -> None:
    shown = {shlex.split(line, comments=True)[1] for line in lines(COMMANDS) if line.startswith("uavseg")}
    shown |= set(re.findall(r"`uavseg ([\w-]+) [^`]+`", COMMANDS))
    assert shown == set(main.list_commands(click.Context(main)))


def run(page: str, folder: Path) -> Path:
    """Run the lines of a page in a folder with the samples."""
    shutil.copytree(ROOT / "samples", folder / "samples")
    script = ["set -eu", 'uavseg() { "$PYTHON" -m uavseg "$@"; }', *lines(page)]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # of rio, with the plugin
    how = os.environ | {"PYTHON": sys.executable, "PYTHONPATH": str(ROOT), "PATH": path}
    done = subprocess.run(
        ["bash", "-c", "\n".join(script)], cwd=folder, env=how, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return folder


def outputs(page: str) -> set[str]:
    named = r"(?:-o|--labels|--objects|--mission) ([\w.]+)"
    return {word for line in lines(page) for word in re.findall(named, line)}


@pytest.mark.slow
def test_the_commands_of_the_readme_run(tmp_path: Path) -> None:
    ran = os.environ.get("UAVSEG_README_RAN")  # a folder in which they ran already
    folder = Path(ran) if ran else run(README, tmp_path)
    assert len(outputs(README)) > 6
    for written in outputs(README):
        assert (folder / written).stat().st_size > 0


@pytest.mark.slow
def test_the_commands_line_by_line_run(tmp_path: Path) -> None:
    ran = os.environ.get("UAVSEG_COMMANDS_RAN")  # a folder in which they ran already
    folder = Path(ran) if ran else run(COMMANDS, tmp_path)
    assert len(outputs(COMMANDS)) > 20
    several = {"fly-1.plan", "fly-2.plan", "each-quarry.gpkg", "masked.tif"}
    for written in outputs(COMMANDS) - {"fly.plan"} | several:
        assert (folder / written).stat().st_size > 0
