"""Attributes of regions in the units of their raster: mean, range and unit, beside those in v."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.raster.spectral.value_scale import ValueAxis
from uavseg.regions.table import VALUE_COLUMNS, Regions
from uavseg.segmentation.components import Sums
from uavseg.units import GREY_MAX

UNKNOWN = (np.nan, np.nan)

MIDDLE = 32768  # grey of the one intensity of such a stretch


def with_values(
    regions: Regions,
    sums: Sums,
    axis: ValueAxis | None,
    ends: tuple[ArrayLike, ArrayLike] | None = None,
) -> Regions:
    """Regions with the columns `mean_value`, `value_low`, `value_high` and `unit` after `range_high`.

    Parameters
    ----------
    regions : Regions
    sums : Sums
        Of its pixels.
    axis : ValueAxis or None
        How v maps to values; None where that is not known: NaN and an empty unit then.
    ends : (float, float) or two (n,) arrays, optional
        The range in values of all regions or of each, NaN where it is open; by default that of `range_low`
        and `range_high`.
    """
    columns, n = regions.columns, len(regions)
    if ends is None:
        ends = UNKNOWN if axis is None else axis.ends(columns["range_low"], columns["range_high"])
    mean = np.full(n, np.nan) if axis is None else _means(columns, sums, axis)
    low, high = (np.broadcast_to(np.asarray(end, np.float64), n).copy() for end in ends)
    unit = np.full(n, "" if axis is None else axis.unit, object)
    more = dict(zip(VALUE_COLUMNS, (mean, low, high, unit), strict=True))
    found = {}
    for name, column in columns.items():
        found[name] = column
        if name == "range_high":
            found |= more
    return replace(regions, columns=found)


def _means(columns: dict[str, NDArray[Any]], sums: Sums, axis: ValueAxis) -> NDArray[np.float64]:
    """Mean value of each region; NaN where its pixels are known only as a stretch clips them.

    That is so in a block map, which has no standard deviations either, and beyond a stretch of one intensity.
    """
    v = columns["mean"] if sums.beyond is None else columns["mean"] + sums.beyond / sums.counts / GREY_MAX
    unknown = np.isnan(columns["std"]) if axis.low < axis.high else columns["mean"] != MIDDLE / GREY_MAX
    return np.where(unknown & axis.clips, np.nan, axis.values(v))
