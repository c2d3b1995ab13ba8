"""Gaussian mixtures of few components.

A picture of few kinds of ground has a mixture of few components. How many there are is not known, so there
are mixtures of several sizes. Each begins with the one before, whose longest component is split. A kind that
is rare, or that lies between others, has no component of its own in any of them; a mixture may be fitted
again with one that begins at points of that kind.

Expectation maximisation: Dempster, Laird and Rubin, Journal of the Royal Statistical Society B 39 (1977),
1-38. Sums are in a fixed order, not those of a linear algebra library whose threads change them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel

SIZES = (2, 3, 4, 5, 6, 8)
"""Numbers of components of the mixtures that vote."""

_SWEEPS = 30
_BEGUN_SWEEPS = 15  # of a mixture with one component more
_FLOOR = 1e-2  # added to variances, of features whose variance in the raster is 1
_STRETCH = 0.8  # how far from the middle the halves of a component begin, in its deviations
_SHRINK = 0.6  # share of the variance along the longest axis that the split takes away
RARE = 1e-3  # share of the raster below which a component counts as this share
_BEGUN_SHARE = 0.01  # of the points, of a component that begins at the sample

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
        found = np.empty((len(self), len(points)))
        roots = np.linalg.cholesky(self.covariances)
        logs = np.log(np.maximum(self.shares, 1e-12))
        logs -= np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(1)
        _log_densities(np.ascontiguousarray(points), self.means, np.linalg.inv(roots), logs, found)
        found -= found.max(0)
        np.exp(found, out=found)
        found /= found.sum(0)
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
    counts[len(points) :] = RARE * len(points) / len(sample)
    for _ in range(_BEGUN_SWEEPS):
        found = _estimate(everything, counts * found.memberships(everything))
    return found


def _estimate(points: Points, memberships: Points) -> Mixture:
    """The mixture of components with these members: a step of maximisation."""
    size, dims = len(memberships), points.shape[1]
    counts, sums, products = np.zeros(size), np.zeros((size, dims)), np.zeros((size, dims, dims))
    _add_moments(np.ascontiguousarray(points), np.ascontiguousarray(memberships), counts, sums, products)
    counts += 1e-9
    means = sums / counts[:, None]
    covariances = products / counts[:, None, None] - means[:, :, None] * means[:, None, :]
    return Mixture(means, covariances + _FLOOR * np.eye(dims), counts / counts.sum())


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


@kernel("void(f8[:,::1], f8[:,::1], f8[:,:,::1], f8[::1], f8[:,::1])")
def _log_densities(points, means, inverses, logs, found):  # type: ignore[no-untyped-def]
    """Logarithm of share times density of components, but for the constant that all have.

    `inverses` are those of the Cholesky factors of the covariances.
    """
    count, dims = points.shape
    for k in range(len(logs)):
        for i in range(count):
            squares = 0.0
            for row in range(dims):
                part = 0.0
                for col in range(row + 1):
                    part += inverses[k, row, col] * (points[i, col] - means[k, col])
                squares += part * part
            found[k, i] = logs[k] - 0.5 * squares


@kernel("void(f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,:,::1])")
def _add_moments(points, memberships, counts, sums, products):  # type: ignore[no-untyped-def]
    """Add up the members of each component, their coordinates, and products of two of these."""
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
