"""The pages of `map` and `serve` by axe-core, by keys and by touch, on a telephone and a desktop."""

import json
import os
import subprocess
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import uavseg
from tests.plot.web.test_in_browser import CHROMIUM, NODE, REQUIRED, SAMPLE, has_playwright


@cache
def has_axe() -> bool:
    """Whether node finds playwright-core and axe-core (through NODE_PATH)."""
    words = [str(NODE), "-e", "require.resolve('axe-core')"]
    return has_playwright() and subprocess.run(words, capture_output=True).returncode == 0


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not REQUIRED and not has_axe(), reason="needs chromium, node, playwright-core and axe-core"
    ),
]
SIZES = ["phone", "desktop"]


def look(url: str, folder: Path) -> dict[str, Any]:
    """Use a page as `drive_access.js` does, and return what was seen."""
    assert has_axe(), "chromium, node, playwright-core and axe-core (through NODE_PATH) are not there"
    words = [str(NODE), str(Path(__file__).with_name("drive_access.js")), url, str(folder), str(CHROMIUM)]
    found = subprocess.run(words, capture_output=True, text=True, timeout=200)
    assert found.returncode == 0, found.stderr
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = Path(os.environ.get("UAVSEG_SCREENSHOTS") or tmp_path_factory.mktemp("access"))
    regions = uavseg.extract(SAMPLE, (0.552, 0.9), min_area=200)
    with warnings.catch_warnings(action="ignore"):
        mission = uavseg.plan(regions, home="auto", altitude=60, angle=0, camera="DJI Mavic 3")
        uavseg.map_page(SAMPLE, folder / "access.html", regions=regions, mission=mission, overwrite=True)
        server = uavseg.serve(SAMPLE)  # without rio-tiler there are no tiles
    with server:
        return {"map": look(f"file://{folder / 'access.html'}", folder), "serve": look(server.url, folder)}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", ["map", "serve"])
def test_axe_finds_nothing_and_tab_reaches_all(kind: str, size: str, seen: dict[str, Any]) -> None:
    found = seen[kind][size]
    assert found["violations"] == [] and found["errors"] == []
    assert found["controls"] >= 15
    assert found["missed"] == [] and found["unmarked"] == [] and found["hidden"] == []


@pytest.mark.parametrize("size", SIZES)
def test_a_region_that_is_touched_has_its_popup_in_the_screen_above_all(
    size: str, seen: dict[str, Any]
) -> None:
    for place in [*seen["map"][size]["popups"], seen["map"][size]["listed"]]:
        assert place is not None and place["rows"] > 3
        assert place["outside"] <= 0
        assert place["covered"] == 0 and place["cross"]


@pytest.mark.parametrize("size", SIZES)
def test_regions_and_layers_are_used_by_keys(size: str, seen: dict[str, Any]) -> None:
    found = seen["map"][size]
    assert found["closed"] and found["unticked"] and found["layers"]
    assert found["spaced"]
    assert found["focus"] == [True, True]


@pytest.mark.parametrize("size", SIZES)
def test_jobs_of_a_server_are_started_by_keys(size: str, seen: dict[str, Any]) -> None:
    found = seen["serve"][size]
    of_regions, of_all = found["downloads"]
    assert 0 < of_regions < of_all
    assert "altitude" in found["refused"] or "height" in found["refused"]


def test_keys_hide_the_panel_of_a_telephone(seen: dict[str, Any]) -> None:
    assert [seen[kind]["phone"]["toggled"] for kind in ("map", "serve")] == [[True, "false"]] * 2
