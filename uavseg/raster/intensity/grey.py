"""Grey levels: v = (intensity − low) / (high − low) clipped to [0, 1], quantised to floor(65535 v + 0.5)."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Float32s, Floats, Uint16s

RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722  # weights of luminance, Rec. 709

Values = NDArray[Any]


def to_grey(values: Values, low: float, high: float) -> Uint16s:
    """Return grey of every pixel, in double precision, with exactly this order of operations.

    If low = high, grey is 0 below, 65535 above and 32768 at that intensity. `values` are intensity, (1, rows,
    cols), or red, green and blue, (3, rows, cols), of any real type.
    """
    grey, dtype = np.empty(values.shape[1:], np.uint16), values.dtype
    flat, result = np.ascontiguousarray(values).reshape(len(values), -1), grey.reshape(-1)
    if len(values) == 3 and dtype in _GREY_RGB:
        _GREY_RGB[dtype](flat, low, high, result)
    elif len(values) == 3:
        _grey_f8(luminance(flat), low, high, result)
    elif dtype.kind in "iu" and dtype.itemsize <= 2:
        look_up = _look_up_u1 if dtype.itemsize == 1 else _look_up_u2
        look_up(flat[0].view(f"u{dtype.itemsize}"), _lookup_table(low, high, dtype.str), result)
    elif dtype == np.float32:
        _grey_f4(flat[0], low, high, result)
    else:
        _grey_f8(flat[0].astype(np.float64, copy=False), low, high, result)
    return grey


def luminance(planes: Values) -> Floats:
    """Return 0.2126 R + 0.7152 G + 0.0722 B of (3, ...) planes, in double precision, from left to right."""
    total: Floats = planes[0] * np.float64(RED)
    total += planes[1] * np.float64(GREEN)
    total += planes[2] * np.float64(BLUE)
    return total


def luminance_f4(values: Values) -> Float32s:
    """Return luminance in double precision, rounded to single: (3, rows, cols) becomes (rows, cols)."""
    result = np.empty(values.shape[1:], np.float32)
    planes = np.ascontiguousarray(values).reshape(3, -1)
    if planes.dtype == np.uint8:
        _luminance_u1(planes, result.reshape(-1))
    elif planes.dtype == np.uint16:
        _luminance_u2(planes, result.reshape(-1))
    else:
        result[...] = luminance(values)
    return result


@lru_cache(maxsize=16)
def _lookup_table(low: float, high: float, type_code: str) -> Uint16s:
    """Return lookup table: grey of every value of an integer type of at most 16 bits, by bit pattern."""
    dtype = np.dtype(type_code)
    patterns = np.arange(1 << 8 * dtype.itemsize, dtype=f"u{dtype.itemsize}")
    grey = np.empty(len(patterns), np.uint16)
    _grey_f8(patterns.view(dtype.newbyteorder("=")).astype(np.float64), low, high, grey)
    return grey


def _look_up(values, table, grey):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        grey[i] = table[values[i]]


_look_up_u1 = kernel("void(u1[::1], u2[::1], u2[::1])")(_look_up)
_look_up_u2 = kernel("void(u2[::1], u2[::1], u2[::1])")(_look_up)


@inlined
def _grey_of(intensity, low, high):  # type: ignore[no-untyped-def]
    v = (intensity - low) / (high - low)  # low = high: infinite on either side, NaN at that intensity
    middle = 0.5 if low == high else 0.0
    v = v if v > 0.0 else (0.0 if v <= 0.0 else middle)
    v = v if v < 1.0 else 1.0
    return np.int32(65535.0 * v + 0.5)


@kernel("void(f4[::1], f8, f8, u2[::1])")
def _grey_f4(values, low, high, grey):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        grey[i] = _grey_of(np.float64(values[i]), low, high)


@kernel("void(f8[::1], f8, f8, u2[::1])")
def _grey_f8(values, low, high, grey):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        grey[i] = _grey_of(values[i], low, high)


@inlined
def _luminance(red, green, blue):  # type: ignore[no-untyped-def]
    return RED * red + GREEN * green + BLUE * blue


def _grey_rgb(planes, low, high, grey):  # type: ignore[no-untyped-def]
    for i in range(grey.size):
        grey[i] = _grey_of(_luminance(planes[0, i], planes[1, i], planes[2, i]), low, high)


_grey_rgb_u1 = kernel("void(u1[:,::1], f8, f8, u2[::1])")(_grey_rgb)
_grey_rgb_u2 = kernel("void(u2[:,::1], f8, f8, u2[::1])")(_grey_rgb)
_grey_rgb_f4 = kernel("void(f4[:,::1], f8, f8, u2[::1])")(_grey_rgb)
_GREY_RGB = {np.dtype("u1"): _grey_rgb_u1, np.dtype("u2"): _grey_rgb_u2, np.dtype("f4"): _grey_rgb_f4}


def _luminances(planes, result):  # type: ignore[no-untyped-def]
    for i in range(result.size):
        result[i] = _luminance(planes[0, i], planes[1, i], planes[2, i])


_luminance_u1 = kernel("void(u1[:,::1], f4[::1])")(_luminances)
_luminance_u2 = kernel("void(u2[:,::1], f4[::1])")(_luminances)
