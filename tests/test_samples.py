"""The samples equal the output of their script, are small, and match their README."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio

SAMPLES = Path(__file__).resolve().parents[1] / "samples"
KINDS = {  # dtypes, nodata, EPSG, metres per pixel
    "quarry.tif": (("uint8",), None, 32610, 0.5),
    "shore.tif": (("uint8",), None, 32618, 1.0),
    "fields_rgb.tif": (("uint8",) * 4, None, 32750, 0.1),
    "thermal.tif": (("uint16",), 0, 25832, 0.15),
}
WETLANDS = (("uint8",) * 4, 0, 26914, 5.0)


@pytest.fixture(scope="module")
def redrawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    subprocess.run([sys.executable, str(SAMPLES / "make_samples.py"), str(folder)], check=True)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_the_script_draws_the_committed_pixels(name: str, redrawn: Path) -> None:
    with rasterio.open(SAMPLES / name) as committed, rasterio.open(redrawn / name) as again:
        assert np.array_equal(committed.read(), again.read())
        assert (committed.crs, committed.transform) == (again.crs, again.transform)


@pytest.mark.parametrize("name", [*KINDS, "wetlands.tif"])
def test_a_sample_has_the_type_and_georeference_of_the_readme(name: str) -> None:
    dtypes, nodata, epsg, metres = KINDS.get(name, WETLANDS)
    with rasterio.open(SAMPLES / name) as file:
        assert (file.dtypes, file.nodata, file.crs.to_epsg()) == (dtypes, nodata, epsg)
        assert file.res == (metres, metres)
        assert file.block_shapes[0] == ((256, 256) if name in KINDS else (512, 512))
        assert f"{file.width} x {file.height}, {metres:g} m" in (SAMPLES / "README.md").read_text("utf-8")


def test_there_are_only_these_samples_and_they_are_small() -> None:
    sizes = {path.name: path.stat().st_size for path in SAMPLES.glob("*.tif")}
    assert set(sizes) == {*KINDS, "wetlands.tif"}
    assert max(sizes[name] for name in KINDS) < 400_000 and sizes["wetlands.tif"] < 3_000_000


def test_the_quarry_is_bright_in_a_dark_forest() -> None:
    with rasterio.open(SAMPLES / "quarry.tif") as file:
        v = file.read(1) / 255
    assert 0.25 < (v >= 0.55).mean() < 0.4
    assert ((v > 0.5) & (v < 0.6)).mean() < 0.05  # few pixels have intermediate values


@pytest.mark.parametrize("name, band", [("fields_rgb.tif", 4), ("thermal.tif", 1)])
def test_drone_mosaics_have_an_irregular_outline(name: str, band: int) -> None:
    with rasterio.open(SAMPLES / name) as file:
        seen = file.read(band) > 0
    assert 0.6 < seen.mean() < 0.95
    assert len(set(seen.argmax(axis=1))) > 10  # the left edge is irregular
