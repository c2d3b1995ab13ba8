"""The slider of a raster too large for a page shows what `extract blocks.tif --refine none` finds."""

import json
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
from pyproj import Transformer
from rasterio.features import rasterize

import uavseg
from tests.plot.web.test_slider import RANGES, run, speckled
from tests.server.asking import fetch
from uavseg.api.pages import MapServer
from uavseg.jobs.web_map import content as field_map

SAMPLES = Path(uavseg.__file__).parents[1] / "samples"
NO_CODE = 65535


@pytest.fixture(scope="module", params=["speckled", "quarry", "fields_rgb"])
def raster(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    if request.param == "speckled":
        return speckled(tmp_path_factory.mktemp("raster") / "speckled.tif")
    return SAMPLES / f"{request.param}.tif"


@pytest.fixture(scope="module")
def server(raster: Path) -> Iterator[MapServer]:
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings(action="ignore"):
        patch.setattr(field_map, "MAX_CELLS", 100)
        found = uavseg.serve(raster, size=100)
    with found:
        yield found


def page_data(server: MapServer) -> dict[str, Any]:
    page = fetch(server.url)[1].decode()
    [data] = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    found: dict[str, Any] = json.loads(data)
    return found


def labels_of(regions: geopandas.GeoDataFrame, raster: Path) -> np.ndarray:
    """Which pixels of a raster lie in a region."""
    with rasterio.open(raster) as file:
        if regions.empty:
            return np.zeros(file.shape, bool)
        return rasterize(regions.geometry, file.shape, transform=file.transform).astype(bool)


def pixels_below(raster: Path, tile: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row and column below each centre of a tile, and whether it is on the raster; -1 on an edge."""
    zoom, x, y = tile
    world, centres = 2 * np.pi * 6378137, (np.arange(256) + 0.5) / 256
    places = np.meshgrid(
        (x + centres) / 2**zoom * world - world / 2, world / 2 - (y + centres) / 2**zoom * world
    )
    with rasterio.open(raster) as file:
        ground = Transformer.from_crs(3857, file.crs, always_xy=True).transform(*places)
        cols, rows = ~file.transform * ground
        inside = (rows >= 0) & (cols >= 0) & (rows < file.height) & (cols < file.width)
    unclear = (np.abs(rows / 8 - np.round(rows / 8)) < 0.005) | (
        np.abs(cols / 8 - np.round(cols / 8)) < 0.005
    )
    rows, cols = (np.where(inside, values, 0).astype(int) for values in (rows, cols))
    return rows, cols, np.where(unclear, -1, inside)


def tiles_of(raster: Path, zoom: int, count: int) -> list[tuple[int, int, int]]:
    """Tiles around places of a raster."""
    with rasterio.open(raster) as file:
        rng = np.random.default_rng(zoom)
        pixels = rng.random((2, count)) * [[file.width], [file.height]]
        x, y = file.transform * pixels
        x, y = Transformer.from_crs(file.crs, 3857, always_xy=True).transform(x, y)
    world = 2 * np.pi * 6378137
    corners = zip((x / world + 0.5) * 2**zoom, (0.5 - y / world) * 2**zoom, strict=True)
    return sorted({(zoom, int(col), int(row)) for col, row in corners})


@pytest.mark.slow
def test_cells_of_any_range_are_the_regions_of_the_block_map(
    raster: Path, server: MapServer, tmp_path: Path
) -> None:
    blocks = tmp_path / "blocks.tif"
    run("divide", raster, "-o", blocks, "-q")
    areas = page_data(server)["server"]["areas"]
    seen = []
    for low, high in RANGES:
        file = tmp_path / f"{low}-{high}.gpkg"
        ends = f"{low / 1000},{high / 1000}"
        run("extract", blocks, "--refine", "none", "--range", ends, "-o", file, "-q")
        regions = geopandas.read_file(file)
        assert sum(areas[2 * low : 2 * high + 1]) == pytest.approx(
            regions["area_m2"].sum(), rel=1e-5, abs=1e-6
        )
        seen.append(((low, high), labels_of(regions, raster)))
    compared = colored = 0
    for tile in [tile for zoom in (14, 17, 19, 21) for tile in tiles_of(raster, zoom, 3)]:
        rows, cols, inside = pixels_below(raster, tile)
        status, content = fetch(f"{server.url}codes/{'/'.join(map(str, tile))}")
        assert status == (200 if content else 204)
        codes = np.frombuffer(content or b"\xff" * 131072, "<u2").reshape(256, 256)
        assert (codes[inside == 0] == NO_CODE).all()
        for (low, high), labels in seen:
            shown = (codes >= 2 * low) & (codes <= 2 * high)
            on = inside == 1
            assert np.array_equal(shown[on], labels[rows[on], cols[on]])
            compared, colored = compared + on.sum(), colored + shown.sum()
    assert compared > 1e6
    assert 0.05 * compared < colored < 0.9 * compared


def test_the_page_asks_for_cells_where_it_does_not_hold_them(server: MapServer) -> None:
    data = page_data(server)
    assert data["cells"] is None
    assert len(data["server"]["areas"]) == 2001
    assert not any("too many" in note for note in data["notes"])


@pytest.mark.parametrize("path", ["codes/27/0/0", "codes/3/8/0", "codes/1/0", "codes/-1/0/0", "codes/1/0/0/"])
def test_tiles_that_cannot_be_are_404(path: str, server: MapServer) -> None:
    assert fetch(server.url + path)[0] == 404


@pytest.mark.slow
def test_a_small_raster_is_in_the_page() -> None:
    with warnings.catch_warnings(action="ignore"):
        server = uavseg.serve(SAMPLES / "quarry.tif", size=100)
    with server:
        data = page_data(server)
        assert data["cells"] and data["server"]["areas"] is None
        assert fetch(f"{server.url}codes/0/0/0")[0] == 404


def test_a_page_without_a_server_has_no_slider_beyond_its_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(field_map, "MAX_CELLS", 100)
    with pytest.warns(UserWarning, match="640 x 560 pixels are too many.*uavseg serve has one"):
        uavseg.map_page(SAMPLES / "quarry.tif", tmp_path / "map.html", size=100)
