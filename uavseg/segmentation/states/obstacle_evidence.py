"""Significance of thin obstacles in an occupancy map: likelihood ratios, and an extent threshold.

With prior 0.5, v / (1 - v) of a cell is the likelihood ratio of its measurements, occupied against free.
Where a cell is free, the ratio exceeds c with probability 1 / c at most (Markov's inequality; A. Wald,
Sequential tests of statistical hypotheses, Ann. Math. Stat. 16 (1945) 117-186), and so does the product over
several independent cells. With c = N / alpha, at most alpha of N cells or structures exceed it by chance
(Bonferroni).

Noise that is added to v is not part of that model. With standard deviation sigma it lifts three given cells
above the limit of occupied by z sigma with probability Q(z)^3, where Q is the upper tail of the normal
distribution. There are 20 shapes of three 8-connected cells, so with 20 N Q(z)^3 = alpha at most alpha such
triples are expected in a map of N cells (union bound): z is a threshold for structures of three cells. It
never exceeds 0.65, above which a robot takes a cell for occupied.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.params.segment import StateLimits
from uavseg.units import GREY_LEVELS, GREY_MAX

MIN_CELLS = 3  # of an obstacle that is not attached to an occupied one, in a map of probabilities
STRONG = 128  # bit of a cell with strong evidence
PARTS = 8  # evidence is counted in eighths of a nat

_ALPHA = 0.05  # expected number of false structures in a map
_TRIPLES = 20  # fixed shapes of three 8-connected cells
STRONG_ABOVE = 0.65  # v: the occupied_thresh of ROS maps as Nav2 writes them
_CERTAIN = 126  # code of v = 1, whose likelihood ratio is infinite


@dataclass(frozen=True, slots=True)
class EvidenceRule:
    """Which structures of cells that are occupied by their own value are obstacles.

    Parameters
    ----------
    codes : (65536,) uint8 array
        Evidence of each grey: 0 where noise explains it; else 1 + ln(v / (1 - v)) in eighths, rounded down,
        126 and more for v = 1, plus 128 where v is above 0.65 too.
    min_cells : int
        An 8-connected structure of so many cells, without an occupied cell beside it, is an obstacle.
    min_evidence : int
        So is a structure of strong cells with this sum of evidence, in eighths of a nat.
    """

    codes: NDArray[np.uint8]
    min_cells: int
    min_evidence: int


def evidence_rule(limits: StateLimits, cells: int, noise: float, trinary: bool) -> EvidenceRule:
    """The rule for a map.

    Parameters
    ----------
    limits : StateLimits
    cells : int
        Number of valid cells.
    noise : float
        Standard deviation of the noise of v.
    trinary : bool
        Whether a value is a decision: then each cell that is occupied by its own value is an obstacle.

    Examples
    --------
    >>> rule = evidence_rule(StateLimits(), 100_000, 0.0, trinary=False)
    >>> rule.codes[[0, 32800, 39321, 65535]], rule.min_cells, rule.min_evidence
    (array([  0,   0,   4, 255], dtype=uint8), 3, 117)
    """
    strong = max(STRONG_ABOVE, limits.occupied_above)
    weakest = min(limits.occupied_above + noise_deviations(cells) * noise, strong)
    v = np.arange(GREY_LEVELS) / GREY_MAX
    odds = np.divide(v, 1 - v, out=np.full(GREY_LEVELS, np.inf), where=v < 1)
    nats = np.log(np.maximum(odds, 1.0))
    codes = 1 + np.minimum(np.floor(PARTS * np.minimum(nats, GREY_MAX)), _CERTAIN).astype(np.uint8)
    codes[v > strong] |= np.uint8(STRONG)
    codes[v <= weakest] = 0
    return EvidenceRule(codes, 1 if trinary else MIN_CELLS, math.ceil(PARTS * math.log(cells / _ALPHA)))


def noise_deviations(cells: int) -> float:
    """z: how many standard deviations of the noise three cells of a structure exceed the limit by.

    Examples
    --------
    >>> round(noise_deviations(1_000_000), 2)
    3.0
    """
    return -NormalDist().inv_cdf((_ALPHA / (_TRIPLES * max(cells, 1))) ** (1 / 3))
