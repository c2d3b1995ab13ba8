"""Features have the values that the words which choose them read."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine

from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.features import features_of, weighted_sum
from uavseg.raster.intensity.grey import luminance_f4
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import BandScale
from uavseg.raster.spectral.formula import BandWords

SHAPE = (9, 11)
NAMES = BandWords(names="blue,green,red,nir")


def written(path: Path, planes: np.ndarray, scale: float = 1.0) -> str:
    profile = {"count": len(planes), "height": SHAPE[0], "width": SHAPE[1], "dtype": planes.dtype.name}
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    with rasterio.open(path, "w", "GTiff", **profile, **place) as file:
        file.write(planes)
        file.scales = [scale] * len(planes)
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 0.0001])
def test_values_are_those_that_are_read(tmp_path: Path, scale: float) -> None:
    planes = np.random.default_rng(1).integers(1, 9000, (4, *SHAPE)).astype(np.uint16)
    path = written(tmp_path / "a.tif", planes, scale)
    layout = Dataset.open(path, words=NAMES).mosaic.files[0].layout
    features = features_of(layout, [1, 2, 3, 4], None, NAMES, integers=scale == 1)
    total = weighted_sum(layout, [1, 2, 3, 4], [0.5, 0, -0.25, 0.25], NAMES)
    assert total is not None and total.words.expr == "0.5 * b1 - 0.25 * b3 + 0.25 * b4"
    stored = {band: planes[band - 1].reshape(-1).astype(float) for band in (1, 2, 3, 4)}
    scales = dict.fromkeys((1, 2, 3, 4), BandScale(scale))
    for one in [*features, total]:
        opened = Dataset.open(path, band=one.band, words=one.words)
        values, _ = opened.read(Window(0, 0, *SHAPE))
        read = luminance_f4(values) if len(values) == 3 else values[0]
        assert opened.scale is not None
        expected = opened.scale.values(read).reshape(-1)
        assert np.allclose(one.values(stored, scales), expected, rtol=1e-6), one.choice.name


def test_indices_are_those_that_the_bands_allow(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", np.ones((4, *SHAPE), np.uint16))
    layout = Dataset.open(path, words=NAMES).mosaic.files[0].layout

    def names(bands: list[int], integers: bool = True) -> set[str | None]:
        return {one.words.index for one in features_of(layout, bands, None, NAMES, integers)} - {None}

    assert {"ndvi", "ndwi", "exg", "vari"} <= names([1, 2, 3, 4]) and "savi" not in names([1, 2, 3, 4])
    assert "savi" in names([1, 2, 3, 4], integers=False)
    assert "ndvi" not in names([1, 2, 3]) and "exg" in names([1, 2, 3])
    assert names([1]) == set()


def test_a_band_is_called_by_its_name_where_its_number_is_that_of_another(tmp_path: Path) -> None:
    """Band 2 of the file is named b3 and band 3 b4, as in a file of some bands of Sentinel-2."""
    path = written(tmp_path / "a.tif", np.ones((4, *SHAPE), np.uint16))
    with rasterio.open(path, "r+") as file:
        file.descriptions = ("B2", "B3 - green", "B4 - red", "B8 - nir")
    layout = Dataset.open(path, band=1).mosaic.files[0].layout
    total = weighted_sum(layout, [1, 2, 3, 4], [0.1, 0.2, 0.3, -0.4], BandWords())
    assert total is not None and total.choice.bands == (1, 2, 3, 4)
    assert total.words.expr == "0.1 * b1 + 0.2 * green + 0.3 * red - 0.4 * nir"


def test_a_band_that_no_word_stands_for_is_left_out_of_expressions(tmp_path: Path) -> None:
    words = BandWords(names="b2,b3,b8")
    path = written(tmp_path / "a.tif", np.ones((3, *SHAPE), np.uint16))
    layout = Dataset.open(path, words=words).mosaic.files[0].layout
    total = weighted_sum(layout, [1, 2, 3], [0.2, 0.3, -0.5], words)
    assert total is None
    assert [one.band for one in features_of(layout, [1, 2, 3], None, words, integers=True)] == [1, 2, 3, None]


def test_a_sum_of_one_band_is_none(tmp_path: Path) -> None:
    layout = Dataset.open(written(tmp_path / "a.tif", np.ones((3, *SHAPE), np.uint8))).mosaic.files[0].layout
    assert weighted_sum(layout, [1, 2, 3], [0, 1, 0], BandWords()) is None


def test_bands_of_different_types_are_not_computed_with() -> None:
    from uavseg.raster.spectral.bands import BandLayout

    layout = BandLayout(("uint8", "float32", "uint8"), ("gray", "undefined", "undefined"), (8, 32, 8))
    found = features_of(layout, [1, 2, 3], None, BandWords(), integers=True)
    assert [one.band for one in found] == [1, 2, 3, None]
    assert found[3].words.expr == "(b3 - b1) / (b3 + b1)"
