"""Whether scores of cells are clearly of two kinds: those of a sample, and others with a gap between them."""

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.sample.g_scores import MAX_SCORE, SCORE_UNITS

_FEW = 32  # cells
_SEPARABLE = 0.8  # least share of the variance that lies between the two kinds
_GAP = SCORE_UNITS // 4  # width of the gap above the limit
_LEAST = 0.1  # share of cells beyond the gap
_BETWEEN = 0.4  # cells within the gap, as a share of those beyond it
_OUTLIERS = 0.99  # quantile to which larger scores are reduced
_OTSU_BINS = 256
_PART = 1 << 20  # scores that are counted at a time


def separability(scores: NDArray[np.uint16]) -> float:
    """Share of the variance of scores that lies between the two kinds which it parts best: Otsu's eta [1]_.

    Parameters
    ----------
    scores : (n,) uint16 array
        See `g_scores.best_scores`; MAX_SCORE and more are left out.

    Returns
    -------
    eta : float
        From 0 to 1; 0.64 for one normal distribution, 0.75 for a uniform one. 0 for fewer than 32 scores, or
        where all are equal.

    References
    ----------
    .. [1] N. Otsu, "A threshold selection method from gray-level histograms", IEEE Transactions on Systems,
       Man, and Cybernetics 9 (1979) 62-66, equation 12.
    """
    from skimage.filters import threshold_otsu

    counts = _histogram(scores)[:MAX_SCORE]
    values = np.flatnonzero(counts).astype(np.float64)
    counts = counts[counts > 0]
    total = int(counts.sum())
    if total < _FEW:
        return 0.0
    values = np.minimum(values, _quantile(values, counts, _OUTLIERS))
    if values[0] == values[-1]:
        return 0.0
    bins, edges = np.histogram(values, _OTSU_BINS, weights=counts)
    low = values <= threshold_otsu(hist=(bins, (edges[1:] + edges[:-1]) / 2))
    share = float(counts[low].sum() / total)
    if not 0 < share < 1:
        return 0.0
    means = [float(values[side] @ counts[side] / counts[side].sum()) for side in (low, ~low)]
    mean = float(values @ counts / total)
    variance = float((values - mean) ** 2 @ counts / total)
    return share * (1 - share) * (means[0] - means[1]) ** 2 / variance


def are_two_kinds(scores: NDArray[np.uint16], limit: int) -> bool:
    """Whether scores part into some that are like the sample and others that are clearly not.

    They are when two kinds explain most of their variance, a tenth at least lies well beyond the limit, and
    few lie just beyond it.

    Parameters
    ----------
    scores : (n,) uint16 array
        See `g_scores.best_scores`; MAX_SCORE and more are left out.
    limit : int
        The largest score of a cell that is like the sample.
    """
    known = scores[scores < MAX_SCORE]
    beyond = int((known > limit + _GAP).sum())
    between = int((known > limit).sum()) - beyond
    has_gap = beyond >= _LEAST * len(known) and between <= _BETWEEN * beyond
    return has_gap and separability(scores) >= _SEPARABLE


def _histogram(scores: NDArray[np.uint16]) -> NDArray[np.int64]:
    counts = np.zeros(1 << 16, np.int64)
    for begin in range(0, len(scores), _PART):
        counts += np.bincount(scores[begin : begin + _PART], minlength=len(counts))
    return counts


def _quantile(values: NDArray[np.float64], counts: NDArray[np.int64], share: float) -> float:
    """Quantile of sorted values that occur so many times, between two of them as `numpy.quantile` has it."""
    until = np.cumsum(counts)
    place = share * (int(until[-1]) - 1)
    low, high = (values[np.searchsorted(until, np.floor(place) + k, "right")] for k in (0, 1))
    return float(low + (high - low) * (place - np.floor(place)))
