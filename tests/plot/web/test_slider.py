"""The program of the page finds the regions that `uavseg extract blocks.tif --refine none` finds."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner
from pyproj import Transformer

import uavseg
from uavseg.cli import main
from uavseg.plot.web import field_map

NODE = shutil.which("node")
ASSETS = Path(field_map.__file__).parent / "assets"
SAMPLES = Path(uavseg.__file__).parents[1] / "samples"
needs_node = pytest.mark.skipif(
    NODE is None and not os.environ.get("UAVSEG_REQUIRE_CHROMIUM"), reason="needs node"
)
RANGES = [
    *((0, 1000), (550, 1000), (0, 400), (300, 500), (412, 413)),
    *((500, 501), (120, 777), (999, 1000), (205, 610), (640, 655)),
]


def data_of(html: Path) -> dict[str, Any]:
    text = html.read_text()
    [data] = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    found: dict[str, Any] = json.loads(data)
    return found


def speckled(path: Path) -> Path:
    """A rotated raster with odd sides, holes of nodata, and cells that touch at corners."""
    rng = np.random.default_rng(5)
    cells = np.kron(rng.integers(1, 255, (30, 41)), np.ones((8, 8)))[:235, :323]
    image = np.clip(cells + rng.normal(0, 3, cells.shape), 1, 255).astype(np.uint8)
    image[np.kron(rng.random((30, 41)) < 0.1, np.ones((8, 8), bool))[:235, :323]] = 0
    image[100:103, 40:90] = 0
    transform = Affine.translation(5e5, 5e6) * Affine.rotation(20) * Affine.scale(0.5, -0.5)
    how = {"driver": "GTiff", "height": 235, "width": 323, "count": 1, "dtype": "uint8", "nodata": 0}
    with rasterio.open(path, "w", **how, crs="EPSG:32633", transform=transform) as file:
        file.write(image, 1)
    return path


def in_page(program: str, requested: dict[str, Any], tmp_path: Path) -> Any:
    """What a program of this folder answers with the page's own code."""
    question = tmp_path / "asked.json"
    question.write_text(json.dumps(requested))
    words = [str(NODE), str(Path(__file__).with_name(program)), str(ASSETS), str(question)]
    return json.loads(subprocess.run(words, capture_output=True, check=True, text=True).stdout)


def run(*words: object) -> None:
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output


@pytest.mark.slow
@needs_node
@pytest.mark.parametrize("name", ["speckled", "quarry", "fields_rgb"])
def test_the_slider_gives_the_regions_of_the_block_map(name: str, tmp_path: Path) -> None:
    raster = speckled(tmp_path / "speckled.tif") if name == "speckled" else SAMPLES / f"{name}.tif"
    blocks, html = tmp_path / "blocks.tif", tmp_path / "map.html"
    run("divide", raster, "-o", blocks, "-q")
    run("map", raster, "-o", html, "-q")
    answers = in_page("run_blocks.js", {"cells": data_of(html)["cells"], "ranges": RANGES}, tmp_path)
    regions = 0
    for (low, high), answer in zip(RANGES, answers, strict=True):
        expected = tmp_path / f"{low}-{high}.gpkg"
        run(
            "extract",
            blocks,
            "--refine",
            "none",
            "--range",
            f"{low / 1000},{high / 1000}",
            "-o",
            expected,
            "-q",
        )
        compare(answer, geopandas.read_file(expected))
        regions += len(answer["features"])
    assert regions > 10


@pytest.mark.slow
@needs_node
def test_the_picture_of_cells_lies_where_the_raster_lies_and_its_area_is_that_of_the_regions(
    tmp_path: Path,
) -> None:
    raster, html = speckled(tmp_path / "speckled.tif"), tmp_path / "map.html"
    run("map", raster, "-o", html, "-q")
    data = data_of(html)
    requested = {
        "cells": data["cells"],
        "bounds": data["image"]["bounds"],
        "size": [300, 250],
        "ranges": RANGES,
    }
    answer = in_page("run_cells.js", requested, tmp_path)
    west, south, east, north = data["image"]["bounds"]
    to_3857 = Transformer.from_crs(4326, 3857, always_xy=True)
    (left, right), (bottom, top) = to_3857.transform([west, east], [south, north])
    x, y = np.meshgrid(
        left + (np.arange(300) + 0.5) / 300 * (right - left),
        top - (np.arange(250) + 0.5) / 250 * (top - bottom),
    )
    with rasterio.open(raster) as file:
        ground = Transformer.from_crs(3857, file.crs, always_xy=True).transform(x, y)
        cols, rows = ~file.transform * ground
        inside = (rows >= 0) & (cols >= 0) & (rows < file.height) & (cols < file.width)
    across = data["cells"]["cells"][1]
    expected = np.where(inside, rows // 8 * across + cols // 8, np.prod(data["cells"]["cells"])).astype(int)
    assert (expected.ravel() == answer["cells"]).mean() > 0.999  # others lie on an edge of two cells
    assert 0.5 < inside.mean() < 0.9
    regions = in_page("run_blocks.js", requested, tmp_path)
    numbers = re.findall(r"\d+\.(\d+)", json.dumps([one["geometry"] for one in regions[0]["features"]]))
    assert max(map(len, numbers)) == 8  # as pixels of half a metre need
    sums = [sum(one["properties"]["area_m2"] for one in found["features"]) for found in regions]
    np.testing.assert_allclose(answer["areas"], sums, rtol=1e-5)


def compare(answer: dict[str, Any], expected: geopandas.GeoDataFrame) -> None:
    features = answer["features"]
    assert [one["properties"]["id"] for one in features] == list(expected["id"])
    if not features:
        return
    assert [one["properties"]["pixels"] for one in features] == list(expected["pixels"])
    polygons = shapely.from_geojson([json.dumps(one["geometry"]) for one in features])
    assert shapely.is_valid(polygons).all()
    found = geopandas.GeoSeries(polygons, crs=4326).to_crs(expected.crs)
    others = expected.geometry
    # The page interpolates places to half a centimetre: sides move by less than two.
    assert (found.symmetric_difference(others).area <= 0.02 * others.length).all()
    np.testing.assert_allclose([one["properties"]["area_m2"] for one in features], expected["area_m2"], 1e-5)
    np.testing.assert_allclose(
        [one["properties"]["mean"] for one in features], expected["mean"], rtol=0, atol=1.01e-3
    )
