"""Regions like a sample by texture: where grey tells nothing, for any tiles, and as the words promise."""

import pickle
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.crs import CRS

import uavseg
from uavseg.errors import ParameterError, SampleError
from uavseg.execution.executors import serial, threads
from uavseg.jobs.match.match import Match, match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import parse_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.edit.small import as_area
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.sample.place import Disc

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]


def grain(rng: np.random.Generator, shape: tuple[int, int], side: int) -> NDArray[np.float64]:
    """Noise as a mean over squares."""
    made = rng.normal(size=(shape[0] + side, shape[1] + side)).cumsum(0).cumsum(1)
    return made[side:, side:] - made[:-side, side:] - made[side:, :-side] + made[:-side, :-side]


def even(made: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same texture with mean 0.5 and deviation 0.12."""
    return 0.5 + 0.12 * (made - made.mean()) / made.std()


def texture(name: str, rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.float64]:
    row, col = np.mgrid[: shape[0], : shape[1]]
    noise = rng.normal(size=shape)
    if name == "sand":
        return even(noise)
    if name == "meadow":
        return even(grain(rng, shape, 3) / 3 + 0.3 * noise)
    if name == "forest":
        return even(-np.abs(grain(rng, shape, 6)) / 6 + 0.2 * noise)
    return even(np.sin((row + 0.5 * col) * 2 * np.pi / 7) + 0.4 * noise)


def scene(wanted: str, other: str, seed: int = 0, shape: tuple[int, int] = (256, 320)) -> tuple[Image, Mask]:
    """A disc and a bar of one texture in another one; both have the same mean and deviation."""
    rng = np.random.default_rng(seed)
    row, col = np.mgrid[: shape[0], : shape[1]]
    truth = (row - 110) ** 2 + (col - 110) ** 2 < 80**2
    truth |= (col > 230) & (col < 290) & (row > 40)
    image = np.where(truth, texture(wanted, rng, shape), texture(other, rng, shape))
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8), truth


INSIDE = Disc(110, 110, 50)  # of the scene's disc
PLAIN = MatchRequest(INSIDE, by="texture")
CELLS = replace(PLAIN, refine="none")


def dataset(image: NDArray[np.generic], crs: str | None = None) -> Dataset:
    """A raster with pixels of one unit, y downwards."""
    return Dataset.of_values(image, GeoBox(image.shape, Affine.identity(), crs and CRS.from_string(crs)), "a")


def found(
    image: NDArray[np.generic],
    like: Disc = INSIDE,
    request: MatchRequest = PLAIN,
    stretch: str = "auto",
    work: Work = SERIAL,
) -> Match:
    return match(Raster(dataset(image), parse_stretch(stretch)), replace(request, like=like), work)


def painted(made: Match) -> Mask:
    box = made.found.geobox
    return rasterise(made.found.rings, Window(0, 0, *box.shape)) > 0


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


def best_threshold(image: Image, truth: Mask) -> float:
    """The best overlap of any range of greys, after any of three blurs: what grey can do, told the truth."""
    best = 0.0
    for side in (1, 5, 11):
        padded = np.pad(image.astype(float), side // 2, mode="reflect").cumsum(0).cumsum(1)
        padded = np.pad(padded, ((1, 0), (1, 0)))
        sums = padded[side:, side:] - padded[:-side, side:] - padded[side:, :-side] + padded[:-side, :-side]
        steps = np.quantile(sums, np.linspace(0, 1, 11))
        ranges = [(low, high) for k, low in enumerate(steps) for high in steps[k + 1 :]]
        best = max(best, *(overlap((sums >= low) & (sums <= high), truth) for low, high in ranges))
    return best


PAIRS = [("rows", "meadow"), ("rows", "sand"), ("forest", "sand"), ("meadow", "sand"), ("sand", "rows")]


@pytest.mark.parametrize(("wanted", "other"), PAIRS, ids=" in ".join)
def test_texture_is_found_where_grey_tells_nothing(wanted: str, other: str) -> None:
    image, truth = scene(wanted, other)
    assert overlap(painted(found(image)), truth) > 0.9
    assert best_threshold(image, truth) < 0.6


@pytest.mark.parametrize("seed", range(3))
def test_textures_that_a_window_alone_may_both_be_are_told_apart(seed: int) -> None:
    """G of windows takes all of this meadow for forest: what the raster as a whole looks like tells them."""
    image, truth = scene("forest", "meadow", seed)
    assert overlap(painted(found(image)), truth) > 0.65
    assert best_threshold(image, truth) < 0.6


def test_what_is_found_goes_to_the_pixel() -> None:
    image, truth = scene("rows", "meadow", 1)
    by_pixel, by_cell = (overlap(painted(found(image, request=p)), truth) for p in (PLAIN, CELLS))
    assert by_pixel > by_cell > 0.7


@pytest.mark.slow
@settings(max_examples=6)
@given(
    seed=st.integers(0, 10**6),
    shape=st.tuples(st.integers(70, 200), st.integers(70, 200)),
    wanted=st.sampled_from(["rows", "forest"]),
    refine=st.sampled_from(["pixel", "none"]),
    window=st.sampled_from([16, 24, 32]),
)
def test_tiles_and_threads_change_nothing(
    seed: int, shape: tuple[int, int], wanted: str, refine: str, window: int
) -> None:
    rng = np.random.default_rng(seed)
    image, _ = scene(wanted, "meadow", seed, (256, 320))
    image = image[: shape[0], : shape[1]].astype(np.float32) / 255
    image[rng.random(shape) < 0.001] = np.nan
    like = Disc(36, 36, 34)
    request = MatchRequest(like, window, refine=refine, similarity=0.7)
    whole = found(image, like, request, "none", Work(256))
    for side, count in ((64, 1), (128, 2)):
        parts = found(image, like, request, "none", Work(side, threads(count)))
        assert np.array_equal(parts.found.rings.vertices, whole.found.rings.vertices)
        assert np.array_equal(parts.found.rings.labels, whole.found.rings.labels)
        for name, column in whole.found.regions.columns.items():
            np.testing.assert_array_equal(parts.found.regions.columns[name], column)


@pytest.mark.slow
def test_what_workers_get_and_give_may_be_sent() -> None:
    """As a scheduler does: each function, item and result goes through pickle."""

    def elsewhere(function: Any, items: Any, progress: Any = None) -> Iterator[Any]:
        for item in items:
            sent, job = pickle.loads(pickle.dumps((function, item)))
            yield pickle.loads(pickle.dumps(sent(job)))

    image, _ = scene("rows", "sand", 11)
    request = MatchRequest(INSIDE, fill_holes=as_area("50px"))
    here, there = (found(image, request=request, work=Work(64, run)) for run in (serial, elsewhere))
    for name, column in here.found.regions.columns.items():
        np.testing.assert_array_equal(there.found.regions.columns[name], column)


@pytest.mark.parametrize("wanted", ["rows", "meadow", "sand", "forest"])
def test_a_sample_is_like_itself(wanted: str) -> None:
    image, _ = scene(wanted, "meadow" if wanted == "rows" else "rows", 2)
    row, col = np.mgrid[: image.shape[0], : image.shape[1]]
    own = (row + 0.5 - INSIDE.y) ** 2 + (col + 0.5 - INSIDE.x) ** 2 <= INSIDE.radius**2
    assert painted(found(image))[own].all()


@pytest.mark.parametrize("name", ["sand", "meadow", "forest", "rows"])
def test_a_raster_of_one_texture_is_like_its_sample_everywhere(name: str) -> None:
    made = texture(name, np.random.default_rng(3), (200, 160))
    image = np.rint(255 * np.clip(made, 0, 1)).astype(np.uint8)
    columns = found(image, Disc(80, 100, 60)).found.regions.columns
    assert columns["pixels"].tolist() == [200 * 160]
    assert columns["similarity"][0] == 1


@pytest.mark.slow
@pytest.mark.parametrize("pair", [("meadow", "forest"), ("rows", "meadow")], ids=" in ".join)
def test_less_similarity_finds_all_of_it_and_more(pair: tuple[str, str]) -> None:
    image, _ = scene(*pair, 4)
    masks = [painted(found(image, request=replace(CELLS, similarity=s))) for s in (1, 0.9, 0.7, 0.4, 0.1)]
    for strict, loose in pairwise(masks):
        assert not (strict & ~loose).any()
    assert masks[-1].sum() > masks[0].sum()


@pytest.mark.slow
def test_more_deviations_find_all_of_it_and_more() -> None:
    image, _ = scene("sand", "sand", 5)
    image[:, 160:] = np.clip(image[:, 160:] * 0.9 + 30, 0, 255)
    masks = [painted(found(image, request=replace(CELLS, intensity=k))) for k in (0, 0.3, 1, 3, np.inf)]
    for strict, loose in pairwise(masks):
        assert not (strict & ~loose).any()
    assert masks[0].sum() < masks[-1].sum()


def test_the_same_texture_of_another_grey_is_not_like_the_sample() -> None:
    rng = np.random.default_rng(6)
    image = 0.3 + 0.05 * rng.normal(size=(200, 300))
    image[:, 150:] += 0.3
    sides = painted(found(np.clip(image, 0, 1), Disc(75, 100, 50), stretch="none"))
    assert sides[:, :148].all() and not sides[:, 152:].any()
    alone = replace(PLAIN, intensity=np.inf)
    assert painted(found(np.clip(image, 0, 1), Disc(75, 100, 50), alone, "none")).all()


def test_each_region_tells_how_similar_it_is() -> None:
    image, truth = scene("rows", "meadow", 7)
    strict = found(image, request=replace(CELLS, similarity=0.9))
    columns = strict.found.regions.columns
    assert list(columns)[:4] == ["id", "similarity", "confidence", "area_m2"]
    assert (columns["similarity"] >= 0.9).all() and (columns["similarity"] <= 1).all()
    assert strict.texture is not None and strict.compared == "texture"
    assert strict.texture.limit == pytest.approx(strict.texture.own - 2 * np.log(0.9), abs=0.001)
    grey = image[truth].astype(float) / 255
    assert strict.texture.sample.mean / 65535 == pytest.approx(grey.mean(), abs=0.01)
    assert strict.texture.sample.deviation / 65535 == pytest.approx(grey.std(), abs=0.01)
    low, high = columns["range_low"][0], columns["range_high"][0]
    assert (low, high) == pytest.approx((grey.mean() - grey.std(), grey.mean() + grey.std()), abs=0.02)


def test_nodata_is_never_like_anything_and_hides_nothing() -> None:
    image, truth = scene("rows", "meadow", 8)
    values = image.astype(np.float32) / 255
    values[60:70] = np.nan
    values[:, 300:] = np.nan
    made = painted(found(values, stretch="none"))
    known = np.isfinite(values)
    assert not made[~known].any()
    assert overlap(made[known], truth[known]) > 0.85


def test_holes_are_filled_and_small_regions_dropped() -> None:
    image, _ = scene("rows", "meadow", 9)
    image[104:128, 104:128] = 127  # a hole in the texture
    open_, filled = (
        found(image, Disc(110, 60, 28), MatchRequest(INSIDE, 16, fill_holes=size, min_area=size))
        for size in (None, as_area("900px"))
    )
    assert not painted(open_)[115, 115] and painted(filled)[115, 115]
    assert filled.found.regions.columns["pixels"].min() >= 900
    assert filled.found.regions.columns["holes"].sum() < open_.found.regions.columns["holes"].sum()


@pytest.mark.slow
def test_a_clearing_is_not_like_the_forest_around_it(shared_data: Path) -> None:
    raster = Dataset.open(shared_data / "imagery" / "naip_forest_gap_1m.tif")
    x, y = raster.geobox.xy_from_pixel(230, 100)
    made = painted(match(Raster(raster), MatchRequest(Disc(float(x), float(y), 50))))
    assert made[180:, :60].mean() > 0.95 and made[150:280, 180:].mean() > 0.99
    assert not made[75:100, 108:125].any() and not made[15:25, 70:90].any()


# Samples


@pytest.mark.parametrize("radius", [3, 8, 12])
def test_a_sample_that_is_too_small_is_refused_with_how_large_it_must_be(radius: float) -> None:
    image, _ = scene("rows", "meadow")
    with pytest.raises(SampleError, match=r"at least 512.* a radius of 16 pixels"):
        found(image, Disc(110, 110, radius))
    with pytest.raises(SampleError, match=r"at least 2,048.* a radius of 32 pixels"):
        found(image, Disc(110, 110, radius), replace(PLAIN, window=32))


@pytest.mark.parametrize(("radius", "window"), [(16, 16), (23, 16), (24, 24), (31, 24), (32, 32), (70, 32)])
def test_the_window_is_the_largest_usual_one_that_fits(radius: float, window: int) -> None:
    image, _ = scene("rows", "meadow")
    made = found(image, Disc(110, 110, radius))
    assert made.texture is not None and made.texture.window == window


@pytest.mark.slow
@settings(max_examples=10)
@given(x=st.floats(100, 120), y=st.floats(100, 120), window=st.sampled_from([16, 32, 64]))
def test_a_disc_as_large_as_the_message_says_is_enough(x: float, y: float, window: int) -> None:
    image, _ = scene("rows", "meadow", shape=(220, 220))
    made = found(image, Disc(x, y, window), replace(PLAIN, window=window))
    assert made.texture is not None and made.texture.sample.model.count > 2 * window**2


def test_a_sample_on_nodata_is_refused() -> None:
    values = np.full((200, 200), np.nan)
    values[:, :100] = 0.5
    with pytest.raises(SampleError, match="lies on nodata"):
        found(values, Disc(160, 100, 35), stretch="none")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"window": 30}, "one of 16, 24, 32"),
        ({"similarity": 0}, "above 0 and at most 1, not 0"),
        ({"similarity": 1.1}, "at most 1, not 1.1"),
        ({"similarity": np.nan}, "at most 1"),
        ({"intensity": -1}, "not negative, not -1"),
        ({"intensity": np.nan}, "not negative"),
        ({"refine": "scan"}, "pixel or none"),
    ],
)
def test_parameters_check_themselves(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        MatchRequest(INSIDE, **wrong)  # type: ignore[arg-type]


@pytest.mark.slow
def test_from_python() -> None:
    image, truth = scene("rows", "sand", 10)
    frame = uavseg.match(image, like=(110, 110, 50))
    assert frame.geometry.iloc[0].contains(shapely.Point(110, 110))
    assert frame["pixels"].sum() == pytest.approx(truth.sum(), rel=0.1)
    assert {"similarity", "area_m2", "mean", "std", "source"} <= set(frame.columns)
