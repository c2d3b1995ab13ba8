"""How likely pixels are of a sample's kind, by their colour: blurred bands, looked up in a table.

Bands are blurred by a binomial filter of 5 x 5 pixels (a Gaussian of one pixel), which halves the noise of
single pixels and leaves edges where they are. Of more than three bands, three linear combinations are used.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.sample.mixture import Points
from uavseg.segmentation.sample.sample_vote import SampleVote, votes_of
from uavseg.units import GREY_MAX

BLUR_HALO = 2  # pixels
_BINS = {1: 4096, 2: 512, 3: 64}  # along each of so many axes
_TAILS = (0.001, 0.999)  # quantiles between which bins lie; what is beyond belongs to the outer ones
_AXES = 3
_LEAST_LIMIT = 0.25  # of likeness, on the way from what is certainly of other kinds to the sample
_UNDECIDED = 0.5  # likeness of less than this from 0.5, doubled, is undecided: 0.25 to 0.75
_AGREED = 0.8  # intersection over union of what two votes find, from which on they find the same
_OTHERS = 0.05  # share of the raster that is certainly of other kinds


@dataclass(frozen=True)
class LikenessTable:
    """Probability that a colour is of the sample's kind.

    Parameters
    ----------
    weights : (axes, bands) float64 array
        Of the bands in each axis.
    lows, scales : (axes,) float64 arrays
        Where the first bin of each axis begins, and bins per unit.
    likeness : (bins ** axes,) uint16 array
        Probability of each bin, 65535 for 1; the last axis runs fastest.
    own : float
        Mean probability of the sample's pixels.
    share : float
        Mean probability of the raster's pixels.
    unlike : float, optional
        Mean probability of the pixels of samples of what is not of the kind.
    undecided : float
        Share of the raster's pixels with a probability of 0.25 to 0.75.
    """

    weights: NDArray[np.float64]
    lows: NDArray[np.float64]
    scales: NDArray[np.float64]
    likeness: NDArray[np.uint16]
    own: float
    share: float
    unlike: float | None = None
    undecided: float = 0.0

    @classmethod
    def fit(
        cls,
        points: NDArray[np.uint16],
        sample: NDArray[np.uint16],
        unlike: NDArray[np.uint16] | None = None,
    ) -> "LikenessTable":
        """Fit a table to colours.

        One half lies at least in the middle between the likeness of the sample and that of the least likely
        twentieth of the raster; with a sample of what is not of the kind, in the middle between the two. From
        there it is lowered to the limit above which the expected intersection over union is largest.

        Parameters
        ----------
        points : (n, bands) uint16 array
            Blurred colours of pixels all over the raster.
        sample : (m, bands) uint16 array
            Those of the sample's pixels.
        unlike : (k, bands) uint16 array, optional
            Those of pixels that are not of the kind.
        """
        weights = _axes(points.astype(np.float64), sample.astype(np.float64))
        raster, own = (_project(values, weights) for values in (points, sample))
        mean = raster.mean(0)
        deviation = np.maximum(raster.std(0), 1)
        other = None if unlike is None else (_project(unlike, weights) - mean) / deviation
        values = (raster - mean) / deviation, (own - mean) / deviation
        decision = _decide(*values, other)
        bins = _BINS[len(weights)]
        lows, highs = np.quantile(np.concatenate([raster, own]), _TAILS, axis=0)
        scales = bins / np.maximum(highs - lows, 1)
        middles = [low + (np.arange(bins) + 0.5) / scale for low, scale in zip(lows, scales, strict=True)]
        grid = np.stack(np.meshgrid(*middles, indexing="ij"), -1).reshape(-1, len(weights))
        of_grid = decision.likeness((grid - mean) / deviation)
        likeness = np.rint(of_grid * GREY_MAX).astype(np.uint16)
        table = cls(weights, lows, scales, likeness, 0.0, 0.0)
        of_points = table.of(points)
        parts = [float(found.mean()) / GREY_MAX for found in (table.of(sample), of_points)]
        against = None if unlike is None else float(table.of(unlike).mean()) / GREY_MAX
        undecided = float((np.abs(2 * (of_points / GREY_MAX) - 1) < _UNDECIDED).mean())
        return cls(weights, lows, scales, likeness, parts[0], parts[1], against, undecided)

    @property
    def parting(self) -> float:
        """By how much the likeness of the sample exceeds that of what it is compared with."""
        return self.own - (self.share if self.unlike is None else self.unlike)

    def of(self, colors: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """Likeness of (n, bands) colours, 65535 for certain."""
        found: NDArray[np.uint16] = self.apply([column[None] for column in colors.T])[0]
        return found

    def apply(self, planes: Sequence[NDArray[np.uint16]]) -> NDArray[np.uint16]:
        """Likeness of the pixels of blurred bands, each (M, N)."""
        stacked = np.stack(planes)
        found = np.empty(stacked.shape[1:], np.uint16)
        bins = _BINS[len(self.weights)]
        _look_up(stacked, self.weights, self.lows, self.scales, bins, self.likeness, found)
        return found


@dataclass(frozen=True)
class _Decision:
    """A vote, and which likeness becomes one half: first what lies in the middle, then the limit."""

    vote: SampleVote
    middle: float
    limit: float

    @classmethod
    def of(cls, vote: SampleVote, points: Points, sample: Points, unlike: Points | None) -> "_Decision":
        """By the likeness of the sample, and of the points or of what is not of the kind."""
        of_points, of_own = vote.likeness(points), vote.likeness(sample)
        own = float(of_own.mean())
        if unlike is None:
            middle = max(0.5, (float(np.quantile(of_points, _OTHERS)) + own) / 2)
        else:
            middle = min(max((float(vote.likeness(unlike).mean()) + own) / 2, 0.01), 0.99)
        return cls(vote, middle, _best_limit(_moved(of_points, middle), _moved(of_own, middle)))

    def likeness(self, points: Points) -> Points:
        """Likeness of points; those of one half and more are found."""
        return _moved(_moved(self.vote.likeness(points), self.middle), self.limit)


def _decide(points: Points, sample: Points, unlike: Points | None) -> _Decision:
    """The usual vote; or that with a component begun at the sample, unless both find nearly the same.

    The usual one is better at the rim, where pixels of two kinds are mixed.
    """
    usual, *begun = (_Decision.of(vote, points, sample, unlike) for vote in votes_of(points, sample, unlike))
    for other in begun:
        first, second = (decision.likeness(points) >= 0.5 for decision in (usual, other))
        if (first & second).sum() < _AGREED * (first | second).sum():
            return other
    return usual


def blurred(grey: NDArray[np.uint16], valid: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Binomial mean of 5 x 5 pixels, of those that are valid.

    Parameters
    ----------
    grey : (M + 4, N + 4) uint16 array
    valid : (M + 4, N + 4) uint8 array

    Returns
    -------
    means : (M, N) uint16 array, rounded down; 0 where no pixel is valid
    """
    rows, cols = (max(length - 2 * BLUR_HALO, 0) for length in grey.shape)
    means = np.empty((rows, cols), np.uint16)
    sums, counts = np.empty((2, grey.shape[1]), np.int64)
    _blur(grey, valid, sums, counts, means)
    return means


def _moved(likeness: Points, middle: float) -> Points:
    """Likeness where what was this becomes one half."""
    found: Points = np.interp(likeness, [0, middle, 1], [0, 0.5, 1])
    return found


def _best_limit(likeness: Points, own: Points) -> float:
    """The limit, at most one half, above which pixels overlap best with what is of the kind, as is expected.

    It lies at least a quarter of the way from the least likely twentieth of the raster to the sample.

    The expected intersection over union of the k likeliest pixels is that of the sums of probabilities:
    S. Nowozin, Optimal Decisions from Probabilistic Models: the Intersection-over-Union Case, CVPR 2014.
    """
    falling = np.sort(likeness)[::-1]
    found = np.cumsum(falling)
    overlap = found / np.maximum(found[-1] + np.arange(1, len(found) + 1) - found, 1e-9)
    rest = float(np.quantile(likeness, _OTHERS))
    least = rest + _LEAST_LIMIT * (float(own.mean()) - rest)
    return float(min(max(falling[int(overlap.argmax())], least, 1e-3), 0.5))


def _axes(points: Points, sample: Points) -> Points:
    """Weights of bands: the bands themselves, or of more than three the directions that show most.

    The first parts the sample from the raster best (Fisher's discriminant, with the scatter of the sample),
    the others show most of what remains.
    """
    bands = points.shape[1]
    if bands <= _AXES:
        return np.eye(bands)
    scale = 1 / np.maximum(points.std(0), 1)
    values, own = points * scale, sample * scale
    scatter = np.cov(own.T) + 0.05 * np.eye(bands)
    first = np.linalg.solve(scatter, own.mean(0) - values.mean(0))
    first /= max(float(np.sqrt((first * first).sum())), 1e-12)
    rest = np.cov(values.T)
    keep = np.eye(bands) - np.outer(first, first)
    _, vectors = np.linalg.eigh(keep @ rest @ keep)
    weights: Points = np.stack([first, vectors[:, -1], vectors[:, -2]]) * scale
    return weights


def _project(colors: NDArray[np.uint16], weights: Points) -> Points:
    parts = [sum(weight * colors[:, k] for k, weight in enumerate(row)) for row in weights]
    return np.stack(parts, 1)


@kernel("void(u2[:,::1], u1[:,::1], i8[::1], i8[::1], u2[:,::1])")
def _blur(grey, valid, sums, counts, means):  # type: ignore[no-untyped-def]
    rows, cols = means.shape
    for r in range(rows):
        for c in range(cols + 4):
            total = np.int64(0)
            count = np.int64(0)
            for k in range(5):
                weight = np.int64(6 if k == 2 else (4 if k == 1 or k == 3 else 1))
                if valid[r + k, c]:
                    total += weight * np.int64(grey[r + k, c])
                    count += weight
            sums[c] = total
            counts[c] = count
        for c in range(cols):
            total = sums[c] + sums[c + 4] + 4 * (sums[c + 1] + sums[c + 3]) + 6 * sums[c + 2]
            count = counts[c] + counts[c + 4] + 4 * (counts[c + 1] + counts[c + 3]) + 6 * counts[c + 2]
            means[r, c] = total // count if count else 0


@kernel("void(u2[:,:,::1], f8[:,::1], f8[::1], f8[::1], i8, u2[::1], u2[:,::1])")
def _look_up(planes, weights, lows, scales, bins, likeness, found):  # type: ignore[no-untyped-def]
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
            found[r, c] = likeness[index]
