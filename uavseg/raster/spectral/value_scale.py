"""Values of a raster in its own units: scale, offset and unit of its bands, and how v maps to values."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.plain_text import one_line

Floats = NDArray[np.float64]

_MAX_UNIT = 24  # characters


@dataclass(frozen=True, slots=True)
class BandScale:
    """The scale, offset and unit of a band, as GDAL keeps them: value = scale * stored + offset.

    Parameters
    ----------
    scale : float
        Not 0.
    offset : float
    unit : str
        Such as "m" or "degC"; empty where it is not known.
    """

    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""

    @classmethod
    def of_tags(cls, scale: object, offset: object, unit: object) -> "BandScale | None":
        """From what a file says; None where its numbers are no scale and offset.

        Examples
        --------
        >>> BandScale.of_tags(0.1, None, "degC"), BandScale.of_tags(0.0, 0.0, None)
        (BandScale(scale=0.1, offset=0.0, unit='degC'), None)
        """
        try:
            numbers = float(1.0 if scale is None else scale), float(0.0 if offset is None else offset)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            return None
        if not all(map(math.isfinite, numbers)) or numbers[0] == 0:
            return None
        return cls(*numbers, one_line(str(unit or "").strip(), _MAX_UNIT))

    def inverted(self, maximum: float) -> "BandScale":
        """The scale of maximum - stored in place of the stored numbers."""
        return BandScale(-self.scale, self.offset + self.scale * maximum, self.unit)

    def values(self, stored: ArrayLike) -> Floats:
        """Values of stored numbers."""
        found: Floats = np.asarray(stored, np.float64) * self.scale + self.offset
        return found

    def stored(self, value: float) -> float:
        """The stored number of a value; without scale and offset, the value itself."""
        return (value - self.offset) / self.scale


AS_STORED = BandScale()
"""Values are the stored numbers, of no known unit."""


@dataclass(frozen=True, slots=True)
class ValueAxis:
    """How v maps to values in the units of a raster, for a fitted stretch.

    Parameters
    ----------
    low, high : float
        The stored intensities that are v = 0 and v = 1.
    scale : BandScale
    limits : (float, float)
        The smallest and the largest intensity that can be stored.

    Examples
    --------
    >>> axis = ValueAxis(100.0, 300.0, BandScale(0.1, 0.0, "degC"), (0.0, 65535.0))
    >>> axis.values([0.0, 0.5]), axis.text(0.5, 1.0)
    (array([10., 20.]), '20 degC and more')
    """

    low: float
    high: float
    scale: BandScale = AS_STORED
    limits: tuple[float, float] = (-inf, inf)

    @property
    def unit(self) -> str:
        """Unit of the values; empty where it is not known."""
        return self.scale.unit

    @property
    def clips(self) -> bool:
        """Whether intensities may lie beyond the ends."""
        return self.low > self.limits[0] or self.high < self.limits[1]

    def values(self, v: ArrayLike) -> Floats:
        """The value of each v; NaN where the stretch ends at infinity."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.scale.values(self.low + np.asarray(v, np.float64) * (self.high - self.low))

    def ends(self, low: ArrayLike, high: ArrayLike) -> tuple[Floats, Floats]:
        """The smallest and the largest value of ranges of v; NaN where a range is open.

        It is open at v = 0 or 1 where the stretch clips, because all that lies beyond has that v.
        """
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        first = np.where((low <= 0) & (self.low > self.limits[0]), nan, self.values(low))
        last = np.where((high >= 1) & (self.high < self.limits[1]), nan, self.values(high))
        return (first, last) if self.scale.scale > 0 else (last, first)

    def text(self, low: float, high: float) -> str:
        """A range of v in values: "20 to 40 degC", "20 degC and more"."""
        first, last = self.ends(low, high)
        return values_text((float(first), float(last)), self.unit)


def values_text(ends: Sequence[float], unit: str = "") -> str:
    """A range of values for people; an end that is NaN is open.

    Examples
    --------
    >>> values_text((20, 40.0), "degC"), values_text((float("nan"), 3.25)), values_text((1e-9, float("nan")))
    ('20 to 40 degC', '3.25 and less', '1e-09 and more')
    """
    low, high = ends
    unit = f" {unit}" if unit else ""
    if math.isnan(low) and math.isnan(high):
        return "all values"
    if math.isnan(low):
        return f"{high:.6g}{unit} and less"
    if math.isnan(high):
        return f"{low:.6g}{unit} and more"
    return f"{low:.6g} to {high:.6g}{unit}"
