import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from uavseg.raster.intensity.grey import luminance_f4, to_grey

TYPES = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "int64", "float32", "float64"]


def formula(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Section 0 of the algorithm in plain numpy."""
    planes = values.astype(np.float64)
    intensity = planes[0]
    if len(planes) == 3:
        intensity = 0.2126 * planes[0] + 0.7152 * planes[1] + 0.0722 * planes[2]
    v = np.clip((intensity - low) / (high - low), 0, 1)
    return np.floor(65535 * v + 0.5).astype(np.uint16)


@st.composite
def pixels(draw):
    dtype = np.dtype(draw(st.sampled_from(TYPES)))
    shape = (draw(st.sampled_from([1, 3])), draw(st.integers(1, 5)), draw(st.integers(1, 5)))
    numbers = st.floats(-1e4, 1e4, width=32) if dtype.kind == "f" else None
    return draw(hnp.arrays(dtype, shape, elements=numbers))


@pytest.mark.slow
@settings(max_examples=200)
@given(pixels(), st.floats(-300, 300), st.floats(1e-3, 5e4))
def test_grey_is_the_formula_to_the_last_bit(values, low, width):
    assert np.array_equal(to_grey(values, low, low + width), formula(values, low, low + width))


@pytest.mark.parametrize("dtype", ["uint8", "int8", "uint16", "int16"])
def test_every_value_of_a_small_type_has_the_grey_of_the_formula(dtype):
    limits = np.iinfo(dtype)
    values = np.arange(limits.min, limits.max + 1).astype(dtype)[None, None]
    assert np.array_equal(to_grey(values, -3.3, 200.7), formula(values, -3.3, 200.7))


def test_all_colours_of_a_palette_have_the_grey_of_the_formula():
    rng = np.random.default_rng(1)
    for dtype in ("uint8", "uint16"):
        values = rng.integers(0, np.iinfo(dtype).max, (3, 300, 301), endpoint=True).astype(dtype)
        assert np.array_equal(to_grey(values, 0.0, 255.0), formula(values, 0.0, 255.0))


def test_non_contiguous_arrays_are_read():
    values = np.arange(240, dtype=np.uint16).reshape(1, 12, 20)[:, ::2, ::-1]
    assert np.array_equal(to_grey(values, 0.0, 200.0), formula(values, 0.0, 200.0))


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32", "float64"])
def test_where_low_is_high_the_middle_is_grey(dtype):
    values = np.array([[[6, 7, 8]]], dtype)
    assert to_grey(values, 7.0, 7.0).tolist() == [[0, 32768, 65535]]


def test_nan_becomes_black():
    values = np.array([[[np.nan, -np.inf, np.inf]]], np.float32)
    assert to_grey(values, 0.0, 1.0).tolist() == [[0, 0, 65535]]


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int32", "float32"])
def test_luminance_is_rounded_once(dtype):
    values = np.random.default_rng(2).integers(0, 100, (3, 20, 20)).astype(dtype)
    r, g, b = values.astype(np.float64)
    assert np.array_equal(luminance_f4(values), (0.2126 * r + 0.7152 * g + 0.0722 * b).astype(np.float32))
