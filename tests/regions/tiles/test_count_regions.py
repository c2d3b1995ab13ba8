"""Numbers of regions: counted as extracting gives them, and estimates that are near."""

import numpy as np
import pytest
from affine import Affine

from uavseg.jobs import suggest as module
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.source.source import Raster
from uavseg.jobs.suggest import SuggestRequest, suggest
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.tiles import range_tiles as count_regions
from uavseg.regions.tiles.range_tiles import sample_parts
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams


def raster(seed: int, shape: tuple[int, int], step: int = 24) -> Raster:
    """Patches with noise and holes of NaN."""
    rng = np.random.default_rng(seed)
    coarse = rng.choice([0.2, 0.5, 0.8], (shape[0] // step + 1, shape[1] // step + 1))
    image = np.kron(coarse, np.ones((step, step)))[: shape[0], : shape[1]] + rng.normal(0, 0.1, shape)
    image = np.clip(image, 0, 1).astype(np.float32)
    image[rng.random(shape) < 0.01] = np.nan
    return Raster(Dataset.of_values(image, GeoBox(shape, Affine.identity(), None), "scene"))


@pytest.mark.parametrize("how", [("adaptive", "tv"), ("paper", "scan"), ("adaptive", "smooth")])
@pytest.mark.parametrize("seed", range(3))
def test_the_number_is_that_of_extracting(seed: int, how: tuple[str, str]) -> None:
    source = raster(seed, (333, 290))
    segment = SegmentParams(how[0], refine=how[1])  # type: ignore[arg-type]
    ranges = suggest(source, SuggestRequest(3, segment)).ranges
    assert len(ranges) == 3
    for one in ranges:
        regions = extract(source, ExtractRequest(IntensityRange(*one.range), segment)).regions
        assert one.exact and one.regions == len(regions) and one.regions_text == f"{len(regions):,}"
        assert one.pixels == regions.columns["pixels"].sum()


@pytest.mark.slow
def test_the_number_in_a_large_raster_is_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    source = raster(7, (1400, 1300), 40)
    exact = suggest(source, SuggestRequest(3)).ranges
    monkeypatch.setattr(module, "EXACT_PIXELS", 1000)
    monkeypatch.setattr(count_regions, "PART_SIDE", 128)
    estimated = suggest(source, SuggestRequest(3)).ranges
    for one, other in zip(exact, estimated, strict=True):
        assert not other.exact and other.regions_text.startswith("about ")
        assert other.regions == pytest.approx(one.regions, rel=0.4)
        assert other.share == pytest.approx(one.share, abs=0.1)


@pytest.mark.parametrize("shape", [(1, 1), (1024, 3000), (20_000, 9000), (10**6, 10**6)])
def test_parts_lie_on_the_raster_and_apart(shape: tuple[int, int]) -> None:
    parts = sample_parts(shape)
    assert 1 <= len(parts) <= 25 and len(set(parts)) == len(parts)
    assert all(part == part.clipped(shape) and part.rows > 0 < part.cols for part in parts)
    assert all(part.row % 64 == 0 == part.col % 64 for part in parts)
    if max(shape) <= 1024:
        assert parts == [Window(0, 0, *shape)]
