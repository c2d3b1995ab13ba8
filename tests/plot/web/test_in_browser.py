"""The page of `uavseg map` in headless Chromium, without network."""

import json
import os
import re
import shutil
import subprocess
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import geopandas
import pytest
import rasterio
import shapely

import uavseg
from tests.plot.web.test_page import squares
from uavseg.plot.web import field_map

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
CHROMIUM = shutil.which("chromium")
NODE = shutil.which("node")
EVIL = "</script><img src=x onerror=alert(1)><b class=injected>&amp;"


REQUIRED = bool(os.environ.get("UAVSEG_REQUIRE_CHROMIUM"))  # a failure where it is not there, not a skip


@cache
def has_playwright() -> bool:
    """Whether node finds playwright-core (through NODE_PATH)."""
    if NODE is None or CHROMIUM is None:
        return False
    return subprocess.run([NODE, "-e", "require('playwright-core')"], capture_output=True).returncode == 0


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not REQUIRED and not has_playwright(), reason="needs chromium, node and playwright-core"
    ),
]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    assert has_playwright(), "chromium, node and playwright-core (through NODE_PATH) are not there"
    folder = Path(os.environ.get("UAVSEG_SCREENSHOTS") or tmp_path_factory.mktemp("screenshots"))
    regions = uavseg.extract(SAMPLE, (0.552, 0.9), min_area=200)
    regions["note"] = EVIL
    regions[EVIL] = 1
    with warnings.catch_warnings(action="ignore"):
        mission = uavseg.plan(regions, home="auto", altitude=60, pattern="survey", camera="DJI Mavic 3")
    html = folder / "map.html"
    uavseg.map_page(SAMPLE, html, regions=regions, mission=mission, overwrite=True)
    program = Path(__file__).with_name("drive_page.js")
    found = subprocess.run(
        [str(NODE), str(program), str(html), str(folder), str(CHROMIUM)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert found.returncode == 0, found.stderr
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer


def test_the_page_requests_nothing_and_has_no_errors(seen: dict[str, Any]) -> None:
    assert seen["requests"] == []
    assert seen["errors"] == []


def test_the_slider_begins_with_the_range_of_the_regions(seen: dict[str, Any]) -> None:
    assert seen["start"] == ["0.552", "0.9"]


def test_cells_follow_while_the_slider_is_dragged_and_regions_when_it_is_released(
    seen: dict[str, Any],
) -> None:
    (shown, first), (_, second) = seen["dragged"]
    assert shown == 1
    assert first != second
    low, regions = seen["released"]
    assert {one["properties"]["range_low"] for one in regions["features"]} == {low}
    area = sum(one["properties"]["area_m2"] for one in regions["features"])
    assert second == f"v {low:g} to 0.9: {area / 1e4:.2f} ha in range"
    with rasterio.open(SAMPLE) as raster:
        ground = abs(raster.transform.determinant) * raster.width * raster.height
        edges = geopandas.GeoSeries([shapely.box(*raster.bounds)], crs=raster.crs).to_crs(3857)
    assert seen["colored"] == pytest.approx(area / ground * edges.area[0] / edges.envelope.area[0], rel=0.02)


def test_footprints_are_shown_on_request(seen: dict[str, Any]) -> None:
    assert re.fullmatch(r"\W*Footprints of [1-9]\d+ photographs", seen["footprints"])


def test_text_is_readable_in_sunlight(seen: dict[str, Any]) -> None:
    assert seen["contrast"] >= 7  # level AAA of WCAG 2


def test_the_slider_moves_regions(seen: dict[str, Any]) -> None:
    assert seen["low"] == "0.58"
    areas = [
        sum(one["properties"]["pixels"] for one in seen[name]["features"]) for name in ("first", "moved")
    ]
    assert 0 < areas[1] < areas[0]
    assert {one["properties"]["range_low"] for one in seen["moved"]["features"]} == {0.58}


def test_one_end_of_the_range_moves_the_other(seen: dict[str, Any]) -> None:
    assert seen["crossed"] == [199, 200]


def test_what_is_downloaded_are_the_chosen_regions(seen: dict[str, Any]) -> None:
    whole, rest = (geopandas.GeoDataFrame.from_features(seen[name], crs=4326) for name in ("all", "without"))
    assert list(rest["id"]) == list(whole["id"])[1:]
    assert shapely.is_valid(whole.geometry).all()
    assert set(whole["note"]) == {EVIL}


@pytest.mark.parametrize("name", ["without", "moved"])
def test_a_mission_is_planned_over_what_is_downloaded(
    name: str, seen: dict[str, Any], tmp_path: Path
) -> None:
    file = tmp_path / "chosen.geojson"
    file.write_text(json.dumps(seen[name]))
    with warnings.catch_warnings(action="ignore"):
        planned = uavseg.plan(file, home="auto", altitude=60)
    assert len(planned.missions) == 1


def test_a_popup_shows_attributes_as_text(seen: dict[str, Any]) -> None:
    assert re.search(r"^area\s+[\d.]+ m²$", seen["popup"], re.MULTILINE)
    assert EVIL in seen["popup"]
    assert seen["markup"] == 0


def test_layers_can_be_hidden(seen: dict[str, Any]) -> None:
    assert seen["raster"] == [1, 0]


def test_a_telephone_shows_it_in_its_width_with_large_buttons(seen: dict[str, Any]) -> None:
    assert seen["wider"] <= 0
    assert seen["small"] == []
    assert seen["closed"]


@pytest.mark.parametrize("plain_bytes", [0, 1 << 30], ids=["packed", "plain"])
def test_a_long_list_has_the_rows_that_are_near(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plain_bytes: int
) -> None:
    monkeypatch.setattr(field_map, "_PLAIN_BYTES", plain_bytes)
    places = squares(40, 80)
    html = tmp_path / "map.html"
    uavseg.map_page(SAMPLE, html, regions=places)
    program = Path(__file__).with_name("drive_list.js")
    words = [str(NODE), str(program), str(html), str(CHROMIUM)]
    found = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    seen = json.loads(found.stdout)
    assert seen["errors"] == []
    assert 0 < seen["started"] <= 150 and 0 < seen["ended"] <= 150
    assert seen["height"] == pytest.approx(45 * len(places), rel=0.05)
    assert seen["grown"] == pytest.approx(seen["height"], rel=0.05)
    assert seen["last"].startswith(f"{len(places)}: ")
    assert seen["kept"] is False and seen["summary"] == f"{len(places) - 1} of {len(places)} chosen"
    assert seen["tabbed"] == "Choose region 131"
