"""Ranges of values or of percentiles as requested and as stored, and the stretch that decides them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.grey import to_grey
from uavseg.raster.intensity.stretch import (
    Border,
    Stretch,
    StretchSpec,
    counts_exactly,
    order_statistics,
    percents_of,
    resolved_spec,
    stretch_of,
)
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import BandScale, ValueAxis
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.units import GREY_LEVELS, GREY_MAX

_MARGIN = 1 / 8  # of the span of an automatic stretch: its ends stay so far from each bound
_GREYS = 1.25  # greys between a bound and the end of a stretch: one for what lies beyond, and for rounding
_ROUNDING = 1e-6  # of a step between stored integers

Statistics = dict[Fraction, float]  # intensities at percentiles
Bounds = tuple[float, float]  # a range of stored intensities: closed, infinite where it is open
_V = np.arange(GREY_LEVELS) / GREY_MAX
_ROUNDINGS = 8  # doubles near a bound that may be the same v


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


def _percent(percent: float, scale: BandScale) -> Fraction:
    """Return a percentile of stored intensities; they fall where values rise if the scale is negative."""
    exact = Fraction(repr(float(percent)))
    if scale.scale > 0:
        return exact
    return min(100 - exact + Fraction(1, 10**15), Fraction(100))  # the rank counted from the other end


def stored_range(requested: ValueRange, scale: BandScale, dataset: Dataset, statistics: Statistics) -> Bounds:
    """Return a range as intensities that are stored."""
    ends: list[float | None] = [requested.low, requested.high]
    for k, end in enumerate(ends):
        if end is not None and requested.by_rank:
            ends[k] = statistics[_percent(end, scale)]
        elif end is not None:
            ends[k] = _stored_bound(end, k == 0, scale, dataset)
    low, high = ends if scale.scale > 0 else ends[::-1]
    low, high = -inf if low is None else low, inf if high is None else high
    if requested.by_rank and is_wide(dataset):  # percentiles are rounded to float32
        return next_float32(low, high)
    return low, high


def next_float32(low: float, high: float) -> tuple[float, float]:
    """Return the numbers of single precision beside the ends of a range, outside of it."""
    below = np.nextafter(np.float32(low), np.float32(-inf))
    return float(below), float(np.nextafter(np.float32(high), np.float32(inf)))


def _stored_bound(end: float, is_low: bool, scale: BandScale, dataset: Dataset) -> float:
    """Return the outermost stored number whose value lies within the end of a range, by bisection."""
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


def asked_ends(requested: ValueRange, bounds: Bounds, scale: BandScale) -> tuple[float, float]:
    """Return a range in values: as it was asked for, or at its percentiles; NaN at an open end."""
    if not requested.by_rank:
        return requested.ends
    first, last = (scale.values(end).item() if math.isfinite(end) else math.nan for end in bounds)
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


def fit_values(
    dataset: Dataset, spec: Stretch | StretchSpec, requested: ValueRange, tile_pass: TilePass
) -> tuple[Stretch, DetectedRange]:
    """Fit a stretch under which a range of values is decided exactly, and express it in v.

    An automatic stretch is widened until each bound lies inside it, an eighth of its span from its ends (but
    no further than values go), because values beyond the ends of a stretch have the same v. A stretch that
    the user chose keeps its ends; a bound at one of them moves it outwards by a grey. Pixels whose grey is
    that of a bound and whose value lies on its other side get the next grey, so that 16-bit greys move no
    bound.

    A fitted stretch keeps its ends. The result does not depend on `tile_pass`, by which pixels are read only
    where percentiles or the stretch need them. A ParameterError says that a bound lies outside of a stretch
    that the user chose, or that the files have different scales.
    """
    scale = scale_of(dataset)
    asked = [end for end in (requested.low, requested.high) if requested.by_rank and end is not None]
    found, statistics = _fit(dataset, spec, [_percent(end, scale) for end in asked], tile_pass)
    if statistics is None:
        return found, DetectedRange(IntensityRange(0.0, 1.0), (math.nan, math.nan))
    bounds = stored_range(requested, scale, dataset, statistics)
    of_type = type_limits(dataset)
    if bounds[0] > of_type[1] or bounds[1] < of_type[0]:
        first, last = sorted(scale.values(of_type).tolist())
        unit = f" {scale.unit}" if scale.unit else ""
        raise ParameterError(
            f"the values {requested} lie outside of what {dataset.source} can hold: {first:.6g} to "
            f"{last:.6g}{unit} ({dataset.dtype})"
        )
    limits = _limits(dataset, found, statistics)
    low, high = bounds  # open where nothing lies beyond
    inner = -inf if low <= limits[0] else low, inf if high >= limits[1] else high
    ends = sorted(set(filter(math.isfinite, inner)))
    if isinstance(spec, StretchSpec) and spec.form == "auto":
        found = _widened(found, ends, limits)
    _check_inside(found, ends, requested, isinstance(spec, Stretch))
    if ends and not isinstance(spec, Stretch):  # its ends get other greys than the bounds
        low, high = found.low, found.high
        span = high - low or 1e-6 * abs(low) or 1e-30  # any, if all pixels are one intensity
        grey = span / GREY_MAX
        low, high = min(low, ends[0] - _GREYS * grey), max(high, ends[-1] + _GREYS * grey)
        found = replace(found, low=low, high=high)
    found = replace(found, borders=_borders(dataset, found, inner))
    return found, DetectedRange(_in_v(dataset, found, inner), asked_ends(requested, bounds, scale))


def _fit(
    dataset: Dataset, spec: Stretch | StretchSpec, asked: Sequence[Fraction], tile_pass: TilePass
) -> tuple[Stretch, Statistics | None]:
    """Return the stretch without a range, and intensities at percentiles, if any; None: no valid pixel."""
    resolved = spec if isinstance(spec, Stretch) else resolved_spec(dataset, spec)
    own = () if isinstance(resolved, Stretch) else percents_of(resolved)
    statistics: Statistics | None = {}
    if own or asked:
        every = sorted({*own, *asked, Fraction(0), Fraction(100)})
        found = order_statistics(dataset, every, tile_pass)
        statistics = None if found is None else dict(zip(every, found, strict=True))
    if isinstance(resolved, Stretch):
        return resolved, statistics
    ends = None if statistics is None else [statistics[percent] for percent in own]
    return stretch_of(dataset, resolved, ends), statistics


def _limits(dataset: Dataset, stretch: Stretch, statistics: Statistics) -> tuple[float, float]:
    """Return intensities between which all pixels lie, as far as it is known."""
    low, high = intensity_limits(dataset, stretch)
    if statistics:
        first, last = statistics[Fraction(0)], statistics[Fraction(100)]
        if is_wide(dataset):
            first, last = next_float32(first, last)
        low, high = max(low, first), min(high, last)
    return low, high


def _widened(stretch: Stretch, ends: Sequence[float], limits: tuple[float, float]) -> Stretch:
    """Return an automatic stretch with each bound well inside it."""
    if not ends:
        return stretch
    first, last = min(stretch.low, ends[0]), max(stretch.high, ends[-1])
    margin = _MARGIN * (last - first)
    low = min(stretch.low, max(ends[0] - margin, min(limits[0], ends[0])))
    high = max(stretch.high, min(ends[-1] + margin, max(limits[1], ends[-1])))
    if (low, high) == (stretch.low, stretch.high):
        return stretch
    return Stretch(low, high, f"{stretch.name}, widened to {low:g}..{high:g} for the range")


def _check_inside(stretch: Stretch, ends: Sequence[float], requested: ValueRange, is_fitted: bool) -> None:
    """Refuse a bound outside of a stretch that cannot be widened."""
    for end in ends:
        inside = stretch.low < end < stretch.high if is_fitted else stretch.low <= end <= stretch.high
        if not inside:
            first, last = min(ends[0], stretch.low), max(ends[-1], stretch.high)
            more = (last - first) / 8
            raise ParameterError(
                f"the range {requested} reaches to {end:g} or beyond, outside of the "
                f"stretch {stretch.name}, which makes all values there alike; use the stretch auto, or "
                f"{first - more:g},{last + more:g}"
            )


def _grey(stretch: Stretch, intensity: float) -> int:
    return int(to_grey(np.array([[[intensity]]], np.float64), stretch.low, stretch.high)[0, 0])


def _steps_are_greys(dataset: Dataset, stretch: Stretch) -> bool:
    """Return whether all intensities are integers with different greys, as far as the stretch reaches."""
    return counts_exactly(dataset) and stretch.high - stretch.low <= GREY_MAX


def _borders(dataset: Dataset, stretch: Stretch, inner: Bounds) -> tuple[Border, ...]:
    """Return the bounds that greys alone do not decide."""
    if _steps_are_greys(dataset, stretch):
        return ()
    found = [
        Border(end, _grey(stretch, end), is_low)
        for end, is_low in zip(inner, (True, False), strict=True)
        if math.isfinite(end)
    ]
    if any(border.grey == (0 if border.is_low else GREY_MAX) for border in found):
        raise ParameterError(
            f"the values of {dataset.source} reach from {stretch.low:g} to {stretch.high:g}, too far apart "
            "for the range to be decided; give a stretch around it (--stretch LOW,HIGH)"
        )
    return tuple(found)


def _in_v(dataset: Dataset, stretch: Stretch, inner: Bounds) -> IntensityRange:
    """Return a range in v that holds the greys of its intensities and no other; its ends differ."""
    exact = _steps_are_greys(dataset, stretch)
    low = _end_in_v(stretch, inner[0], exact, True) if math.isfinite(inner[0]) else 0.0
    high = _end_in_v(stretch, inner[1], exact, False) if math.isfinite(inner[1]) else 1.0
    if low >= high:  # one intensity, or none: between the greys of two integers
        middle, reach = (low + high) / 2, (0.25 if low == high else 0.125) / GREY_MAX
        low, high = max(middle - reach, 0.0), min(middle + reach, 1.0)
    return IntensityRange(low, high)


def _end_in_v(stretch: Stretch, bound: float, in_steps: bool, is_low: bool) -> float:
    if not in_steps:
        return _grey(stretch, bound) / GREY_MAX
    v = (bound - stretch.low) / (stretch.high - stretch.low)
    if is_low:
        first = math.ceil(bound)  # the smallest integer in the range
        return min(max(v, (_grey(stretch, first - 1) + 0.5) / GREY_MAX), _grey(stretch, first) / GREY_MAX)
    last = math.floor(bound)  # the largest integer in the range
    return max(min(v, (_grey(stretch, last + 1) - 0.5) / GREY_MAX), _grey(stretch, last) / GREY_MAX)


def decided_at(
    dataset: Dataset, stretch: Stretch, edges: Sequence[float], bounds: Sequence[float]
) -> Stretch:
    """Return a fitted stretch under which edges between intervals of v are decided exactly.

    Greys are rounded to the nearest: those of 0.5 and 0.50000001 of float pixels are one, and its v lies
    above 0.5. So pixels near an edge get the grey on that side of it on which their intensity lies.

    `edges` increase; a value on an edge belongs to the interval below it. `bounds` are the edges as they were
    asked for: one that is not among them is the number before the low end of a range, to which that end
    belongs.
    """
    found: dict[int, Border] = {}
    for edge in edges if stretch.low < stretch.high else ():
        is_low = edge not in bounds
        v = math.nextafter(edge, 1.0) if is_low else edge
        below = int(np.searchsorted(_V, edge, "right")) - 1  # the last grey below the edge
        if 0 < v < 1 and below not in found:
            border = Border(_intensity_at(dataset, stretch, v, is_low), below + is_low, is_low)
            if not _steps_over(dataset, stretch, border):
                found[below] = border
    return replace(stretch, borders=(*stretch.borders, *found.values())) if found else stretch


def _intensity_at(dataset: Dataset, stretch: Stretch, v: float, is_low: bool) -> float:
    """Return the intensity of a bound, the outermost that belongs to it."""
    span = stretch.high - stretch.low
    result = nearest_of_type(stretch.low + v * span, dataset)
    if not is_wide(dataset) or dataset.dtype.kind in "iu":
        return result
    for _ in range(_ROUNDINGS):
        further = math.nextafter(result, -inf if is_low else inf)
        own = (further - stretch.low) / span
        if own < v if is_low else own > v:
            break
        result = further
    return result


def _steps_over(dataset: Dataset, stretch: Stretch, border: Border) -> bool:
    """Return whether the intensities beside a bound are integers whose greys lie on its two sides already."""
    if dataset.dtype.kind not in "iu" or len(dataset.bands) == 3 or dataset.choice.expanded:
        return False
    inside = math.ceil(border.intensity) if border.is_low else math.floor(border.intensity)
    greys = [_grey(stretch, number) for number in (inside, inside + (-1 if border.is_low else 1))]
    if border.is_low:
        return greys[0] >= border.grey > greys[1]
    return greys[0] <= border.grey < greys[1]
