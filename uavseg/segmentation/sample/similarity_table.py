"""Colour classifier as a lookup table: the probability that a pixel is of a sample's class.

Bands are blurred by a binomial filter of 5 x 5 pixels (a Gaussian of one pixel), which halves the noise of
single pixels and leaves edges where they are. Of more than three bands, three linear combinations are used.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from uavseg._jit import kernel
from uavseg.arrays import Bools, Floats, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.segmentation.sample.mixture import SampleVote, sample_votes
from uavseg.units import GREY_LEVELS, GREY_MAX

BLUR_HALO = 2  # pixels
_BINS = {1: 4096, 2: 512, 3: 64}  # along each of so many axes
_TAILS = (0.001, 0.999)  # quantiles between which bins lie; values outside belong to the outer ones
_AXES = 3
_WITHIN = 0.7  # share of the smallest differences between neighbours, which are within one kind of ground
_STEPS = 256  # of an axis in each bin
_ROOM = 24576  # steps below the first bin, and as many above the last
_MIN_LIMIT = 0.25  # of the way in similarity from pixels that are certainly of other classes to the sample
_UNCERTAIN = 0.5  # twice the distance from 0.5 below which a similarity is uncertain: 0.25 to 0.75
_AGREED = 0.8  # intersection over union from which two votes agree
_OTHERS = 0.05  # share of the raster that is certainly of other classes


@dataclass(frozen=True)
class Axes:
    """Weighted sums of many bands, as 16-bit numbers."""

    weights: Floats  # (axes, bands)
    offsets: Floats  # (axes,)

    def of(self, planes: Iterable[Uint16s]) -> Uint16s:
        """Sum bands, each (M, N), which are taken one after the other: (axes, M, N)."""
        total: Any = self.offsets[:, None, None]
        for weights, plane in zip(self.weights.T, planes, strict=True):
            total = total + weights[:, None, None] * plane
        return np.asarray(np.clip(total, 0, GREY_MAX).astype(np.uint16))


@dataclass(frozen=True)
class SimilarityTable:
    """Lookup table of the probability that a colour is of the sample's class."""

    weights: Floats  # (axes, bands): of the bands in each axis
    lows: Floats  # (axes,): start of the first bin of each axis
    scales: Floats  # (axes,): bins per unit
    similarity: Uint16s  # (bins ** axes,): 65535 for 1; the last axis runs fastest
    sample_mean: float  # mean probability of the sample's pixels
    raster_mean: float  # of the raster's pixels
    other_mean: float | None = None  # of pixels of samples of other classes
    uncertain: float = 0.0  # share of the raster's pixels with 0.25 to 0.75
    share: float = 0.0  # of the raster's pixels with one half and more, by the usual vote
    finer_share: float | None = None  # the same by the finest mixture; None where that is not clearly less

    @classmethod
    def fit(
        cls, points: Uint16s, sample: Uint16s, unlike: Uint16s | None = None, finer: bool = False
    ) -> "SimilarityTable":
        """Fit a table to (n, bands) blurred colours of a raster, of a sample, and of other classes if given.

        One half lies at least in the middle between the similarity of the sample and that of the least
        similar twentieth of the raster; with a sample of other classes, in the middle between the two. From
        there it is lowered to the limit above which the expected intersection over union is largest. `finer`
        kinds are those of the finest mixture, where it finds less.
        """
        weights = _axes(points.astype(np.float64), sample.astype(np.float64))
        raster, of_sample = (_project(values, weights) for values in (points, sample))
        mean = raster.mean(0)
        deviation = np.maximum(raster.std(0), 1)
        other = None if unlike is None else (_project(unlike, weights) - mean) / deviation
        usual, finest = _decide((raster - mean) / deviation, (of_sample - mean) / deviation, other)
        decision = finest if finer and finest is not None else usual
        bins = _BINS[len(weights)]
        lows, highs = np.quantile(np.concatenate([raster, of_sample]), _TAILS, axis=0)
        scales = bins / np.maximum(highs - lows, 1)
        middles = [low + (np.arange(bins) + 0.5) / scale for low, scale in zip(lows, scales, strict=True)]
        grid = np.stack(np.meshgrid(*middles, indexing="ij"), -1).reshape(-1, len(weights))
        of_grid = decision.similarity((grid - mean) / deviation)
        similarity = np.rint(of_grid * GREY_MAX).astype(np.uint16)
        table = cls(weights, lows, scales, similarity, sample_mean=0.0, raster_mean=0.0)
        of_points = table.of(points)
        return replace(
            table,
            sample_mean=float(table.of(sample).mean()) / GREY_MAX,
            raster_mean=float(of_points.mean()) / GREY_MAX,
            other_mean=None if unlike is None else float(table.of(unlike).mean()) / GREY_MAX,
            uncertain=float((np.abs(2 * (of_points / GREY_MAX) - 1) < _UNCERTAIN).mean()),
            share=float(usual.found.mean()),
            finer_share=None if finest is None else float(finest.found.mean()),
        )

    @property
    def axes(self) -> Axes:
        """The axes with 256 steps in each bin, and room for noise on both sides of the bins."""
        return Axes(self.weights * (_STEPS * self.scales)[:, None], _ROOM - _STEPS * self.scales * self.lows)

    @property
    def on_axes(self) -> "SimilarityTable":
        """The same table for what `axes` makes of the bands."""
        count = len(self.weights)
        lows, scales = np.full(count, float(_ROOM)), np.full(count, 1 / _STEPS)
        return replace(self, weights=np.eye(count), lows=lows, scales=scales)

    @property
    def separation(self) -> float:
        """Mean similarity of the sample less that of the other samples, or else of the raster."""
        return self.sample_mean - (self.raster_mean if self.other_mean is None else self.other_mean)

    def of(self, colors: Uint16s) -> Uint16s:
        """Look up the similarity of (n, bands) colours, 65535 for certain."""
        return np.asarray(self.apply([column[None] for column in colors.T])[0])

    def apply(self, planes: Sequence[Uint16s]) -> Uint16s:
        """Look up the similarity of the pixels of blurred bands, each (M, N)."""
        stacked = np.stack(planes)
        result = np.empty(stacked.shape[1:], np.uint16)
        if np.array_equal(self.weights, np.eye(len(stacked))):
            _look_up_bands(stacked, self._starts, self.similarity, result)
        else:
            bins = _BINS[len(self.weights)]
            _look_up(stacked, self.weights, self.lows, self.scales, bins, self.similarity, result)
        return result

    @cached_property
    def _starts(self) -> Uint32s:
        """What each grey of each axis adds to the index of the table: (axes, 65536)."""
        bins, greys = _BINS[len(self.lows)], np.arange(GREY_LEVELS)
        places = np.clip((greys - self.lows[:, None]) * self.scales[:, None], 0, bins - 1).astype(np.uint32)
        strides = bins ** np.arange(len(places))[::-1]
        return places * strides[:, None].astype(np.uint32)


@dataclass(frozen=True)
class _Decision:
    """A vote, and the similarity that becomes one half: first the middle, then the limit."""

    vote: SampleVote
    middle: float
    limit: float
    found: Bools  # which points of the raster are of the class: those of one half and more

    @classmethod
    def of(cls, vote: SampleVote, points: Floats, sample: Floats, unlike: Floats | None) -> "_Decision":
        """Fit middle and limit to the similarity of the sample, and of the points or of other classes."""
        of_points, of_sample = vote.similarity(points), vote.similarity(sample)
        mean = float(of_sample.mean())
        if unlike is None:
            middle = max(0.5, (float(np.quantile(of_points, _OTHERS)) + mean) / 2)
        else:
            middle = min(max((float(vote.similarity(unlike).mean()) + mean) / 2, 0.01), 0.99)
        # The limit with the largest expected intersection over union of the likeliest pixels and the class:
        # that of the sums of probabilities (S. Nowozin, Optimal Decisions from Probabilistic Models: the
        # Intersection-over-Union Case, CVPR 2014). It is at least a quarter of the way to the sample.
        similarity = _moved(of_points, middle)
        falling = np.sort(similarity)[::-1]
        result = np.cumsum(falling)
        overlap = result / np.maximum(result[-1] + np.arange(1, len(result) + 1) - result, 1e-9)
        rest = float(np.quantile(similarity, _OTHERS))
        minimum = rest + _MIN_LIMIT * (float(_moved(of_sample, middle).mean()) - rest)
        limit = float(min(max(falling[int(overlap.argmax())], minimum, 1e-3), 0.5))
        return cls(vote, middle, limit, found=_moved(similarity, limit) >= 0.5)

    def similarity(self, points: Floats) -> Floats:
        """Compute the similarity of points; those of one half and more are of the class."""
        return _moved(_moved(self.vote.similarity(points), self.middle), self.limit)

    def agrees(self, other: "_Decision") -> bool:
        """Check whether two decisions find much the same points."""
        both, either = self.found & other.found, self.found | other.found
        return bool(both.sum() >= _AGREED * either.sum())


def _decide(points: Floats, sample: Floats, unlike: Floats | None) -> tuple[_Decision, _Decision | None]:
    """Return the usual vote, or the one with seeded components if the two differ much; and a finer one."""
    # The usual one is better at the rim, where pixels of two classes are mixed.
    given = points, sample, unlike
    votes, finest = sample_votes(*given)
    usual, *seeded, finer = (_Decision.of(vote, *given) for vote in (*votes, finest))
    chosen = next((other for other in seeded if not usual.agrees(other)), usual)
    is_less = finer.found.sum() < chosen.found.sum()
    return chosen, finer if is_less and not chosen.agrees(finer) else None


def blurred(grey: Uint16s, valid: Uint8s) -> Uint16s:
    """Blur by the binomial mean of 5 x 5 pixels, of those that are valid.

    The arrays are (M + 4, N + 4), the means (M, N), rounded down; 0 where no pixel is valid.
    """
    rows, cols = (max(length - 2 * BLUR_HALO, 0) for length in grey.shape)
    means = np.empty((rows, cols), np.uint16)
    sums, counts = np.empty((2, grey.shape[1]), np.uint32)
    _blur(grey, valid, sums, counts, means)
    return means


def _moved(similarity: Floats, middle: float) -> Floats:
    """Stretch similarity so that `middle` becomes one half."""
    return np.interp(similarity, [0, middle, 1], [0, 0.5, 1])


def _axes(points: Floats, sample: Floats) -> Floats:
    """Return weights of bands: the bands themselves, or of more than three a projection to three axes."""
    # The first axis is Fisher's discriminant of sample and raster, the others are the principal components of
    # the rest. Few pixels of a sample do not tell how many bands vary together, so its scatter is averaged
    # with that of noise, from differences between neighbours (minimum noise fraction: Green et al., IEEE
    # Transactions on Geoscience and Remote Sensing 26, 1988, 65-74), less those across borders.
    bands = points.shape[1]
    if bands <= _AXES:
        return np.eye(bands)
    scale = 1 / np.maximum(points.std(0), 1)
    values, scaled = points * scale, sample * scale
    steps = np.diff(values, axis=0)
    lengths = (steps * steps).sum(1)
    noise = _products(steps[lengths <= np.quantile(lengths, _WITHIN)]) / 2
    scatter = (noise + _products(scaled - scaled.mean(0))) / 2 + 0.01 * np.eye(bands)
    first = np.linalg.solve(scatter, scaled.mean(0) - values.mean(0))
    first /= max(float(np.sqrt((first * first).sum())), 1e-12)
    keep = np.eye(bands) - np.outer(first, first)
    _, vectors = np.linalg.eigh(keep @ _products(values - values.mean(0)) @ keep)
    return np.asarray(np.stack([first, vectors[:, -1], vectors[:, -2]]) * scale)


def _products(rows: Floats) -> Floats:
    """Average the products of columns, in a fixed order: (bands, bands)."""
    return np.asarray(np.einsum("ni,nj->ij", rows, rows) / len(rows))


def _project(colors: Uint16s, weights: Floats) -> Floats:
    parts = [sum(weight * colors[:, k] for k, weight in enumerate(row)) for row in weights]
    return np.stack(parts, 1)


@kernel("void(u2[:,::1], u1[:,::1], u4[::1], u4[::1], u2[:,::1])")
def _blur(grey, valid, sums, counts, means):  # type: ignore[no-untyped-def]
    rows, cols = means.shape
    four, six = np.uint32(4), np.uint32(6)
    for r in range(rows):
        sums[:], counts[:] = 0, 0
        for k in range(5):
            weight = six if k == 2 else (four if k == 1 or k == 3 else np.uint32(1))
            for c in range(cols + 4):
                share = weight * np.uint32(valid[r + k, c] != 0)
                sums[c] += share * np.uint32(grey[r + k, c])
                counts[c] += share
        for c in range(cols):
            total = sums[c] + sums[c + 4] + four * (sums[c + 1] + sums[c + 3]) + six * sums[c + 2]
            count = counts[c] + counts[c + 4] + four * (counts[c + 1] + counts[c + 3]) + six * counts[c + 2]
            if count == 256:  # all are valid
                means[r, c] = total >> np.uint32(8)
            else:
                means[r, c] = total // count if count else 0


@kernel("void(u2[:,:,::1], u4[:,::1], u2[::1], u2[:,::1])")
def _look_up_bands(planes, starts, similarity, result):  # type: ignore[no-untyped-def]
    bands, rows, cols = planes.shape
    for r in range(rows):
        for c in range(cols):
            index = np.int64(0)
            for band in range(bands):
                index += starts[band, planes[band, r, c]]
            result[r, c] = similarity[index]


@kernel("void(u2[:,:,::1], f8[:,::1], f8[::1], f8[::1], i8, u2[::1], u2[:,::1])")
def _look_up(planes, weights, lows, scales, bins, similarity, result):  # type: ignore[no-untyped-def]
    bands, rows, cols = planes.shape
    for r in range(rows):
        for c in range(cols):
            index = np.int64(0)
            for axis in range(weights.shape[0]):
                value = 0.0
                for band in range(bands):
                    value += weights[axis, band] * planes[band, r, c]
                place = np.int64(min(max((value - lows[axis]) * scales[axis], 0.0), bins - 1.0))
                index = index * bins + place
            result[r, c] = similarity[index]
