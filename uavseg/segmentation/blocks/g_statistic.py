"""G, the log-likelihood ratio of two histograms (Sokal and Rohlf, Biometry), and its expectation.

With J(a, b) = (a + b) ln (a + b) - a ln a - b ln b, G of histograms f_s and f_m with totals N_s and N_m is
2 [J(N_s, N_m) - sum of J(f_s, f_m) over the symbols]: equation 1 of the paper, reordered. A symbol that only
one of the two histograms has adds nothing.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined
from uavseg.arrays import Floats
from uavseg.units import BLOCK

MIN_G_PER_PIXEL = 1e-9  # a G that is smaller, per pixel of the pair, is rounding error and counts as 0

_MAX_TABLE = 1 << 16  # largest n of a lookup table: above it, computing n ln n is no slower
_EXACT = 64  # pixels of a symbol up to which the expectation is computed for every number
_GRID_RATIO = 1.05  # between the numbers of pixels above, for which it is computed


def g_statistic(first: NDArray[np.integer], second: NDArray[np.integer]) -> float:
    """Compute G of two histograms, arrays of counts: 0 where they have the same proportions.

    Examples
    --------
    >>> g_statistic(np.array([2, 1]), np.array([4, 2]))
    0.0
    >>> round(g_statistic(np.array([1, 0]), np.array([0, 1])), 4)
    2.7726
    """
    totals = np.array([first.sum()]), np.array([second.sum()])
    shared = (first > 0) & (second > 0)
    g = 2 * float(_j(*totals)[0] - _j(first[shared], second[shared]).sum())
    return g if g >= MIN_G_PER_PIXEL * int(totals[0][0] + totals[1][0]) else 0.0


def _j(first: NDArray[np.integer], second: NDArray[np.integer]) -> Floats:
    return n_ln_n(first + second) - n_ln_n(first) - n_ln_n(second)


def expected_g(largest: int, share: float) -> Floats:
    """Compute what a symbol adds to the expected G under the null hypothesis, by its number of pixels.

    If both histograms come from one source, each pixel of a symbol belongs to the window with probability
    `share`, independently of all others. So the expectation of G is a sum over symbols; it is close to 1 for
    each frequent symbol and smaller for the rarest. It is subtracted as a bias correction: otherwise a window
    of many rare symbols would seem less similar to its texture than to one of few symbols.

    `largest` is the largest number of pixels, in both histograms together, and `share` the window's share of
    them. The result, (largest + 1,) float64, is 2 (n H - E[n ln n - f ln f - (n - f) ln (n - f)]) with f
    binomial of n and `share`, and H the entropy of `share`. Above 64, it is computed at steps of 5 % and
    interpolated.

    Examples
    --------
    >>> expected_g(1000, 0.2).round(3)[[0, 1, 2, 10, 1000]]
    array([0.   , 1.001, 1.114, 1.144, 1.001])
    """
    ln_factorial: Floats = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, largest + 1)))])
    powers = np.arange(np.log(max(largest / _EXACT, 1)) / np.log(_GRID_RATIO) + 1)
    steps = np.rint(_EXACT * _GRID_RATIO**powers)
    grid = np.unique(np.minimum(np.concatenate([np.arange(_EXACT), steps]), largest)).astype(np.int64)
    values = [_expected_g_of_symbol(n, share, ln_factorial) for n in grid.tolist()]
    return np.interp(np.arange(largest + 1), grid, values)


def _expected_g_of_symbol(n: int, share: float, ln_factorial: Floats) -> float:
    middle, width = n * share, 12 * np.sqrt(n * share * (1 - share)) + 30
    f = np.arange(max(int(middle - width), 0), min(int(middle + width), n) + 1)
    ln_binomial = ln_factorial[n] - ln_factorial[f] - ln_factorial[n - f]
    probability = np.exp(ln_binomial + f * np.log(share) + (n - f) * np.log1p(-share))
    entropy = -share * np.log(share) - (1 - share) * np.log1p(-share)
    joint = n_ln_n(np.array([n])) - n_ln_n(f) - n_ln_n(n - f)
    return float(2 * (n * entropy - (probability * joint).sum()))


def n_ln_n(n: NDArray[np.integer]) -> Floats:
    """Compute n ln n of counts; 0 where n is 0."""
    return np.asarray(n.astype(np.float64) * np.log(np.maximum(n, 1)))


def n_ln_n_table(largest: int) -> Floats:
    """Tabulate n ln n for n from 0 to `largest`, or to 65536 if that is less; see `n_ln_n_of`."""
    return n_ln_n(np.arange(min(largest, _MAX_TABLE) + 1))


N_LN_N = n_ln_n_table(BLOCK * BLOCK)  # for the counts of a block


@inlined
def n_ln_n_of(table, n):  # type: ignore[no-untyped-def]
    """Look up n ln n in a table; compute it above the end of the table."""
    return table[n] if n < table.shape[0] else n * np.log(np.float64(n))


@inlined
def g_of_region(histograms, totals, region, counts, present, n_present, table):  # type: ignore[no-untyped-def]
    """Compute G of a region's histogram and `counts`, with symbols in the first `n_present` of `present`."""
    total = np.int64(0)
    shared = 0.0
    for k in range(n_present):
        a = counts[present[k]]
        b = np.int64(histograms[region, present[k]])
        total += a
        if b:
            shared += n_ln_n_of(table, a + b) - n_ln_n_of(table, a) - n_ln_n_of(table, b)
    whole = (
        n_ln_n_of(table, total + totals[region]) - n_ln_n_of(table, total) - n_ln_n_of(table, totals[region])
    )
    g = 2.0 * (whole - shared)
    return g if g >= MIN_G_PER_PIXEL * (total + totals[region]) else 0.0
