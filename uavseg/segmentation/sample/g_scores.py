"""How like a sample an image is: G between the sample's histogram and that of a window that moves over it.

A model is the joint histogram of LBP codes and bins of contrast of a sample's counted pixels. A square window
moves over the image in steps of one cell of 8 pixels; its score is G of the two histograms (Sokal and Rohlf's
log-likelihood ratio, as between the children of a block), less what chance makes of G, for each of its
counted pixels. Logarithms are in fixed point, so that a score is a sum of integers: where a window began to
move changes nothing.
"""

from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.g_statistic import chance, x_ln_x
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.units import CELL

UNITS = 2048  # of a score: G for each counted pixel, in parts of this
EVEN = 4 * UNITS  # the score where G is what chance makes of it
UNLIKE = 0xFFFE  # the score of a window whose mean lies outside of what is asked for, and the largest score
UNKNOWN = 0xFFFF  # the score where no window has enough counted pixels
GREY_BINS = 64

_FINE = 1 << 20  # fixed point of n ln n
_FULL_SHARE = (7, 8)  # of a window's pixels that must be counted

T = TypeVar("T", bound=np.integer[Any])


@dataclass(frozen=True)
class Model:
    """Histograms of counted pixels; those of parts merge by adding.

    Parameters
    ----------
    texture : (2048,) int64 array
        How often each symbol occurs, see `texture.symbols`.
    greys : (64,) int64 array
        How many pixels have a grey of 0..1023, 1024..2047, and so on.
    coarse : (2048,) int64 array
        How often each symbol of means of 2 x 2 pixels occurs, see `coarser.coarse_symbols`.
    """

    texture: NDArray[np.int64] = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))
    greys: NDArray[np.int64] = field(default_factory=lambda: np.zeros(GREY_BINS, np.int64))
    coarse: NDArray[np.int64] = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))

    def __add__(self, other: "Model") -> "Model":
        return Model(self.texture + other.texture, self.greys + other.greys, self.coarse + other.coarse)

    @property
    def count(self) -> int:
        """Number of counted pixels."""
        return int(self.texture.sum())


@dataclass(frozen=True, slots=True)
class Bounds:
    """The mean grey that a window must have, both ends in it."""

    low: int = 0
    high: int = 65535


def model_of(
    symbols: NDArray[np.uint16],
    grey: NDArray[np.uint16],
    cells: NDArray[np.uint8],
    margin: int = 0,
    coarse: NDArray[np.uint16] | None = None,
) -> Model:
    """The histograms of some cells of an image.

    Parameters
    ----------
    symbols : (M + 2 m, N + 2 m) uint16 array
        From `texture.symbols`; 65535 does not count.
    grey : (M + 2 m, N + 2 m) uint16 array
    cells : (M / 8, N / 8) uint8 array
        1 where a cell counts.
    margin : int
        m, pixels on every side that belong to no cell.
    coarse : (M, N) uint16 array, optional
        From `coarser.coarse_symbols`, without the margin.
    """
    found = Model()
    _count(symbols, grey, cells, margin, found.texture, found.greys)
    if coarse is not None:
        _count_coarse(coarse, cells, found.coarse)
    return found


def smallest_count(side: int) -> int:
    """How many pixels of a window of `side` cells must be counted, that it has a score: seven eighths."""
    return (side * CELL) ** 2 * _FULL_SHARE[0] // _FULL_SHARE[1]


def window_scores(
    symbols: NDArray[np.uint16],
    grey: NDArray[np.uint16],
    model: Model,
    side: int,
    bounds: Bounds = Bounds(),
    left_out: bool = False,
) -> NDArray[np.uint16]:
    """The score of every window: G against a model beyond chance, for each of its counted pixels.

    Parameters
    ----------
    symbols, grey : (M, N) uint16 arrays
        From `texture.symbols`, and the grey of the same pixels; M and N are multiples of 8.
    model : Model
    side : int
        Of a window, in cells.
    bounds : Bounds
        Of the mean grey of a window's counted pixels.
    left_out : bool
        Whether each window is compared with the rest of the model instead: it must be a part of it.

    Returns
    -------
    scores : (M / 8 - side + 1, N / 8 - side + 1) uint16 array
        Of the window that begins at each cell: (G - chance) / pixels in parts of 1 / 2048, rounded down, and
        `EVEN` more. 65534 where the mean is out of bounds, 65535 where less than seven eighths of the window
        are counted.
    """
    rows, cols = (length // CELL - side + 1 for length in symbols.shape)
    scores = np.full((max(rows, 0), max(cols, 0)), UNKNOWN, np.uint16)
    if scores.size and model.count:
        above, below, whole = _tables(model, (CELL * side) ** 2, left_out)
        _slide(
            symbols,
            grey,
            side,
            model.texture,
            above,
            below,
            whole,
            left_out,
            smallest_count(side),
            bounds.low,
            bounds.high,
            np.zeros(SYMBOLS, np.int64),
            scores,
        )
    return scores


def best_scores(scores: NDArray[T], side: int) -> NDArray[T]:
    """For each cell the lowest score of the windows that it lies in.

    Near a boundary, most windows around a cell lie on both sides of it, but some on its own side alone (as in
    Kuwahara's filter): so the lowest is that of a window on the sample's side, if the cell is there too.

    Parameters
    ----------
    scores : (m + side - 1, n + side - 1) array of integers
        Of the windows that begin up to ``side - 1`` cells before the first cell.
    side : int

    Returns
    -------
    best : (m, n) array
    """
    best = scores
    for axis in (0, 1):
        length = best.shape[axis] - side + 1
        best = np.minimum.reduce([best.take(range(k, k + length), axis) for k in range(side)])
    return best


def _tables(
    model: Model, largest: int, left_out: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """What windows of up to `largest` pixels are scored by, in fixed point; all of it is half of G.

    Returns
    -------
    above, below : int64 arrays
        What one more pixel of a symbol adds, by the pixels of it in both histograms, and in the window; see
        `gain`.
    whole : (largest + 1,) int64 array
        J(N, n) of windows of n counted pixels, less what chance makes of it before a window has any.
    """
    total = model.count
    n = np.arange(largest + 1)
    rest = np.maximum(total - n, 0) if left_out else np.full_like(n, total)
    most = int(model.texture.max()) + (0 if left_out else largest + 1)
    share = min(largest / total, 0.5) if left_out else largest / (total + largest)
    by_chance = _fixed(chance(most, share) / 2)
    above: NDArray[np.int64] = np.diff(_fixed(x_ln_x(np.arange(most + 1))))
    if not left_out:  # else the pixels of both are those of the model, whatever the window
        above += np.diff(by_chance)
    below = np.diff(_fixed(x_ln_x(np.arange(largest + 2))))
    whole = _fixed(x_ln_x(rest + n)) - _fixed(x_ln_x(rest)) - _fixed(x_ln_x(n))
    return above, below, whole - by_chance[model.texture].sum()


def _fixed(values: NDArray[np.float64]) -> NDArray[np.int64]:
    fixed: NDArray[np.int64] = np.rint(values * _FINE).astype(np.int64)
    return fixed


@inlined
def gain(frequency, count, above, below, left_out):  # type: ignore[no-untyped-def]
    """What one more pixel of a symbol adds to J(f, n) = (f + n) ln (f + n) - f ln f - n ln n, and to chance.

    `count` pixels of the symbol are in the window; those of the model that are not are all `frequency`, or
    (left_out) what the window leaves of them.
    """
    other = frequency - count - 1 if left_out else frequency + count
    return above[other] - below[count]


@kernel(
    "void(u2[:,::1], u2[:,::1], i8, i8[::1], i8[::1], i8[::1], i8[::1], b1, i8, i8, i8, i8[::1], u2[:,::1])",
)
def _slide(  # type: ignore[no-untyped-def]
    symbols, grey, side, model, above, below, whole, left_out, least, low, high, table, scores
):
    # One row of windows after the other, from left to right: a column of cells enters, another one leaves.
    rows, cols = scores.shape
    for row in range(rows):
        shared = np.int64(0)
        counted = np.int64(0)
        light = np.int64(0)
        for entering in range(cols + 2 * side - 1):
            for r in range(8 * row, 8 * (row + side)):
                if entering < cols + side - 1:
                    for c in range(8 * entering, 8 * entering + 8):
                        name = symbols[r, c]
                        if name != UNCOUNTED:
                            shared += gain(model[name], table[name], above, below, left_out)
                            table[name] += 1
                            counted += 1
                            light += np.int64(grey[r, c])
                if entering >= side:
                    for c in range(8 * (entering - side), 8 * (entering - side) + 8):
                        name = symbols[r, c]
                        if name != UNCOUNTED:
                            table[name] -= 1
                            shared -= gain(model[name], table[name], above, below, left_out)
                            counted -= 1
                            light -= np.int64(grey[r, c])
            first = entering - side + 1
            if first < 0 or first >= cols or counted < least:
                continue
            if light < low * counted or light > high * counted:
                scores[row, first] = UNLIKE
            else:
                score = EVEN + (whole[counted] - shared) // (256 * counted)  # 2 * UNITS / _FINE = 1 / 256
                scores[row, first] = min(max(score, np.int64(0)), np.int64(UNLIKE))


@kernel("void(u2[:,::1], u2[:,::1], u1[:,::1], i8, i8[::1], i8[::1])")
def _count(symbols, grey, cells, margin, texture, greys):  # type: ignore[no-untyped-def]
    for r in range(8 * cells.shape[0]):
        for cell in range(cells.shape[1]):
            if cells[r // 8, cell]:
                for c in range(margin + 8 * cell, margin + 8 * cell + 8):
                    name = symbols[margin + r, c]
                    if name != UNCOUNTED:
                        texture[name] += 1
                        greys[grey[margin + r, c] >> 10] += 1


@kernel("void(u2[:,::1], u1[:,::1], i8[::1])")
def _count_coarse(coarse, cells, found):  # type: ignore[no-untyped-def]
    for r in range(8 * cells.shape[0]):
        for cell in range(cells.shape[1]):
            if cells[r // 8, cell]:
                for c in range(8 * cell, 8 * cell + 8):
                    if coarse[r, c] != UNCOUNTED:
                        found[coarse[r, c]] += 1
