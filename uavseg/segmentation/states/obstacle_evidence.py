"""Significance of thin obstacles in an occupancy map: noise level, likelihood ratios, extent threshold.

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

Sigma is estimated after J. Immerkaer, Fast noise variance estimation, Comput. Vis. Image Underst. 64 (1996)
300-302: the response to the second difference along rows of the second difference along columns has the
standard deviation 6 sigma. Its median absolute value, 0.6745 times that, is robust: structure in less than
half of the map changes little, and a map that is flat in more than half of its area has no noise. Only
responses within blocks of 64 x 64 pixels are used, so statistics of tiles merge by adding.
"""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.arrays import Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.segmentation.params.segment import StateLimits
from uavseg.units import BLOCK, GREY_LEVELS, GREY_MAX

MIN_CELLS = 3  # of an obstacle that is not attached to an occupied one, in a map of probabilities
STRONG = 128  # bit of a cell with strong evidence
PARTS = 8  # evidence is counted in eighths of a nat

_ALPHA = 0.05  # expected number of false structures in a map
_TRIPLES = 20  # fixed shapes of three 8-connected cells
STRONG_ABOVE = 0.65  # v: the occupied_thresh of ROS maps as Nav2 writes them
_CERTAIN = 126  # code of v = 1, whose likelihood ratio is infinite
_ROW_STEP = 8  # one row of responses in so many
_BIN_WIDTH = 64  # of |response|, in grey
_BINS = 8192  # 8 GREY_MAX, the largest |response|, divided by the width
_STATES = 4
_NO_LEVEL, _SEVERAL_LEVELS = -1, -2
_MEDIAN_OF_NORMAL = 0.6744897501960817  # of |z|


@dataclass(frozen=True, slots=True)
class EvidenceRule:
    """Thresholds of evidence above which structures of cells with occupied values are obstacles.

    The evidence of a grey is 0 where noise explains it; else 1 + ln(v / (1 - v)) in eighths, rounded down,
    126 and more for v = 1, plus 128 where v is above 0.65 too. An 8-connected structure of enough cells,
    without an occupied cell beside it, is an obstacle; so is one of strong cells with enough evidence.
    """

    codes: Uint8s  # (65536,): evidence of each grey
    min_cells: int
    min_evidence: int  # in eighths of a nat


def evidence_rule(limits: StateLimits, cells: int, noise: float, trinary: bool) -> EvidenceRule:
    """Derive the rule for a map of so many valid `cells`; `noise` is its standard deviation, of v.

    In a `trinary` map a value is a decision: each cell whose value is occupied is an obstacle.

    Examples
    --------
    >>> rule = evidence_rule(StateLimits(), 100_000, 0.0, trinary=False)
    >>> rule.codes[[0, 32800, 39321, 65535]], rule.min_cells, rule.min_evidence
    (array([  0,   0,   4, 255], dtype=uint8), 3, 117)
    """
    strong = max(STRONG_ABOVE, limits.occupied_above)
    deviations = -NormalDist().inv_cdf((_ALPHA / (_TRIPLES * max(cells, 1))) ** (1 / 3))  # 3.0 for 1e6 cells
    weakest = min(limits.occupied_above + deviations * noise, strong)
    v = np.arange(GREY_LEVELS) / GREY_MAX
    odds = np.divide(v, 1 - v, out=np.full(GREY_LEVELS, np.inf), where=v < 1)
    nats = np.log(np.maximum(odds, 1.0))
    codes = 1 + np.minimum(np.floor(PARTS * np.minimum(nats, GREY_MAX)), _CERTAIN).astype(np.uint8)
    codes[v > strong] |= np.uint8(STRONG)
    codes[v <= weakest] = 0
    return EvidenceRule(codes, 1 if trinary else MIN_CELLS, math.ceil(PARTS * math.log(cells / _ALPHA)))


@dataclass(frozen=True, slots=True)
class ValueStatistics:
    """Statistics of the values of a map, or of a tile of it."""

    levels: NDArray[np.int32]  # (4,): grey of each state by value; -1 for none, -2 for several
    responses: Integers  # (8192,): histogram of |response|, in bins of 64

    @classmethod
    def empty(cls) -> "ValueStatistics":
        """Return the statistics of no pixels."""
        return cls(np.full(_STATES, _NO_LEVEL, np.int32), np.zeros(_BINS, np.int64))

    @property
    def trinary(self) -> bool:
        """Whether free, unknown and occupied pixels have one value each: a value is then a decision."""
        return bool((self.levels != _SEVERAL_LEVELS).all())

    @property
    def noise(self) -> float:
        """Standard deviation of the noise of v; 0 where it is below 0.0003, and in a trinary map."""
        total = int(self.responses.sum())
        if total == 0 or self.trinary:
            return 0.0
        median = int(np.searchsorted(np.cumsum(self.responses), (total + 1) // 2))
        return median * _BIN_WIDTH / (6 * _MEDIAN_OF_NORMAL * GREY_MAX)

    def merged(self, other: "ValueStatistics") -> "ValueStatistics":
        """Merge the statistics of the pixels of both."""
        pairs = zip(self.levels.tolist(), other.levels.tolist(), strict=True)
        levels = np.array([_merged_level(one, two) for one, two in pairs], np.int32)
        return ValueStatistics(levels, self.responses + other.responses)


def value_statistics(grey: Uint16s, valid: Uint8s, states: Uint8s) -> ValueStatistics:
    """Measure the statistics of the values of whole blocks: (M, N) arrays, multiples of 64.

    `states` are those of each pixel's value.

    Examples
    --------
    >>> grey = np.repeat([[0, 65535]], [32, 32], axis=1).repeat(64, axis=0).astype(np.uint16)
    >>> states = np.where(grey > 0, 3, 1).astype(np.uint8)
    >>> statistics = value_statistics(grey, np.ones((64, 64), np.uint8), states)
    >>> statistics.trinary, statistics.noise, statistics.levels.tolist()
    (True, 0.0, [-1, 0, -1, 65535])
    """
    statistics = value_levels(grey, valid, states)
    _count_responses(grey, valid, statistics.responses)
    return statistics


def value_levels(grey: Uint16s, valid: Uint8s, states: Uint8s) -> ValueStatistics:
    """Measure the levels of `value_statistics` alone, without responses."""
    statistics = ValueStatistics.empty()
    _find_levels(grey, valid, states, statistics.levels)
    return statistics


def _merged_level(one: int, other: int) -> int:
    if _NO_LEVEL in (one, other):
        return max(one, other) if _SEVERAL_LEVELS not in (one, other) else _SEVERAL_LEVELS
    return one if one == other else _SEVERAL_LEVELS


@kernel("void(u2[:,::1], u1[:,::1], u1[:,::1], i4[::1])")
def _find_levels(grey, valid, states, levels):  # type: ignore[no-untyped-def]
    # Stops at the second value of a state: a map of probabilities has one in its first rows.
    for row in range(grey.shape[0]):
        last = np.int32(-1)
        for col in range(grey.shape[1]):
            here = np.int32(grey[row, col])
            if here == last or not valid[row, col]:
                continue
            last = here
            state = states[row, col]
            if levels[state] == np.int32(-1):
                levels[state] = here
            elif levels[state] != here:
                levels[state] = np.int32(-2)
                return


@kernel("void(u2[:,::1], u1[:,::1], i8[::1])")
def _count_responses(grey, valid, counts):  # type: ignore[no-untyped-def]
    for row in range(_ROW_STEP // 2, grey.shape[0], _ROW_STEP):
        for begin in range(0, grey.shape[1], BLOCK):
            for c in range(begin + 1, begin + BLOCK - 1):
                ok = True
                response = np.int64(0)
                for k in range(-1, 2):
                    above, below = np.int64(grey[row - 1, c + k]), np.int64(grey[row + 1, c + k])
                    column = above - 2 * np.int64(grey[row, c + k]) + below
                    response += column if k != 0 else -2 * column
                    ok = ok and valid[row - 1, c + k] and valid[row, c + k] and valid[row + 1, c + k]
                if ok:
                    counts[min(abs(response) // _BIN_WIDTH, _BINS - 1)] += 1
