import numpy as np
import pytest

from uavseg.raster.spectral.bands import usable_nodata, valid_pixels

NAN = float("nan")


def validity(planes, nodata=None, alpha=None, mask=None):
    values = np.asarray(planes)
    values = values[:, None]
    valid = valid_pixels(values, [nodata] * len(values), alpha, mask)
    return None if valid is None else valid[0].tolist()


def test_by_default_all_pixels_are_valid():
    assert validity(np.array([[0, 1, 255]], np.uint8)) is None
    assert validity(np.array([[1, 2]], np.uint8), nodata=0) is None


def test_a_band_is_invalid_where_it_is_nodata():
    assert validity(np.array([[0, 1, 2]], np.uint8), nodata=0) == [False, True, True]
    assert validity(np.array([[-1, 0, 1]], np.int8), nodata=-1) == [False, True, True]


def test_a_black_channel_of_a_photograph_is_valid():
    planes = np.array([[0, 0, 5], [0, 9, 5], [0, 9, 0]], np.uint8)
    assert validity(planes, nodata=0) == [False, True, True]


@pytest.mark.parametrize(("dtype", "nodata"), [("int16", -1), ("float32", -1), ("float32", 5)])
def test_a_nodata_value_that_cannot_be_a_colour_counts_in_any_band(dtype, nodata):
    planes = np.array([[nodata, 1], [1, 1], [1, 1]], dtype)
    assert validity(planes, nodata=nodata) == [False, True]


def test_nan_and_infinity_are_invalid():
    planes = np.array([[1, np.nan, np.inf, -np.inf, -9999]], np.float32)
    assert validity(planes, nodata=NAN) == [True, False, False, False, True]
    assert validity(planes, nodata=-9999) == [True, False, False, False, False]


def test_nodata_is_compared_in_the_type_of_the_pixels():
    lowest = np.finfo(np.float32).min
    planes = np.array([[lowest, 0.1, 3]], np.float32)
    assert validity(planes, nodata=-3.40282346600000016e38) == [False, True, True]
    assert validity(planes, nodata=0.1) == [True, False, True]


def test_alpha_and_mask_combine():
    planes = np.array([[1, 2, 3, 4]], np.uint16)
    alpha = np.array([[0, 1, 65535, 1]], np.uint16)
    mask = np.array([[True, True, True, False]])
    assert validity(planes, alpha=alpha) == [False, True, True, True]
    assert validity(planes, nodata=3, alpha=alpha, mask=mask) == [False, True, False, False]


@pytest.mark.parametrize(
    ("nodata", "dtype", "fits"),
    [
        (255, "uint8", True),
        (256, "uint8", False),
        (-1, "uint8", False),
        (0.5, "int16", False),
        (NAN, "uint16", False),
        (NAN, "float32", True),
        (-3.4028234663852886e38, "float32", True),
        (-1.7976931348623157e308, "float32", False),
        (-1.7976931348623157e308, "float64", True),
    ],
)
def test_a_nodata_value_that_no_pixel_can_have_gives_a_warning(nodata, dtype, fits):
    usable, warning = usable_nodata(nodata, np.dtype(dtype))
    assert (usable is not None) == fits == (warning is None)
