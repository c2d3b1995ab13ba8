"""Log-odds to probability, and on to grey: the same on every machine, and many at a time."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.occupancy.mapping.pending import free_once

Singles = NDArray[np.float32]


def probabilities_of(log_odds: Singles) -> tuple[Singles, NDArray[np.uint16]]:
    """1 / (1 + exp(-log-odds)), and its grey floor(65535 p + 0.5).

    Parameters
    ----------
    log_odds : float32 array
        In -6..6.

    Returns
    -------
    probabilities : float32 array
    grey : uint16 array

    Examples
    --------
    >>> p, grey = probabilities_of(np.array([-6, 0, 6], np.float32))
    >>> p.round(4).tolist(), grey.tolist()
    ([0.0024999999441206455, 0.5, 0.9975000023841858], [162, 32768, 65373])
    """
    probabilities, grey = np.empty(log_odds.shape, np.float32), np.empty(log_odds.shape, np.uint16)
    _probabilities(log_odds.reshape(-1), probabilities.reshape(-1), grey.reshape(-1))
    return probabilities, grey


@cache
def usual() -> tuple[Singles, Singles, NDArray[np.uint16]]:
    """Log-odds of cells that were called free never, once, twice or more often, and what follows."""
    odds = np.zeros(4, np.float32)
    for k in range(3):
        odds[k + 1 :] = free_once(odds[k])
    return odds, *probabilities_of(odds)


@inlined
def probability(odds):  # type: ignore[no-untyped-def]
    """1 / (1 + exp(-odds)) for odds in -6..6, the same on every machine.

    exp(-odds / 16) is a Taylor polynomial whose next term is below 1e-16, then squared four times: no call,
    so that a loop of it is vectorised.
    """
    x = odds * -0.0625
    e = 1.0 + x / 13.0
    for k in (12.0, 11.0, 10.0, 9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0):
        e = 1.0 + e * x * (1.0 / k)
    e *= e
    e *= e
    e *= e
    e *= e
    return np.float32(1.0 / (1.0 + e))


@inlined
def grey_of(p):  # type: ignore[no-untyped-def]
    """Grey of a probability, as of `raster.grey`."""
    return np.uint16(np.int32(65535.0 * np.float64(p) + 0.5))


@kernel("void(f4[::1], f4[::1], u2[::1])")
def _probabilities(log_odds, probabilities, grey):  # type: ignore[no-untyped-def]
    for i in range(log_odds.size):
        p = probability(np.float64(log_odds[i]))
        probabilities[i] = p
        grey[i] = grey_of(p)
