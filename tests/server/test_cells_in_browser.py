"""The slider of a raster too large for a page, in headless Chromium."""

import json
import os
import subprocess
import warnings
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest

import uavseg
from tests.plot.web.test_in_browser import CHROMIUM, NODE, REQUIRED, has_playwright
from tests.plot.web.test_slider import RANGES, run
from tests.server.test_cell_tiles import labels_of, pixels_below
from uavseg.jobs.web_map import content as field_map
from uavseg.jobs.web_map.content import has_map_tiles

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not REQUIRED and not has_playwright(), reason="needs chromium, node and playwright-core"
    ),
]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    assert has_playwright(), "chromium, node and playwright-core (through NODE_PATH) are not there"
    folder = Path(os.environ.get("UAVSEG_SCREENSHOTS") or tmp_path_factory.mktemp("cells"))
    requested = tmp_path_factory.mktemp("asked") / "ranges.json"
    requested.write_text(json.dumps(RANGES))
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings(action="ignore"):
        patch.setattr(field_map, "MAX_CELLS", 100)
        server = uavseg.serve(SAMPLE)
    with server:
        program = Path(__file__).with_name("drive_cells.js")
        words = [str(NODE), str(program), server.url, str(folder), str(CHROMIUM), str(requested)]
        found = subprocess.run(words, capture_output=True, text=True, timeout=200)
    assert found.returncode == 0, found.stderr
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer


def test_what_is_drawn_is_what_the_block_map_answers(seen: dict[str, Any], tmp_path: Path) -> None:
    blocks = tmp_path / "blocks.tif"
    run("divide", SAMPLE, "-o", blocks, "-q")
    compared = colored = 0
    for (low, high), shown in zip(RANGES, seen["shown"], strict=True):
        file = tmp_path / f"{low}-{high}.gpkg"
        ends = f"{low / 1000},{high / 1000}"
        run("extract", blocks, "--refine", "none", "--range", ends, "-o", file, "-q")
        regions = geopandas.read_file(file)
        area = regions["area_m2"].sum()
        text = f"{area:.0f} m\u00b2" if area < 1e4 else f"{area / 1e4:.2f} ha"
        assert shown["text"] == f"v {low / 1000:g} to {high / 1000:g}: {text} in range"
        labels = labels_of(regions, SAMPLE)
        assert shown["tiles"]
        for tile in shown["tiles"]:
            zoom, x, y = map(int, tile["place"].split("/"))
            rows, cols, inside = pixels_below(SAMPLE, (zoom, x, y))
            drawn = (np.frombuffer(tile["bits"].encode(), np.uint8) == ord("1")).reshape(256, 256)
            on = inside == 1
            assert not drawn[inside == 0].any()
            assert np.array_equal(drawn[on], labels[rows[on], cols[on]])
            compared, colored = compared + on.sum(), colored + drawn.sum()
    assert compared > 1e5
    assert 0.05 * compared < colored < 0.9 * compared


def test_nothing_is_asked_while_the_slider_is_dragged(seen: dict[str, Any]) -> None:
    assert seen["errors"] == []
    assert seen["asked"] > 0
    assert seen["dragged"] == 0


def test_tiles_lie_over_the_picture(seen: dict[str, Any]) -> None:
    if not has_map_tiles(uavseg.Dataset.open(SAMPLE)):
        pytest.skip("needs rio-tiler")
    assert seen["covered"][0] == seen["covered"][1]
