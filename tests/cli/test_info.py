"""`uavseg info`: one block for people, one object for programs, one sentence where it cannot."""

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

from uavseg.cli.preview import info as command
from uavseg.errors import MosaicError, ParameterError, RasterReadError


@pytest.fixture
def raster(tmp_path: Path) -> Path:
    pixels = np.zeros((3, 40, 50), np.uint8)
    pixels[0], pixels[1], pixels[2] = 255, 51, 0
    place = {"crs": "EPSG:32618", "transform": Affine(1, 0, 380_000, 0, -1, 4_897_000)}
    path = tmp_path / "a.tif"
    with rasterio.open(
        path, "w", driver="GTiff", dtype="uint8", count=3, height=40, width=50, **place
    ) as file:
        file.write(pixels)
    return path


def run(*arguments: object) -> str:
    result = CliRunner().invoke(command, [str(a) for a in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_people_read_what_matters(raster: Path) -> None:
    text = run(raster)
    for fact in (
        "50 x 40 pixels",
        "EPSG:32618",
        "1: uint8 red",
        "luminance of bands 1,2,3",
        "nodata     none",
    ):
        assert fact in text
    assert text.splitlines()[-1] == f"try        uavseg extract {raster} --range 0,0.5"


def test_programs_read_json(raster: Path) -> None:
    metadata = json.loads(run(raster, "--json", "--threads", 1))
    assert metadata["mean"] == pytest.approx(0.2126 + 0.7152 * 0.2, abs=1e-5)
    assert metadata["valid"] == 2000 and sum(metadata["histogram"]) == 2000


def test_options_choose_bands_and_what_counts(raster: Path) -> None:
    assert json.loads(run(raster, "--json", "--band", 2))["mean"] == pytest.approx(0.2)
    turned = json.loads(run(raster, "--json", "--rgb", "3,2,1", "--stretch", "0,510"))["mean"]
    assert turned == pytest.approx((0.7152 * 0.2 + 0.0722) / 2, abs=1e-4)
    assert json.loads(run(raster, "--json", "--band", 2, "--nodata", 51))["valid"] == 0


def test_what_is_wrong_is_one_sentence(raster: Path, tmp_path: Path) -> None:
    far = tmp_path / "far.tif"
    with (
        rasterio.open(raster) as source,
        rasterio.open(far, "w", **source.profile | {"crs": "EPSG:4326"}) as file,
    ):
        file.write(source.read())
    for wrong, arguments in [
        (RasterReadError, [tmp_path / "missing.tif"]),
        (ParameterError, [raster, "--band", 9]),
        (ParameterError, [raster, "--stretch", "loud"]),
        (MosaicError, [raster, far]),
    ]:
        result = CliRunner().invoke(command, [str(a) for a in arguments])
        assert isinstance(result.exception, wrong) and "\n" not in str(result.exception)
    assert CliRunner().invoke(command, [str(raster), "--rgb", "1,x"]).exit_code == 2
    assert CliRunner().invoke(command, []).exit_code == 2


def test_a_terminal_without_blocks_gets_ascii_bars(raster: Path) -> None:
    text = CliRunner(charset="ascii").invoke(command, [str(raster)], catch_exceptions=False).output
    assert "#####" in text and "█" not in text
