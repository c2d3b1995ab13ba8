"""Log-odds: to probability (logistic function) and 16-bit grey, equal on every machine; contradictions."""

from functools import cache
from math import log

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Float32s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.raster.grid.tiling import Window
from uavseg.units import GREY_MAX

P_MIN = 0.1
FREE_LOG_ODDS = log(P_MIN / (1 - P_MIN))
MAX_LOG_ODDS = 6.0
MARGIN = 8  # cells that are looked at outside of those that a scan observes
_EDGE = 2  # cells: thickness of the edge of what stands
_MAX_SCANS = 1_000_000
_SQUARE = np.ones((3, 3), bool)


def probabilities_and_grey(log_odds: Float32s) -> tuple[Float32s, Uint16s]:
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
def free_only_values() -> tuple[Float32s, Float32s, Uint16s]:
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
    """Compute 1 / (1 + exp(-odds)) for odds in -6..6, the same on every machine."""
    # exp(-odds / 16) is a Taylor polynomial whose next term is below 1e-16, then squared four times. There is
    # no call, so the compiler vectorises a loop of it.
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


@dataclass(frozen=True, slots=True)
class Fading:
    """How evidence of a grid fades, see `OccupancyGrid`; ParameterError if a number is not possible."""

    clamp: float = MAX_LOG_ODDS
    half_life: float | None = None
    forget_after: float | None = None

    def __post_init__(self) -> None:
        scans = (1, _MAX_SCANS)
        limits = {"clamp": (1e-3, MAX_LOG_ODDS), "half_life": scans, "forget_after": scans}
        for name, (low, high) in limits.items():
            if (number := getattr(self, name)) is not None and not low <= number <= high:
                raise ParameterError(f"{name} is {low:g} to {high:g}, not {number:g}")


class Contradictions:
    """Scans in a row that contradicted each cell of a map of a shape, and their log-odds.

    A scan contradicts an occupied cell if beams cross it and none returns within 3 sigma of it. Its free
    evidence is held back; after so many contradicting scans in a row, that of all of them takes the place of
    the cell's. A return at the cell confirms it. Beams that graze a wall cross its edge and return behind: so
    contradicted cells are forgotten only in groups that reach beyond the edge of what stands or is unknown.
    """

    def __init__(self, shape: tuple[int, int], forget_after: float) -> None:
        self._forget_after = forget_after
        self._counts, self._held = np.zeros(shape, np.uint32), np.zeros(shape, np.float32)

    def revised(self, at: Window, before: Float32s, odds: Float32s, after: Float32s, beside: int) -> Float32s:
        """Return log-odds of a window, from those before a scan, of it alone, and after."""
        from scipy import ndimage

        counts, held = self._counts[at.slices], self._held[at.slices]
        occupied, is_hit = before > 0, odds > 0
        through = occupied & (odds < 0) & ~ndimage.binary_dilation(is_hit, _SQUARE, beside)
        counts[through] += 1
        held[through] += odds[through]
        counts[is_hit | ~occupied], held[is_hit | ~occupied] = 0, 0
        due = counts >= self._forget_after
        stands = ndimage.binary_dilation((occupied & ~due) | (after == 0), _SQUARE, _EDGE)
        groups, number = ndimage.label(due, _SQUARE)
        beyond = np.bincount(groups[due & through & ~stands], minlength=number + 1) > 0
        gone = due & (odds < 0) & beyond[groups]
        revised = np.where(occupied & (odds < 0), before, after)
        revised[gone] = np.maximum(held[gone], -MAX_LOG_ODDS)
        counts[gone], held[gone] = 0, 0
        return revised
