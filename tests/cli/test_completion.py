"""Completion of command lines in bash, with click's own script."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import uavseg

BASH = shutil.which("bash")
pytestmark = pytest.mark.skipif(BASH is None, reason="bash is not installed")


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """An environment in which `uavseg` is a program on the search path."""
    root = Path(uavseg.__file__).parents[1]
    program = tmp_path / "bin" / "uavseg"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{root}" exec "{sys.executable}" -m uavseg "$@"\n')
    program.chmod(0o755)
    return os.environ | {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}


def completed(environment: dict[str, str], *words: str) -> list[str]:
    """What bash offers for the last word, after it has run the documented line."""
    line = " ".join(f"'{word}'" for word in ("uavseg", *words))
    script = f"""
        compopt() {{ echo "files:" "$@"; }}  # outside of a completion bash refuses its own
        eval "$(_UAVSEG_COMPLETE=bash_source uavseg)"
        COMP_WORDS=({line}); COMP_CWORD={len(words)}
        _uavseg_completion uavseg
        printf '%s\\n' "${{COMPREPLY[@]}}"
        complete -p uavseg
    """
    done = subprocess.run(
        [str(BASH), "--norc", "-c", script],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        timeout=60,
        stdin=subprocess.DEVNULL,
    )
    *offered, registered = done.stdout.splitlines()
    assert "_uavseg_completion" in registered and not done.stderr
    return [word for word in offered if word]


@pytest.mark.slow
def test_commands_options_and_choices_are_completed(environment: dict[str, str]) -> None:
    assert completed(environment, "ext") == ["extract"]
    assert completed(environment, "build") == ["build-map"]
    assert completed(environment, "extract", "--meth") == ["--method"]
    assert completed(environment, "extract", "--method", "a") == ["adaptive"]
    assert completed(environment, "extract", "--no-such") == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("extract", "til"),
        ("extract", "tile.tif", "-o", "out"),
        ("plan", "reg"),
        ("plan", "regions.gpkg", "--avoid", "zo"),
        ("check", "fly"),
        ("resume", "fly"),
        ("resume", "fly.plan", "--from", "fl"),
        ("build-map", "dri"),
    ],
)
def test_names_of_files_are_left_to_the_shell(environment: dict[str, str], words: tuple[str, ...]) -> None:
    assert completed(environment, *words) == ["files: -o default"]


def test_what_is_no_file_is_not_completed_with_files(environment: dict[str, str]) -> None:
    assert completed(environment, "extract", "tile.tif", "--range", "0") == []


def test_standard_input_is_not_read_for_a_completion(environment: dict[str, str]) -> None:
    reading, writing = os.pipe()  # a terminal that says nothing
    try:
        own = environment | {"COMP_WORDS": "uavseg extract - --meth", "COMP_CWORD": "3"}
        done = subprocess.run(
            ["uavseg"],
            capture_output=True,
            text=True,
            check=False,
            env=own | {"_UAVSEG_COMPLETE": "bash_complete"},
            stdin=reading,
            timeout=30,
        )
    finally:
        os.close(reading)
        os.close(writing)
    assert done.stdout == "plain,--method\n"
