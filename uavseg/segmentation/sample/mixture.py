"""Gaussian mixtures of few components, and what a sample says of them.

A picture of few kinds of ground has a mixture of few components, and a sample of one kind says which of them
are that kind: those that are far more frequent in the sample than in the raster. How many components there
are is not known, so mixtures of several sizes vote, each by the share of the sample that it calls its kind.
Each mixture begins with the one before, whose longest component is split.

A kind that is rare, or that lies between others, has no component of its own in any of them. So each mixture
is tried once more with a component that begins at the sample. In a picture a kind is seldom one Gaussian, and
only the part of it that the sample shows would be found; so only those count that leave half as much
undecided, which is where the kind is a cloud of its own.

Expectation maximisation: Dempster, Laird and Rubin, Journal of the Royal Statistical Society B 39 (1977),
1-38. Learning from a sample and unlabelled points: Elkan and Noto, Knowledge Discovery and Data Mining 2008,
213-220. Sums are numpy's, in a fixed order, not those of a linear algebra library whose threads change them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SIZES = (2, 3, 4, 5, 6, 8)
"""Numbers of components of the mixtures that vote."""

_SWEEPS = 30
_BEGUN_SWEEPS = 15  # of a mixture with one component more
_FLOOR = 1e-2  # added to variances, of features whose variance in the raster is 1
_STRETCH = 0.8  # how far from the middle the halves of a component begin, in its deviations
_SHRINK = 0.6  # share of the variance along the longest axis that the split takes away
_RARE = 1e-3  # share of the raster below which a component counts as this share
_IN_SAMPLE = 0.1  # share of the sample with which a component is compared at all
_WRONG = 0.1  # share of the sample that may be of another kind
_ELSEWHERE = 0.1  # weight of the raster where a sample of other kinds lacks what the raster has
_VOTE = 20.0  # how much a mixture loses by the share of the sample that it does not find
_BEGUN_SHARE = 0.01  # of the points, of a component that begins at the sample
_CLEARER = 0.5  # share of what is undecided otherwise, that a mixture with such a component leaves at most

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Mixture:
    """A mixture of k Gaussians in d dimensions.

    Parameters
    ----------
    means : (k, d) float64 array
    covariances : (k, d, d) float64 array
    shares : (k,) float64 array
        Of the points, with a sum of 1.
    """

    means: Points
    covariances: Points
    shares: Points

    def __len__(self) -> int:
        return len(self.shares)

    def memberships(self, points: Points) -> Points:
        """Probability that each point is of each component: (k, n)."""
        found = np.stack([self._log_density(points, k) for k in range(len(self))])
        found -= found.max(0)
        np.exp(found, out=found)
        found /= found.sum(0)
        return found

    def _log_density(self, points: Points, k: int) -> Points:
        """Logarithm of share times density, but for the constant that all have."""
        root = np.linalg.cholesky(self.covariances[k])
        away = points - self.means[k]
        solved: list[Points] = []
        for row in range(len(root)):  # forward substitution
            rest = away[:, row] - sum((root[row, col] * solved[col] for col in range(row)), np.zeros(1))
            solved.append(rest / root[row, row])
        squares = sum((column * column for column in solved), np.zeros(1))
        constant = np.log(max(self.shares[k], 1e-12)) - np.log(np.diag(root)).sum()
        found: Points = constant - 0.5 * squares
        return found


def fit_mixtures(points: Points, sizes: Sequence[int] = SIZES) -> list[Mixture]:
    """Mixtures of several sizes, each begun by splitting the longest component of the one before.

    Parameters
    ----------
    points : (n, d) float64 array
        With a variance of about 1 in each dimension.
    sizes : sequence of int
        Numbers of components, ascending.
    """
    found = []
    mixture = _estimate(points, np.ones((1, len(points))))
    for _ in range(1, max(sizes)):
        mixture = _split(mixture)
        for _ in range(_SWEEPS):
            mixture = _estimate(points, mixture.memberships(points))
        if len(mixture) in sizes:
            found.append(mixture)
    return found


def begun_at(sample: Points, mixture: Mixture, points: Points) -> Mixture:
    """A mixture with one component more, which begins at a sample and is then fitted like the others.

    The sample counts among the points as if it were a thousandth of them: a kind may be so rare that few of
    them show it.

    Parameters
    ----------
    sample : (m, d) float64 array
    mixture : Mixture
        Of the points.
    points : (n, d) float64 array
    """
    own = _estimate(sample, np.ones((1, len(sample))))
    shares = np.append(mixture.shares * (1 - _BEGUN_SHARE), _BEGUN_SHARE)
    found = Mixture(
        np.concatenate([mixture.means, own.means]),
        np.concatenate([mixture.covariances, own.covariances]),
        shares,
    )
    everything = np.concatenate([points, sample])
    counts = np.ones(len(everything))
    counts[len(points) :] = _RARE * len(points) / len(sample)
    for _ in range(_BEGUN_SWEEPS):
        found = _estimate(everything, counts * found.memberships(everything))
    return found


def votes_of(points: Points, sample: Points, unlike: Points | None = None) -> list["SampleVote"]:
    """The vote of mixtures of points on a sample, and that of mixtures with a component begun at the sample.

    Of the latter only those vote that leave half as much undecided; where none does, there is one vote.

    Parameters
    ----------
    points : (n, d) float64 array
        All over the raster, with a variance of about 1 in each dimension.
    sample, unlike
        As of `SampleVote.of`.
    """
    mixtures = fit_mixtures(points)
    usual = SampleVote.of(mixtures, sample, unlike)
    least = _CLEARER * usual.undecided(points)
    begun = [begun_at(sample, mixture, points) for mixture in mixtures]
    clear = [
        mixture
        for mixture in begun
        if mixture.memberships(sample)[-1].mean() > 0.5
        and SampleVote.of([mixture], sample, unlike).undecided(points) < least
    ]
    return [usual, SampleVote.of(clear, sample, unlike)] if clear else [usual]


@dataclass(frozen=True)
class SampleVote:
    """Mixtures, what share of each component is of the sample's kind, and how much each mixture counts.

    Parameters
    ----------
    mixtures : tuple of Mixture
    purities : tuple of (k,) float64 arrays
        For each mixture, the share of each component that is of the sample's kind.
    weights : tuple of float
        Of the mixtures, with a sum of 1.
    """

    mixtures: tuple[Mixture, ...]
    purities: tuple[Points, ...]
    weights: tuple[float, ...]

    @classmethod
    def of(cls, mixtures: Sequence[Mixture], sample: Points, unlike: Points | None = None) -> "SampleVote":
        """The vote of mixtures.

        Parameters
        ----------
        mixtures : sequence of Mixture
        sample : (m, d) float64 array
            Points of the kind.
        unlike : (n, d) float64 array, optional
            Points that are not. The share of a component is then known by both, and a mixture counts by how
            well it parts them.
        """
        memberships = [mixture.memberships(sample) for mixture in mixtures]
        pairs = list(zip(mixtures, memberships, strict=True))
        if unlike is None:
            purities = [_purities(*pair) for pair in pairs]
            parted = np.array([_trimmed(_weighted(p, m)) for p, m in zip(purities, memberships, strict=True)])
        else:
            others = [mixture.memberships(unlike) for mixture in mixtures]
            purities = [_purities_of_two(*parts) for parts in zip(mixtures, memberships, others, strict=True)]
            found = zip(purities, memberships, others, strict=True)
            parted = np.array(
                [_trimmed(_weighted(p, m)) + _trimmed(1 - _weighted(p, o)) for p, m, o in found]
            )
        weights = np.exp(_VOTE * (parted - parted.max()))
        return cls(tuple(mixtures), tuple(purities), tuple((weights / weights.sum()).tolist()))

    def likeness(self, points: Points) -> Points:
        """Probability that each of (n, d) points is of the sample's kind."""
        parts = zip(self.mixtures, self.purities, self.weights, strict=True)
        votes = (weight * _weighted(pure, mixture.memberships(points)) for mixture, pure, weight in parts)
        return sum(votes, np.zeros(len(points)))

    def undecided(self, points: Points) -> float:
        """Of the points that are found, by how much each may be wrong on average: 0 if all are certain."""
        likeness = self.likeness(points)
        return float(np.minimum(likeness, 1 - likeness).sum() / max(float(likeness.sum()), 1e-9))


def _trimmed(likeness: Points) -> float:
    """Mean likeness of points of which some may be of another kind."""
    return float(np.sort(likeness)[int(_WRONG * len(likeness)) :].mean())


def _purities_of_two(mixture: Mixture, memberships: Points, others: Points) -> Points:
    """Share of each component that is of the kind of one sample and not of another one.

    What neither has, and the raster has, is of another kind still.
    """
    own, other = memberships.mean(1), others.mean(1)
    found: Points = own / (own + np.maximum(other, _ELSEWHERE * mixture.shares) + _RARE)
    return found


def _purities(mixture: Mixture, memberships: Points) -> Points:
    """Share of each component that is of the kind of a sample with these memberships.

    By Bayes' rule it is in proportion to how much more frequent the component is in the sample than in the
    raster. The component where that is most is taken to be of the kind as a whole.
    """
    in_sample = memberships.mean(1)
    ratio = in_sample / np.maximum(mixture.shares, _RARE)
    largest = ratio[in_sample > _IN_SAMPLE].max()
    found: Points = np.minimum(ratio / largest, 1)
    return found


def _weighted(weights: Points, rows: Points) -> Points:
    return sum((weight * row for weight, row in zip(weights, rows, strict=True)), np.zeros(rows.shape[1]))


def _estimate(points: Points, memberships: Points) -> Mixture:
    """The mixture of components with these members: a step of maximisation."""
    counts = memberships.sum(1) + 1e-9
    dims = range(points.shape[1])
    means = np.stack([(memberships * points[:, dim]).sum(1) / counts for dim in dims], 1)
    covariances = np.empty((len(counts), len(dims), len(dims)))
    for k, members in enumerate(memberships):
        away = points - means[k]
        for a in dims:
            for b in range(a + 1):
                covariances[k, a, b] = (members * away[:, a] * away[:, b]).sum() / counts[k]
                covariances[k, b, a] = covariances[k, a, b]
        covariances[k] += _FLOOR * np.eye(len(dims))
    return Mixture(means, covariances, counts / counts.sum())


def _split(mixture: Mixture) -> Mixture:
    """The mixture with the component of most spread divided across its longest axis."""
    axes = [_longest_axis(covariance) for covariance in mixture.covariances]
    k = int(np.argmax([share * variance for share, (variance, _) in zip(mixture.shares, axes, strict=True)]))
    variance, axis = axes[k]
    step = _STRETCH * np.sqrt(variance) * axis
    means = np.concatenate([mixture.means, mixture.means[k : k + 1] + step])
    means[k] -= step
    narrow = mixture.covariances[k] - _SHRINK * variance * np.outer(axis, axis)
    covariances = np.concatenate([mixture.covariances, narrow[None]])
    covariances[k] = narrow
    shares = np.append(mixture.shares, mixture.shares[k] / 2)
    shares[k] /= 2
    return Mixture(means, covariances, shares)


def _longest_axis(covariance: Points) -> tuple[float, Points]:
    """Largest eigenvalue and its eigenvector, whose largest entry is positive."""
    values, vectors = np.linalg.eigh(covariance)
    axis: Points = vectors[:, -1]
    return float(values[-1]), axis if axis[np.argmax(np.abs(axis))] > 0 else -axis
