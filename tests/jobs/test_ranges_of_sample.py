"""Ranges that part a sample: extracting them finds what the sample is of."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from rasterio.features import rasterize

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, SampleError
from uavseg.execution.executors import threads
from uavseg.jobs.match.ranges_of_sample import (
    SampleRange,
    SampleRanges,
    SuggestLikeRequest,
    ranges_of_sample,
)
from uavseg.jobs.source.open_source import open_all_bands
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.options.reading import ReadOptions
from uavseg.regions.sample.place import Disc

SHAPE = (160, 200)
PLACE = Affine(2, 0, 4e5, 0, -2, 5e6)
INSIDE = Disc(4e5 + 2 * 50, 5e6 - 2 * 90, 60)
OUTSIDE = Disc(4e5 + 2 * 150, 5e6 - 2 * 80, 30)


def kind() -> np.ndarray:
    """Left: what is wanted, with a corner that is not."""
    rows, cols = np.indices(SHAPE)
    found: np.ndarray = (cols < 90) & ((rows > 40) | (cols > 40))
    return found


def write(path: Path, planes: np.ndarray, **more: Any) -> str:
    profile = {"count": len(planes), "height": SHAPE[0], "width": SHAPE[1], "dtype": planes.dtype.name}
    with rasterio.open(path, "w", "GTiff", **profile, crs="EPSG:32618", transform=PLACE, **more) as file:
        file.write(planes)
    return str(path)


def noisy(planes: list[np.ndarray], deviation: float = 6, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    found = np.stack(planes) + rng.normal(0, deviation, (len(planes), *SHAPE))
    return np.clip(np.rint(found), 1, 255).astype(np.uint8)


def patches(seed: int, low: float, high: float) -> np.ndarray:
    """Light that differs from patch to patch, the same in all bands."""
    coarse = np.random.default_rng(seed).uniform(low, high, (SHAPE[0] // 5, SHAPE[1] // 5))
    return np.kron(coarse, np.ones((5, 5)))


def suggested(path: str, *like: Disc, options: ReadOptions = ReadOptions(), **more: Any) -> SampleRanges:
    work = more.pop("work", SERIAL)
    request = SuggestLikeRequest(like or (INSIDE,), **more)
    return ranges_of_sample(open_all_bands(path, options), request, work)


def overlap(path: str, one: SampleRange, truth: np.ndarray) -> float:
    regions = uavseg.extract(path, values=one.values, **one.words)
    found = rasterize(((shape, 1) for shape in regions.geometry), SHAPE, transform=PLACE) > 0
    return float((found & truth).sum() / (found | truth).sum())


@pytest.mark.slow
def test_a_band_that_parts_the_kind_is_the_answer(tmp_path: Path) -> None:
    other = patches(1, 60, 190)
    path = write(tmp_path / "a.tif", noisy([other, np.where(kind(), 150, 90), other]), photometric="RGB")
    found = suggested(path)
    best = found.ranges[0]
    assert best.words == {"band": 2} and best.values[1] is None and found.warnings == ()
    assert overlap(path, best, kind()) > 0.97
    assert best.agreement > 0.75 and best.share == pytest.approx(kind().mean(), abs=0.03)


@pytest.mark.slow
def test_a_ratio_is_the_answer_under_uneven_light(tmp_path: Path) -> None:
    light = patches(2, 0.5, 1.3)
    planes = [light * np.where(kind(), 130, 90), light * 100, light * 110]
    path = write(tmp_path / "a.tif", noisy(planes, 3), photometric="RGB")
    ranges = suggested(path).ranges
    assert {"index", "expr"} & set(ranges[0].words) and overlap(path, ranges[0], kind()) > 0.95
    bands = [one for one in ranges if not {"index", "expr"} & set(one.words)]
    assert all(one.agreement < ranges[0].agreement - 0.1 for one in bands)


@pytest.mark.slow
def test_a_sum_is_as_good_where_bands_differ_by_a_step(tmp_path: Path) -> None:
    common = patches(3, 40, 160)
    planes = [common + np.where(kind(), 40, 0), common + 10, common + np.where(kind(), 10, 45)]
    path = write(tmp_path / "a.tif", noisy(planes, 8))
    [total] = [one for one in suggested(path).ranges if " * " in one.words.get("expr", "")]
    assert overlap(path, total, kind()) > 0.95


@pytest.mark.slow
def test_the_best_comes_first_and_each_kind_of_feature_once(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", noisy([patches(k, 60, 190) + 25 * kind() for k in range(3)]))
    ranges = suggested(path).ranges
    assert 1 <= len(ranges) <= 3
    for one, other in pairwise(ranges):
        assert one.agreement >= other.agreement - 0.02
    assert all(0 <= one.agreement <= 1 and 0 <= one.share <= 1 for one in ranges)


@pytest.mark.slow
def test_tiles_and_threads_change_nothing(tmp_path: Path) -> None:
    planes = noisy([patches(k, 60, 190) + 25 * kind() for k in range(3)]).astype(np.uint16) * 211
    path = write(tmp_path / "a.tif", planes)
    assert suggested(path).ranges == suggested(path, work=Work(64, threads(2))).ranges


@pytest.mark.slow
def test_what_is_unlike_is_left_out(tmp_path: Path) -> None:
    """Three levels: the sample and one unlike it leave a range between the two."""
    grey = np.where(kind(), 120, 60) + np.where(np.indices(SHAPE)[1] > 150, 90, 0)
    path = write(tmp_path / "a.tif", noisy([grey], 4))
    best = suggested(path, INSIDE, unlike=(OUTSIDE, Disc(4e5 + 2 * 180, 5e6 - 2 * 80, 20))).ranges[0]
    assert best.value_low is not None and 60 < best.value_low < 120
    assert best.value_high is not None and 120 < best.value_high < 150
    assert overlap(path, best, kind()) > 0.95


@pytest.mark.slow
def test_a_raster_of_many_bands_needs_no_choice(tmp_path: Path) -> None:
    planes = noisy([patches(k, 60, 190) for k in range(7)])
    planes[5] = noisy([np.where(kind(), 40, 120)])[0]
    path = write(tmp_path / "a.tif", planes)
    assert suggested(path).ranges[0].words == {"band": 6}
    assert suggested(path, bands=(1, 6)).ranges[0].words == {"band": 6}
    chosen = suggested(path, options=ReadOptions(band=6)).ranges
    assert [one.words for one in chosen] == [{"band": 6}]
    assert overlap(path, chosen[0], kind()) > 0.95


@pytest.mark.slow
def test_one_band_of_many_is_the_answer(tmp_path: Path) -> None:
    planes = noisy([patches(k, 60, 190) for k in range(17)])
    planes[11] = noisy([np.where(kind(), 40, 120)])[0]
    path = write(tmp_path / "a.tif", planes)
    assert suggested(path).ranges[0].words == {"band": 12}
    with pytest.raises(ParameterError, match="there is no band 18"):
        suggested(path, bands=(1, 18))


@pytest.mark.slow
def test_the_words_keep_what_was_chosen(tmp_path: Path) -> None:
    planes = noisy([np.where(kind(), 60, 120), patches(1, 90, 110), np.where(kind(), 140, 90)])
    path = write(tmp_path / "a.tif", planes)
    names = "red,green,nir"
    best = suggested(path, options=ReadOptions(index="ndvi", band_names=names)).ranges
    assert [one.words for one in best] == [{"index": "ndvi", "band_names": "red,green,nir"}]
    assert overlap(path, best[0], kind()) > 0.95
    by_name = suggested(path, options=ReadOptions(band_names=names)).ranges
    assert all(one.words["band_names"] == "red,green,nir" for one in by_name)


@pytest.mark.slow
def test_scales_are_those_of_values(tmp_path: Path) -> None:
    planes = (noisy([np.where(kind(), 150, 90)])).astype(np.int16) * 20
    path = write(tmp_path / "a.tif", planes)
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets, file.units = [0.1], [-50.0], ["degC"]
    best = suggested(path).ranges[0]
    assert best.value_low is not None and 20 * 9 - 50 < best.value_low < 20 * 15 - 50 and best.unit == "degC"
    assert overlap(path, best, kind()) > 0.97


@pytest.mark.slow
def test_what_color_does_not_part_is_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", noisy([np.full(SHAPE, 120.0)] * 3, 10))
    found = suggested(path)
    assert any("hardly parts" in line for line in found.warnings)
    flat = suggested(write(tmp_path / "flat.tif", np.full((1, *SHAPE), 9, np.uint8)))
    assert flat.ranges == () and flat.warnings


def test_samples_are_checked(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", noisy([patches(1, 60, 190)]))
    with pytest.raises(ParameterError, match="a sample of what is wanted is needed"):
        SuggestLikeRequest((), unlike=(OUTSIDE,))
    with pytest.raises(SampleError):
        suggested(path, Disc(0, 0, 5))
    with pytest.raises(SampleError, match="in common"):
        suggested(path, INSIDE, unlike=(INSIDE,))
    CliRunner().invoke(main, ["divide", path, "-o", str(tmp_path / "blocks.tif")])
    with pytest.raises(ParameterError, match="a block map holds no colors"):
        suggested(str(tmp_path / "blocks.tif"))


@pytest.mark.slow
def test_a_palette_is_its_luminance(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", kind().astype(np.uint8)[None], photometric="palette")
    with rasterio.open(path, "r+") as file:
        file.write_colormap(1, {0: (20, 40, 30, 255), 1: (200, 210, 190, 255)})
    [best] = suggested(path).ranges
    with pytest.warns(UserWarning, match="palette"):
        fits = overlap(path, best, kind()) > 0.98
    assert fits and best.words == {} and best.values[1] is None and best.value_low is not None


@pytest.mark.slow
def test_a_sample_may_be_an_array_of_three_numbers(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", noisy([np.where(kind(), 150, 90)]))
    place = (INSIDE.x, INSIDE.y, INSIDE.radius)
    assert uavseg.suggest(path, like=np.array(place)) == uavseg.suggest(path, like=place)  # type: ignore[arg-type]
