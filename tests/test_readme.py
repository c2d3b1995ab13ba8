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
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


LINES = [line for block in blocks("sh") for line in block.splitlines() if not line.startswith("python3 ")]


def test_the_readme_shows_every_command() -> None:
    shown = {shlex.split(line, comments=True)[1] for line in LINES if line.startswith("uavseg")}
    shown |= set(re.findall(r"`uavseg ([\w-]+) [^`]+`", README))
    assert shown == set(main.list_commands(click.Context(main)))


def test_the_example_of_a_live_map_runs() -> None:
    [example] = [block for block in blocks("python") if "OccupancyGrid" in block]
    seen: dict[str, object] = {}
    exec(compile(example, "README.md", "exec"), seen)
    assert seen["update"].blocks.any() and seen["free"].agreeing(2).any()  # type: ignore[attr-defined]


@pytest.fixture
def ran(tmp_path: Path) -> Path:
    """A folder in which the commands ran: UAVSEG_README_RAN names one where that is done already."""
    if os.environ.get("UAVSEG_README_RAN"):
        return Path(os.environ["UAVSEG_README_RAN"])
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    script = ["set -eu", 'uavseg() { "$PYTHON" -m uavseg "$@"; }', *LINES]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # of rio, with the plugin
    how = os.environ | {"PYTHON": sys.executable, "PYTHONPATH": str(ROOT), "PATH": path}
    done = subprocess.run(
        ["bash", "-c", "\n".join(script)], cwd=tmp_path, env=how, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return tmp_path


@pytest.mark.slow
def test_the_commands_of_the_readme_run(ran: Path) -> None:
    named = {word for line in LINES for word in re.findall(r"(?:-o|--labels|--objects) ([\w.]+)", line)}
    assert len(named) > 20
    for written in named - {"fly.plan"} | {"fly-1.plan", "fly-2.plan", "each-quarry.gpkg", "masked.tif"}:
        assert (ran / written).stat().st_size > 0
