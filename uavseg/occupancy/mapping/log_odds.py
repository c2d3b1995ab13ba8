"""Log-odds to probability (logistic function) and to 16-bit grey, vectorised and equal on every machine."""

from functools import cache
from math import log

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.units import GREY_MAX

Float32s = NDArray[np.float32]

P_MIN = 0.1
FREE_LOG_ODDS = log(P_MIN / (1 - P_MIN))
MAX_LOG_ODDS = 6.0


def probabilities_and_grey(log_odds: Float32s) -> tuple[Float32s, NDArray[np.uint16]]:
    """Compute p = 1 / (1 + exp(-log-odds)) for log-odds in -6..6, and its grey floor(65535 p + 0.5).

    Examples
    --------
    >>> p, grey = probabilities_and_grey(np.array([-6, 0, 6], np.float32))
    >>> p.round(4).tolist(), grey.tolist()
    ([0.0024999999441206455, 0.5, 0.9975000023841858], [162, 32768, 65373])
    """
    probabilities, grey = np.empty(log_odds.shape, np.float32), np.empty(log_odds.shape, np.uint16)
    _convert(log_odds.reshape(-1), probabilities.reshape(-1), grey.reshape(-1))
    return probabilities, grey


@cache
def free_only_values() -> tuple[Float32s, Float32s, NDArray[np.uint16]]:
    """Compute log-odds, probability and grey, (4,) each, of cells with 0 to 3 free observations only."""
    odds = np.zeros(4, np.float32)
    for k in range(3):
        odds[k + 1 :] = add_one_free(odds[k])
    return odds, *probabilities_and_grey(odds)


@inlined
def add_one_free(odds):  # type: ignore[no-untyped-def]
    """Return the log-odds of a cell after one more free observation."""
    return np.float32(max(np.float64(odds) + FREE_LOG_ODDS, -MAX_LOG_ODDS))


@inlined
def logistic(odds):  # type: ignore[no-untyped-def]
    """Compute 1 / (1 + exp(-odds)) for odds in -6..6, the same on every machine.

    exp(-odds / 16) is a Taylor polynomial whose next term is below 1e-16, then squared four times. There is
    no call, so the compiler vectorises a loop of it.
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
def grey_of_probability(p):  # type: ignore[no-untyped-def]
    """Convert a probability to 16-bit grey, as in `raster.intensity.grey`."""
    return np.uint16(np.int32(np.float64(GREY_MAX) * np.float64(p) + 0.5))


@kernel("void(f4[::1], f4[::1], u2[::1])")
def _convert(log_odds, probabilities, grey):  # type: ignore[no-untyped-def]
    for i in range(log_odds.size):
        p = logistic(np.float64(log_odds[i]))
        probabilities[i] = p
        grey[i] = grey_of_probability(p)
