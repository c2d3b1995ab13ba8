"""Sliding-window texture similarity: G between the histogram of a window and that of a sample.

A model is the joint histogram of LBP codes and contrast bins of a sample's counted pixels. A square window
moves over the image in steps of one cell of 8 pixels. Its score is G of the two histograms less the expected
G under the null hypothesis (see `expected_g`), per counted pixel. Logarithms are in fixed point, so a score
is a sum of integers and does not depend on where the window started.

Scores of cells are bimodal where Otsu's criterion separates those of the sample from others with a gap
between them: N. Otsu, "A threshold selection method from gray-level histograms", IEEE Transactions on
Systems, Man, and Cybernetics 9 (1979) 62-66.
"""

from dataclasses import field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.segmentation.blocks.g_statistic import expected_g, n_ln_n
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.units import CELL, GREY_MAX
from uavseg.warning_filters import changing_filters

SCORE_UNITS = 2048  # units of a score for a G of 1 per counted pixel
NULL_SCORE = 4 * SCORE_UNITS  # the score where G equals its expectation under the null hypothesis
MAX_SCORE = 0xFFFE  # the largest score, and that of a window whose mean grey is out of bounds
NO_SCORE = 0xFFFF  # sentinel: no window has enough counted pixels
GREY_BINS = 64

_LOG_SCALE = 1 << 20  # fixed point of n ln n
_MIN_COVERAGE = (7, 8)  # share of a window's pixels that must be counted

T = TypeVar("T", bound=np.integer[Any])
_FEW = 32  # cells
_SEPARABLE = 0.8  # minimum share of the variance between the two classes
_GAP = SCORE_UNITS // 4  # width of the gap above the limit
_MIN_SHARE = 0.1  # of cells above the gap
_BETWEEN = 0.4  # cells within the gap, as a share of those above it
_OUTLIERS = 0.99  # quantile to which larger scores are reduced
_OTSU_BINS = 256
_PART = 1 << 20  # scores that are counted at a time


@dataclass(frozen=True)
class TextureModel:
    """Texture and grey histograms of counted pixels; those of parts merge by adding.

    `texture` (2048,) is the histogram of symbols, see `lbp.lbp_symbols`, `greys` (64,) that of grey in bins
    of 1024, and `coarse` (2048,) that of symbols of means of 2 x 2 pixels, see `coarse_lbp.coarse_symbols`.
    """

    texture: Integers = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))
    greys: Integers = field(default_factory=lambda: np.zeros(GREY_BINS, np.int64))
    coarse: Integers = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))

    def __add__(self, other: "TextureModel") -> "TextureModel":
        return TextureModel(
            self.texture + other.texture, self.greys + other.greys, self.coarse + other.coarse
        )

    @property
    def count(self) -> int:
        """Number of counted pixels."""
        return int(self.texture.sum())


@dataclass(frozen=True, slots=True)
class GreyBounds:
    """Bounds of the mean grey of a window, both included."""

    low: int = 0
    high: int = GREY_MAX


def texture_model(
    symbols: Uint16s, grey: Uint16s, cells: Uint8s, margin: int = 0, coarse: Uint16s | None = None
) -> TextureModel:
    """Count the textures and greys of selected cells of an image.

    `symbols`, of `lbp_symbols`, and `grey` are (M + 2 m, N + 2 m) with a border of m pixels, the `margin`,
    that belongs to no cell. `cells`, (M / 8, N / 8), is 1 where one is selected. `coarse`, of
    `coarse_symbols`, is without the margin.
    """
    model = TextureModel()
    _count(symbols, grey, cells, margin, model.texture, model.greys)
    if coarse is not None:
        _count_coarse(coarse, cells, model.coarse)
    return model


def min_count(side: int) -> int:
    """Return the minimum of counted pixels with which a window of `side` cells has a score: seven eighths."""
    return (side * CELL) ** 2 * _MIN_COVERAGE[0] // _MIN_COVERAGE[1]


def window_scores(
    symbols: Uint16s,
    grey: Uint16s,
    model: TextureModel,
    side: int,
    bounds: GreyBounds = GreyBounds(),
    leave_one_out: bool = False,
) -> Uint16s:
    """Score every window: G against a model less its expectation, per counted pixel.

    `symbols`, from `lbp_symbols`, and the `grey` of the same pixels are (M, N), multiples of 8; `side` is
    that of a window in cells, and `bounds` are those of the mean grey of its counted pixels. With
    `leave_one_out` each window, a part of the model, is compared with the rest of the model. The scores, (M /
    8 - side + 1, N / 8 - side + 1), are of the window that begins at each cell: (G - expected G) / pixels in
    units of 1 / 2048, rounded down, plus `NULL_SCORE`. 65534 where the mean is out of bounds, 65535 where
    less than seven eighths of the window are counted.
    """
    rows, cols = (length // CELL - side + 1 for length in symbols.shape)
    scores = np.full((max(rows, 0), max(cols, 0)), NO_SCORE, np.uint16)
    if scores.size and model.count:
        above, below, whole = _tables(model, (CELL * side) ** 2, leave_one_out)
        limits = min_count(side), bounds.low, bounds.high
        counts = np.zeros(SYMBOLS, np.int64)
        tables = model.texture, above, below, whole
        _slide_window(symbols, grey, side, *tables, leave_one_out, *limits, counts, scores)
    return scores


def best_scores(scores: NDArray[T], side: int) -> NDArray[T]:
    """Return for each cell the lowest score of the windows that contain it (minimum filter).

    Near a boundary, most windows around a cell straddle it, but some lie on the cell's side only (as in
    Kuwahara's filter). A cell on the sample's side therefore gets the score of a window on that side. The
    scores are (m + side - 1, n + side - 1), the first of a window that begins ``side - 1`` cells before the
    first of the (m, n) cells.
    """
    best = scores
    for axis in (0, 1):
        length = best.shape[axis] - side + 1
        best = np.minimum.reduce([best.take(range(k, k + length), axis) for k in range(side)])
    return best


def _tables(model: TextureModel, largest: int, leave_one_out: bool) -> tuple[Integers, Integers, Integers]:
    """Tabulate halves of G for windows of up to `largest` pixels, in fixed point."""
    # The first two are the terms of `added_g`, by the pixels of a symbol in both histograms and in the
    # window. The third is J(N, n) of windows of n counted pixels, less the expectation for an empty window.
    total = model.count
    n = np.arange(largest + 1)
    rest = np.maximum(total - n, 0) if leave_one_out else np.full_like(n, total)
    largest_n = int(model.texture.max()) + (0 if leave_one_out else largest + 1)
    share = min(largest / total, 0.5) if leave_one_out else largest / (total + largest)
    expected = _fixed(expected_g(largest_n, share) / 2)
    above: Integers = np.diff(_fixed(n_ln_n(np.arange(largest_n + 1))))
    if not leave_one_out:  # else both histograms together are the model, for every window
        above += np.diff(expected)
    below = np.diff(_fixed(n_ln_n(np.arange(largest + 2))))
    whole = _fixed(n_ln_n(rest + n)) - _fixed(n_ln_n(rest)) - _fixed(n_ln_n(n))
    return above, below, whole - expected[model.texture].sum()


def _fixed(values: Floats) -> Integers:
    return np.rint(values * _LOG_SCALE).astype(np.int64)


@inlined
def added_g(frequency, count, above, below, leave_one_out):  # type: ignore[no-untyped-def]
    """Compute what one more pixel of a symbol adds to J(f, n) and its expectation, see `blocks.division`."""
    # The window has `count` pixels of the symbol; the model has `frequency`, which include those of the
    # window if leave_one_out.
    other = frequency - count - 1 if leave_one_out else frequency + count
    return above[other] - below[count]


@kernel(
    "void(u2[:,::1], u2[:,::1], i8, i8[::1], i8[::1], i8[::1], i8[::1], b1, i8, i8, i8, i8[::1], u2[:,::1])"
)
def _slide_window(  # type: ignore[no-untyped-def]
    symbols, grey, side, model, above, below, whole, leave_one_out, minimum, low, high, table, scores
):
    # Row by row of windows, from left to right: one column of cells enters, another leaves.
    rows, cols = scores.shape
    for row in range(rows):
        shared, count, grey_sum = np.int64(0), np.int64(0), np.int64(0)
        for entering in range(cols + 2 * side - 1):
            for r in range(8 * row, 8 * (row + side)):
                if entering < cols + side - 1:
                    for c in range(8 * entering, 8 * entering + 8):
                        symbol = symbols[r, c]
                        if symbol != UNCOUNTED:
                            shared += added_g(model[symbol], table[symbol], above, below, leave_one_out)
                            table[symbol] += 1
                            count += 1
                            grey_sum += np.int64(grey[r, c])
                if entering >= side:
                    for c in range(8 * (entering - side), 8 * (entering - side) + 8):
                        symbol = symbols[r, c]
                        if symbol != UNCOUNTED:
                            table[symbol] -= 1
                            shared -= added_g(model[symbol], table[symbol], above, below, leave_one_out)
                            count -= 1
                            grey_sum -= np.int64(grey[r, c])
            first = entering - side + 1
            if first < 0 or first >= cols or count < minimum:
                continue
            if grey_sum < low * count or grey_sum > high * count:
                scores[row, first] = MAX_SCORE
            else:
                units = (whole[count] - shared) // (256 * count)  # 2 * SCORE_UNITS / _LOG_SCALE = 1 / 256
                score = NULL_SCORE + units
                scores[row, first] = min(max(score, np.int64(0)), np.int64(MAX_SCORE))


@kernel("void(u2[:,::1], u2[:,::1], u1[:,::1], i8, i8[::1], i8[::1])")
def _count(symbols, grey, cells, margin, texture, greys):  # type: ignore[no-untyped-def]
    for r in range(8 * cells.shape[0]):
        for cell in range(cells.shape[1]):
            if cells[r // 8, cell]:
                for c in range(margin + 8 * cell, margin + 8 * cell + 8):
                    symbol = symbols[margin + r, c]
                    if symbol != UNCOUNTED:
                        texture[symbol] += 1
                        greys[grey[margin + r, c] >> 10] += 1


@kernel("void(u2[:,::1], u1[:,::1], i8[::1])")
def _count_coarse(coarse, cells, histogram):  # type: ignore[no-untyped-def]
    for r in range(8 * cells.shape[0]):
        for cell in range(cells.shape[1]):
            if cells[r // 8, cell]:
                for c in range(8 * cell, 8 * cell + 8):
                    if coarse[r, c] != UNCOUNTED:
                        histogram[coarse[r, c]] += 1


def separability(scores: Uint16s) -> float:
    """Compute Otsu's eta, the share of the variance of scores that lies between the two best classes.

    Scores of `best_scores`, an (n,) uint16 array, are ignored from MAX_SCORE on. Eta is 0.64 for a normal
    distribution, 0.75 for a uniform one; 0 for fewer than 32 scores, or where all are equal.
    """
    with changing_filters():  # which scikit-image does while it is imported
        from skimage.filters import threshold_otsu
    counts = _histogram(scores)[:MAX_SCORE]
    values = np.flatnonzero(counts).astype(np.float64)
    counts = counts[counts > 0]
    total = int(counts.sum())
    if total < _FEW:
        return 0.0
    values = np.minimum(values, _quantile(values, counts, _OUTLIERS))
    if values[0] == values[-1]:
        return 0.0
    bins, edges = np.histogram(values, _OTSU_BINS, weights=counts)
    low = values <= threshold_otsu(hist=(bins, (edges[1:] + edges[:-1]) / 2))
    share = float(counts[low].sum() / total)
    if not 0 < share < 1:
        return 0.0
    means = [float(values[side] @ counts[side] / counts[side].sum()) for side in (low, ~low)]
    mean = float(values @ counts / total)
    variance = float((values - mean) ** 2 @ counts / total)
    return share * (1 - share) * (means[0] - means[1]) ** 2 / variance


def is_bimodal(scores: Uint16s, limit: int) -> bool:
    """Test whether scores split into those similar to the sample and others that are clearly not.

    Two classes explain most of their variance, a tenth at least lies well above the limit, and few lie just
    above it. The scores, (n,), are those of `best_scores`, ignored from MAX_SCORE on; `limit` is the largest
    of a cell that is similar to the sample.
    """
    known = scores[scores < MAX_SCORE]
    above = int((known > limit + _GAP).sum())
    between = int((known > limit).sum()) - above
    has_gap = above >= _MIN_SHARE * len(known) and between <= _BETWEEN * above
    return has_gap and separability(scores) >= _SEPARABLE


def _histogram(scores: Uint16s) -> Integers:
    counts = np.zeros(1 << 16, np.int64)
    for begin in range(0, len(scores), _PART):
        counts += np.bincount(scores[begin : begin + _PART], minlength=len(counts))
    return counts


def _quantile(values: Floats, counts: Integers, share: float) -> float:
    """Interpolate the quantile of sorted values with counts, as `numpy.quantile` does."""
    until = np.cumsum(counts)
    place = share * (int(until[-1]) - 1)
    low, high = (values[np.searchsorted(until, np.floor(place) + k, "right")] for k in (0, 1))
    return float(low + (high - low) * (place - np.floor(place)))
