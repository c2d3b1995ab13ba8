"""Gaussian mixture models of several sizes, and their vote on a sample (positive-unlabelled learning).

A picture of few classes of ground has a mixture of few components. Their number is unknown, so mixtures of
several sizes vote, each by the share of the sample that it assigns to the sample's class: the components that
are far more frequent in the sample than in the raster. Each mixture begins with the one before, whose longest
component is split.

A class that is rare, or lies between others, has no component in any of them, so each mixture is fitted once
more with a component seeded at the sample. In a picture a class is seldom one Gaussian, and only the part of
it that the sample shows would be found; so only those mixtures count that leave half as much undecided, which
is where the class is a separate cloud.

Learning from a sample and unlabelled points: Elkan and Noto, Knowledge Discovery and Data Mining 2008,
213-220. Expectation maximisation: Dempster, Laird and Rubin, Journal of the Royal Statistical Society B 39
(1977), 1-38. Sums are in a fixed order, not those of a linear algebra library whose threads change them.
"""

from collections.abc import Sequence

import numpy as np

from uavseg._jit import kernel
from uavseg.arrays import Floats
from uavseg.dataclass import dataclass

SIZES = (2, 3, 4, 5, 6, 8)  # numbers of components of the mixtures that vote

_SWEEPS = 30
_SEED_SWEEPS = 15  # of a mixture with one component more
_FLOOR = 1e-2  # added to variances, of features whose variance in the raster is 1
_STRETCH = 0.8  # how far from the middle the halves of a component begin, in its deviations
_SHRINK = 0.6  # share of the variance along the longest axis that the split takes away
RARE = 1e-3  # share of the raster below which a component counts as this share
_SEED_SHARE = 0.01  # of the points, of a component that begins at the sample

_IN_SAMPLE = 0.1  # share of the sample from which a component is compared at all
_WRONG = 0.1  # share of the sample that may be of another class
_ELSEWHERE = 0.1  # weight of the raster where a sample of other classes lacks what the raster has
_VOTE = 20.0  # exponent of the weight of a mixture by its share of the sample
_CLEARER = 0.5  # maximum of the undecided share with a seeded component, over that without it


@dataclass(frozen=True)
class Mixture:
    """Mixture of k Gaussians in d dimensions: (k, d) means, (k, d, d) covariances, and shares, 1 in sum."""

    means: Floats
    covariances: Floats
    shares: Floats

    def __len__(self) -> int:
        return len(self.shares)

    def memberships(self, points: Floats) -> Floats:
        """Compute the probability that each point is of each component: (k, n)."""
        result = np.empty((len(self), len(points)))
        roots = np.linalg.cholesky(self.covariances)
        logs = np.log(np.maximum(self.shares, 1e-12))
        logs -= np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(1)
        _log_densities(np.ascontiguousarray(points), self.means, np.linalg.inv(roots), logs, result)
        result -= result.max(0)
        np.exp(result, out=result)
        result /= result.sum(0)
        return result


def fit_mixtures(points: Floats, sizes: Sequence[int] = SIZES) -> list[Mixture]:
    """Fit mixtures of several sizes, each from the one before with its longest component split.

    The points, (n, d), have a variance of about 1 in each dimension; `sizes` are numbers of components,
    ascending.
    """
    mixtures = []
    mixture = _estimate(points, np.ones((1, len(points))))
    for _ in range(1, max(sizes)):
        mixture = _split(mixture)
        for _ in range(_SWEEPS):
            mixture = _estimate(points, mixture.memberships(points))
        if len(mixture) in sizes:
            mixtures.append(mixture)
    return mixtures


def _fit_seeded(sample: Floats, mixture: Mixture, points: Floats) -> Mixture:
    """Fit a mixture with one component more, which is seeded at a sample."""
    # The sample counts among the points as if it were a thousandth of them: a class may be so rare that few
    # of them show it.
    seed = _estimate(sample, np.ones((1, len(sample))))
    shares = np.append(mixture.shares * (1 - _SEED_SHARE), _SEED_SHARE)
    covariances = np.concatenate([mixture.covariances, seed.covariances])
    seeded = Mixture(np.concatenate([mixture.means, seed.means]), covariances, shares)
    everything = np.concatenate([points, sample])
    counts = np.ones(len(everything))
    counts[len(points) :] = RARE * len(points) / len(sample)
    for _ in range(_SEED_SWEEPS):
        seeded = _estimate(everything, counts * seeded.memberships(everything))
    return seeded


def _estimate(points: Floats, memberships: Floats) -> Mixture:
    """Estimate the mixture of components with these members (M step)."""
    size, dims = len(memberships), points.shape[1]
    counts, sums, products = np.zeros(size), np.zeros((size, dims)), np.zeros((size, dims, dims))
    _add_moments(np.ascontiguousarray(points), np.ascontiguousarray(memberships), counts, sums, products)
    counts += 1e-9
    means = sums / counts[:, None]
    covariances = products / counts[:, None, None] - means[:, :, None] * means[:, None, :]
    return Mixture(means, covariances + _FLOOR * np.eye(dims), counts / counts.sum())


def _split(mixture: Mixture) -> Mixture:
    """Split the component of most spread across its longest axis."""
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


def _longest_axis(covariance: Floats) -> tuple[float, Floats]:
    """Return the largest eigenvalue and its eigenvector, whose largest entry is positive."""
    values, vectors = np.linalg.eigh(covariance)
    axis: Floats = vectors[:, -1]
    return float(values[-1]), axis if axis[np.argmax(np.abs(axis))] > 0 else -axis


@kernel("void(f8[:,::1], f8[:,::1], f8[:,:,::1], f8[::1], f8[:,::1])")
def _log_densities(points, means, inverses, logs, result):  # type: ignore[no-untyped-def]
    # Logarithm of share times density of components, but for the constant that all have. `inverses` are those
    # of the Cholesky factors of the covariances.
    count, dims = points.shape
    for k in range(len(logs)):
        for i in range(count):
            squares = 0.0
            for row in range(dims):
                part = 0.0
                for col in range(row + 1):
                    part += inverses[k, row, col] * (points[i, col] - means[k, col])
                squares += part * part
            result[k, i] = logs[k] - 0.5 * squares


@kernel("void(f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,:,::1])")
def _add_moments(points, memberships, counts, sums, products):  # type: ignore[no-untyped-def]
    count, dims = points.shape
    for k in range(len(memberships)):
        for i in range(count):
            members = memberships[k, i]
            counts[k] += members
            for a in range(dims):
                weighted = members * points[i, a]
                sums[k, a] += weighted
                for b in range(a + 1):
                    products[k, a, b] += weighted * points[i, b]
        for a in range(dims):
            for b in range(a):
                products[k, b, a] = products[k, a, b]


def sample_votes(
    points: Floats, sample: Floats, unlike: Floats | None = None
) -> tuple[list["SampleVote"], "SampleVote"]:
    """Return the vote of mixtures of points on a sample and that of mixtures seeded at it; and of the finest.

    Of the seeded ones only those vote that leave half as much undecided; where none does, there is one vote.
    The finest mixture, alone, tells apart what coarse ones take together. The points, (n, d), are all over
    the raster, with a variance of about 1 in each dimension; `sample` and `unlike` are those of
    `SampleVote.of`.
    """
    mixtures = fit_mixtures(points)
    usual = SampleVote.of(mixtures, sample, unlike)
    limit = _CLEARER * usual.undecided(points)
    seeded = [_fit_seeded(sample, mixture, points) for mixture in mixtures]
    clear = [
        mixture
        for mixture in seeded
        if mixture.memberships(sample)[-1].mean() > 0.5
        and SampleVote.of([mixture], sample, unlike).undecided(points) < limit
    ]
    votes = [usual, SampleVote.of(clear, sample, unlike)] if clear else [usual]
    return votes, SampleVote.of(mixtures[-1:], sample, unlike)


@dataclass(frozen=True)
class SampleVote:
    """Mixtures, the share of each component that is of the sample's class, and the weight of each mixture.

    The weights have a sum of 1.
    """

    mixtures: tuple[Mixture, ...]
    purities: tuple[Floats, ...]
    weights: tuple[float, ...]

    @classmethod
    def of(cls, mixtures: Sequence[Mixture], sample: Floats, unlike: Floats | None = None) -> "SampleVote":
        """Let mixtures vote on a sample: (m, d) points of the class.

        With `unlike`, (n, d) points of other classes, the share of a component follows from both, and a
        mixture counts by how well it separates them.
        """
        memberships = [mixture.memberships(sample) for mixture in mixtures]
        pairs = list(zip(mixtures, memberships, strict=True))
        if unlike is None:
            purities = [_purities(*pair) for pair in pairs]
            recall = np.array([_trimmed(_weighted(p, m)) for p, m in zip(purities, memberships, strict=True)])
        else:
            others = [mixture.memberships(unlike) for mixture in mixtures]
            purities = list(map(_purities_of_two, mixtures, memberships, others))
            parts = zip(purities, memberships, others, strict=True)
            recall = np.array(
                [_trimmed(_weighted(p, m)) + _trimmed(1 - _weighted(p, o)) for p, m, o in parts]
            )
        weights = np.exp(_VOTE * (recall - recall.max()))
        return cls(tuple(mixtures), tuple(purities), tuple((weights / weights.sum()).tolist()))

    def similarity(self, points: Floats) -> Floats:
        """Compute the probability that each of (n, d) points is of the sample's class."""
        parts = zip(self.mixtures, self.purities, self.weights, strict=True)
        votes = (weight * _weighted(pure, mixture.memberships(points)) for mixture, pure, weight in parts)
        return sum(votes, np.zeros(len(points)))

    def undecided(self, points: Floats) -> float:
        """Compute the expected error of the points of the class: 0 if all are certain."""
        similarity = self.similarity(points)
        return float(np.minimum(similarity, 1 - similarity).sum() / max(float(similarity.sum()), 1e-9))


def _trimmed(similarity: Floats) -> float:
    """Average the similarity of points of which some may be of another class."""
    return float(np.sort(similarity)[int(_WRONG * len(similarity)) :].mean())


def _purities_of_two(mixture: Mixture, memberships: Floats, others: Floats) -> Floats:
    """Return the share of each component that is of the class of one sample and not of another one."""
    # Components that neither has, and the raster has, are of a third class. As far as both do not show what
    # the raster has, it is the background too, as of one sample: to say what is not wanted is no reason to
    # find more of what was not shown.
    one, other = memberships.mean(1), others.mean(1)
    shown = min(float(np.minimum(np.maximum(one, other), mixture.shares).sum()), 1.0)
    against_other = one / (one + np.maximum(other, _ELSEWHERE * shown * mixture.shares) + RARE)
    return np.asarray(_purities(mixture, memberships) ** (1 - shown) * against_other)


def _purities(mixture: Mixture, memberships: Floats) -> Floats:
    """Return the share of each component that is of the class of a sample with these memberships."""
    # By Bayes' rule it is in proportion to how much more frequent the component is in the sample than in the
    # raster. The component with the largest ratio is taken to be of the class as a whole.
    in_sample = memberships.mean(1)
    ratio = in_sample / np.maximum(mixture.shares, RARE)
    largest = ratio[in_sample > _IN_SAMPLE].max()
    return np.asarray(np.minimum(ratio / largest, 1))


def _weighted(weights: Floats, rows: Floats) -> Floats:
    return sum((weight * row for weight, row in zip(weights, rows, strict=True)), np.zeros(rows.shape[1]))
