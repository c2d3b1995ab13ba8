"""Tests of the confidence of regions."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, strategies as st
from scipy.ndimage import gaussian_filter

import uavseg
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.confidence import (
    OF_RANGES,
    Parting,
    confidence_of,
    keep_confident,
    region_terms,
    texture_terms,
)
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.components import border_steps, component_sums, label_components
from uavseg.segmentation.source import GreySource, Statistics, with_statistics


def all_steps(grey):
    """Absolute differences of all adjacent pixels."""
    return np.concatenate([abs(np.diff(grey.astype(int), axis=axis)).ravel() for axis in (0, 1)])


def statistics(grey):
    """Mean step, standard deviation and Otsu's eta of a picture, threshold by threshold."""
    g, parted = grey.astype(float), [0.0]
    for end in np.unique(g)[:-1]:
        low, high = g[g <= end], g[g > end]
        parted.append(low.size * high.size / g.size**2 * (low.mean() - high.mean()) ** 2)
    return Statistics(all_steps(grey).mean(), g.std(), max(parted) / max(g.var(), 1e-9))


def source_of(grey):
    """A picture whose grey is that of an array."""
    place = GeoBox(grey.shape, Affine.identity(), None)
    return GreySource(Dataset.of_values(grey, place, "picture"), Stretch(0, 65535, "none"))


def outlined(mask, grey, raster=None):
    """Regions of a mask, with their sums."""
    labels, count = label_components(mask.astype(np.uint8))
    large = int(np.quantile(all_steps(grey if raster is None else raster), 0.9, method="lower"))
    steps = border_steps(mask.astype(np.uint8), labels, count, grey, np.ones_like(mask, np.uint8), large)
    return RegionOutlines(trace(labels), replace(component_sums(labels, count, grey), steps=steps))


@pytest.fixture
def square():
    """A square of 10 pixels with a contrast of a fifth of the range and noise of a sixteenth."""
    mask = np.zeros((30, 30), bool)
    mask[10:20, 10:20] = True
    noise = np.random.default_rng(0).normal(0, 0.06, mask.shape)
    return mask, np.rint(65535 * (0.4 + 0.2 * mask + noise)).astype(np.uint16)


def test_terms_are_what_they_are_said_to_be(square):
    mask, grey = square
    terms = region_terms(outlined(mask, grey), statistics(grey))[0]
    size, shape, large, to_steps, to_deviation, parted = terms
    beside = np.abs(np.diff(grey.astype(int), axis=1))[mask[:, 1:] != mask[:, :-1]].tolist()
    beside += np.abs(np.diff(grey.astype(int), axis=0))[mask[1:] != mask[:-1]].tolist()
    assert size == pytest.approx(np.log(100))
    assert shape == pytest.approx(0)
    raster = statistics(grey)
    assert large == np.mean(np.array(beside) > np.quantile(all_steps(grey), 0.9, method="lower"))
    assert to_steps == pytest.approx(np.log((np.mean(beside) + 1) / (raster.mean_step + 1)))
    assert to_deviation == pytest.approx(np.log((np.mean(beside) + 1) / (raster.deviation + 1)))
    assert parted == raster.separability


def test_a_clear_square_is_surer_than_a_faint_or_ragged_one(square):
    mask, grey = square
    faint = np.rint(65535 * 0.5 + (grey - 65535 * 0.5) * np.where(mask, 1, 0.2)).astype(np.uint16)
    rng = np.random.default_rng(1)
    ragged = rng.permutation(grey[mask]).reshape(100, 1)
    line = np.full((120, 3), grey[~mask].min(), np.uint16)
    line[10:110, 1:2] = ragged
    along = np.zeros(line.shape, bool)
    along[10:110, 1] = True
    clear = confidence_of(outlined(mask, grey), statistics(grey))[0]
    assert clear > 0.9
    assert confidence_of(outlined(mask, faint, grey), statistics(grey))[0] < clear  # in one raster
    assert confidence_of(outlined(along, line, grey), statistics(grey))[0] < 0.5


@pytest.mark.slow
@given(st.integers(0, 9999))
def test_dark_regions_are_as_sure_as_bright_ones(seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((12, 12)) < 0.4
    grey = np.rint(65535 * rng.random(mask.shape)).astype(np.uint16)
    bright = confidence_of(outlined(mask, grey), statistics(grey))
    dark = confidence_of(outlined(mask, 65535 - grey), statistics(65535 - grey))
    np.testing.assert_allclose(bright, dark, atol=0.0011)
    assert ((bright >= 0) & (bright <= 1)).all()


def test_what_is_not_known_has_no_confidence(square):
    mask, grey = square
    found = outlined(mask, grey)
    without = replace(found, sums=replace(found.sums, steps=None))
    assert np.isnan(confidence_of(without, statistics(grey))).all()
    assert np.isnan(confidence_of(found, source_of(grey).statistics)).all()


def test_a_region_without_bounds_or_borders_has_some():
    grey = np.full((8, 8), 100, np.uint16)
    found = confidence_of(outlined(np.ones((8, 8), bool), grey), statistics(grey))
    assert np.isfinite(found).all()


def test_the_probability_is_a_logistic_function():
    terms = np.array([[1.0, 0.5, 0.4, 1.0, 1.0, 0.7]])
    logit = OF_RANGES.intercept + float(terms[0] @ OF_RANGES.terms)
    assert OF_RANGES.probability(terms)[0] == pytest.approx(1 / (1 + np.exp(-logit)), abs=0.0005)


@given(st.integers(1, 64), st.integers(1, 64), st.integers(1, 4), st.integers(0, 99))
def test_statistics_are_those_of_all_pixels_of_a_small_raster(rows, cols, kinds, seed):
    rng = np.random.default_rng(seed)
    grey = (rng.integers(0, kinds, (rows, cols)) * 9000 + rng.integers(0, 40, (rows, cols))).astype(np.uint16)
    found = with_statistics(source_of(grey), TilePass([]))
    if grey.size == 1:
        assert found.statistics == Statistics(0, 0, 0)
        return
    np.testing.assert_allclose(astuple(found.statistics), astuple(statistics(grey)), rtol=1e-6)
    assert found.large_step == np.quantile(all_steps(grey), 0.9, method="lower")


def test_statistics_of_a_large_raster_are_near_those_of_all_its_pixels():
    grey = np.random.default_rng(2).normal(30000, 3000, (900, 1500)).astype(np.uint16)
    grey[:, 800:] += 9000
    found = with_statistics(source_of(grey), TilePass([]))
    np.testing.assert_allclose(found.statistics.mean_step, all_steps(grey).mean(), rtol=0.02)
    np.testing.assert_allclose(found.statistics.deviation, grey.std(), rtol=0.02)


@pytest.mark.slow
def test_statistics_of_a_corner_are_found_in_an_empty_raster():
    values = np.full((1600, 1600), np.nan)
    values[1430:1500, 1500:1580] = np.random.default_rng(4).random((70, 80))
    place = GeoBox(values.shape, Affine.identity(), None)
    source = GreySource(Dataset.of_values(values, place, "corner"), Stretch(0, 1, "none"))
    assert with_statistics(source, TilePass([])).statistics.mean_step > 10000
    nothing = Dataset.of_values(np.full(values.shape, np.nan), place, "nothing")
    assert with_statistics(GreySource(nothing, source.stretch), TilePass([])).statistics == Statistics(
        0, 0, 0
    )


def drawn_square(blur=0.0, noise=0.04, cut=0.0, side=24):
    """A bright square; `cut` is noise in a third of its pixels."""
    v = np.full((256, 256), 0.4)
    v[100 : 100 + side, 100 : 100 + side] += 0.3
    rng = np.random.default_rng(6)
    v = gaussian_filter(v, blur) + rng.normal(0, noise, v.shape)
    v[100 : 100 + side, 100 : 100 + side] += (
        cut * rng.normal(size=(side, side)) * (rng.random((side, side)) < 1 / 3)
    )
    return v


def sure(v, **words):
    return uavseg.extract(v, range=(0.55, 1), stretch="none", **words)["confidence"].iloc[0]


@pytest.mark.parametrize("noise", [0.01, 0.04])
def test_a_sharp_border_is_surer_than_a_blurred_one(noise):
    values = [sure(drawn_square(blur, noise, side=12)) for blur in (0, 1, 2, 4)]
    assert values[0] > 0.8 and values == sorted(values, reverse=True) and values[-1] < values[0] - 0.4


def test_a_region_that_noise_cuts_is_less_sure():
    clear = sure(drawn_square(), refine="pixels")
    assert sure(drawn_square(cut=0.3), refine="pixels") < clear - 0.1


@pytest.mark.parametrize(("factor", "offset"), [(0.5, 0.1), (40, -7), (3, 100)])
def test_an_affine_change_of_values_with_its_stretch_changes_nothing(noisy, factor, offset):
    ends = f"{offset},{factor + offset}"
    changed = uavseg.extract(noisy * factor + offset, range=(0.5, 1), stretch=ends)
    first = uavseg.extract(noisy, range=(0.5, 1), stretch="0,1")
    assert changed["pixels"].tolist() == first["pixels"].tolist()
    np.testing.assert_allclose(changed["confidence"], first["confidence"], atol=0.0011)


def test_the_sure_ones_are_kept_in_order():
    mask = np.zeros((9, 20), bool)
    mask[1:8, 1:8], mask[1:4, 10:13], mask[6:8, 10:12] = True, True, True
    found = outlined(mask, np.full(mask.shape, 9, np.uint16))
    kept, which = keep_confident(found, np.array([0.2, 0.9, 0.5]), 0.5)
    assert which.tolist() == [False, True, True]
    assert kept.sums.counts.tolist() == found.sums.counts[1:].tolist()
    assert sorted(set(kept.rings.labels.tolist())) == [1, 2]


@pytest.fixture
def noisy():
    """A bright square of 60 pixels among grains of a few pixels."""
    rng = np.random.default_rng(3)
    grains = gaussian_filter(rng.normal(size=(256, 256)), 2)
    v = 0.42 + 0.04 * grains / grains.std() + rng.normal(0, 0.03, grains.shape)
    v[40:100, 40:100] += 0.26
    return np.clip(v, 0, 1)


def test_tiles_and_threads_change_nothing(noisy):
    whole = uavseg.extract(noisy, range=(0.5, 1), stretch="none")
    tiled = uavseg.extract(noisy, range=(0.5, 1), stretch="none", tile=64, threads=2)
    assert whole["confidence"].nunique() > 1
    assert whole["confidence"].tolist() == tiled["confidence"].tolist()


def test_the_square_is_sure_and_the_specks_are_not(noisy):
    found = uavseg.extract(noisy, range=(0.5, 1), stretch="none")
    assert found["confidence"][0] > 0.8
    assert found["confidence"][1:].max() < 0.5
    kept = uavseg.extract(noisy, range=(0.5, 1), stretch="none", min_confidence=0.6)
    assert kept["pixels"].tolist() == found["pixels"][:1].tolist()
    assert kept["id"].tolist() == [1]
    assert kept.attrs["uavseg"]["min_confidence"] == 0.6
    assert "min_confidence" not in found.attrs["uavseg"]


@pytest.mark.parametrize("job", ["classes", "levels"])
def test_kinds_have_the_confidence_of_their_own_range(noisy, job):
    if job == "classes":
        many = uavseg.extract(noisy, classes={"a": (0, 0.5), "b": (0.5, 1)}, stretch="none")
    else:
        many = uavseg.levels(noisy, breaks=[0.5], stretch="none")
    least = uavseg.extract(noisy, range=(0.5, 1), stretch="none")
    same = many[many["range_low"] == 0.5]
    assert same["pixels"].max() == least["pixels"].max()
    assert abs(same["confidence"].iloc[0] - least["confidence"].iloc[0]) < 0.01
    sure = float(many["confidence"].median())
    again = (
        uavseg.extract(noisy, classes={"a": (0, 0.5), "b": (0.5, 1)}, stretch="none", min_confidence=sure)
        if job == "classes"
        else uavseg.levels(noisy, breaks=[0.5], stretch="none", min_confidence=sure)
    )
    kept = many[many["confidence"] >= sure]
    assert 0 < len(again) < len(many)
    for column in ("pixels", "confidence", "range_low", "class" if job == "classes" else "level"):
        assert again[column].tolist() == kept[column].tolist()


def test_block_edges_have_no_confidence_and_refuse_a_least_one(noisy):
    found = uavseg.extract(noisy, range=(0.5, 1), stretch="none", refine="none")
    assert found["confidence"].isna().all()
    with pytest.raises(uavseg.errors.ParameterError, match="block edges have no confidence"):
        uavseg.extract(noisy, range=(0.5, 1), stretch="none", refine="none", min_confidence=0.5)


@pytest.mark.parametrize("least", [-0.1, 1.1, float("nan")])
def test_a_least_confidence_is_within_0_and_1(noisy, least):
    with pytest.raises(uavseg.errors.ParameterError, match="within 0 and 1"):
        uavseg.extract(noisy, range=(0.5, 1), stretch="none", min_confidence=least)


def test_where_none_is_sure_enough_a_warning_says_so(noisy):
    noisy[40:100, 40:100] -= 0.26
    with pytest.warns(UserWarning, match="a confidence of less than 1; a smaller minimum keeps more"):
        found = uavseg.extract(noisy, range=(0.5, 1), stretch="none", min_confidence=1)
    assert len(found) == 0


@pytest.mark.slow
def test_matches_have_a_confidence(noisy):
    found = uavseg.match(noisy, like=(70, 70, 20), by="color", stretch="none")
    assert found["confidence"].iloc[0] > 0.8
    tiled = uavseg.match(noisy, like=(70, 70, 20), by="color", stretch="none", tile=64)
    assert found["confidence"].tolist() == tiled["confidence"].tolist()
    kept = uavseg.match(noisy, like=(70, 70, 20), by="color", stretch="none", min_confidence=0.8)
    assert kept["pixels"].tolist() == found["pixels"][found["confidence"] >= 0.8].tolist()


@pytest.fixture
def rows():
    """A square of 150 pixels with rows in two directions, on grains of the same mean and deviation."""
    rng = np.random.default_rng(5)
    grains = gaussian_filter(rng.normal(size=(256, 256)), 1)
    row, col = np.mgrid[:256, :256]
    v = 0.5 + 0.1 * grains / grains.std()
    inside = 0.5 + 0.14 * np.sin((row + 0.5 * col) * 2 * np.pi / 7) + rng.normal(0, 0.02, v.shape)
    v[40:190, 40:190] = inside[40:190, 40:190]
    return np.clip(v, 0, 1)


def test_a_region_by_texture_is_sure_where_texture_parts_it(rows):
    found = uavseg.match(rows, like=(115, 115, 40), by="texture", stretch="none")
    assert found["confidence"].iloc[0] > 0.8
    assert abs(found["pixels"].iloc[0] - 150**2) < 1500
    tiled = uavseg.match(rows, like=(115, 115, 40), by="texture", stretch="none", tile=64, threads=2)
    assert found["confidence"].tolist() == tiled["confidence"].tolist()
    kept = uavseg.match(rows, like=(115, 115, 40), by="texture", stretch="none", min_confidence=0.8)
    assert kept["pixels"].tolist() == found["pixels"][found["confidence"] >= 0.8].tolist()


def test_texture_at_the_edges_of_cells_has_no_confidence(rows):
    found = uavseg.match(rows, like=(115, 115, 40), by="texture", refine="none", stretch="none")
    assert found["confidence"].isna().all()


def test_where_no_texture_is_sure_enough_a_warning_says_so(rows):
    with pytest.warns(UserWarning, match="have a confidence of less than 1|has a confidence of less than 1"):
        found = uavseg.match(rows, like=(115, 115, 40), by="texture", stretch="none", min_confidence=1)
    assert len(found) == 0


def test_terms_of_texture_are_what_they_are_said_to_be(square):
    mask, grey = square
    parting = Parting(window=8, separability=0.9, pixels=1000)
    terms = texture_terms(outlined(mask, grey), parting, statistics(grey))[0]
    beside = region_terms(outlined(mask, grey), statistics(grey))[0, 4]
    assert terms == pytest.approx([np.log(100 / 64), 0, 0.9, 0.1, beside])
