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

    known = scores[scores < MAX_SCORE].astype(np.float64)
    if len(known) < _FEW:
        return 0.0
    known = np.minimum(known, np.quantile(known, _OUTLIERS))
    if known.min() == known.max():
        return 0.0
    low = known <= threshold_otsu(known)
    share = float(low.mean())
    if not 0 < share < 1:
        return 0.0
    return float(share * (1 - share) * (known[low].mean() - known[~low].mean()) ** 2 / known.var())


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
