"""Ranges of values or of percentiles as they are asked for, and as intensities that a raster stores."""

import math
from fractions import Fraction
from math import inf

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.raster.intensity.grey import to_grey
from uavseg.raster.intensity.stretch import Stretch, counts_exactly
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import BandScale, ValueAxis
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.units import GREY_MAX

_ROUNDING = 1e-6  # of a step between stored integers

Statistics = dict[Fraction, float]
"""Intensities at percentiles."""


@dataclass(frozen=True, slots=True)
class ValueRange:
    """A closed range of values in the units of a raster, or of percentiles of them.

    A ParameterError says that the ends are reversed or not finite, that both are open, or that a percentile
    is not in 0..100.
    """

    low: float | None  # None for an open end
    high: float | None
    # whether they are percentiles: the smallest value with at least so many per cent of all valid pixels at
    # or below it
    by_rank: bool = False

    def __post_init__(self) -> None:
        kind = "percentiles" if self.by_rank else "values"
        given = [end for end in (self.low, self.high) if end is not None]
        if not given:
            raise ParameterError(f"a range of {kind} has at least one end, such as 20,40 or 300,")
        if not all(map(math.isfinite, given)):
            raise ParameterError(
                f"a range of {kind} is two finite numbers; leave an end out to open it: 300,"
            )
        if given[0] > given[-1]:
            raise ParameterError(f"the low end of a range of {kind} is above its high one: {self}")
        if self.by_rank and not all(0 <= end <= 100 for end in given):
            raise ParameterError(f"percentiles lie in 0..100, not {self}")

    @property
    def ends(self) -> tuple[float, float]:
        """The ends; NaN where they are open."""
        low, high = (math.nan if end is None else end for end in (self.low, self.high))
        return low, high

    def __str__(self) -> str:
        """As the options take it."""
        return ",".join("" if end is None else f"{end:.12g}" for end in (self.low, self.high))


@dataclass(frozen=True, slots=True)
class DetectedRange:
    """A range of v, after the stretch, and its ends in values; NaN where it is open or values are unknown."""

    interval: IntensityRange
    ends: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Bounds:
    """A range of stored intensities: closed, infinite where it is open."""

    low: float
    high: float

    @property
    def finite(self) -> list[float]:
        """The ends that are given."""
        return [end for end in (self.low, self.high) if math.isfinite(end)]


def scale_of(dataset: Dataset) -> BandScale:
    """Return the scale of the bands that are used; ParameterError if bands or files have different ones."""
    if dataset.scale is None:
        raise ParameterError(
            f"the bands or files of {dataset.source} have different scales, offsets or units, so they "
            "share no values; name one band or file, or give a range of v"
        )
    return dataset.scale


def axis_of(dataset: Dataset, stretch: Stretch) -> ValueAxis | None:
    """Return how v maps to values; None if the bands or files share no scale."""
    if dataset.scale is None:
        return None
    return ValueAxis(stretch.low, stretch.high, dataset.scale, intensity_limits(dataset, stretch))


def intensity_limits(dataset: Dataset, stretch: Stretch) -> tuple[float, float]:
    """Return the smallest and the largest intensity that a dataset holds, as far as a stretch says it."""
    low, high = type_limits(dataset)
    return (low, high) if stretch.clips else (max(low, stretch.low), min(high, stretch.high))


def type_limits(dataset: Dataset) -> tuple[float, float]:
    """Return the smallest and the largest intensity that the type of a dataset holds."""
    if dataset.dtype.kind == "f":
        return -inf, inf
    if dataset.dtype.kind == "i":
        kept = np.iinfo(dataset.dtype.name)
        return float(kept.min), float(kept.max)
    return 0.0, math.ldexp(1.0, dataset.bits) - 1


def percents_asked(requested: ValueRange, scale: BandScale) -> list[Fraction]:
    """Return the percentiles of stored intensities that a range asks for."""
    if not requested.by_rank:
        return []
    return [_percent(end, scale) for end in (requested.low, requested.high) if end is not None]


def _percent(percent: float, scale: BandScale) -> Fraction:
    """Return a percentile of stored intensities; they fall where values rise if the scale is negative."""
    exact = Fraction(repr(float(percent)))
    if scale.scale > 0:
        return exact
    return min(100 - exact + Fraction(1, 10**15), Fraction(100))  # the rank counted from the other end


def stored_range(requested: ValueRange, scale: BandScale, dataset: Dataset, statistics: Statistics) -> Bounds:
    """Return a range as intensities that are stored."""
    if requested.by_rank:
        ends = [
            None if end is None else statistics[_percent(end, scale)]
            for end in (requested.low, requested.high)
        ]
    else:
        ends = [
            None if end is None else _stored_bound(end, k == 0, scale, dataset)
            for k, end in enumerate((requested.low, requested.high))
        ]
    low, high = ends if scale.scale > 0 else ends[::-1]
    low, high = -inf if low is None else low, inf if high is None else high
    if requested.by_rank and is_wide(dataset):  # percentiles are rounded to float32
        low, high = next_float32(low, high)
    return Bounds(low, high)


def next_float32(low: float, high: float) -> tuple[float, float]:
    """Return the numbers of single precision beside the ends of a range, outside of it."""
    below, above = (
        np.nextafter(np.float32(low), np.float32(-inf)),
        np.nextafter(np.float32(high), np.float32(inf)),
    )
    return float(below), float(above)


def _stored_bound(end: float, is_low: bool, scale: BandScale, dataset: Dataset) -> float:
    """Return the outermost stored number whose value lies within the end of a range.

    Many 64-bit numbers have one value once a scale and an offset are applied; it is found by bisection.
    """
    stored = nearest_of_type(scale.stored(end), dataset)
    if not is_wide(dataset) or (scale.scale, scale.offset) == (1.0, 0.0):
        return stored
    step = 8 * np.finfo(np.float64).eps * (abs(end) + abs(scale.offset)) / scale.scale
    inner, outer = (stored + step, stored - step) if is_low else (stored - step, stored + step)
    while True:
        middle = (inner + outer) / 2
        if middle in (inner, outer):
            return float(inner)
        value = float(scale.values(middle))
        if value >= end if is_low else value <= end:
            inner = middle
        else:
            outer = middle


def nearest_of_type(stored: float, dataset: Dataset) -> float:
    """Return a bound as the type of a dataset holds it, if it is so close to it that it is meant."""
    if len(dataset.bands) == 3 or dataset.choice.expanded or dataset.dtype == np.float32:
        with np.errstate(over="ignore"):
            return float(np.float32(stored))
    if dataset.dtype.kind in "iu" and abs(stored - round(stored)) <= _ROUNDING:
        return float(round(stored))
    return stored


def is_wide(dataset: Dataset) -> bool:
    """Return whether intensities are compared in more precision than float32 has."""
    single = len(dataset.bands) == 1 and not dataset.choice.expanded
    return single and not counts_exactly(dataset) and dataset.dtype != np.float32


def check_type(requested: ValueRange, bounds: Bounds, dataset: Dataset, scale: BandScale) -> None:
    """Refuse a range with values that the type cannot hold."""
    limits = type_limits(dataset)
    if bounds.low > limits[1] or bounds.high < limits[0]:
        first, last = sorted(scale.values(limits).tolist())
        unit = f" {scale.unit}" if scale.unit else ""
        raise ParameterError(
            f"the values {requested} lie outside of what {dataset.source} can hold: {first:.6g} to "
            f"{last:.6g}{unit} ({dataset.dtype})"
        )


def asked_ends(requested: ValueRange, bounds: Bounds, scale: BandScale) -> tuple[float, float]:
    """Return a range in values: as it was asked for, or at its percentiles; NaN at an open end."""
    if not requested.by_rank:
        return requested.ends
    first, last = (
        scale.values(end).item() if math.isfinite(end) else math.nan for end in (bounds.low, bounds.high)
    )
    return (first, last) if scale.scale > 0 else (last, first)


def range_on_axis(requested: ValueRange, axis: ValueAxis | None, name: str) -> DetectedRange:
    """Return a range of values in v, where greys are all that is known: to half a grey.

    A ParameterError says that it is of percentiles, or that a bound is at an end of the stretch or beyond,
    where values are alike.
    """
    if axis is None:
        raise ParameterError(f"the bands or files of {name} share no values; give a range of v")
    if requested.by_rank:
        raise ParameterError(
            f"the percentiles {requested} are those of pixels, which a block map has not; name the raster "
            "itself"
        )
    ends = [None if end is None else axis.scale.stored(end) for end in (requested.low, requested.high)]
    low, high = ends if axis.scale.scale > 0 else ends[::-1]
    first = 0.0 if low is None or low <= axis.limits[0] else _v_inside(low, requested, axis)
    last = 1.0 if high is None or high >= axis.limits[1] else _v_inside(high, requested, axis)
    if first >= last:
        first, last = max(first - 0.25 / GREY_MAX, 0.0), min(last + 0.25 / GREY_MAX, 1.0)
    return DetectedRange(IntensityRange(first, last), requested.ends)


def _v_inside(stored: float, requested: ValueRange, axis: ValueAxis) -> float:
    if not axis.low < stored < axis.high:
        first, last = sorted(axis.values([0, 1]).tolist())
        raise ParameterError(
            f"the range {requested} does not lie inside of the stretch of the block map, {first:g} to "
            f"{last:g}, beyond which all values are alike; make it again with a wider stretch, or name the "
            "raster"
        )
    return int(to_grey(np.array([[[stored]]], np.float64), axis.low, axis.high)[0, 0]) / GREY_MAX
