"""What chance makes of G between two histograms that come from one source."""

import numpy as np
from numpy.typing import NDArray

from uavseg.units import BLOCK

_DENSE = 64  # pixels of a symbol up to which chance is computed for every number, and then for each 5 % more


def chance(most: int, share: float) -> NDArray[np.float64]:
    """What chance makes of G: the part of a symbol, by how many pixels of it both histograms have together.

    If both come from one source, each pixel of a symbol is the window's with a probability of `share`, apart
    from all others. So the expectation of G is a sum over symbols, close to 1 for each that is frequent and
    less for the rarest. Without it, a window of many rare symbols would seem less like its own kind than like
    another one of few symbols.

    Parameters
    ----------
    most : int
        The largest number of pixels.
    share : float
        Of the window in the pixels of both.

    Returns
    -------
    parts : (most + 1,) float64 array
        2 (n H - E[n ln n - f ln f - (n - f) ln (n - f)]) with f binomial of n and `share`, and H the entropy
        of `share`. Numbers above 64 are computed for each 5 % more, and interpolated.

    Examples
    --------
    >>> chance(1000, 0.2).round(3)[[0, 1, 2, 10, 1000]]
    array([0.   , 1.001, 1.114, 1.144, 1.001])
    """
    ln_factorial: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, most + 1)))])
    steps = np.rint(_DENSE * 1.05 ** np.arange(np.log(max(most / _DENSE, 1)) / np.log(1.05) + 1))
    grid = np.unique(np.minimum(np.concatenate([np.arange(_DENSE), steps]), most)).astype(np.int64)
    return np.interp(np.arange(most + 1), grid, [_part(n, share, ln_factorial) for n in grid.tolist()])


def _part(n: int, share: float, ln_factorial: NDArray[np.float64]) -> float:
    """What chance makes of G in a symbol of n pixels."""
    middle, width = n * share, 12 * np.sqrt(n * share * (1 - share)) + 30
    f = np.arange(max(int(middle - width), 0), min(int(middle + width), n) + 1)
    ways = ln_factorial[n] - ln_factorial[f] - ln_factorial[n - f]
    likely = np.exp(ways + f * np.log(share) + (n - f) * np.log1p(-share))
    entropy = -share * np.log(share) - (1 - share) * np.log1p(-share)
    both = x_ln_x(np.array([n])) - x_ln_x(f) - x_ln_x(n - f)
    return float(2 * (n * entropy - (likely * both).sum()))


def x_ln_x(x: NDArray[np.int64]) -> NDArray[np.float64]:
    """x ln x; 0 of 0."""
    product: NDArray[np.float64] = x.astype(np.float64) * np.log(np.maximum(x, 1))
    return product


SMALLEST_G = 1e-9  # per pixel of the pair; below it a G is what rounding left of 0


_N_LN_N = np.concatenate([[0.0], np.arange(1, BLOCK * BLOCK + 1) * np.log(np.arange(1, BLOCK * BLOCK + 1))])


def likelihood_ratio(first: NDArray[np.integer], second: NDArray[np.integer]) -> float:
    """G between two histograms: 0 where they have the same proportions.

    Parameters
    ----------
    first, second : (n,) integer arrays
        Counts, of at most 4096 in all.

    Examples
    --------
    >>> likelihood_ratio(np.array([2, 1]), np.array([4, 2]))
    0.0
    >>> round(likelihood_ratio(np.array([1, 0]), np.array([0, 1])), 4)
    2.7726
    """
    total = int(first.sum() + second.sum())
    shared = (first > 0) & (second > 0)
    both = _joined(first[shared], second[shared]).sum()
    g = 2 * float(_joined(np.array([first.sum()]), np.array([second.sum()]))[0] - both)
    return g if g >= SMALLEST_G * total else 0.0


def _joined(first: NDArray[np.integer], second: NDArray[np.integer]) -> NDArray[np.float64]:
    joined: NDArray[np.float64] = _N_LN_N[first + second] - _N_LN_N[first] - _N_LN_N[second]
    return joined
