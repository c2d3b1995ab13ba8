"""Optimal threshold interval: the one that separates a sample's class best from the rest of a raster."""

import math

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass

Floats = NDArray[np.float64]

_BINS = 256
_TAILS = (0.001, 0.999)  # quantiles between which bins lie; values outside belong to the outer ones
_WRONG = 0.1  # share of the sample that may be of another class
_OPEN = 0.005  # agreement that an end may cost to be open


@dataclass(frozen=True, slots=True)
class Interval:
    """Interval, open where an end is infinite, with its expected fit.

    `agreement` is the expected number of pixels that are of the class and in the interval, as a share of
    those that are either; `share` that of the raster's pixels in it; `step` the one between values that were
    compared as ends.
    """

    low: float
    high: float
    agreement: float
    share: float
    step: float


def best_interval(values: Floats, similarity: Floats, sample: Floats) -> Interval | None:
    """Choose the interval with the largest expected intersection over union with a sample's class.

    It is open at an end where that costs almost no agreement; None where all values are one, or none is
    finite. `values`, (n,), are of pixels all over the raster, `similarity`, (n,), the probability that each
    is of the class. An interval that lacks more than a tenth of the values of the `sample`, (m,), counts for
    less.
    """
    finite = np.isfinite(values)
    values, similarity, sample = values[finite], similarity[finite], sample[np.isfinite(sample)]
    if len(values) == 0 or len(sample) == 0:
        return None
    low, high = np.quantile(np.concatenate([values, sample]), _TAILS)
    if not low < high:
        return None
    edges = np.linspace(low, high, _BINS + 1)
    places = np.searchsorted(edges[1:-1], values, side="right")
    of_sample = np.bincount(np.searchsorted(edges[1:-1], sample, side="right"), minlength=_BINS) / len(sample)
    expected = _between(np.bincount(places, similarity, _BINS).astype(np.float64))
    pixels = _between(np.bincount(places, minlength=_BINS).astype(np.float64))
    in_sample = np.minimum(_between(of_sample) / (1 - _WRONG), 1)
    agreement = np.triu(expected / np.maximum(expected[0, -1] + pixels - expected, 1e-9), 1) * in_sample
    agreement[0, -1] = 0  # not the interval of all values
    first, last = (int(place) for place in np.unravel_index(agreement.argmax(), agreement.shape))
    best = float(agreement[first, last])
    if agreement[0, last] >= best - _OPEN:
        first = 0
    if agreement[first, -1] >= best - _OPEN:
        last = _BINS
    return Interval(
        -math.inf if first == 0 else float(edges[first]),
        math.inf if last == _BINS else float(edges[last]),
        float(agreement[first, last]),
        float(pixels[first, last] / len(values)),
        float(edges[1] - edges[0]),
    )


def _between(counts: Floats) -> Floats:
    """Sum counts from each edge of bins to each other one."""
    sums = np.concatenate([[0.0], np.cumsum(counts)])
    between: Floats = sums[None, :] - sums[:, None]
    return between


def linear_weights(colors: Floats, similarity: Floats, digits: int = 2) -> Floats:
    """Return the weights of bands whose sum separates a class best: Fisher's linear discriminant.

    R. A. Fisher, Annals of Eugenics 7 (1936) 179-188, with probabilities in place of two classes.

    `similarity` is the probability that each of the (n, bands) colours is of the class. The weights are
    rounded to `digits` decimals; their absolute values have a sum of about 1.
    """
    of_kind, of_rest = (share / max(float(share.sum()), 1e-9) for share in (similarity, 1 - similarity))
    middle, other = ((share[:, None] * colors).sum(0) for share in (of_kind, of_rest))
    scale = np.maximum(colors.std(0), 1e-12)
    scatter = _scatter((colors - middle) / scale, of_kind) + _scatter((colors - other) / scale, of_rest)
    weights = np.linalg.solve(scatter + 0.01 * np.eye(len(scale)), (middle - other) / scale) / scale
    rounded: Floats = np.round(weights / max(float(abs(weights).sum()), 1e-12), digits)
    return rounded


def _scatter(away: Floats, shares: Floats) -> Floats:
    bands = range(away.shape[1])
    return np.array([[(shares * away[:, a] * away[:, b]).sum() for b in bands] for a in bands])
