"""Noise level of an occupancy map (Immerkaer, median absolute response), and whether the map is trinary.

J. Immerkaer, Fast noise variance estimation, Comput. Vis. Image Underst. 64 (1996) 300-302: the response to
the second difference along rows of the second difference along columns has the standard deviation 6 sigma.
Its median absolute value, 0.6745 times that, is robust: structure in less than half of the map changes
little, and a map that is flat in more than half of its area has no noise.

Only responses within blocks of 64 x 64 pixels are used, so statistics of tiles merge by adding.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.units import BLOCK, GREY_MAX

_ROW_STEP = 8  # one row of responses in so many
_BIN_WIDTH = 64  # of |response|, in grey
_BINS = 8192  # 8 GREY_MAX, the largest |response|, divided by the width
_STATES = 4
_NO_LEVEL, _SEVERAL_LEVELS = -1, -2
_MEDIAN_OF_NORMAL = 0.6744897501960817  # of |z|


@dataclass(frozen=True, slots=True)
class ValueStatistics:
    """Statistics of the values of a map, or of a tile of it.

    Parameters
    ----------
    levels : (4,) int32 array
        The grey of the pixels of each own state; -1 where there are none, -2 where there are several greys.
    responses : (8192,) int64 array
        Histogram of |response| in bins of 64.
    """

    levels: NDArray[np.int32]
    responses: NDArray[np.int64]

    @classmethod
    def empty(cls) -> "ValueStatistics":
        """Statistics of no pixels."""
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
        """Statistics of the pixels of both."""
        pairs = zip(self.levels.tolist(), other.levels.tolist(), strict=True)
        levels = np.array([_merged_level(one, two) for one, two in pairs], np.int32)
        return ValueStatistics(levels, self.responses + other.responses)


def value_statistics(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], own: NDArray[np.uint8]
) -> ValueStatistics:
    """Statistics of the values of whole blocks.

    Parameters
    ----------
    grey : (M, N) uint16 array
        M and N are multiples of 64.
    valid : (M, N) uint8 array
        1 where a pixel is valid.
    own : (M, N) uint8 array
        State of each pixel's own v.

    Examples
    --------
    >>> grey = np.repeat([[0, 65535]], [32, 32], axis=1).repeat(64, axis=0).astype(np.uint16)
    >>> found = value_statistics(grey, np.ones((64, 64), np.uint8), np.where(grey > 0, 3, 1).astype(np.uint8))
    >>> found.trinary, found.noise, found.levels.tolist()
    (True, 0.0, [-1, 0, -1, 65535])
    """
    found = value_levels(grey, valid, own)
    _count_responses(grey, valid, found.responses)
    return found


def value_levels(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], own: NDArray[np.uint8]
) -> ValueStatistics:
    """As `value_statistics`, without responses."""
    found = ValueStatistics.empty()
    _find_levels(grey, valid, own, found.levels)
    return found


def _merged_level(one: int, other: int) -> int:
    if _NO_LEVEL in (one, other):
        return max(one, other) if _SEVERAL_LEVELS not in (one, other) else _SEVERAL_LEVELS
    return one if one == other else _SEVERAL_LEVELS


@kernel("void(u2[:,::1], u1[:,::1], u1[:,::1], i4[::1])")
def _find_levels(grey, valid, own, levels):  # type: ignore[no-untyped-def]
    # Stops at the second value of a state: a map of probabilities has one in its first rows.
    for row in range(grey.shape[0]):
        last = np.int32(-1)
        for col in range(grey.shape[1]):
            here = np.int32(grey[row, col])
            if here == last or not valid[row, col]:
                continue
            last = here
            state = own[row, col]
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
                    column = (
                        np.int64(grey[row - 1, c + k])
                        - 2 * np.int64(grey[row, c + k])
                        + np.int64(grey[row + 1, c + k])
                    )
                    response += column if k != 0 else -2 * column
                    ok = ok and valid[row - 1, c + k] and valid[row, c + k] and valid[row + 1, c + k]
                if ok:
                    counts[min(abs(response) // _BIN_WIDTH, _BINS - 1)] += 1
