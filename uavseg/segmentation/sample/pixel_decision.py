"""Which side a pixel joins: that of the texture which the pixels around it are likelier to come from.

After the pixelwise step of Ojala and Pietikäinen (1999), who compare the histogram around a pixel with a
model of either side by G. Where the models are much larger than what lies around a pixel, the difference of
the two G is twice the logarithm of the likelihood ratio, which is a sum over pixels: one weight a pixel.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.g_scores import TextureModel

DECISION_HALO = 16  # pixels: an image cut with this much around it is decided as the whole would be
WINDOW_RADIUS = 6  # pixels on every side of a pixel that decide with it

_WEIGHT_UNITS = 1024  # fixed point of a logarithm


@dataclass(frozen=True)
class PixelWeights:
    """ln of how much likelier one side is than the other, in parts of 1 / 1024.

    Parameters
    ----------
    texture : (2048,) int64 array
        By symbol.
    greys : (64,) int64 array
        By grey, as the bins of a `Model`.
    coarse : (2048,) int64 array
        By symbol of means of 2 x 2 pixels.
    """

    texture: NDArray[np.int64]
    greys: NDArray[np.int64]
    coarse: NDArray[np.int64] = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))

    @classmethod
    def between(cls, one: TextureModel, other: TextureModel, by_grey: bool = True) -> "PixelWeights":
        """Weights above 0 for what speaks for `one`.

        Parameters
        ----------
        one, other : Model
        by_grey : bool
            Whether grey speaks, too.
        """
        greys = _log_ratio(one.greys, other.greys)
        coarse = _log_ratio(one.coarse, other.coarse) // 2  # means that share pixels say less
        return cls(_log_ratio(one.texture, other.texture), greys if by_grey else np.zeros_like(greys), coarse)


def _log_ratio(one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """ln of the ratio of two probabilities, each after Krichevsky and Trofimov: half a count more."""
    first, second = ((counts + 0.5) / (counts.sum() + 0.5 * len(counts)) for counts in (one, other))
    weights: NDArray[np.int64] = np.rint(np.log(first / second) * _WEIGHT_UNITS).astype(np.int64)
    return weights


def classify_pixels(
    cells: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    symbols: NDArray[np.uint16],
    coarse: NDArray[np.uint16],
    weights: PixelWeights,
) -> NDArray[np.uint8]:
    """Pixels of cells that are in, and of those that are open where the 13 x 13 pixels around weigh above 0.

    Parameters
    ----------
    cells : (M / 8, N / 8) uint8 array
        0 out, 1 in, 2 open.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array
    symbols : (M - 2, N - 2) uint16 array
        From `texture.symbols`: without a border of one pixel, which weighs nothing.
    coarse : (M - 6, N - 6) uint16 array
        From `coarser.coarse_symbols`: without a border of three pixels.
    weights : Weights

    Returns
    -------
    inside : (M, N) uint8 array, 1 in; 0 where a pixel is not valid
    """
    inside = np.zeros_like(valid)
    columns = np.zeros(valid.shape[1], np.int64)
    around = np.pad(coarse, 2, constant_values=UNCOUNTED)  # the border is that of the symbols
    tables = (weights.texture, weights.greys, weights.coarse)
    _classify_pixels(cells, valid, grey, symbols, around, *tables, WINDOW_RADIUS, columns, inside)
    return inside


def undecided_cells(matched: NDArray[np.bool_], others: NDArray[np.bool_], reach: int) -> NDArray[np.uint8]:
    """Cells with those near a boundary left open.

    Parameters
    ----------
    matched, others : (m, n) bool arrays
        The cells on one side, and on the other; some may be on neither.
    reach : int
        A cell is open where both sides have cells within so many of it (in a square).

    Returns
    -------
    cells : (m, n) uint8 array
        0 out, 1 in, 2 open.
    """
    near = spread(matched, reach) & spread(others, reach)
    cells: NDArray[np.uint8] = np.where(near, np.uint8(2), matched.view(np.uint8))
    return cells


def spread(cells: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Cells with those within so many of them, in a square."""
    spread = cells
    for axis in (0, 1):
        own = np.moveaxis(spread, axis, 0)
        wide = own.copy()
        for k in range(1, reach + 1):
            wide[k:] |= own[:-k]
            wide[:-k] |= own[k:]
        spread = np.moveaxis(wide, 0, axis)
    return spread


@inlined
def pixel_weight(symbols, above, grey, valid, r, c, texture, greys, coarse):  # type: ignore[no-untyped-def]
    """What a pixel says; 0 where it is not valid."""
    if valid[r, c] == 0:
        return np.int64(0)
    name = symbols[r - 1, c - 1]
    mean = above[r - 1, c - 1]
    weight = greys[grey[r, c] >> 10] + (texture[name] if name != UNCOUNTED else np.int64(0))
    return weight + (coarse[mean] if mean != UNCOUNTED else np.int64(0))


@kernel(
    "void(u1[:,::1], u1[:,::1], u2[:,::1], u2[:,::1], u2[:,::1], "
    "i8[::1], i8[::1], i8[::1], i8, i8[::1], u1[:,::1])",
)
def _classify_pixels(  # type: ignore[no-untyped-def]
    cells, valid, grey, symbols, above, texture, greys, coarse, around, columns, inside
):
    rows, cols = valid.shape
    for ahead in range(1, rows + around):  # the row that enters the sums of columns
        if ahead < rows - 1:
            for c in range(1, cols - 1):
                columns[c] += pixel_weight(symbols, above, grey, valid, ahead, c, texture, greys, coarse)
        behind = ahead - 2 * around - 1
        if behind >= 1:
            for c in range(1, cols - 1):
                columns[c] -= pixel_weight(symbols, above, grey, valid, behind, c, texture, greys, coarse)
        r = ahead - around
        if r < 0:
            continue
        total = np.int64(0)
        for c in range(min(around, cols)):
            total += columns[c]
        for c in range(cols):
            if c + around < cols:
                total += columns[c + around]
            if c - around - 1 >= 0:
                total -= columns[c - around - 1]
            side = cells[r // 8, c // 8]
            if valid[r, c] and (side == 1 or (side == 2 and total > 0)):
                inside[r, c] = 1
