"""Uncertainty sampling: the cells whose mean similarity over a disc lies nearest to one half.

D. Lewis and W. Gale, A sequential algorithm for training text classifiers, SIGIR 1994.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from uavseg.units import CELL, GREY_MAX

_STRIP = 1 << 20  # cells that are scored at a time, in whole rows
_FORBIDDEN = -(1 << 40)  # score of a cell that no disc may touch: no disc can outweigh it
_FULL = CELL * CELL  # pixels of a cell
_CERTAIN = _FULL * GREY_MAX  # sum of a cell whose similarity is 1


def half_widths(radius: float) -> NDArray[np.int64]:
    """Return how far a disc around the middle of a cell reaches in each row of cells, from -k to k.

    The radius is in pixels, the (2 k + 1,) half-widths in cells.

    Examples
    --------
    >>> half_widths(8), half_widths(16)
    (array([1, 1, 1]), array([1, 2, 2, 2, 1]))
    """
    reach = int(np.ceil((radius - CELL / 2) / CELL))
    gaps = np.maximum(np.abs(np.arange(-reach, reach + 1)) * CELL - CELL / 2, 0)
    widths = np.ceil((np.sqrt(np.maximum(radius**2 - gaps**2, 0)) - CELL / 2) / CELL)
    return np.asarray(np.maximum(widths, 0).astype(np.int64))


def most_uncertain_cells(
    sums: NDArray[np.uint32],
    counts: NDArray[np.uint8],
    taken: NDArray[np.bool_],
    radius: float,
    count: int,
    minimum: float,
) -> NDArray[np.int64]:
    """Return the cells around which a disc of valid pixels is most uncertain, in descending order: (k, 2).

    The uncertainty of a cell is 1 where its mean similarity is one half, and 0 where that is 0 or 1; that of
    a disc is `minimum`, 0 to 1, or more. Sums and counts are of the similarity, as in a block map. No disc,
    whose radius is in pixels, may touch the cells `taken`. `count` is the maximum number; of equal ones the
    first by row and column.
    """
    widths = half_widths(radius)
    limit = int(np.ceil(minimum * _CERTAIN * int((2 * widths + 1).sum())))
    scores, cells = np.empty(0, np.int64), np.empty((0, 2), np.int64)
    for top, strip in _strips(sums, counts, taken, widths):
        places = np.flatnonzero(strip >= limit)
        if len(places) > count:
            at_places = strip.ravel()[places]
            places = places[at_places >= np.partition(at_places, -count)[-count]]
        rows, cols = np.divmod(places, strip.shape[1])
        scores = np.concatenate([scores, strip.ravel()[places]])
        cells = np.concatenate([cells, np.stack([rows + top, cols], 1)])
        best = np.argsort(-scores, kind="stable")[:count]
        scores, cells = scores[best], cells[best]
    return cells


def _strips(
    sums: NDArray[np.uint32], counts: NDArray[np.uint8], taken: NDArray[np.bool_], widths: NDArray[np.int64]
) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Yield the first row of each strip, and the score of a disc around each of its cells."""
    reach, side = len(widths) // 2, int(widths.max())
    rows, cols = sums.shape
    step = max(_STRIP // cols, 1)
    for top in range(0, rows, step):
        first, end = max(top - reach, 0), min(top + step + reach, rows)
        height = min(step, rows - top)
        around = np.full((height + 2 * reach, cols + 2 * side), _FORBIDDEN, np.int64)
        part = np.s_[first:end]
        inner = around[first - top + reach : end - top + reach, side : side + cols]
        inner[:] = _CERTAIN - np.abs(2 * sums[part].astype(np.int64) - _CERTAIN)
        inner[(counts[part] != _FULL) | taken[part]] = _FORBIDDEN
        yield top, _disc_sums(around, widths)


def _disc_sums(around: NDArray[np.int64], widths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sum over the cells that a disc touches, around each cell that is not in the margin."""
    reach, side = len(widths) // 2, int(widths.max())
    rows, cols = around.shape[0] - 2 * reach, around.shape[1] - 2 * side
    along = np.zeros((around.shape[0], around.shape[1] + 1), np.int64)
    np.cumsum(around, axis=1, out=along[:, 1:])
    total = np.zeros((rows, cols), np.int64)
    for row, width in enumerate(widths.tolist()):
        line = along[row : row + rows]
        total += line[:, side + width + 1 : side + width + 1 + cols]
        total -= line[:, side - width : side - width + cols]
    return total
