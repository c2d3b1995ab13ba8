"""Scores of cells, and mean scores of regions, do not depend on tiles."""

import numpy as np
import pytest
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import SampleError
from uavseg.execution.executors import serial
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.trace import trace
from uavseg.regions.sample.place import Disc, SampleMask, sample_mask
from uavseg.regions.sample.scores import (
    CellScores,
    Criterion,
    Sample,
    fit_sample,
    fit_weights,
    mean_scores,
    reject_unlike,
    score_cells,
)
from uavseg.segmentation.components import component_sums
from uavseg.segmentation.sample.g_scores import MAX_SCORE, NULL_SCORE
from uavseg.segmentation.source import GreySource

SIDE = 4
EDGES = np.array([2, 5, 9, 14, 20, 30, 50], np.int32) * 257


def source_of(image: NDArray[np.uint8]) -> GreySource:
    box = GeoBox(image.shape, Affine.identity(), None)
    return GreySource(Dataset.of_values(image, box, "a"), Stretch(0.0, 255.0, "dtype"))


def two_textures() -> NDArray[np.uint8]:
    """Noise on the left, stripes with noise on the right."""
    rng = np.random.default_rng(1)
    image = rng.normal(128, 30, (192, 256))
    col = np.arange(128)
    image[:, 128:] = 128 + 40 * np.sin(col * 2 * np.pi / 7) + rng.normal(0, 5, (192, 128))
    return np.clip(np.rint(image), 1, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def scene() -> tuple[GreySource, SampleMask, Sample]:
    source = source_of(two_textures())
    mask = sample_mask(Disc(60, 96, 50), source.dataset.geobox)
    return source, mask, fit_sample(source, EDGES, mask, SIDE, serial)


def same(one: CellScores, other: CellScores) -> bool:
    pairs = [(one.best, other.best), (one.whole, other.whole), (one.rest.texture, other.rest.texture)]
    return all(np.array_equal(a, b) for a, b in pairs)


def test_a_sample_is_similar_to_itself_and_not_below_the_null_score(
    scene: tuple[GreySource, SampleMask, Sample],
) -> None:
    _, mask, sample = scene
    assert sample.own >= NULL_SCORE
    assert sample.similarity(np.array([0.0, sample.own])).tolist() == [1, 1]
    similarities = sample.similarity(np.linspace(0, MAX_SCORE, 50))
    assert (np.diff(similarities) <= 0).all() and (similarities > 0).all()
    limits = [sample.limit(similarity) for similarity in (1.0, 0.9, 0.5, 0.1)]
    assert limits == sorted(limits) and limits[0] == sample.own and limits[-1] < MAX_SCORE
    assert 0 < sample.model.count <= mask.mask.sum()


def test_deviations_widen_the_bounds_of_grey(scene: tuple[GreySource, SampleMask, Sample]) -> None:
    *_, sample = scene
    narrow, wide, every = (sample.bounds(deviations) for deviations in (0, 2, np.inf))
    assert every.low <= wide.low < narrow.low < sample.mean < narrow.high < wide.high <= every.high


def criterion_of(sample: Sample) -> Criterion:
    return Criterion(sample.model, EDGES, SIDE, sample.bounds(np.inf), sample.limit(0.9))


def test_one_texture_matches_and_the_other_does_not(scene: tuple[GreySource, SampleMask, Sample]) -> None:
    source, _, sample = scene
    criterion = criterion_of(sample)
    matched = score_cells(source, criterion, TilePass(tiles(source.shape, 64))).best <= criterion.limit
    assert matched[:, :14].all() and not matched[:, 18:32].any()


@pytest.mark.parametrize("side", [64, 128])
def test_tiles_change_no_score(scene: tuple[GreySource, SampleMask, Sample], side: int) -> None:
    source, mask, sample = scene
    criterion = criterion_of(sample)
    whole = score_cells(source, criterion, TilePass(tiles(source.shape, 4096)))
    parts = score_cells(source, criterion, TilePass(tiles(source.shape, side)))
    assert same(whole, parts)
    weights = fit_weights(source, EDGES, mask, whole.whole, SIDE, serial)
    least = weights.threshold(0.9)
    once, again = (
        reject_unlike(source, criterion, scores, weights.weights, least, TilePass(tiles(source.shape, tile)))
        for scores, tile in ((whole, 4096), (parts, side))
    )
    assert same(once, again)
    changed = once.best != whole.best
    assert (once.best[changed] == MAX_SCORE).all() and (whole.best[changed] <= criterion.limit).all()


def test_every_matched_cell_is_rejected_where_the_threshold_is_out_of_reach(
    scene: tuple[GreySource, SampleMask, Sample],
) -> None:
    source, mask, sample = scene
    criterion = criterion_of(sample)
    tile_pass = TilePass(tiles(source.shape, 128))
    scores = score_cells(source, criterion, tile_pass)
    weights = fit_weights(source, EDGES, mask, scores.whole, SIDE, serial).weights
    assert (reject_unlike(source, criterion, scores, weights, 2**62, tile_pass).best > criterion.limit).all()
    assert same(reject_unlike(source, criterion, scores, weights, -(2**62), tile_pass), scores)


@pytest.mark.parametrize("side", [64, 4096])
def test_the_mean_score_of_a_region_is_that_of_its_pixels(side: int) -> None:
    rng = np.random.default_rng(2)
    labels = rng.integers(0, 5, (20, 19)).repeat(5, 0).repeat(7, 1).astype(np.uint32)
    best = rng.integers(0, 500, (16, 24)).astype(np.uint16)
    best[3:5] = MAX_SCORE  # cells without a score
    grey = np.zeros(labels.shape, np.uint16)
    outlines = RegionOutlines(trace(labels), component_sums(labels, 4, grey))
    means = mean_scores(outlines, best, TilePass(tiles(labels.shape, side)))
    scores = best.repeat(8, 0).repeat(8, 1)[: labels.shape[0], : labels.shape[1]].astype(float)
    counted = scores < MAX_SCORE
    expected = [scores[(labels == k) & counted].mean() for k in range(1, 5)]
    assert means == pytest.approx(expected)


def test_a_sample_without_texture_is_refused() -> None:
    source = source_of(two_textures())
    empty = SampleMask(Window(0, 0, 16, 16), np.packbits(np.zeros((16, 16), bool), axis=1))
    with pytest.raises(SampleError, match="no valid pixel"):
        fit_sample(source, EDGES, empty, SIDE, serial)
