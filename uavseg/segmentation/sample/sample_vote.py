"""What a sample says of mixtures: which components are of its kind.

These are the components that are far more frequent in the sample than in the raster. Mixtures of several
sizes vote, each by the share of the sample that it calls its kind.

Each mixture is tried once more with a component that begins at the sample, for a kind that has none of its
own. In a picture a kind is seldom one Gaussian, and only the part of it that the sample shows would be found;
so only those count that leave half as much undecided, which is where the kind is a cloud of its own.

Learning from a sample and unlabelled points: Elkan and Noto, Knowledge Discovery and Data Mining 2008,
213-220.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavseg.segmentation.sample.mixture import RARE, Mixture, Points, begun_at, fit_mixtures

_IN_SAMPLE = 0.1  # share of the sample with which a component is compared at all
_WRONG = 0.1  # share of the sample that may be of another kind
_ELSEWHERE = 0.1  # weight of the raster where a sample of other kinds lacks what the raster has
_VOTE = 20.0  # how much a mixture loses by the share of the sample that it does not find
_CLEARER = 0.5  # share of what is undecided otherwise, that a mixture with such a component leaves at most


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
    found: Points = own / (own + np.maximum(other, _ELSEWHERE * mixture.shares) + RARE)
    return found


def _purities(mixture: Mixture, memberships: Points) -> Points:
    """Share of each component that is of the kind of a sample with these memberships.

    By Bayes' rule it is in proportion to how much more frequent the component is in the sample than in the
    raster. The component where that is most is taken to be of the kind as a whole.
    """
    in_sample = memberships.mean(1)
    ratio = in_sample / np.maximum(mixture.shares, RARE)
    largest = ratio[in_sample > _IN_SAMPLE].max()
    found: Points = np.minimum(ratio / largest, 1)
    return found


def _weighted(weights: Points, rows: Points) -> Points:
    return sum((weight * row for weight, row in zip(weights, rows, strict=True)), np.zeros(rows.shape[1]))
