"""A disk that is full while a library writes is one line that says so, whatever the library reports."""

import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner
from rasterio.transform import from_origin

from uavseg.cli import main

LIMIT = 4 << 10  # bytes of a file


@pytest.fixture
def raster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    image = np.random.default_rng(0).integers(0, 256, (40, 40)).repeat(16, 0).repeat(16, 1).astype(np.uint8)
    image[np.indices(image.shape).sum(axis=0) % 3 == 0] += 1
    place = {"crs": "EPSG:32633", "transform": from_origin(500000, 5000000, 1, 1)}
    with rasterio.open("a.tif", "w", "GTiff", *image.shape[::-1], 1, dtype="uint8", **place) as file:
        file.write(image, 1)
    return Path("a.tif")


@pytest.fixture
def full(raster: Path) -> Iterator[None]:
    """No file may grow beyond the limit, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("name", ["b.geojson", "b.gpkg", "b.fgb", "b.shp", "b.kml", "b.parquet"])
@pytest.mark.usefixtures("full")
def test_regions_that_find_no_room_are_one_line(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_one_line(["extract", "a.tif", "--range", "0.5,1", "-o", name, "-q"], name, capfd)


@pytest.mark.parametrize(
    "words",
    [
        ("divide", "a.tif", "-o", "b.tif"),
        ("extract", "a.tif", "--range", "0.5,1", "-o", "-", "--labels", "b.tif"),
        ("preview", "a.tif", "-o", "b.png"),
    ],
)
@pytest.mark.usefixtures("full")
def test_rasters_that_find_no_room_are_one_line(
    words: tuple[str, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    more = [] if words[0] == "preview" else ["-q"]
    assert_one_line([*words, *more], words[-1], capfd)


def assert_one_line(words: list[str], name: str, capfd: pytest.CaptureFixture[str]) -> None:
    done = CliRunner().invoke(main, words)
    [line] = done.stderr.splitlines()
    assert done.exit_code == 1 and line.startswith(f"uavseg: error: {name} cannot be written: ")
    assert "File too large" in line and capfd.readouterr().err == ""
    assert {path.name for path in Path().iterdir()} == {"a.tif"}
