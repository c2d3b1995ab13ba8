"""Likelihood ratios: of windows by texture; of pixels, two-class, by texture, grey and further bands.

After the pixelwise step of Ojala and Pietikäinen (1999), who compare the histogram around a pixel with a
model of either side by G. Where the models are much larger than the window around a pixel, the difference of
the two G is twice the log-likelihood ratio, which is a sum of one weight per pixel. Further bands are taken
for independent, given the side that a pixel is on (naive Bayes).
"""

import math
from collections.abc import Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.g_scores import TextureModel, best_scores, min_count
from uavseg.units import CELL

DECISION_HALO = 16  # pixels: a tile with this halo is classified exactly as the whole image
WINDOW_RADIUS = 6  # pixels on every side of a pixel in its window

PRIOR_PIXELS = 1000  # pseudo-count: pixels in the proportions of the background added to a sample
WEIGHT_UNITS = 1024  # units of a weight for a natural logarithm of 1

_NO_WINDOW = -(1 << 31)  # sentinel: no window has enough counted pixels
_MAX_WINDOWS = 1024  # of a sample, approximately
_SAMPLE_QUANTILE = (1, 20)  # of the mean weights of the sample's windows: the threshold at similarity 1
_SIMILARITY_DIVISOR = 2  # the threshold is lowered by ln(similarity) over this

SymbolPair = tuple[NDArray[np.uint16], NDArray[np.uint16]]  # of the same pixels: fine and coarse scale


@dataclass(frozen=True)
class SampleWeights:
    """Log-likelihood-ratio weights of symbols, sample against background; the mean that its windows reach.

    G tests whether a window and a sample may have the same texture, without an alternative; where noise makes
    textures similar, nearly all windows pass. The alternative is known: the raster is the background model.
    The log-likelihood ratio of two known sources is a sum of one weight per pixel, and it is the most
    powerful test between them (Neyman and Pearson, 1933). Two scales are used: pixels, and means of 2 x 2.
    """

    weights: Integers  # (2, 2048): log-likelihood ratios, both scales, in 1 / 1024
    sample_level: int  # reached by 19 of 20 windows of the sample, each against its rest; at most 0

    @classmethod
    def of(cls, sample: SymbolPair, background: Integers, side: int) -> "SampleWeights":
        """Compute the weights for a sample.

        The sample is (M, N) symbols, multiples of 8, 65535 outside of it; `background`, (2, 2048), the
        histogram of those of the raster, which includes the sample; `side` that of a window, in cells.
        """
        means = np.sort(_sample_window_means(sample, background, side))
        lowest = means[len(means) * _SAMPLE_QUANTILE[0] // _SAMPLE_QUANTILE[1]] if len(means) else 0.0
        weights = _log_ratio_weights(symbol_counts(sample), background)
        return cls(weights, min(math.floor(lowest * WEIGHT_UNITS), 0))

    def threshold(self, similarity: float) -> int:
        """Return the smallest mean weight of a window with at least this similarity to the sample."""
        return self.sample_level + math.floor(WEIGHT_UNITS * math.log(similarity) / _SIMILARITY_DIVISOR)


def symbol_counts(symbols: SymbolPair) -> Integers:
    """Count symbols at both scales, a (2, 2048) array; those of parts merge by adding."""
    counts = [np.bincount(each.ravel(), minlength=SYMBOLS)[:SYMBOLS] for each in symbols]
    return np.stack(counts).astype(np.int64)


def _log_ratio_weights(sample: Integers, background: Integers) -> Integers:
    """Round the log-likelihood ratio of each symbol to units of 1 / 1024; 0 if the background lacks it."""
    return np.rint(WEIGHT_UNITS * _log_ratio(sample, background)).astype(np.int64)


def _log_ratio(sample: Integers, background: Integers) -> Floats:
    """Compute the log-likelihood ratio with `PRIOR_PIXELS` pixels of the background added to the sample."""
    share = background / np.maximum(background.sum(axis=-1, keepdims=True), 1)
    expected = (sample.sum(axis=-1, keepdims=True) + PRIOR_PIXELS) * share
    ratio = np.divide(sample + PRIOR_PIXELS * share, expected, out=np.ones_like(share), where=background > 0)
    return np.asarray(np.log(ratio))


def _sample_window_means(sample: SymbolPair, background: Integers, side: int) -> Floats:
    """Average the weights of windows of a sample, each by the rest of the sample (leave one out)."""
    # Windows have at least seven eighths of their pixels counted; in a large sample about 1024 are evenly
    # spaced.
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


def best_mean_weights(symbols: SymbolPair, weights: Integers, side: int) -> Integers:
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


def window_sums(sums: Integers, side: int) -> Integers:
    """Sum over the window, of `side` cells, that begins at each cell."""
    for axis in (0, 1):
        length = sums.shape[axis] - side + 1
        sums = np.sum([sums.take(range(k, k + length), axis) for k in range(side)], axis=0)
    return sums


@kernel("void(u2[:,::1], u2[:,::1], i8[:,::1], i8[:,::1], i8[:,::1])")
def _sum_weights(fine, coarse, weights, sums, counts):  # type: ignore[no-untyped-def]
    for r in range(8 * sums.shape[0]):
        for cell in range(sums.shape[1]):
            total, count = np.int64(0), np.int64(0)
            for c in range(8 * cell, 8 * cell + 8):
                if fine[r, c] != UNCOUNTED:
                    total += weights[0, fine[r, c]]
                    count += 1
                if coarse[r, c] != UNCOUNTED:
                    total += weights[1, coarse[r, c]]
            sums[r // 8, cell] += total
            counts[r // 8, cell] += count


@dataclass(frozen=True)
class PixelWeights:
    """Log-likelihood ratio of one side to the other, in units of 1 / 1024.

    There is one for each of 2048 symbols, of 64 bins of grey as in a `TextureModel`, and of 2048 symbols of
    means of 2 x 2 pixels (`coarse`).
    """

    texture: Integers
    greys: Integers
    coarse: Integers = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))

    @classmethod
    def between(cls, one: TextureModel, other: TextureModel, by_grey: bool = True) -> "PixelWeights":
        """Compute the weights of two models, positive where `one` is more likely.

        Without `by_grey` they are of texture alone.
        """
        greys = log_ratio(one.greys, other.greys)
        coarse = log_ratio(one.coarse, other.coarse) // 2  # means that share pixels are not independent
        return cls(log_ratio(one.texture, other.texture), greys if by_grey else np.zeros_like(greys), coarse)


def log_ratio(one: Integers, other: Integers) -> Integers:
    """Compute the log ratio of two probabilities in units of 1 / 1024.

    Each is the Krichevsky-Trofimov estimate from (n,) counts: half a count is added.
    """
    first, second = ((counts + 0.5) / (counts.sum() + 0.5 * len(counts)) for counts in (one, other))
    return np.asarray(np.rint(np.log(first / second) * WEIGHT_UNITS).astype(np.int64))


def classify_pixels(
    cells: Uint8s,
    valid: Uint8s,
    grey: Uint16s,
    symbols: SymbolPair,
    weights: PixelWeights,
    colors: Sequence["ColorPlane"] = (),
) -> Uint8s:
    """Classify pixels as their cell, in undecided cells by the sign of the weight of a 13 x 13 window.

    `cells`, (M / 8, N / 8), are 0 outside, 1 inside, 2 undecided; `valid` and `grey` are (M, N). Pixels along
    the border have no weight: of the `symbols`, those from `lbp_symbols` are without a border of one pixel,
    those from `coarse_symbols` without one of three. The weights of further bands, `colors`, are added. The
    result, (M, N), is 1 inside; 0 where a pixel is not valid.
    """
    inside = np.zeros_like(valid)
    of_colors = np.zeros(valid.shape if colors else (0, 0), np.int64)
    for color in colors:
        of_colors += np.where(color.valid & valid, color.weights[color.grey >> 10], 0)
    padded = np.pad(symbols[1], 2, constant_values=UNCOUNTED)  # the border is that of the fine symbols
    tables = (weights.texture, weights.greys, weights.coarse, of_colors)
    columns = np.zeros(valid.shape[1], np.int64)
    _classify_pixels(cells, valid, grey, symbols[0], padded, *tables, WINDOW_RADIUS, columns, inside)
    return inside


def undecided_cells(matched: Bools, others: Bools, reach: int) -> Uint8s:
    """Mark the cells near a boundary as undecided: 0 outside, 1 inside, 2 undecided.

    All arrays are (m, n). `matched` and `others` are the cells of one side, and of the other; a cell may
    belong to neither. A cell is undecided where both sides have cells within a distance of `reach` (in a
    square).
    """
    near = dilate(matched, reach) & dilate(others, reach)
    return np.where(near, np.uint8(2), matched.view(np.uint8))


@inlined
def pixel_weight(symbols, coarse_symbols, grey, valid, r, c, texture, greys, coarse):  # type: ignore[no-untyped-def]
    """Return the weight of a pixel; 0 where it is not valid."""
    if valid[r, c] == 0:
        return np.int64(0)
    symbol, coarse_symbol = symbols[r - 1, c - 1], coarse_symbols[r - 1, c - 1]
    weight = greys[grey[r, c] >> 10] + (texture[symbol] if symbol != UNCOUNTED else np.int64(0))
    return weight + (coarse[coarse_symbol] if coarse_symbol != UNCOUNTED else np.int64(0))


@kernel(
    "void(u1[:,::1], u1[:,::1], u2[:,::1], u2[:,::1], u2[:,::1], "
    "i8[::1], i8[::1], i8[::1], i8[:,::1], i8, i8[::1], u1[:,::1])"
)
def _classify_pixels(  # type: ignore[no-untyped-def]
    cells, valid, grey, symbols, coarse_symbols, texture, greys, coarse, colors, radius, columns, inside
):
    rows, cols = valid.shape
    for entering in range(1, rows + radius):  # the row that enters the column sums
        if entering < rows - 1:
            for c in range(1, cols - 1):
                columns[c] += pixel_weight(
                    symbols, coarse_symbols, grey, valid, entering, c, texture, greys, coarse
                )
            if colors.shape[0] > 0:
                for c in range(1, cols - 1):
                    columns[c] += colors[entering, c]
        leaving = entering - 2 * radius - 1
        if leaving >= 1:
            for c in range(1, cols - 1):
                columns[c] -= pixel_weight(
                    symbols, coarse_symbols, grey, valid, leaving, c, texture, greys, coarse
                )
            if colors.shape[0] > 0:
                for c in range(1, cols - 1):
                    columns[c] -= colors[leaving, c]
        r = entering - radius
        if r < 0:
            continue
        total = np.int64(0)
        for c in range(min(radius, cols)):
            total += columns[c]
        for c in range(cols):
            if c + radius < cols:
                total += columns[c + radius]
            if c - radius - 1 >= 0:
                total -= columns[c - radius - 1]
            side = cells[r // 8, c // 8]
            if valid[r, c] and (side == 1 or (side == 2 and total > 0)):
                inside[r, c] = 1


@dataclass(frozen=True)
class ColorPlane:
    """Grey and validity of one band, (M, N), and the weight of each of its 64 bins as in `PixelWeights`."""

    grey: Uint16s
    valid: Uint8s
    weights: Integers
