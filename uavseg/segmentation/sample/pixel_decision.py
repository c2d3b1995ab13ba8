"""Per-pixel two-class likelihood-ratio classification by texture and grey.

After the pixelwise step of Ojala and Pietikäinen (1999), who compare the histogram around a pixel with a
model of either side by G. Where the models are much larger than the window around a pixel, the difference of
the two G is twice the log-likelihood ratio, which is a sum of one weight per pixel.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.g_scores import TextureModel

DECISION_HALO = 16  # pixels: a tile with this halo is classified exactly as the whole image
WINDOW_RADIUS = 6  # pixels on every side of a pixel in its window

_WEIGHT_UNITS = 1024  # units of a weight for a natural logarithm of 1


@dataclass(frozen=True)
class PixelWeights:
    """Log-likelihood ratio of one side to the other, in units of 1 / 1024.

    Parameters
    ----------
    texture : (2048,) int64 array
        By symbol.
    greys : (64,) int64 array
        By grey, in the bins of a `TextureModel`.
    coarse : (2048,) int64 array
        By symbol of means of 2 x 2 pixels.
    """

    texture: NDArray[np.int64]
    greys: NDArray[np.int64]
    coarse: NDArray[np.int64] = field(default_factory=lambda: np.zeros(SYMBOLS, np.int64))

    @classmethod
    def between(cls, one: TextureModel, other: TextureModel, by_grey: bool = True) -> "PixelWeights":
        """Weights of two models: positive where `one` is more likely.

        Parameters
        ----------
        one, other : Model
        by_grey : bool
            Whether grey is used in addition to texture.
        """
        greys = log_ratio(one.greys, other.greys)
        coarse = log_ratio(one.coarse, other.coarse) // 2  # means that share pixels are not independent
        return cls(log_ratio(one.texture, other.texture), greys if by_grey else np.zeros_like(greys), coarse)


def log_ratio(one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """Log ratio of two probabilities in units of 1 / 1024.

    Each is the Krichevsky-Trofimov estimate from counts: half a count is added.
    """
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
    """Pixels of cells that are inside, and of undecided cells where the 13 x 13 window has a positive weight.

    Parameters
    ----------
    cells : (M / 8, N / 8) uint8 array
        0 outside, 1 inside, 2 undecided.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array
    symbols : (M - 2, N - 2) uint16 array
        From `lbp_symbols`: without a border of one pixel, which has no weight.
    coarse : (M - 6, N - 6) uint16 array
        From `coarse_symbols`: without a border of three pixels.
    weights : Weights

    Returns
    -------
    inside : (M, N) uint8 array, 1 inside; 0 where a pixel is not valid
    """
    inside = np.zeros_like(valid)
    columns = np.zeros(valid.shape[1], np.int64)
    padded = np.pad(coarse, 2, constant_values=UNCOUNTED)  # the border is that of the symbols
    tables = (weights.texture, weights.greys, weights.coarse)
    _classify_pixels(cells, valid, grey, symbols, padded, *tables, WINDOW_RADIUS, columns, inside)
    return inside


def undecided_cells(matched: NDArray[np.bool_], others: NDArray[np.bool_], reach: int) -> NDArray[np.uint8]:
    """Classes of cells, with those near a boundary undecided.

    Parameters
    ----------
    matched, others : (m, n) bool arrays
        The cells of one side, and of the other; a cell may belong to neither.
    reach : int
        A cell is undecided where both sides have cells within this distance (in a square).

    Returns
    -------
    cells : (m, n) uint8 array
        0 outside, 1 inside, 2 undecided.
    """
    near = dilate(matched, reach) & dilate(others, reach)
    cells: NDArray[np.uint8] = np.where(near, np.uint8(2), matched.view(np.uint8))
    return cells


@inlined
def pixel_weight(symbols, coarse_symbols, grey, valid, r, c, texture, greys, coarse):  # type: ignore[no-untyped-def]
    """Weight of a pixel; 0 where it is not valid."""
    if valid[r, c] == 0:
        return np.int64(0)
    symbol = symbols[r - 1, c - 1]
    coarse_symbol = coarse_symbols[r - 1, c - 1]
    weight = greys[grey[r, c] >> 10] + (texture[symbol] if symbol != UNCOUNTED else np.int64(0))
    return weight + (coarse[coarse_symbol] if coarse_symbol != UNCOUNTED else np.int64(0))


@kernel(
    "void(u1[:,::1], u1[:,::1], u2[:,::1], u2[:,::1], u2[:,::1], "
    "i8[::1], i8[::1], i8[::1], i8, i8[::1], u1[:,::1])",
)
def _classify_pixels(  # type: ignore[no-untyped-def]
    cells, valid, grey, symbols, coarse_symbols, texture, greys, coarse, radius, columns, inside
):
    rows, cols = valid.shape
    for entering in range(1, rows + radius):  # the row that enters the column sums
        if entering < rows - 1:
            for c in range(1, cols - 1):
                columns[c] += pixel_weight(
                    symbols, coarse_symbols, grey, valid, entering, c, texture, greys, coarse
                )
        leaving = entering - 2 * radius - 1
        if leaving >= 1:
            for c in range(1, cols - 1):
                columns[c] -= pixel_weight(
                    symbols, coarse_symbols, grey, valid, leaving, c, texture, greys, coarse
                )
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
