"""Refinement "pixels": every valid pixel by its own value, as a threshold and a polygonizer give it."""

import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.features import rasterize, shapes
from skimage.measure import label

import uavseg
from tests.jobs.test_flatten import run, write
from uavseg.errors import ParameterError

RANGE = (0.55, 1)
IDENTITY = rasterio.Affine.identity()
GRID = rasterio.Affine(2, 0, 4e5, 0, -2, 5e6)
SHAPES = st.tuples(st.integers(1, 100), st.integers(1, 130))


def speckled(seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Noise of any grain and share of bright pixels, with 0 where nodata will be."""
    rng = np.random.default_rng(seed)
    grain = int(rng.choice([1, 1, 3, 9]))
    coarse = rng.random((shape[0] // grain + 1, shape[1] // grain + 1)) < rng.choice([0.02, 0.3, 0.6])
    bright = np.kron(coarse, np.ones((grain, grain), bool))[: shape[0], : shape[1]]
    image = np.where(bright, rng.integers(135, 256, shape), rng.integers(1, 150, shape))
    return np.where(rng.random(shape) < 0.05, 0, image).astype(np.uint8)


def vineyard(side: int = 512) -> NDArray[np.uint8]:
    """Bars of 4 bright pixels every 8."""
    rng = np.random.default_rng(1)
    ground = rng.integers(60, 68, (side, side))
    return np.where(np.arange(side) % 8 < 4, ground + 120, ground).astype(np.uint8)


def same_components(regions: Any, wanted: NDArray[np.bool_], grid: Any = IDENTITY) -> None:
    """Regions are the 4-connected components of a mask: the same pixels, and as many of each area."""
    labels, number = label(wanted, connectivity=1, return_num=True)
    assert np.array_equal(drawn(regions, np.ones(number), wanted.shape, grid), wanted)
    assert sorted(regions["pixels"]) == sorted(np.bincount(labels.ravel())[1:])
    polygons = [one for one, value in shapes(wanted.astype(np.uint8), mask=wanted) if value]
    assert len(regions) == len(polygons)


@pytest.mark.slow
@settings(max_examples=8)
@given(st.integers(0, 10**6), SHAPES, st.sampled_from([None, 64, 128]))
def test_regions_are_the_components_of_the_threshold(
    seed: int, shape: tuple[int, int], tile: int | None
) -> None:
    image = speckled(seed, shape)
    wanted = (image / 255 >= RANGE[0]) & (image > 0)
    same_components(answer(uavseg.extract, image, RANGE, refine="pixels", tile=tile), wanted)


def answer(function: Any, image: NDArray[np.uint8], *given: Any, **how: Any) -> Any:
    """Of an image whose v is its value over 255, and which is nodata at 0; without the warning of nothing."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return function(np.where(image > 0, image / 255, np.nan), *given, stretch="none", **how)


@pytest.mark.parametrize("method", ["paper", "adaptive"])
def test_bars_are_found_though_every_leaf_lies_between(method: str) -> None:
    image = vineyard()
    found = answer(uavseg.extract, image, RANGE, refine="pixels", method=method)
    same_components(found, image > 140)
    assert found["area_m2"].sum() == (image > 140).sum()


def test_a_pixel_in_range_counts_wherever_it_lies() -> None:
    image = np.full((300, 300), 20, np.uint8)
    image[200, 10] = image[201, 11] = 250  # far from any leaf in range; they touch at a corner alone
    assert len(answer(uavseg.extract, image, RANGE, refine="pixels", tile=64)) == 2


@pytest.mark.slow
def test_values_and_percentiles_are_decided_by_each_pixel(tmp_path: Path) -> None:
    image = np.random.default_rng(3).normal(300, 40, (150, 170)).astype(np.float32)
    path = tmp_path / "heat.tif"
    place = {"crs": "EPSG:32618", "transform": GRID}
    with rasterio.open(path, "w", "GTiff", 170, 150, 1, dtype="float32", **place) as file:
        file.write(image, 1)
    found = uavseg.extract(path, values=(310, 350), refine="pixels")
    same_components(found, (image >= 310) & (image <= 350), GRID)
    low = np.sort(image.ravel())[int(0.9 * image.size)]
    found = uavseg.extract(path, percentile=(90, 100), refine="pixels")
    part = drawn(found, np.ones(len(found)), image.shape, GRID)
    assert ((image >= low) != part).sum() <= 1


@pytest.mark.slow
@settings(max_examples=8)
@given(st.integers(0, 10**6), SHAPES, st.sampled_from([None, 64]))
def test_levels_and_classes_carry_the_interval_of_each_pixel(
    seed: int, shape: tuple[int, int], tile: int | None
) -> None:
    image = speckled(seed, shape)
    v, valid = image / 255, image > 0
    segments = answer(uavseg.levels, image, 0.3, refine="pixels", tile=tile)
    wanted = np.where(valid, np.ceil(v / 0.3), 0)
    assert np.array_equal(drawn(segments, segments["level"] + 1, shape), wanted)
    assert len(segments) == label(wanted, background=0, connectivity=1, return_num=True)[1]
    classes = {"dark": (0.1, 0.4), "bright": (0.4, 0.8)}
    regions = answer(uavseg.extract, image, classes=classes, refine="pixels", tile=tile)
    kinds = np.where((v >= 0.1) & (v <= 0.4), 1, np.where((v > 0.4) & (v <= 0.8), 2, 0)) * valid
    assert np.array_equal(drawn(regions, 1 + (regions["class"] == "bright"), shape), kinds)
    assert len(regions) == label(kinds, background=0, connectivity=1, return_num=True)[1]


def drawn(regions: Any, numbers: Any, shape: tuple[int, int], grid: Any = IDENTITY) -> NDArray[Any]:
    """Regions as pixels with their numbers, 0 elsewhere."""
    if not len(regions):
        return np.zeros(shape)
    return np.asarray(rasterize(zip(regions.geometry, numbers, strict=True), shape, transform=grid))


@pytest.mark.slow
def test_a_block_map_answers_from_the_raster_where_it_is_in_place(tmp_path: Path) -> None:
    raster, blocks = Path(write(tmp_path / "rows.tif", vineyard(200))), tmp_path / "blocks.tif"
    run("divide", str(raster), "-o", str(blocks), "-q")
    for how in ({"range": RANGE}, {"classes": {"bar": RANGE}}):
        found = uavseg.extract(blocks, refine="pixels", **how)
        assert found.equals(uavseg.extract(raster, refine="pixels", **how))
    same = uavseg.levels(blocks, breaks="otsu:3", refine="pixels")
    assert same.equals(uavseg.levels(raster, breaks="otsu:3", refine="pixels"))
    raster.unlink()
    for ask in (partial(uavseg.extract, range=RANGE), partial(uavseg.levels, width=0.2)):
        with pytest.raises(ParameterError, match="the raster of this block map is not where it was"):
            ask(blocks, refine="pixels")
