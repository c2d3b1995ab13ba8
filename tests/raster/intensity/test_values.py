"""Ranges of values are decided exactly by pixels, whatever their type and the stretch."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, isnan

import numpy as np
import pytest
from affine import Affine
from hypothesis import assume, given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import Stretch, parse_stretch
from uavseg.raster.intensity.value_range import DetectedRange, ValueRange, axis_of, fit_values, range_on_axis
from uavseg.raster.read.array_source import from_values
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.mosaic import align_rasters
from uavseg.raster.spectral.bands import BandScale, ValueAxis, choose_bands

TYPES = (np.uint8, np.int8, np.int16, np.uint16, np.int32, np.float32, np.float64)


def dataset_of(values: NDArray, scale: BandScale | None = None) -> Dataset:
    box = GeoBox(values.shape, Affine.identity(), None)
    if scale is None:
        return Dataset.of_values(values, box, "array")
    source = replace(from_values(values, box, "array"), scales=(scale,))
    return Dataset(align_rasters([source]), choose_bands(source.layout), ())


def fitted(
    dataset: Dataset, stretch: str, requested: ValueRange, tile: int = 64
) -> tuple[Stretch, DetectedRange]:
    return fit_values(dataset, parse_stretch(stretch), requested, TilePass(dataset.windows(tile)))


def selected(values: NDArray, stretch: Stretch, found: DetectedRange) -> NDArray[np.bool_]:
    """The pixels whose own grey is in the range."""
    grey = stretch.apply(values if values.ndim == 3 else values[None])
    low, high = found.interval.greys
    return (grey >= low) & (grey <= high)


def in_range(values: NDArray, requested: ValueRange) -> NDArray[np.bool_]:
    low, high = (
        -inf if requested.low is None else requested.low,
        inf if requested.high is None else requested.high,
    )
    return (values >= low) & (values <= high)


@st.composite
def images(draw: st.DrawFn) -> NDArray:
    """Skewed values of some type, with a few that are far from the others."""
    dtype = np.dtype(draw(st.sampled_from(TYPES)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    image = rng.gamma(2, draw(st.sampled_from([3, 40, 900])), (70, 90)) - 20
    image[rng.random(image.shape) < 0.01] *= 30
    if dtype.kind in "iu":
        image = image.clip(np.iinfo(dtype).min, np.iinfo(dtype).max)
    return image.astype(dtype)


@st.composite
def cases(draw: st.DrawFn) -> tuple[NDArray, ValueRange]:
    """An image, and a range whose ends are values of pixels, near them or open."""
    image = draw(images())
    ends = sorted(image.reshape(-1)[draw(st.integers(0, image.size - 1))].item() for _ in range(2))
    if draw(st.booleans()) and ends[0] > image.min():
        ends[0] -= 0.25
    kind = draw(st.sampled_from(["both", "low", "high", "one"]))
    if kind == "one":
        ends[1] = ends[0]
    return image, ValueRange(None if kind == "high" else ends[0], None if kind == "low" else ends[1])


@pytest.mark.slow
@settings(max_examples=150)
@given(cases(), st.sampled_from(["auto", "minmax"]))
def test_the_pixels_selected_are_those_whose_value_lies_in_the_range(
    case: tuple[NDArray, ValueRange], stretch: str
) -> None:
    image, requested = case
    found, fit = fitted(dataset_of(image), stretch, requested)
    assert np.array_equal(selected(image, found, fit), in_range(image, requested))


@pytest.mark.parametrize("span", [50, 3000, 65534, 65535])
@pytest.mark.parametrize("within", [0.25, 0.5, 0.75, 0.9999])
def test_a_range_between_two_integers_holds_no_pixel(span: int, within: float) -> None:
    image = np.linspace(0, span, 5000).astype(np.uint16).reshape(50, 100)
    image[0, :40] = np.arange(40)
    for below in (0, 7, 21, 38):
        end = below + within
        found, fit = fitted(dataset_of(image), "minmax", ValueRange(end, end))
        assert fit.interval.low < fit.interval.high and not selected(image, found, fit).any()


@settings(max_examples=60)
@given(cases(), st.sampled_from(["0,50", "percentile:10,90", "dtype", "none"]))
def test_a_chosen_stretch_decides_exactly_or_refuses(case: tuple[NDArray, ValueRange], stretch: str) -> None:
    image, requested = case
    assume(stretch != "dtype" or image.dtype.kind != "f")
    try:
        found, fit = fitted(dataset_of(image), stretch, requested)
    except ParameterError as error:
        assert "reaches to" in str(error) and "use the stretch auto" in str(error)
        return
    assert np.array_equal(selected(image, found, fit), in_range(image, requested))


def test_a_range_beyond_the_automatic_stretch_widens_it() -> None:
    image = np.arange(10000, dtype=np.uint16).reshape(100, 100)
    usual, _ = fitted(dataset_of(image), "auto", ValueRange(4000, 6000))
    assert usual.name == "percentile:2,98 -> 199..9799"
    wide, fit = fitted(dataset_of(image), "auto", ValueRange(9900, None))
    assert (wide.low, wide.high) == (199, 9999) and "widened to 199..9999" in wide.name
    assert selected(image, wide, fit).sum() == 100


def test_a_bound_beyond_all_values_does_not_widen_it() -> None:
    image = np.arange(10000, dtype=np.float32).reshape(100, 100)
    found, fit = fitted(dataset_of(image), "auto", ValueRange(5000, 1e30))
    assert found.high == 9799 and fit.interval.high == 1 and fit.ends == (5000, 1e30)


def test_a_bound_at_the_end_of_a_chosen_stretch_is_not_lost_among_what_is_clipped() -> None:
    image = np.array([[49.0, 50.0, 50.5, 80.0]], np.float32)
    found, fit = fitted(dataset_of(image), "0,50", ValueRange(20, 50))
    assert selected(image, found, fit).tolist() == [[True, True, False, False]]
    assert found.high == pytest.approx(50, abs=2e-3)


@settings(max_examples=40)
@given(images(), st.tuples(st.integers(0, 100), st.integers(0, 100)).map(sorted))
def test_percentiles_are_nearest_ranks_of_all_pixels(image: NDArray, ends: list[int]) -> None:
    values = np.sort(image.reshape(-1).astype(np.float32))
    low, high = (values[max(-(-end * values.size // 100), 1) - 1] for end in ends)
    found, fit = fitted(dataset_of(image), "auto", ValueRange(*ends, by_rank=True))
    assert np.array_equal(
        selected(image, found, fit), in_range(image.astype(np.float32), ValueRange(low, high))
    )


@given(st.sampled_from([128, 192]), st.booleans())
@settings(max_examples=6)
def test_tiles_change_nothing(tile: int, by_rank: bool) -> None:
    image = np.random.default_rng(1).normal(20, 5, (200, 300)).astype(np.float32)
    requested = ValueRange(30, 40, by_rank)
    assert fitted(dataset_of(image), "auto", requested, tile=tile) == fitted(
        dataset_of(image), "auto", requested, tile=64
    )


def test_values_are_those_after_scale_and_offset() -> None:
    stored = np.arange(-500, 1500, dtype=np.int16).reshape(40, 50)
    values = stored * 0.1 + 5
    dataset = dataset_of(stored, BandScale(0.1, 5.0, "degC"))
    found, fit = fitted(dataset, "auto", ValueRange(35, 35.3))
    assert np.array_equal(selected(stored, found, fit), (values > 34.99) & (values < 35.31))
    axis = axis_of(dataset, found)
    assert axis is not None and axis.unit == "degC"
    assert axis.values([fit.interval.low, fit.interval.high]) == pytest.approx([35, 35.3], abs=0.01)


def test_a_negative_scale_turns_the_range_around() -> None:
    stored = np.arange(2000, dtype=np.int16).reshape(40, 50)
    dataset = dataset_of(stored, BandScale(-1.0, 0.0))
    found, fit = fitted(dataset, "auto", ValueRange(-10, None))
    assert np.array_equal(selected(stored, found, fit), stored <= 10)
    found, fit = fitted(dataset, "auto", ValueRange(90, 100, by_rank=True))
    assert np.array_equal(selected(stored, found, fit), -stored >= np.sort(-stored.reshape(-1))[1799])


def test_open_and_closed_ranges_of_wide_floats_are_exact() -> None:
    image = np.random.default_rng(2).normal(0, 10, (80, 80))
    for requested in (ValueRange(None, -5), ValueRange(-4.5, 0.125), ValueRange(12, 70)):
        found, fit = fitted(dataset_of(image), "auto", requested)
        assert np.array_equal(selected(image, found, fit), in_range(image, requested))


@pytest.mark.parametrize(
    ("ends", "by_rank", "text"),
    [
        ((None, None), False, "at least one end"),
        ((3, 2), False, "above its high one"),
        ((0, inf), False, "finite"),
        ((-1, 20), True, "0..100"),
        ((90, 101), True, "0..100"),
    ],
)
def test_what_is_no_range_is_refused(ends: Sequence[float | None], by_rank: bool, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        ValueRange(*ends, by_rank=by_rank)


def test_values_that_the_type_cannot_hold_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"can hold: 0 to 255 \(uint8\)"):
        fitted(dataset_of(np.zeros((8, 8), np.uint8)), "auto", ValueRange(300, None))


def test_where_no_pixel_is_valid_there_is_a_range() -> None:
    _, fit = fitted(dataset_of(np.full((8, 8), np.nan)), "auto", ValueRange(3, None))
    assert (fit.interval.low, fit.interval.high) == (0, 1)


def test_the_axis_of_a_clipping_stretch_is_open_at_its_ends() -> None:
    axis = ValueAxis(100, 300, BandScale(0.1, 0, "m"), (0, 65535))
    assert all(map(isnan, axis.ends(0, 1))) and axis.text(0, 1) == "all values"
    assert ValueAxis(0, 255, limits=(0, 255)).ends(0, 1) == (0, 255)
    assert ValueAxis(100, 300, BandScale(-1, 0), (0, 65535)).text(0.5, 1) == "-200 and less"


def test_a_block_map_refuses_what_its_stretch_makes_alike() -> None:
    axis = ValueAxis(100, 300)
    assert range_on_axis(ValueRange(150, None), axis, "a.tif").interval.low == pytest.approx(0.25, abs=1e-5)
    for requested in (ValueRange(300, None), ValueRange(50, 200)):
        with pytest.raises(ParameterError, match="does not lie inside of the stretch"):
            range_on_axis(requested, axis, "a.tif")
    with pytest.raises(ParameterError, match="which a block map has not"):
        range_on_axis(ValueRange(90, 100, by_rank=True), axis, "a.tif")


def test_a_stretch_to_infinity_has_no_values(recwarn: pytest.WarningsRecorder) -> None:
    assert all(map(isnan, ValueAxis(-inf, inf).values([0.3, 0.8]))) and not recwarn.list


def test_values_too_far_apart_for_a_stretch_are_refused() -> None:
    image = np.array([[-3e307, 0.0, 1e-300, 3e307]] * 4)
    dataset = Dataset.of_values(image, GeoBox(image.shape, Affine.identity(), None), "far.tif")
    with pytest.raises(ParameterError, match=r"far.tif reach from -?inf to inf.*give a stretch around it"):
        fit_values(dataset, parse_stretch("auto"), ValueRange(50, 100, True), TilePass(dataset.windows()))


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.lists(st.integers(-20, 20).map(lambda n: n / 10), min_size=2, max_size=6, unique=True),
    st.sampled_from([0.1, 0.0001, -0.1, 3.7]),
    st.sampled_from([-273.15, 7.0, 0.1]),
    st.booleans(),
)
def test_scaled_floats_are_decided_at_the_values_that_they_show(
    stored: list[float], scale: float, offset: float, is_low: bool
) -> None:
    values = np.tile(stored, (3, 1))
    shown = values * scale + offset
    end = float(shown[0, 1])
    requested = ValueRange(end, None) if is_low else ValueRange(None, end)
    stretch, found = fitted(dataset_of(values, BandScale(scale, offset)), "auto", requested)
    assert np.array_equal(selected(values, stretch, found), in_range(shown, requested))
