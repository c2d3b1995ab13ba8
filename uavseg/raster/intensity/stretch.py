"""Contrast stretch: fitted once over a whole dataset by mergeable histograms, applied to each tile."""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import partial, reduce

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.arrays import Bools, Float32s, Integers, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, caused_errors
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.intensity.grey import luminance, luminance_f4, to_grey
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import Valid, Values
from uavseg.units import GREY_LEVELS, GREY_MAX

FORMS = "auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH"
AUTO_PERCENTILES = (Fraction(2), Fraction(98))

_HALF = 1 << 16
_LIMIT = 1 << 30  # greys: what lies farther beyond counts as so far


def rank_of(percent: Fraction, total: int) -> int:
    """Return nearest rank of a percentile among `total` sorted values, counted from 1.

    Examples
    --------
    >>> rank_of(Fraction(50), 4), rank_of(Fraction(51), 4), rank_of(Fraction(0), 4)
    (2, 3, 1)
    """
    return max(-(-percent * total // 100), 1)


def bins_of_ranks(counts: Integers, ranks: Iterable[int]) -> list[tuple[int, int]]:
    """Return for each rank the bin that contains it, and the rank within that bin.

    Examples
    --------
    >>> bins_of_ranks(np.array([2, 0, 3]), [1, 2, 3, 5])
    [(0, 1), (0, 2), (2, 1), (2, 3)]
    """
    below = np.concatenate([[0], np.cumsum(counts)])
    found = [(int(np.searchsorted(below[1:], rank)), rank) for rank in ranks]
    return [(index, rank - int(below[index])) for index, rank in found]


def count_integers(values: Values, valid: Bools | None) -> Integers:
    """Count the values of an integer type of at most 16 bits, smallest value first."""
    size = values.dtype.itemsize
    counts = np.zeros(1 << 8 * size, np.int64)
    flat = np.ascontiguousarray(values).reshape(-1).view(f"u{size}")
    (_count_u1 if size == 1 else _count_u2)(flat, _mask_bytes(valid), counts)
    return np.roll(counts, len(counts) // 2) if values.dtype.kind == "i" else counts


def count_upper_halves(values: Float32s, valid: Bools | None) -> Integers:
    """Count the upper 16 bits of the sort keys: 32-bit integers in the order of the float values."""
    counts = np.zeros(_HALF, np.int64)
    _add_upper(_bit_patterns(values), _mask_bytes(valid), counts)
    return counts


def count_lower_halves(values: Float32s, valid: Bools | None, uppers: tuple[int, ...]) -> Integers:
    """Return histograms of the lower 16 bits of the sort keys, (n, 65536), for n upper halves."""
    counts = np.zeros((len(uppers), _HALF), np.int64)
    row_of = np.full(_HALF, -1, np.int64)
    row_of[list(uppers)] = np.arange(len(uppers))
    _add_lower(_bit_patterns(values), _mask_bytes(valid), row_of, counts)
    return counts


def value_of_key(upper: int, lower: int) -> float:
    """Return the float32 value of a sort key."""
    key = np.uint32(upper << 16 | lower)
    bits = key ^ np.uint32(0x80000000) if key & np.uint32(0x80000000) else ~key
    return float(np.array(bits, np.uint32).view(np.float32))


def _bit_patterns(values: Float32s) -> Uint32s:
    return np.ascontiguousarray(values).reshape(-1).view(np.uint32)


def _mask_bytes(valid: Bools | None) -> Uint8s:
    """Return the mask for a kernel: empty if all pixels are valid."""
    if valid is None:
        return np.empty(0, np.uint8)
    return np.ascontiguousarray(valid).reshape(-1).view(np.uint8)


def _count(values, valid, counts):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        if valid.size == 0 or valid[i]:
            counts[values[i]] += 1


_count_u1 = kernel("void(u1[::1], u1[::1], i8[::1])")(_count)
_count_u2 = kernel("void(u2[::1], u1[::1], i8[::1])")(_count)


@kernel("void(u4[::1], u1[::1], i8[::1])")
def _add_upper(patterns, valid, counts):  # type: ignore[no-untyped-def]
    for i in range(patterns.size):
        if valid.size == 0 or valid[i]:
            bits = patterns[i]
            flipped = bits ^ np.uint32(0xFFFFFFFF if bits >> np.uint32(31) else 0x80000000)
            counts[flipped >> np.uint32(16)] += 1


@kernel("void(u4[::1], u1[::1], i8[::1], i8[:,::1])")
def _add_lower(patterns, valid, row_of, counts):  # type: ignore[no-untyped-def]
    for i in range(patterns.size):
        if valid.size == 0 or valid[i]:
            bits = patterns[i]
            flipped = bits ^ np.uint32(0xFFFFFFFF if bits >> np.uint32(31) else 0x80000000)
            row = row_of[flipped >> np.uint32(16)]
            if row >= 0:
                counts[row, flipped & np.uint32(0xFFFF)] += 1


@dataclass(frozen=True, slots=True)
class Border:
    """A bound of a range, on which greys are decided by the intensities themselves.

    Intensities outside of the bound that have the last grey of the range get the next grey outside; those
    inside that have the next grey outside get this one.
    """

    intensity: float  # stored; belongs to the range
    grey: int  # the last of the range
    is_low: bool  # the range lies above it

    @property
    def outside(self) -> int:
        """The next grey outside of the range."""
        return self.grey - 1 if self.is_low else self.grey + 1


@dataclass(frozen=True, slots=True)
class Stretch:
    """Linear map from intensity to grey.

    v = (intensity − low) / (high − low), clipped to [0, 1], and grey = floor(65535 v + 0.5). If low = high, v
    is 0 below, 1 above and 0.5 at that intensity, so a constant image is middle grey.

    Examples
    --------
    >>> Stretch(0.0, 255.0, "dtype").apply(np.array([[[0, 128, 255]]], np.uint8))
    array([[    0, 32896, 65535]], dtype=uint16)
    """

    low: float  # the intensity that becomes black
    high: float  # and white
    name: str  # for messages: "percentile:2,98 -> 113..2045"
    warnings: tuple[str, ...] = ()
    borders: tuple[Border, ...] = ()  # of ranges that greys alone would not decide exactly

    @property
    def clips(self) -> bool:
        """Whether intensities beyond its ends become those of the ends."""
        return True

    def apply(self, values: Values, valid: Valid | None = None) -> Uint16s:
        """Return grey of each pixel, 0 where it is invalid.

        `values` are intensity, (1, rows, cols), or red, green and blue, (3, rows, cols), whose luminance is
        used, of any real type.
        """
        grey = to_grey(values, self.low, self.high)
        if self.borders:
            _decide_borders(grey, values, self.borders)
        if valid is not None:
            grey *= valid
        return grey

    def colored(self, values: Values, valid: Valid | None = None) -> Uint8s:
        """Return red, green, blue and alpha, (4, rows, cols): three bands each stretched, or one as grey."""
        picture = np.full((4, *values.shape[1:]), 255, np.uint8)
        for band, plane in enumerate(np.broadcast_to(values, (3, *values.shape[1:]))):
            picture[band] = to_grey(plane[None], self.low, self.high) >> 8
        if valid is not None:
            picture *= valid
        return picture


def _decide_borders(grey: Uint16s, values: Values, borders: Sequence[Border]) -> None:
    """Move pixels by a grey where their grey and their intensity lie on different sides of a bound."""
    flat, pixels = grey.reshape(-1), np.ascontiguousarray(values).reshape(len(values), -1)
    is_near = np.zeros(GREY_LEVELS, bool)
    is_near[[key for border in borders for key in (border.grey, border.outside)]] = True
    near = np.flatnonzero(is_near[flat])
    here = luminance_f4(pixels[:, near]) if len(pixels) == 3 else pixels[0, near]
    own = flat[near]
    for border in borders:
        inside = here >= border.intensity if border.is_low else here <= border.intensity
        flat[near[(own == border.grey) & ~inside]] = border.outside
        flat[near[(own == border.outside) & inside]] = border.grey


@dataclass(frozen=True, slots=True)
class StretchSpec:
    """A requested stretch, before it is fitted."""

    form: str  # "auto", "dtype", "minmax", "percentile", "none" or "given"
    bounds: tuple[Fraction, Fraction] | None = None  # percentiles, or intensities

    def __str__(self) -> str:
        if self.bounds is None:
            return self.form
        pair = ",".join(f"{float(bound):g}" for bound in self.bounds)
        return f"percentile:{pair}" if self.form == "percentile" else pair


def parse_stretch(text: str) -> StretchSpec:
    """Parse a stretch: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH; ParameterError for another one.

    Examples
    --------
    >>> str(parse_stretch("percentile:2,98")), str(parse_stretch("0,2047"))
    ('percentile:2,98', '0,2047')
    """
    word = text.strip().lower()
    if word in ("auto", "dtype", "minmax", "none"):
        return StretchSpec(word)
    form = "percentile" if word.startswith("percentile:") else "given"
    wanted = f"a stretch is one of {FORMS}, not {text!r}"
    with caused_errors(wanted, ParameterError, ValueError, ZeroDivisionError, form="{}"):
        low, high = (Fraction(part.strip()) for part in word.removeprefix("percentile:").split(","))
    if form == "percentile" and not 0 <= low < high <= 100:
        raise ParameterError(f"a percentile stretch takes 0 <= P < Q <= 100, not {text}")
    if low >= high:
        raise ParameterError(f"the low intensity of a stretch must be below its high one, not {text}")
    return StretchSpec(form, (low, high))


def fit_stretch(dataset: Dataset, spec: Stretch | StretchSpec | str, tile_pass: TilePass) -> Stretch:
    """Fit a stretch to a whole dataset.

    Only `minmax` and `percentile` read pixels. Percentiles are nearest ranks: percentile p is the smallest
    intensity with at least p percent of the valid pixels at or below it; exact for integers of up to 16 bits,
    with the precision of float32 for all other types. A fitted stretch is returned unchanged; the result does
    not depend on the tiles. A ParameterError says that `dtype` is requested for floating point bands, which
    have no maximum.
    """
    if isinstance(spec, Stretch):
        return spec
    spec = resolved_spec(dataset, parse_stretch(spec) if isinstance(spec, str) else spec)
    percents = percents_of(spec)
    return stretch_of(dataset, spec, order_statistics(dataset, percents, tile_pass) if percents else ())


def resolved_spec(dataset: Dataset, spec: StretchSpec) -> StretchSpec:
    """Return a requested stretch, with what `auto` stands for."""
    if spec.form != "auto":
        return spec
    if dataset.limits is not None:
        return StretchSpec("given", (Fraction(dataset.limits[0]), Fraction(dataset.limits[1])))
    if dataset.dtype.kind in "iu" and dataset.bits <= 8:
        return StretchSpec("dtype")
    return StretchSpec("percentile", AUTO_PERCENTILES)


def percents_of(spec: StretchSpec) -> tuple[Fraction, ...]:
    """Return the percentiles that a resolved stretch is fitted to; none where no pixel is read."""
    if spec.form not in ("minmax", "percentile"):
        return ()
    return spec.bounds or (Fraction(0), Fraction(100))


def stretch_of(dataset: Dataset, spec: StretchSpec, found: Sequence[float] | None) -> Stretch:
    """Return a resolved stretch with the intensities at its percentiles; None if no pixel is valid."""
    if spec.form == "none":
        return Stretch(0.0, 1.0, "none -> 0..1")
    if spec.form == "given" and spec.bounds is not None:
        return _stretch_between(spec, float(spec.bounds[0]), float(spec.bounds[1]))
    if spec.form == "dtype":
        if dataset.dtype.kind == "f":
            raise ParameterError(
                f"{dataset.dtype} bands have no maximum for the stretch dtype; use minmax, percentile:P,Q or "
                "LOW,HIGH, or none if values are 0 to 1 already"
            )
        return _stretch_between(spec, 0.0, math.ldexp(1.0, dataset.bits - (dataset.dtype.kind == "i")) - 1)
    if found is None:
        return Stretch(0.0, 1.0, f"{spec} -> nothing", ("no pixel is valid, so there is nothing to stretch",))
    return _stretch_between(spec, *found)


def _stretch_between(spec: StretchSpec, low: float, high: float) -> Stretch:
    warnings: tuple[str, ...] = ()
    if low == high:
        warnings = (f"the stretch {spec} finds one intensity, {low:g}: it becomes v = 0.5, less 0, more 1",)
    return Stretch(low, high, f"{spec} -> {low:g}..{high:g}", warnings)


def order_statistics(
    dataset: Dataset, percents: Sequence[Fraction], tile_pass: TilePass
) -> list[float] | None:
    """Return the intensities at some percentiles of all valid pixels; None if there are none."""
    integers = counts_exactly(dataset)
    counts = reduce(np.add, tile_pass.run(partial(_count_upper, dataset)))
    total = int(counts.sum())
    if total == 0:
        return None
    bins = bins_of_ranks(counts, [rank_of(percent, total) for percent in percents])
    if integers:
        return [float(index + np.iinfo(dataset.dtype.name).min) for index, _ in bins]
    uppers = tuple(sorted({index for index, _ in bins}))
    lowers = reduce(np.add, tile_pass.run(partial(_count_lower, dataset, uppers)))
    return [
        value_of_key(upper, bins_of_ranks(lowers[uppers.index(upper)], [rank])[0][0]) for upper, rank in bins
    ]


def counts_exactly(dataset: Dataset) -> bool:
    """Return whether one histogram has a bin for each possible value."""
    single = len(dataset.bands) == 1 and not dataset.choice.expanded
    return single and dataset.dtype.kind in "iu" and dataset.dtype.itemsize <= 2


def _count_upper(dataset: Dataset, window: Window) -> Integers:
    if dataset.is_empty(window):
        return np.zeros(1 << (8 * dataset.dtype.itemsize if counts_exactly(dataset) else 16), np.int64)
    values, valid = dataset.read(window)
    if counts_exactly(dataset):
        return count_integers(values[0], valid)
    return count_upper_halves(_floats(values), valid)


def _count_lower(dataset: Dataset, uppers: tuple[int, ...], window: Window) -> Integers:
    if dataset.is_empty(window):
        return np.zeros((len(uppers), 1 << 16), np.int64)
    values, valid = dataset.read(window)
    return count_lower_halves(_floats(values), valid, uppers)


def _floats(values: Values) -> Float32s:
    if len(values) == 3:
        return luminance_f4(values)
    with np.errstate(over="ignore", invalid="ignore"):  # what float32 cannot hold is infinite, or NaN
        floats: Float32s = values[0].astype(np.float32, copy=False)
    return floats


def greys_beyond(
    values: Values, valid: Valid | None, grey: Uint16s, stretch: Stretch
) -> NDArray[np.int32] | None:
    """Return by how many greys each valid pixel lies beyond the end of a stretch, negative below it, int32.

    None if it is 0 everywhere. `values` and `grey` are as of `Stretch.apply`. The sum of the result and that
    of the greys is the sum of the intensities, to half a grey for each pixel.
    """
    low, high = stretch.low, stretch.high
    limits = np.iinfo(values.dtype.name) if values.dtype.kind in "iu" else None
    if not stretch.clips or low == high or (limits and low <= limits.min and limits.max <= high):
        return None
    at_ends = np.flatnonzero(grey.reshape(-1) - np.uint16(1) >= GREY_MAX - 1)  # 0 becomes 65535
    if valid is not None:
        at_ends = at_ends[valid.reshape(-1)[at_ends]]
    pixels = np.ascontiguousarray(values).reshape(len(values), -1)[:, at_ends]
    # Infinity is clipped below; where the stretch is infinitely wide, a quotient is no number and not beyond.
    with np.errstate(over="ignore", invalid="ignore"):
        v = ((luminance(pixels) if len(pixels) == 3 else pixels[0].astype(np.float64)) - low) / (high - low)
        outside = np.flatnonzero((v < 0) | (v > 1))
        if not outside.size:
            return None
        v = v[outside]
        steps = np.floor(GREY_MAX * np.where(v > 1, v - 1, v) + 0.5)
    beyond = np.zeros(grey.shape, np.int32)
    beyond.reshape(-1)[at_ends[outside]] = np.clip(steps, -_LIMIT, _LIMIT)
    return beyond
