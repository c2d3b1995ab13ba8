"""The page of `uavseg serve` in headless Chromium, from a raster to a mission that `uavseg check` accepts."""

import json
import os
import re
import subprocess
import warnings
from pathlib import Path
from typing import Any

import geopandas
import pytest
from click.testing import CliRunner

import uavseg
from tests.plot.web.test_in_browser import CHROMIUM, NODE, REQUIRED, has_playwright
from tests.server.asking import surveyed
from uavseg.cli import main
from uavseg.jobs.web_map.content import has_map_tiles

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not REQUIRED and not has_playwright(), reason="needs chromium, node and playwright-core"
    ),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(os.environ.get("UAVSEG_SCREENSHOTS") or tmp_path_factory.mktemp("served"))


@pytest.fixture(scope="module")
def seen(folder: Path) -> dict[str, Any]:
    return drive("drive_server.js", folder)


def drive(program: str, folder: Path, **options: Any) -> dict[str, Any]:
    """Serve the sample, use its page, and return what was seen."""
    assert has_playwright(), "chromium, node and playwright-core (through NODE_PATH) are not there"
    with warnings.catch_warnings(action="ignore"):  # without rio-tiler there are no tiles
        server = uavseg.serve(SAMPLE, **options)
    with server:
        found = subprocess.run(
            [str(NODE), str(Path(__file__).with_name(program)), server.url, str(folder), str(CHROMIUM)],
            capture_output=True,
            text=True,
            timeout=200,
        )
    assert found.returncode == 0, found.stderr
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer


def test_it_asks_its_own_server_alone(seen: dict[str, Any]) -> None:
    assert seen["others"] == []
    assert (seen["tiles"] > 0) == has_map_tiles(uavseg.Dataset.open(SAMPLE))


def test_only_the_refused_question_is_an_error(seen: dict[str, Any]) -> None:
    assert len(seen["errors"]) == 1
    assert "400" in seen["errors"][0]
    assert "altitude" in seen["refused"] or "height" in seen["refused"]


def test_the_regions_that_are_downloaded_are_those_of_extract(seen: dict[str, Any], folder: Path) -> None:
    found = geopandas.read_file(folder / "regions.gpkg")
    expected = uavseg.extract(SAMPLE, (0.55, 1), min_area=500)
    assert list(found["pixels"]) == list(expected["pixels"])


def test_the_mission_that_is_downloaded_is_accepted(seen: dict[str, Any], folder: Path) -> None:
    regions = str(folder / "regions.gpkg")
    assert Path(regions).exists()
    result = CliRunner().invoke(main, ["check", str(folder / "mission.plan")])
    assert result.exit_code == 0, result.output
    plan = json.loads((folder / "mission.plan").read_text())
    lat, lon = (float(part) for part in re.findall(r"-?\d+\.\d+", seen["home"]))
    assert plan["mission"]["plannedHomePosition"][:2] == pytest.approx([lat, lon], abs=1e-6)
    assert seen["zone"] == "Keep-out zones: 1"
    assert len(plan["geoFence"]["polygons"]) >= 1


def test_regions_like_a_sample_are_found(seen: dict[str, Any]) -> None:
    assert re.search(r"[1-9]\d* of [1-9]\d* chosen", seen["like"][1])


def test_an_answer_about_the_place_that_is_shown_is_sent(seen: dict[str, Any]) -> None:
    assert seen["question"]
    assert seen["answer"]["like"] == [] and [len(disc) for disc in seen["answer"]["unlike"]] == [3]


def test_gaps_of_photographs_are_flown_over_next(folder: Path, tmp_path: Path) -> None:
    mission, photographs = surveyed(tmp_path)
    seen = drive("drive_gaps.js", folder, photos=photographs, mission=mission)
    assert seen["errors"] == [] and not seen["status"]
    assert f"{len(list(photographs.iterdir()))} photographs" in seen["footprints"]
    result = CliRunner().invoke(main, ["check", str(folder / "next.plan")])
    assert result.exit_code == 0, result.output
