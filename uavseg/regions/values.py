"""Attributes of regions in the units of their raster: mean, range and unit, beside those in v."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from uavseg.raster.value_scale import ValueAxis
from uavseg.regions.table import VALUE_COLUMNS, Regions

UNKNOWN = (np.nan, np.nan)


def with_values(
    regions: Regions, axis: ValueAxis | None, ends: tuple[ArrayLike, ArrayLike] | None = None
) -> Regions:
    """Regions with the columns `mean_value`, `value_low`, `value_high` and `unit` after `range_high`.

    Parameters
    ----------
    regions : Regions
    axis : ValueAxis or None
        How v maps to values; None where that is not known: NaN and an empty unit then.
    ends : (float, float) or two (n,) arrays, optional
        The range in values of all regions or of each, NaN where it is open; by default that of `range_low`
        and `range_high`.
    """
    columns, n = regions.columns, len(regions)
    if ends is None:
        ends = UNKNOWN if axis is None else axis.ends(columns["range_low"], columns["range_high"])
    mean = np.full(n, np.nan) if axis is None else axis.values(columns["mean"])
    low, high = (np.broadcast_to(np.asarray(end, np.float64), n).copy() for end in ends)
    unit = np.full(n, "" if axis is None else axis.unit, object)
    more = dict(zip(VALUE_COLUMNS, (mean, low, high, unit), strict=True))
    found = {}
    for name, column in columns.items():
        found[name] = column
        if name == "range_high":
            found |= more
    return replace(regions, columns=found)
