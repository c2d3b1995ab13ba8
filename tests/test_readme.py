"""What the README shows is there, and runs."""

import re
import shlex
from pathlib import Path

import click
import pytest

from uavseg.cli import main

README = (Path(__file__).resolve().parents[1] / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


COMMANDS = [
    line for block in blocks("sh") for line in block.splitlines() if re.match(r"(rio )?uavseg ", line)
]


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_have_the_options_that_are_shown(line: str) -> None:
    words = shlex.split(line, comments=True)
    words = words[words.index("uavseg") + 1 :]
    command = main.get_command(click.Context(main), words[0])
    assert command is not None
    known = {option for parameter in command.params for option in parameter.opts}
    assert {word for word in words if re.match(r"--?[a-z]", word)} <= known


def test_every_command_is_shown() -> None:
    shown = {shlex.split(line, comments=True)[1] for line in COMMANDS if line.startswith("uavseg")}
    assert shown == set(main.list_commands(click.Context(main)))


def test_a_map_that_follows_its_scans() -> None:
    [example] = [block for block in blocks("python") if "OccupancyGrid" in block]
    seen: dict[str, object] = {}
    exec(compile(example, "README.md", "exec"), seen)
    assert seen["told"].blocks.any() and seen["free"].agreeing(2).any()  # type: ignore[attr-defined]
