"""Outlines of many regions are found in a worker, and where there is none, in the page; the same ones."""

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine

import uavseg
from tests.plot.web.test_in_browser import CHROMIUM, NODE, has_playwright, pytestmark as pytestmark

KINDS = ("worker", "slow", "without", "refused")
SHAPE = (960, 1120)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    assert has_playwright(), "chromium, node and playwright-core (through NODE_PATH) are not there"
    folder = tmp_path_factory.mktemp("outlines")
    cells = np.random.default_rng(5).integers(1, 255, (SHAPE[0] // 8, SHAPE[1] // 8), dtype=np.uint8)
    image = np.kron(cells, np.ones((8, 8), np.uint8))
    place = {"crs": "EPSG:32618", "transform": Affine(0.5, 0, 4e5, 0, -0.5, 5e6)}
    size = {"driver": "GTiff", "height": SHAPE[0], "width": SHAPE[1], "count": 1, "dtype": "uint8"}
    with rasterio.open(folder / "many.tif", "w", **size, **place) as file:
        file.write(image, 1)
    html = folder / "map.html"
    uavseg.map_page(folder / "many.tif", html)
    program = Path(__file__).with_name("drive_outlines.js")
    found = subprocess.run(
        [str(NODE), str(program), str(html), str(CHROMIUM)], capture_output=True, text=True, timeout=180
    )
    assert found.returncode == 0, found.stderr
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer


def low_of(collection: dict[str, Any]) -> set[float]:
    return {one["properties"]["range_low"] for one in collection["features"]}


def test_a_worker_looks_for_regions_and_the_page_does_not(seen: dict[str, Any]) -> None:
    assert seen["worker"]["workers"] == 1 and seen["without"]["workers"] == 0
    assert seen["worker"]["first"]["called"] == seen["worker"]["last"]["called"] == 0
    assert seen["without"]["first"]["called"] == seen["refused"]["first"]["called"] == 1


@pytest.mark.parametrize("kind", KINDS)
def test_all_outlines_of_the_last_range_are_on_the_map_and_no_others(kind: str, seen: dict[str, Any]) -> None:
    assert seen[kind]["errors"] == []
    for name, low in (("first", 0.4), ("last", 0.5)):
        state = seen[kind][name]
        assert low_of(state["regions"]) == {low}
        assert state["drawn"] == len(state["regions"]["features"]) > 300


def test_the_page_has_its_turn_while_outlines_are_added(seen: dict[str, Any]) -> None:
    for kind in KINDS:
        # The range was moved after the first outline was added, so those of its range are gone.
        assert seen[kind]["interrupted"]["drawn"] == 0


def test_the_regions_are_the_same_with_and_without_a_worker(seen: dict[str, Any]) -> None:
    for name in ("first", "last", "atOnce"):
        one, *others = (seen[kind][name]["regions"] for kind in KINDS)
        assert all(other == one for other in others), name


def test_what_is_downloaded_at_once_is_the_range_that_is_shown(seen: dict[str, Any]) -> None:
    for kind in KINDS:
        state = seen[kind]["atOnce"]
        assert low_of(state["regions"]) == {0.55} and state["drawn"] == len(state["regions"]["features"])
