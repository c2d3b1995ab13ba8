"""Classes of a histogram: Otsu's thresholds, any number of them, found exactly."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

SMOOTHING = 1 / 32  # deviation of the Gaussian, as a share of what is not empty
VALLEY = 1 / 3  # of the lower of two humps


@dataclass(frozen=True, slots=True)
class Classes:
    """A histogram cut into classes of adjacent bins.

    Parameters
    ----------
    ends : tuple of int
        The last bin of each class but the last that holds anything.
    starts : tuple of int
        The first bin of each class but the first that holds anything; all bins between the end of a class
        and the start of the next are empty, so a cut lies equally well anywhere between them.
    explained : float
        Share of the variance that is between the classes, 0 to 1.
    """

    ends: tuple[int, ...]
    starts: tuple[int, ...]
    explained: float

    @property
    def count(self) -> int:
        """Number of classes."""
        return len(self.ends) + 1


def multi_otsu(counts: ArrayLike, most: int) -> list[Classes]:
    """The best cuts of a histogram into 1, 2, ..., `most` classes.

    Best is what leaves the least variance within classes (Otsu, IEEE Trans. SMC 9 (1979) 62-66; Liao, Chen
    and Chung, J. Inf. Sci. Eng. 17 (2001) 713-727). What is gained by a class depends on where it begins and
    ends alone, so dynamic programming over the bins finds the best of all cuts (Fisher, JASA 53 (1958)
    789-798). Bins are equally wide, and empty ones change nothing.

    Parameters
    ----------
    counts : (n,) array of numbers that are not negative
    most : int
        At least 1.

    Returns
    -------
    found : list of Classes
        Element k has k + 1 classes; fewer than `most` where fewer bins hold anything, none where none does.
        Of equally good cuts, the one with the lower last cut.

    Examples
    --------
    >>> multi_otsu([5, 1, 0, 0, 1, 5], 2)[1].ends, multi_otsu([5, 1, 0, 0, 1, 5], 2)[1].starts
    ((1,), (4,))
    """
    every = np.asarray(counts, np.float64)
    bins = np.flatnonzero(every)
    if not bins.size:
        return []
    values, weights = (bins - bins[0]).astype(np.float64), every[bins]
    gains = _gains(values, weights)
    total = weights.sum()
    mean = (weights * values).sum() / total
    variance = (weights * (values - mean) ** 2).sum()
    found = []
    for inner, gain in _best(gains, min(most, bins.size)):
        ends, starts = tuple(bins[[k - 1 for k in inner]].tolist()), tuple(bins[list(inner)].tolist())
        found.append(Classes(ends, starts, min(float(gain / variance), 1.0) if variance > 0 else 1.0))
    return found


def select_classes(counts: ArrayLike, found: Sequence[Classes]) -> Classes:
    """As many classes as a histogram has by itself: the most of which all are parted, else two.

    Parameters
    ----------
    counts : (n,) array of numbers that are not negative
    found : sequence of Classes
        What `multi_otsu` gives for it; one at least.
    """
    own = [classes for classes in found[1:] if are_separated(counts, classes)]
    return own[-1] if own else found[min(1, len(found) - 1)]


def are_separated(counts: ArrayLike, classes: Classes) -> bool:
    """Whether a valley lies between every two neighbouring classes.

    The histogram is smoothed by a Gaussian with a deviation of a 32nd of its reach. Between the highest bins
    of two classes it has to sink below a third of the lower of them.

    Parameters
    ----------
    counts : (n,) array of numbers that are not negative
    classes : Classes
        Of that histogram.
    """
    every = np.asarray(counts, np.float64)
    first, last = np.flatnonzero(every)[[0, -1]]
    smooth = _smoothed(every[first : last + 1], (last - first + 1) * SMOOTHING)
    begins = [0, *(start - first for start in classes.starts)]
    ends = [*(end - first for end in classes.ends), last - first]
    tops = [begin + int(smooth[begin : end + 1].argmax()) for begin, end in zip(begins, ends, strict=True)]
    return all(
        smooth[one : other + 1].min() < VALLEY * min(smooth[one], smooth[other])
        for one, other in pairwise(tops)
    )


def _smoothed(counts: Floats, sigma: float) -> Floats:
    reach = math.ceil(4 * sigma)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    smooth: Floats = np.convolve(counts, weights / weights.sum())[reach:-reach]
    return smooth


def _gains(values: Floats, weights: Floats) -> Floats:
    """What a class of bins i..j - 1 explains of the variance (times the total), at [i, j]."""
    mean = (weights * values).sum() / weights.sum()
    below = np.concatenate([[0.0], np.cumsum(weights)])
    sums = np.concatenate([[0.0], np.cumsum(weights * (values - mean))])
    number = below[None, :] - below[:, None]
    gains = np.full(number.shape, -np.inf)
    is_class = np.triu(np.ones(number.shape, bool), 1)
    total = sums[None, :] - sums[:, None]
    gains[is_class] = total[is_class] ** 2 / number[is_class]
    return gains


def _best(gains: Floats, most: int) -> list[tuple[tuple[int, ...], float]]:
    """For 1..most classes: where each but the first begins, and what all of them explain."""
    best, begins = gains[0], []
    found: list[tuple[tuple[int, ...], float]] = [((), float(best[-1]))]
    for _ in range(1, most):
        with_one_more = best[:, None] + gains
        begins.append(with_one_more.argmax(axis=0))
        best = with_one_more.max(axis=0)
        found.append((_traced(begins), float(best[-1])))
    return found


def _traced(begins: Sequence[NDArray[np.intp]]) -> tuple[int, ...]:
    """The way back from the end: where each class but the first begins."""
    end, inner = len(begins[0]) - 1, []
    for begin in reversed(begins):
        end = int(begin[end])
        inner.append(end)
    return tuple(reversed(inner))
