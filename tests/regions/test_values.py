"""Attributes in values are those of the pixels, also where the stretch clips them."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from numpy.typing import NDArray

from tests.raster.intensity.test_values import dataset_of
from uavseg.errors import ParameterError
from uavseg.jobs.divide import divide
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.segment_classes import LevelsRequest, levels
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.source.source import Blocks, Raster
from uavseg.jobs.source.work import Work
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import parse_stretch
from uavseg.raster.intensity.value_range import ValueRange
from uavseg.raster.spectral.bands import BandScale
from uavseg.regions.edit.small import as_area
from uavseg.regions.outline.rings import rasterise
from uavseg.segmentation.params.segment import IntensityRange, Levels, SegmentParams

SCALE = BandScale(0.1, -50.0, "degC")


def stored(seed: int = 0) -> NDArray[np.int16]:
    """Warm ground with a few hot spots, which the stretch clips."""
    rng = np.random.default_rng(seed)
    image = rng.normal(700, 10, (200, 260))
    for row, col in rng.integers(8, 180, (7, 2)):
        image[row : row + 12, col : col + 20] += rng.integers(150, 500)
    return image.astype(np.int16)


def means(found: Extraction, image: NDArray[np.int16]) -> list[float]:
    labels = rasterise(found.rings, Window(0, 0, *image.shape))
    values = image * SCALE.scale + SCALE.offset
    return [float(values[labels == number].mean()) for number in found.regions.columns["id"]]


@pytest.mark.parametrize("tile", [64, 128, None])
@pytest.mark.parametrize("stretch", ["auto", "600,800", "dtype"])
@pytest.mark.parametrize("fill", [None, "40px"])
def test_mean_values_are_those_of_the_pixels(tile: int | None, stretch: str, fill: str | None) -> None:
    image = stored()
    source = Raster(dataset_of(image, SCALE), parse_stretch(stretch))
    request = ExtractRequest(ValueRange(27, None), fill_holes=as_area(fill))
    found = extract(source, request, Work(tile))
    columns = found.regions.columns
    assert len(found.regions) >= 5
    assert columns["mean_value"] == pytest.approx(means(found, image), abs=0.03)
    assert set(columns["unit"]) == {"degC"} and set(columns["value_low"]) == {27.0}
    assert np.isnan(columns["value_high"]).all()


def test_levels_have_their_values_open_at_the_ends() -> None:
    image = stored()
    source = Raster(dataset_of(image, SCALE), parse_stretch("650,750"))
    found = levels(source, LevelsRequest(Levels(0.5)))
    columns = found.regions.columns
    assert columns["mean_value"] == pytest.approx(means(found, image), abs=0.01)
    dark, bright = (columns["level"] == level for level in (0, 1))
    assert np.isnan(columns["value_low"][dark]).all() and set(columns["value_high"][dark]) == {20.0}
    assert np.isnan(columns["value_high"][bright]).all() and set(columns["value_low"][bright]) == {20.0}


def test_a_block_map_knows_means_only_where_nothing_is_clipped() -> None:
    request = ExtractRequest(IntensityRange(0.3, 1), SegmentParams(refine="none"))
    for image, stretch, known in [
        (stored(), "auto", False),
        ((stored() // 5).astype(np.uint8), "auto", True),
    ]:
        saved = divide(Raster(dataset_of(image), parse_stretch(stretch))).saved
        found = extract(Blocks(saved, "blocks.tif"), request)
        assert len(found.regions) and found.regions.columns["unit"][0] == ""
        assert np.isfinite(found.regions.columns["mean_value"]).all() == known


def test_a_block_map_answers_values_inside_its_stretch() -> None:
    image = (stored() // 5).astype(np.uint8)
    source = Raster(dataset_of(image), parse_stretch("auto"))
    refine = SegmentParams(refine="none")
    requested = ExtractRequest(ValueRange(170, None), refine)
    found = extract(Blocks(divide(source).saved, "blocks.tif"), requested).regions.columns
    expected = extract(source, requested).regions.columns
    assert found["pixels"].tolist() == expected["pixels"].tolist() and len(found["pixels"])
    assert found["value_low"].tolist() == expected["value_low"].tolist()


def test_values_are_unknown_where_files_share_no_scale(tmp_path: Path) -> None:
    for number, scale in enumerate((0.1, 0.01)):
        place = Affine(1, 0, 260 * number, 0, -1, 200)
        size = {"height": 200, "width": 260, "count": 1, "dtype": "int16", "transform": place}
        with rasterio.open(tmp_path / f"{number}.tif", "w", "GTiff", crs="EPSG:32618", **size) as file:
            file.write(stored(number), 1)
            file.scales = (scale,)
    source = open_source([tmp_path / "0.tif", tmp_path / "1.tif"])
    columns = extract(source, ExtractRequest(IntensityRange(0.5, 1))).regions.columns
    assert any("stored numbers are compared as they are" in text for text in source.warnings)
    assert len(columns["id"]) and np.isnan(columns["mean_value"]).all() and set(columns["unit"]) == {""}
    with pytest.raises(ParameterError, match="have different scales"):
        extract(source, ExtractRequest(ValueRange(3, None)))
    alone = extract(open_source(tmp_path / "1.tif"), ExtractRequest(ValueRange(8, None)))
    assert (alone.regions.columns["mean_value"] > 8).all() and len(alone.regions)
