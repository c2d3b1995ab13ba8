"""Log-likelihood-ratio weights of symbols, sample against background.

G tests whether a window and a sample may have the same texture, without an alternative; where noise makes
textures similar, nearly all windows pass. The alternative is known: the raster is the background model. The
log-likelihood ratio of two known sources is a sum of one weight per pixel, and it is the most powerful test
between them (Neyman and Pearson, 1933). Two scales are used: pixels, and means of 2 x 2.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.dataclass import dataclass
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.g_scores import best_scores, min_count
from uavseg.units import CELL

PRIOR_PIXELS = 1000  # pseudo-count: pixels in the proportions of the background added to a sample
WEIGHT_UNITS = 1024  # units of a weight for a natural logarithm of 1

_NO_WINDOW = -(1 << 31)  # sentinel: no window has enough counted pixels
_MAX_WINDOWS = 1024  # of a sample, approximately
_SAMPLE_QUANTILE = (1, 20)  # of the mean weights of the sample's windows: the threshold at similarity 1
_SIMILARITY_DIVISOR = 2  # the threshold is lowered by ln(similarity) over this

SymbolPair = tuple[NDArray[np.uint16], NDArray[np.uint16]]  # of the same pixels: fine and coarse scale


@dataclass(frozen=True)
class SampleWeights:
    """Weights of symbols for a sample, and the mean weight that its windows reach."""

    weights: NDArray[np.int64]  # (2, 2048): log-likelihood ratios, both scales, in 1 / 1024
    sample_level: int  # reached by 19 of 20 windows of the sample, each against its rest; at most 0

    @classmethod
    def of(cls, sample: SymbolPair, background: NDArray[np.int64], side: int) -> "SampleWeights":
        """Compute the weights for a sample.

        The sample is (M, N) symbols, multiples of 8, 65535 outside of it; `background`, (2, 2048), the
        histogram of those of the raster, which includes the sample; `side` that of a window, in cells.
        """
        means = np.sort(_sample_window_means(sample, background, side))
        lowest = means[len(means) * _SAMPLE_QUANTILE[0] // _SAMPLE_QUANTILE[1]] if len(means) else 0.0
        return cls(
            _log_ratio_weights(symbol_counts(sample), background), min(math.floor(lowest * WEIGHT_UNITS), 0)
        )

    def threshold(self, similarity: float) -> int:
        """Return the smallest mean weight of a window with at least this similarity to the sample."""
        return self.sample_level + math.floor(WEIGHT_UNITS * math.log(similarity) / _SIMILARITY_DIVISOR)


def symbol_counts(symbols: SymbolPair) -> NDArray[np.int64]:
    """Count symbols at both scales, a (2, 2048) array; those of parts merge by adding."""
    counts = [np.bincount(each.ravel(), minlength=SYMBOLS)[:SYMBOLS] for each in symbols]
    return np.stack(counts).astype(np.int64)


def _log_ratio_weights(sample: NDArray[np.int64], background: NDArray[np.int64]) -> NDArray[np.int64]:
    """Round the log-likelihood ratio of each symbol to units of 1 / 1024; 0 if the background lacks it."""
    weights: NDArray[np.int64] = np.rint(WEIGHT_UNITS * _log_ratio(sample, background)).astype(np.int64)
    return weights


def _log_ratio(sample: NDArray[np.int64], background: NDArray[np.int64]) -> NDArray[np.float64]:
    """Compute the log-likelihood ratio with `PRIOR_PIXELS` pixels of the background added to the sample."""
    share = background / np.maximum(background.sum(axis=-1, keepdims=True), 1)
    expected = (sample.sum(axis=-1, keepdims=True) + PRIOR_PIXELS) * share
    ratio = np.divide(sample + PRIOR_PIXELS * share, expected, out=np.ones_like(share), where=background > 0)
    logarithm: NDArray[np.float64] = np.log(ratio)
    return logarithm


def _sample_window_means(sample: SymbolPair, background: NDArray[np.int64], side: int) -> NDArray[np.float64]:
    """Average the weights of windows of a sample, each by the rest of the sample (leave one out).

    Windows have at least seven eighths of their pixels counted; in a large sample about 1024 are evenly
    spaced.
    """
    rows, cols = (max(length // CELL - side + 1, 0) for length in sample[0].shape)
    step = max(math.isqrt(rows * cols // _MAX_WINDOWS), 1)
    total, means = symbol_counts(sample), []
    for row in range(0, rows, step):
        for col in range(0, cols, step):
            part = np.s_[CELL * row : CELL * (row + side), CELL * col : CELL * (col + side)]
            window = symbol_counts((sample[0][part], sample[1][part]))
            count = int(window[0].sum())
            if count >= min_count(side):
                means.append(float((window * _log_ratio(total - window, background)).sum()) / count)
    return np.array(means)


def best_mean_weights(symbols: SymbolPair, weights: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    """Return for each cell the largest mean weight of the windows that contain it, see `best_scores`.

    The symbols are (M, N), multiples of 8, the weights (2, 2048), and `side` is that of a window, in cells.
    The result, (M / 8 - 2 side + 2, N / 8 - 2 side + 2), lacks the ``side - 1`` cells at every edge, which
    serve as a halo. It is in units of 1 / 1024, rounded down; -2**31 where every window has less than seven
    eighths of its pixels counted.
    """
    cells = tuple(length // CELL for length in symbols[0].shape)
    sums, counts = np.zeros(cells, np.int64), np.zeros(cells, np.int64)
    _sum_weights(*symbols, weights, sums, counts)
    totals, numbers = window_sums(sums, side), window_sums(counts, side)
    means = np.where(numbers >= min_count(side), totals // np.maximum(numbers, 1), _NO_WINDOW)
    return -best_scores(-means, side)


def window_sums(sums: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    """Sum over the window, of `side` cells, that begins at each cell."""
    for axis in (0, 1):
        length = sums.shape[axis] - side + 1
        sums = np.sum([sums.take(range(k, k + length), axis) for k in range(side)], axis=0)
    return sums


@kernel("void(u2[:,::1], u2[:,::1], i8[:,::1], i8[:,::1], i8[:,::1])")
def _sum_weights(fine, coarse, weights, sums, counts):  # type: ignore[no-untyped-def]
    for r in range(8 * sums.shape[0]):
        for cell in range(sums.shape[1]):
            total = np.int64(0)
            count = np.int64(0)
            for c in range(8 * cell, 8 * cell + 8):
                if fine[r, c] != UNCOUNTED:
                    total += weights[0, fine[r, c]]
                    count += 1
                if coarse[r, c] != UNCOUNTED:
                    total += weights[1, coarse[r, c]]
            sums[r // 8, cell] += total
            counts[r // 8, cell] += count
