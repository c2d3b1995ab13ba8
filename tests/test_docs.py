"""Commands, links and images in the README and the documentation pages are valid."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import yaml

import uavseg
from uavseg.cli import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "samples").glob("*.md")]
DOCS = ROOT / "docs"
RUN = [DOCS / "tutorial.md", DOCS / "paper.md", DOCS / "changes.md", *sorted((DOCS / "how-to").glob("*.md"))]
SHELL = re.compile(r"^```(?:sh|console)\n(.*?)^```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`(uavseg \w+ [^`]*-[^`]*)`")
NAMED = re.compile(r"`((?:benchmarks|docs|notebooks|qgis_uavseg|ros|samples|tests|uavseg)/[a-z0-9_/.-]+)`")
PICTURE = re.compile(r"!\[[^]]*\]\(([^)]+)\)")


def lines_of(page: Path) -> Iterator[str]:
    """Command lines of a page that call uavseg, in shell blocks and in the text."""
    text = page.read_text(encoding="utf-8")
    for block in SHELL.findall(text):
        for line in block.splitlines():
            for part in re.split(r"\||&&", line.removeprefix("$ ")):
                if re.match(r"\s*(rio )?uavseg ", part):
                    yield part.strip()
    yield from (line for line in INLINE.findall(text) if "..." not in line)


LINES = sorted({(page.relative_to(ROOT).as_posix(), line) for page in PAGES for line in lines_of(page)})


@pytest.mark.parametrize(("page", "line"), LINES)
def test_every_documented_command_line_is_valid(page: str, line: str) -> None:
    words = shlex.split(line, comments=True)
    words = words[words.index("uavseg") + 1 :]
    if words[0].startswith("-"):
        main.make_parser(click.Context(main)).parse_args(words)
        return
    command = main.get_command(click.Context(main), words[0])
    assert command is not None, f"{page}: there is no command {words[0]}"
    context = click.Context(command)
    values, _, _ = command.make_parser(context).parse_args(words[1:])
    for parameter in command.params:
        if isinstance(parameter, click.Option) and parameter.name in values:
            parameter.type_cast_value(context, values[parameter.name])


def test_an_invalid_command_line_is_detected() -> None:
    with pytest.raises(click.UsageError):
        test_every_documented_command_line_is_valid("a page", "uavseg plan a.geojson --largets 2")
    with pytest.raises(click.UsageError):
        test_every_documented_command_line_is_valid("a page", "uavseg plan a.geojson --pattern spiral")


def test_every_command_is_documented() -> None:
    shown = {shlex.split(line, comments=True)[1] for _, line in LINES if line.startswith("uavseg")}
    assert set(main.list_commands(click.Context(main))) <= shown


def test_the_reference_lists_every_public_name() -> None:
    reference = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\.\. auto\w+:: uavseg\.(\w+)$", reference, re.MULTILINE))
    assert named == set(uavseg.__all__) - {"__version__"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_images_exist_and_are_small(page: Path) -> None:
    for link in PICTURE.findall(page.read_text(encoding="utf-8")):
        picture = page.parent / link
        assert picture.is_file(), f"{page.name} shows {link}"
        assert picture.stat().st_size < 300_000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_that_a_page_names_exist(page: Path) -> None:
    if page.name != "CHANGELOG.md":  # names what there was
        for name in NAMED.findall(page.read_text(encoding="utf-8")):
            assert (ROOT / name).exists(), f"{page.name} names {name}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [  # the tutorial is run with a wheel by `nox -s distributions`
        pytest.param(page, id=page.stem, marks=pytest.mark.thorough if page.stem == "tutorial" else [])
        for page in RUN
    ],
)
def test_the_commands_of_a_page_print_the_documented_output(page: Path) -> None:
    ran = subprocess.run(
        [sys.executable, str(ROOT / "docs" / "run.py"), "--check", str(page)], capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr


def test_the_citation_has_this_version_and_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == uavseg.__version__
    assert [author["family-names"] for author in citation["references"][0]["authors"]] == [
        "Abou Merhy",
        "Payeur",
        "Petriu",
    ]
