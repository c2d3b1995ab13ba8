"""How much likelier what a window shows is in a sample than in the raster as a whole.

G asks whether a window and a sample may be one texture, and leaves open what else the window may be. Where
noise makes textures alike, nearly all of them may. But what else there is, is known: the raster. The
logarithm of the likelihood ratio of two known sources is a sum of one weight a pixel, and no other test tells
them apart better (Neyman and Pearson, 1933). It speaks of two scales: of pixels, and of means of 2 x 2.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.g_scores import best_scores, smallest_count
from uavseg.units import CELL

PRIOR = 1000  # pixels of the raster's own proportions that every sample is thought to have more
UNITS = 1024  # of a weight: parts of one in a natural logarithm

_NEITHER = -(1 << 31)  # where no window has enough counted pixels
_MOST_WINDOWS = 1024  # about so many windows of a sample are looked at
_OWN = (1, 20)  # the quantile of the evidence of the sample's own windows that counts as like
_LEEWAY = 2  # a window may fall short by the logarithm of a similarity, over this

Names = tuple[NDArray[np.uint16], NDArray[np.uint16]]  # of the same pixels, from `texture` and from `coarser`


@dataclass(frozen=True)
class Evidence:
    """What pixels say for a sample, and how much its own windows say.

    Parameters
    ----------
    weights : (2, 2048) int64 array
        ln of how much likelier a symbol is in the sample, in parts of 1 / 1024, at both scales.
    own : int
        What nineteen of twenty of the sample's windows reach, each against the rest of it; at most 0.
    """

    weights: NDArray[np.int64]
    own: int

    @classmethod
    def of(cls, sample: Names, whole: NDArray[np.int64], side: int) -> "Evidence":
        """The evidence for a sample.

        Parameters
        ----------
        sample : pair of (M, N) uint16 arrays
            Symbols, 65535 outside of the sample; M and N are multiples of 8.
        whole : (2, 2048) int64 array
            How often each symbol occurs in the raster; the sample is a part of it.
        side : int
            Of a window, in cells.
        """
        own = np.sort(own_evidence(sample, whole, side))
        lowest = own[len(own) * _OWN[0] // _OWN[1]] if len(own) else 0.0
        return cls(weights_of(frequencies(sample), whole), min(math.floor(lowest * UNITS), 0))

    def least(self, similarity: float) -> int:
        """The smallest mean weight of what is like the sample to a degree, see `Sample.similarity`."""
        return self.own + math.floor(UNITS * math.log(similarity) / _LEEWAY)


def frequencies(names: Names) -> NDArray[np.int64]:
    """How often each symbol occurs at each scale, a (2, 2048) array; those of parts add up."""
    counts = [np.bincount(each.ravel(), minlength=SYMBOLS)[:SYMBOLS] for each in names]
    return np.stack(counts).astype(np.int64)


def weights_of(sample: NDArray[np.int64], whole: NDArray[np.int64]) -> NDArray[np.int64]:
    """What each symbol says for a sample, in parts of 1 / 1024; 0 where the raster has none of it.

    Parameters
    ----------
    sample, whole : (2, 2048) int64 arrays
        Frequencies; what the sample has, the raster has too.
    """
    weights: NDArray[np.int64] = np.rint(UNITS * _log_ratio(sample, whole)).astype(np.int64)
    return weights


def _log_ratio(sample: NDArray[np.int64], whole: NDArray[np.int64]) -> NDArray[np.float64]:
    """ln of how much likelier symbols are, with a sample that has `PRIOR` pixels of the raster added."""
    share = whole / np.maximum(whole.sum(axis=-1, keepdims=True), 1)
    expected = (sample.sum(axis=-1, keepdims=True) + PRIOR) * share
    ratio = np.divide(sample + PRIOR * share, expected, out=np.ones_like(share), where=whole > 0)
    logarithm: NDArray[np.float64] = np.log(ratio)
    return logarithm


def own_evidence(sample: Names, whole: NDArray[np.int64], side: int) -> NDArray[np.float64]:
    """The mean weight of windows of a sample, each by the weights that the rest of the sample has.

    Parameters
    ----------
    sample, whole, side
        As of `Evidence.of`.

    Returns
    -------
    means : (n,) float64 array
        Of windows with seven eighths of their pixels counted; of a large sample about 1024, evenly spread.
    """
    rows, cols = (max(length // CELL - side + 1, 0) for length in sample[0].shape)
    step = max(math.isqrt(rows * cols // _MOST_WINDOWS), 1)
    every, found = frequencies(sample), []
    for row in range(0, rows, step):
        for col in range(0, cols, step):
            part = np.s_[CELL * row : CELL * (row + side), CELL * col : CELL * (col + side)]
            window = frequencies((sample[0][part], sample[1][part]))
            count = int(window[0].sum())
            if count >= smallest_count(side):
                found.append(float((window * _log_ratio(every - window, whole)).sum()) / count)
    return np.array(found)


def best_evidence(names: Names, weights: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    """For each cell the largest mean weight of the windows that it lies in, see `likeness.best_scores`.

    Parameters
    ----------
    names : pair of (M, N) uint16 arrays
        Symbols; M and N are multiples of 8.
    weights : (2, 2048) int64 array
    side : int
        Of a window, in cells.

    Returns
    -------
    best : (M / 8 - 2 side + 2, N / 8 - 2 side + 2) int64 array
        Without the ``side - 1`` cells at every edge that are looked at only; in parts of 1 / 1024, rounded
        down. -2**31 where less than seven eighths of the pixels of all windows are counted.
    """
    cells = tuple(length // CELL for length in names[0].shape)
    sums, counts = np.zeros(cells, np.int64), np.zeros(cells, np.int64)
    _weigh(*names, weights, sums, counts)
    light, many = _in_windows(sums, side), _in_windows(counts, side)
    means = np.where(many >= smallest_count(side), light // np.maximum(many, 1), _NEITHER)
    return -best_scores(-means, side)


def _in_windows(sums: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    """Sums over the cells of the window that begins at each."""
    for axis in (0, 1):
        length = sums.shape[axis] - side + 1
        sums = np.sum([sums.take(range(k, k + length), axis) for k in range(side)], axis=0)
    return sums


@kernel("void(u2[:,::1], u2[:,::1], i8[:,::1], i8[:,::1], i8[:,::1])")
def _weigh(fine, coarse, weights, sums, counts):  # type: ignore[no-untyped-def]
    for r in range(8 * sums.shape[0]):
        for cell in range(sums.shape[1]):
            total = np.int64(0)
            many = np.int64(0)
            for c in range(8 * cell, 8 * cell + 8):
                if fine[r, c] != UNCOUNTED:
                    total += weights[0, fine[r, c]]
                    many += 1
                if coarse[r, c] != UNCOUNTED:
                    total += weights[1, coarse[r, c]]
            sums[r // 8, cell] += total
            counts[r // 8, cell] += many
