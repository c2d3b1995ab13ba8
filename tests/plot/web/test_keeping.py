"""Installable pages, with a service worker and a manifest beside them, with and without their server."""

import json
import subprocess
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
from click.testing import CliRunner

import uavseg
from tests.plot.web.test_in_browser import CHROMIUM, NODE, SAMPLE, has_playwright, pytestmark as in_chromium
from uavseg.cli import main
from uavseg.errors import OutputExistsError

SHORE, THERMAL = SAMPLE.with_name("shore.tif"), SAMPLE.with_name("thermal.tif")
SIZES = [pytest.param(size, marks=in_chromium) for size in ("phone", "desktop")]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    assert has_playwright(), "chromium, node and playwright-core (through NODE_PATH) are not there"
    folder, newer = tmp_path_factory.mktemp("server"), tmp_path_factory.mktemp("newer")
    uavseg.map_page(SAMPLE, folder / "first.html", installable=True)
    uavseg.map_page(SHORE, folder / "second map's.html", installable=True)
    uavseg.map_page(THERMAL, newer / "first.html", installable=True)
    program = Path(__file__).with_name("drive_keeping.js")
    words = [str(NODE), str(program), str(folder), str(newer), str(CHROMIUM)]
    found = subprocess.run(words, capture_output=True, text=True, timeout=200)
    assert found.returncode == 0, found.stderr
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer


@pytest.mark.parametrize("size", SIZES)
def test_a_page_is_shown_without_its_server_after_the_first_visit(size: str, seen: dict[str, Any]) -> None:
    found = seen[size]
    assert found["errors"] == [] and found["first"]["notes"] == found["second"]["notes"] == []
    assert [one["title"] for one in found["offline"]] == ["quarry.tif", "shore.tif", "quarry.tif"]
    for one in [*found["offline"], found["failing"]]:
        [note] = one["notes"]
        assert note.startswith("Its server does not answer: the page as it was loaded on ")
        assert (
            one["slider"]
            and one["regions"] == found["first" if one["title"] == "quarry.tif" else "second"]["regions"]
        )


@pytest.mark.parametrize("size", SIZES)
def test_a_newer_page_is_shown_at_once_and_kept_in_place_of_the_old(size: str, seen: dict[str, Any]) -> None:
    found = seen[size]
    assert found["replaced"]["title"] == found["kept"]["title"] == "thermal.tif"
    assert found["replaced"]["notes"] == [] and len(found["kept"]["notes"]) == 1
    assert found["foreign"] == "sign in" and found["after"]["title"] == "thermal.tif"
    assert found["files"] == [1, 1]


@pytest.mark.parametrize("size", SIZES)
def test_a_browser_can_install_it(size: str, seen: dict[str, Any]) -> None:
    assert seen[size]["installability"] == [] and seen[size]["manifest"] == []


def test_both_faces_write_the_same_three_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["map", str(SAMPLE), "-o", "a b.html", "--size", "64", "--installable", "-q"]
    assert CliRunner().invoke(main, words).exit_code == 0
    names = ["a b.html", "a b.sw.js", "a b.webmanifest"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    written = [Path(name).read_bytes() for name in names]
    manifest = json.loads(written[2])
    assert unquote(manifest["start_url"]) == unquote(manifest["scope"]) == "a b.html"
    assert manifest["icons"][0]["sizes"] == "192x192" and b'href="a%20b.webmanifest"' in written[0]
    uavseg.map_page(SAMPLE, "a b.html", size=64, installable=True, overwrite=True)
    assert [Path(name).read_bytes() for name in names] == written


@pytest.mark.parametrize("name", ["a.sw.js", "a.webmanifest"])
def test_no_file_beside_the_page_is_overwritten(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(OutputExistsError, match=name):
        uavseg.map_page(SAMPLE, tmp_path / "a.html", size=64, installable=True)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_page_that_is_not_installable_names_no_other_file(tmp_path: Path) -> None:
    uavseg.map_page(SAMPLE, tmp_path / "a.html", size=64)
    text = (tmp_path / "a.html").read_text()
    assert 'rel="manifest"' not in text and "worker-src blob:" in text and '"keeper":null' in text
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]
