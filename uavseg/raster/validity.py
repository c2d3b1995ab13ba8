"""Valid pixels: nodata values, masks, alpha, NaN and infinity."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[Any]
Valid = NDArray[np.bool_]


def usable_nodata(nodata: float | None, dtype: np.dtype[np.generic]) -> tuple[float | None, str | None]:
    """The nodata value if pixels of `dtype` can hold it, else None and a warning.

    Examples
    --------
    >>> usable_nodata(255, np.dtype("uint8"))
    (255, None)
    >>> usable_nodata(-9999.0, np.dtype("uint8"))
    (None, 'nodata -9999 does not fit uint8 pixels, so no pixel can have it: it is ignored')
    """
    if nodata is None:
        return None, None
    if dtype.kind == "f":
        fits = not math.isfinite(nodata) or abs(nodata) <= float(np.finfo(dtype.name).max) * (1 + 1e-6)
    else:
        limits = np.iinfo(dtype.name)
        fits = math.isfinite(nodata) and nodata == int(nodata) and limits.min <= nodata <= limits.max
    if fits:
        return nodata, None
    return None, f"nodata {nodata:g} does not fit {dtype} pixels, so no pixel can have it: it is ignored"


def valid_pixels(
    values: Values, nodatas: Sequence[float | None], alpha: Values | None, mask: Valid | None
) -> Valid | None:
    """Which pixels are valid; None if all are.

    A pixel is invalid where `mask` is false, alpha is 0 or a band is not finite. With one band it is invalid
    where the band is nodata. With three, a nodata value that cannot be a colour (of float bands, or negative)
    makes a pixel invalid where *any* band has it; one that can be (0 or 255 of a photograph) only where *all*
    three have it, as in GDAL's mask of a whole file.

    Parameters
    ----------
    values : (bands, rows, cols) array
    nodatas : sequence of float or None
        One for each band.
    alpha : (rows, cols) array, optional
    mask : (rows, cols) bool array, optional
    """
    invalid = [] if mask is None else [~mask]
    if alpha is not None:
        invalid.append(alpha == 0)
    if values.dtype.kind == "f":
        invalid += [~np.isfinite(plane) for plane in values]
    invalid += _nodata_pixels(values, nodatas)
    if not invalid:
        return None
    total = invalid[0]
    for other in invalid[1:]:
        total |= other
    return ~total if total.any() else None


def _nodata_pixels(values: Values, nodatas: Sequence[float | None]) -> list[Valid]:
    numbers = [None if nodata is None or math.isnan(nodata) else nodata for nodata in nodatas]
    pairs = zip(values, numbers, strict=True)
    hits = [_equal(plane, number) for plane, number in pairs if number is not None]
    not_a_color = values.dtype.kind == "f" or any(number is not None and number < 0 for number in numbers)
    if len(hits) <= 1 or not_a_color:
        return hits if not_a_color or len(values) == 1 else []
    return [hits[0] & hits[1] & hits[2]] if len(hits) == len(values) else []


def _equal(plane: Values, number: float) -> Valid:
    """Where pixels equal `number`, rounded and clipped to their type."""
    if plane.dtype.kind == "f":
        limit = float(np.finfo(plane.dtype.name).max)
        number = min(max(number, -limit), limit)
    hits: Valid = plane == plane.dtype.type(number)
    return hits
