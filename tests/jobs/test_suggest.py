"""Ranges that are suggested are what extracting them gives."""

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from scipy import ndimage

import uavseg
from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import threads
from uavseg.jobs import suggest as module
from uavseg.jobs.divide import divide
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.source.source import Blocks, Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.jobs.suggest import Suggestion, Suggestions, SuggestRequest, suggest
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import parse_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.range_choice import ChosenRange, RangeChoice

NONE = SegmentParams(refine="none")


def scene(seed: int, shape: tuple[int, int] = (210, 170)) -> np.ndarray:
    """Patches with noise; what is missing is NaN."""
    rng = np.random.default_rng(seed)
    coarse = rng.choice([0.15, 0.5, 0.85], (shape[0] // 24 + 1, shape[1] // 24 + 1))
    image = np.kron(coarse, np.ones((24, 24)))[: shape[0], : shape[1]] + rng.normal(0, 0.06, shape)
    image = np.clip(image, 0, 1).astype(np.float32)
    image[rng.random(shape) < 0.03] = np.nan
    image[50:80, 30:90] = np.nan
    return image


def dataset(image: np.ndarray) -> Dataset:
    return Dataset.of_values(image, GeoBox(image.shape, Affine.identity(), None), "scene")


def raster(image: np.ndarray) -> Raster:
    return Raster(dataset(image), parse_stretch("none"))


def suggested(
    image: np.ndarray, classes: int | None = None, segment: SegmentParams = NONE, work: Work = SERIAL
) -> Suggestions:
    return suggest(raster(image), SuggestRequest(classes, segment), work)


def classes_of(found: Suggestions) -> list[Suggestion]:
    """The ranges that together are 0..1."""
    return [one for one in found.by_intensity if not one.part]


def saved(image: np.ndarray) -> Blocks:
    return Blocks(divide(raster(image)).saved, "blocks.tif")


@pytest.mark.parametrize(
    "segment", [NONE, SegmentParams("paper", refine="none"), SegmentParams("adaptive", 2, 0.2, "none")]
)
@pytest.mark.parametrize("classes", [None, 2, 7])
def test_regions_and_pixels_are_those_of_extracting_each_range(
    classes: int | None, segment: SegmentParams
) -> None:
    blocks = saved(scene(1))
    found = suggest(blocks, SuggestRequest(classes, segment))
    assert len(found.ranges) == (classes or 3 if segment is NONE else len(found.ranges))
    for chosen in found.ranges:
        interval = IntensityRange(*chosen.range)
        regions = extract(blocks, ExtractRequest(interval, segment)).regions
        known = blocks.saved.blocks
        inside = cells_in_range(known, interval, segment.division)
        assert (len(regions), int(known.counts[inside > 0].sum())) == (chosen.regions, chosen.pixels)


@pytest.mark.parametrize("seed", range(5))
def test_ranges_are_all_of_v_and_their_shares_are_all_of_the_area(seed: int) -> None:
    image = scene(seed)
    for classes in (None, 2, 3, 8):
        ranges = classes_of(suggested(image, classes))
        assert sum(chosen.pixels for chosen in ranges) == np.isfinite(image).sum()
        assert sum(chosen.share for chosen in ranges) == pytest.approx(1, abs=1e-12)
        assert [chosen.low for chosen in ranges] == [0, *(chosen.high for chosen in ranges[:-1])]
        assert ranges[-1].high == 1 and all(chosen.regions > 0 for chosen in ranges)


def test_a_cut_that_is_a_mean_moves_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise the leaves on it would belong to the ranges on both of its sides."""
    image = np.full((128, 128), 0.4, np.float32)
    image[:64] = 0.8
    halves = tuple(ChosenRange(*ends, False, None) for ends in ((0.0, 0.4), (0.4, 1.0)))
    monkeypatch.setattr(module, "choose_ranges", lambda *_: RangeChoice(halves, 1.0))
    found = suggest(saved(image))
    assert [chosen.range for chosen in found.ranges] == [(0, 0.40001), (0.40001, 1)]
    assert [chosen.share for chosen in found.ranges] == [0.5, 0.5]


def test_tiles_threads_and_a_block_map_change_nothing() -> None:
    image = scene(2, (330, 270))
    wanted = suggested(image)
    blocks = suggest(saved(image))
    assert blocks.ranges == wanted.ranges and np.array_equal(blocks.histogram, wanted.histogram)
    for tile in (64, 128, 4096):
        found = suggested(image, work=Work(tile, threads(2)))
        assert found.ranges == wanted.ranges and np.array_equal(found.intervals, wanted.intervals)


@pytest.mark.slow
def test_tiles_change_neither_parts_nor_doubt() -> None:
    wanted = suggested(texture(1), segment=SegmentParams())
    assert [one.part for one in wanted.ranges] == [False, False, True] and len(wanted.warnings) == 1
    for tile in (64, 192, 4096):
        found = suggested(texture(1), segment=SegmentParams(), work=Work(tile, threads(2)))
        assert found.ranges == wanted.ranges and found.warnings == wanted.warnings
        assert np.array_equal(found.intervals, wanted.intervals)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_list_of_a_negative_is_the_list_mirrored(seed: int) -> None:
    for image in (texture(seed), discs(0.02, 0.3, seed, 0.08), scene(seed)):
        here, negative = (suggested(v, segment=SegmentParams()) for v in (image, 1 - image))
        mirrored = sorted((one.part, 1 - one.high, 1 - one.low) for one in negative.ranges)
        assert mirrored == [pytest.approx((one.part, *one.range), abs=0.015) for one in here.by_intensity]
        first = negative.ranges[0]
        assert here.ranges[0].range == pytest.approx((1 - first.high, 1 - first.low), abs=0.015)
        kinds = [[text.split(" (")[0] for text in found.warnings] for found in (here, negative)]
        assert kinds[0] == kinds[1]


def test_known_classes_are_found() -> None:
    found = classes_of(suggested(scene(3)))
    assert len(found) == 3
    assert [chosen.high for chosen in found[:2]] == [
        pytest.approx(0.325, abs=0.06),
        pytest.approx(0.675, abs=0.06),
    ]


def discs(share: float, step: float, seed: int = 0, noise: float = 0.03) -> np.ndarray:
    """Two grounds, and small discs that are brighter (or darker) than both."""
    rng = np.random.default_rng(seed)
    image = np.full((320, 384), 0.4) + 0.12 * (np.arange(384) > 180)
    rows, cols = np.indices(image.shape)
    inside = np.zeros(image.shape, bool)
    while inside.mean() < share:
        row, col, radius = rng.uniform(12, 308), rng.uniform(12, 372), rng.uniform(6, 11)
        inside |= (rows - row) ** 2 + (cols - col) ** 2 < radius**2
    image = image + step * inside + rng.normal(0, noise, image.shape)
    return np.clip(image, 0, 1).astype(np.float32)


@pytest.mark.parametrize("step", [0.3, -0.3])
def test_small_things_are_a_part_that_comes_first(step: float) -> None:
    image = discs(0.02, step)
    found = suggested(image, segment=SegmentParams())
    first = found.ranges[0]
    assert first.low > 0.6 if step > 0 else first.high < 0.35
    truth = image > 0.69 if step > 0 else image < 0.28
    assert first.share == pytest.approx(truth.mean(), rel=0.5) and first.contrast is not None
    assert first.contrast > max(one.contrast or 0 for one in found.ranges[1:]) and found.warnings == ()
    regions = extract(raster(image), ExtractRequest(IntensityRange(*first.range))).regions
    assert len(regions) == first.regions


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("segment", [NONE, SegmentParams()])
def test_small_things_and_their_grounds_are_all_of_the_area(seed: int, segment: SegmentParams) -> None:
    image = discs(0.01, (0.3, -0.3, 0.2)[seed], seed, 0.05)
    found = suggested(image, segment=segment)
    classes = classes_of(found)
    assert len(classes) > 2 and all(one.regions > 0 and one.pixels > 0 for one in found.ranges)
    assert [one.low for one in classes] == [0, *(one.high for one in classes[:-1])] and classes[-1].high == 1
    assert sum(one.share for one in classes) == pytest.approx(
        1, abs=0.01 if segment.decides_pixels else 1e-12
    )


def test_a_part_has_the_cells_whose_own_mean_lies_in_it() -> None:
    found = suggested(discs(0.01, 0.3, 2, 0.08), segment=SegmentParams())
    classes = found.by_intensity
    [part] = [one for one in classes if one.part]
    assert classes[-1] is part and part.high == 1
    blocks = found.blocks
    mean = blocks.sums / (65535.0 * np.maximum(blocks.counts, 1))
    inside = (blocks.counts > 0) & (mean >= part.low)
    assert np.array_equal(found.intervals == len(classes), inside)


def test_a_number_of_classes_is_without_parts() -> None:
    image = discs(0.01, 0.3, 2, 0.08)
    assert any(one.part for one in suggested(image, segment=SegmentParams()).ranges)
    for classes in (2, 4):
        found = suggested(image, classes, SegmentParams())
        assert len(found.ranges) == classes and not any(one.part for one in found.ranges)


def test_a_constant_raster_is_one_class_and_no_range() -> None:
    found = suggested(np.full((100, 90), 0.25, np.float32))
    assert found.ranges == () and found.warnings == (
        "all leaves have the mean v = 0.25: one class, and no range to choose",
    )


def test_fewer_means_than_classes_are_reported() -> None:
    image = np.full((64, 128), 0.2, np.float32)
    image[:, 64:] = 0.9
    found = suggested(image, 5)
    assert len(found.ranges) == 2 and "fall into 2 bins, which are no 5 classes" in found.warnings[0]


def test_doubt_is_reported() -> None:
    image = np.random.default_rng(4).normal(0.5, 0.1, (512, 512)).astype(np.float32)
    assert "no range stands out at its borders (contrast 2." in suggested(image).warnings[0]


def blurred(seed: int, sigma: float) -> np.ndarray:
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(384, 384)), sigma, mode="wrap")
    return np.asarray(field / field.std())


def texture(seed: int) -> np.ndarray:
    """One ground whose brightness has a long tail, as of leaves or of light on water."""
    image = 0.15 * np.exp(0.4 * blurred(seed, 8)) + 0.018 * blurred(seed + 9, 0.1)
    return np.clip(image, 0, 1).astype(np.float32)


def grounds(step: float, seed: int = 1) -> np.ndarray:
    """Two grounds with texture of their own size; without a step they are one."""
    field = blurred(seed, 16)
    image = 0.4 + 0.1 * field + step * (field > 0.3) + 0.1 * blurred(seed + 7, 0.1)
    return np.clip(image, 0, 1).astype(np.float32)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_each_doubt_has_its_words(seed: int) -> None:
    told = {
        "no range stands out at its borders": 0.5 + 0.1 * blurred(seed, 10).astype(np.float32),
        "a part of a class stands out more than any class": texture(seed),
        "the classes overlap, and no valley parts them": grounds(0.1, seed),
    }
    for doubt, image in told.items():
        found = suggested(image, segment=SegmentParams())
        [warning] = found.warnings
        assert warning.startswith(f"{doubt} (contrast ") and "look.png" in warning
        best = max(one.contrast or 0 for one in found.ranges)
        assert f"(contrast {best:.1f};" in warning
    assert suggested(grounds(0.5, seed), segment=SegmentParams()).warnings == ()


def test_a_requested_number_of_classes_has_no_doubt_of_their_number() -> None:
    for image in (texture(0), grounds(0.1)):
        assert suggested(image, segment=SegmentParams()).warnings != ()
        assert suggested(image, 2, SegmentParams()).warnings == ()


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(RasterError, match="no pixel of scene is valid"):
        suggested(np.full((20, 20), np.nan, np.float32))
    for classes in (-1, 0, 1, 9):
        with pytest.raises(ParameterError, match="ranges are 2 to 8 in number"):
            suggested(scene(1), classes)


# In Python


@pytest.mark.slow
def test_the_public_word_gives_ranges_to_extract() -> None:
    image = scene(5)
    ranges = uavseg.suggest(image, stretch="none", tile=64, threads=2)
    assert ranges == list(suggested(image, segment=SegmentParams()).ranges)
    for chosen in ranges:
        regions = uavseg.extract(image, chosen.range, stretch="none")
        assert (len(regions), regions["pixels"].sum()) == (chosen.regions, chosen.pixels)


def test_the_public_word_warns_and_refuses() -> None:
    with pytest.warns(UserWarning, match="one class"):
        assert uavseg.suggest(np.full((70, 70), 9, np.uint8)) == []
    for wrong in ("many", 2.5):
        with pytest.raises(ParameterError, match=r"classes (is|are) "):
            uavseg.suggest(scene(1), wrong)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="2 to 8"):
        uavseg.suggest(scene(1), 12)


@pytest.mark.parametrize("name", ["imagery/naip_forest_gap_1m.tif", "imagery/landsat_bahamas_RGB.byte.tif"])
def test_real_rasters(shared_data: Path, name: str) -> None:
    found = suggest(Raster(Dataset.open(shared_data / name)))
    classes = classes_of(found)
    assert len(classes) >= 2 and sum(chosen.share for chosen in classes) == pytest.approx(1, abs=0.01)
    for part in (one for one in found.ranges if one.part):
        assert 0 < part.share < 0.8 * max(one.share for one in classes) and part.regions > 0
