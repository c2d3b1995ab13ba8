from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from uavseg.errors import ParameterError
from uavseg.execution.executors import serial, threads
from uavseg.raster.grid.tiling import TilePass, tiles
from uavseg.raster.intensity.stretch import Stretch, fit_stretch, parse_stretch, rank_of
from uavseg.raster.read.dataset import Dataset

PERCENTS = [0, 0.5, 2, 25, 50, 98, 99.9, 100]


def fitted(dataset, spec, side=64, map=serial):
    return fit_stretch(dataset, spec, TilePass(tiles(dataset.geobox.shape, side), map))


def nearest_rank(numbers, percent):
    """The smallest number with at least `percent` of all at or below it; nothing is rounded."""
    rank = max(-(-Fraction(str(percent)) * len(numbers) // 100), 1)
    return float(np.sort(numbers)[rank - 1])


@st.composite
def rasters(draw):
    dtype = np.dtype(
        draw(st.sampled_from(["uint8", "int8", "uint16", "int16", "int32", "float32", "float64"]))
    )
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (draw(st.integers(1, 100)), draw(st.integers(1, 100)))
    spread = draw(st.sampled_from([1, 30, 1000]))
    return (
        (rng.normal(0, spread, shape) if dtype.kind == "f" else rng.normal(0, 30, shape))
        .clip(*((-1e9, 1e9) if dtype.kind == "f" else (np.iinfo(dtype).min, np.iinfo(dtype).max)))
        .astype(dtype)
    )


@pytest.mark.slow
@settings(max_examples=50)
@given(rasters(), st.sampled_from(PERCENTS[:4]), st.sampled_from(PERCENTS[4:]))
def test_percentiles_are_nearest_ranks_exactly(write_raster, pixels, low, high):
    stretch = fitted(Dataset.open(write_raster(pixels)), f"percentile:{low},{high}")
    numbers = pixels.astype(np.float32).ravel() if pixels.dtype.kind == "f" else pixels.ravel()
    assert (stretch.low, stretch.high) == (nearest_rank(numbers, low), nearest_rank(numbers, high))


@pytest.mark.slow
@settings(max_examples=50)
@given(rasters(), st.integers(1, 15))
def test_percentiles_are_those_of_numpy(write_raster, pixels, eighths):
    percent = eighths * 6.25  # a binary fraction: numpy's own arithmetic on it is exact
    stretch = fitted(Dataset.open(write_raster(pixels)), f"percentile:0,{percent}")
    numbers = pixels.astype(np.float32) if pixels.dtype.kind == "f" else pixels
    assert stretch.high == float(np.percentile(numbers, percent, method="inverted_cdf"))


@pytest.mark.slow
@settings(max_examples=25)
@given(rasters(), st.integers(0, 2**32))
def test_tiles_and_workers_change_nothing(write_raster, pixels, seed):
    mask = np.random.default_rng(seed).choice([0, 255], pixels.shape).astype(np.uint8)
    dataset = Dataset.open(write_raster(pixels, mask=mask))
    for spec in ("percentile:2,98", "minmax"):
        answers = {fitted(dataset, spec, side, who) for side in (64, 128) for who in (serial, threads(2))}
        assert len(answers) == 1


def test_only_valid_pixels_are_counted(write_raster):
    pixels = np.array([[1, 2, 3, 1000]], np.uint16)
    assert fitted(Dataset.open(write_raster(pixels, nodata=1000)), "minmax").high == 3
    holes = np.array([[1, 2, 3, np.nan, np.inf]], np.float32)
    assert fitted(Dataset.open(write_raster(holes)), "minmax").high == 3


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_colours_are_stretched_by_their_luminance(write_raster, dtype):
    colors = np.random.default_rng(3).integers(0, 200, (3, 70, 80)).astype(dtype)
    r, g, b = colors.astype(np.float64)
    luminance = (0.2126 * r + 0.7152 * g + 0.0722 * b).astype(np.float32).ravel()
    stretch = fitted(Dataset.open(write_raster(colors)), "percentile:10,90")
    assert (stretch.low, stretch.high) == (nearest_rank(luminance, 10), nearest_rank(luminance, 90))


@pytest.mark.parametrize(
    ("dtype", "how", "spec", "low", "high", "name"),
    [
        ("uint8", {}, "auto", 0, 255, "dtype -> 0..255"),
        ("int8", {}, "auto", 0, 127, "dtype -> 0..127"),
        ("uint8", {"nbits": 1}, "auto", 0, 1, "dtype -> 0..1"),
        ("uint16", {}, "dtype", 0, 65535, "dtype -> 0..65535"),
        ("uint16", {"nbits": 12}, "dtype", 0, 4095, "dtype -> 0..4095"),
        ("int16", {}, "dtype", 0, 32767, "dtype -> 0..32767"),
        ("uint32", {}, "dtype", 0, 4294967295, "dtype -> 0..4.29497e+09"),
        ("uint16", {}, "auto", 0, 1, "percentile:2,98 -> 0..1"),
        ("float32", {}, "auto", 0, 1, "percentile:2,98 -> 0..1"),
        ("float32", {}, "none", 0, 1, "none -> 0..1"),
        ("uint16", {}, "-10.5,2047", -10.5, 2047, "-10.5,2047 -> -10.5..2047"),
    ],
)
def test_each_form_gives_its_bounds(write_raster, dtype, how, spec, low, high, name):
    dataset = Dataset.open(write_raster(np.array([[0, 1], [1, 0]], dtype), **how))
    assert fitted(dataset, spec) == Stretch(low, high, name)


def test_no_pixel_is_read_where_none_is_needed(write_raster):
    dataset = Dataset.open(write_raster(np.zeros((8, 8), np.uint8)))

    def nobody(*_):
        raise AssertionError("pixels were read")

    assert fit_stretch(dataset, "auto", TilePass([], nobody)).high == 255


def test_floats_have_no_maximum(write_raster):
    with pytest.raises(ParameterError, match="no maximum"):
        fitted(Dataset.open(write_raster(np.zeros((8, 8), np.float32))), "dtype")


def test_a_constant_image_is_middle_grey_with_a_warning(write_raster):
    dataset = Dataset.open(write_raster(np.full((8, 8), 300, np.uint16)))
    stretch = fitted(dataset, "auto")
    assert (stretch.low, stretch.high) == (300, 300)
    assert "one intensity" in stretch.warnings[0]
    assert (stretch.apply(np.full((1, 2, 2), 300, np.uint16)) == 32768).all()


def test_an_image_without_valid_pixels_gives_a_warning(write_raster):
    stretch = fitted(Dataset.open(write_raster(np.zeros((8, 8), np.uint16), nodata=0)), "auto")
    assert "no pixel is valid" in stretch.warnings[0]


def test_invalid_pixels_are_black():
    values, valid = np.full((1, 2, 2), 255, np.uint8), np.array([[True, False], [False, True]])
    assert Stretch(0.0, 255.0, "").apply(values, valid).tolist() == [[65535, 0], [0, 65535]]
    assert Stretch(7.0, 7.0, "").apply(values * np.float32("nan"), ~valid & valid).tolist() == [
        [0, 0],
        [0, 0],
    ]


@pytest.mark.parametrize(
    "text", ["auto", "dtype", "minmax", "none", "percentile:2,98", "percentile:0.5,99.5", "-1,7.25"]
)
def test_parsing_and_formatting_a_stretch_round_trip(text):
    spec = parse_stretch(text)
    assert parse_stretch(str(spec)) == spec


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is one of auto"),
        ("fast", "is one of auto"),
        ("1", "is one of auto"),
        ("1,2,3", "is one of auto"),
        ("nan,1", "is one of auto"),
        ("0,inf", "is one of auto"),
        ("1/0,2", "is one of auto"),
        ("percentile", "is one of auto"),
        ("percentile:2", "is one of auto"),
        ("percentile:98,2", "0 <= P < Q <= 100"),
        ("percentile:-1,50", "0 <= P < Q <= 100"),
        ("percentile:1,101", "0 <= P < Q <= 100"),
        ("5,5", "below its high"),
        ("9,2", "below its high"),
    ],
)
def test_other_texts_are_refused(text, words):
    with pytest.raises(ParameterError, match=words):
        parse_stretch(text)


@given(st.integers(1, 10**6), st.integers(0, 1000))
def test_ranks_are_between_the_first_and_the_last(total, permille):
    rank = rank_of(Fraction(permille, 10), total)
    assert 1 <= rank <= total
    assert rank * 1000 >= permille * total > (rank - 1) * 1000 or rank == 1


@settings(max_examples=50)
@given(hnp.arrays(np.float32, st.integers(1, 30), elements=st.floats(width=32, allow_nan=False)))
def test_keys_put_floats_in_order(numbers):
    from uavseg.raster.intensity import stretch

    counts = stretch.count_upper_halves(numbers, None)
    found = []
    for upper in np.flatnonzero(counts):
        [lowers] = stretch.count_lower_halves(numbers, None, (int(upper),))
        found += [stretch.value_of_key(int(upper), int(low)) for low in np.repeat(np.arange(65536), lowers)]
    assert found == np.sort(numbers).tolist()


def test_the_functions_of_a_fit_can_be_pickled(write_raster):
    import pickle

    dataset = Dataset.open(write_raster(np.arange(100, dtype=np.uint16).reshape(10, 10)))

    def by_post(function, items, progress=None):
        return [pickle.loads(pickle.dumps(function))(item) for item in items]

    assert fitted(dataset, "minmax", map=partial(by_post)).high == 99
