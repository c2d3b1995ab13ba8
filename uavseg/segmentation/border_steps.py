"""Contrast of components across their borders: grey differences of the neighbouring pixels on both sides."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.components import WORD, view_as_words


def border_steps(
    image: NDArray[Any],
    labels: NDArray[np.uint32],
    count: int,
    grey: NDArray[np.uint16],
    valid: NDArray[np.uint8],
) -> NDArray[np.int64]:
    """Sums of the differences of grey across the pixel edges along the borders of components.

    Edges along the border of a tile count where the margin holds a pixel of another value, so the sums of
    tiles add up to those of the raster.

    Parameters
    ----------
    image : (M + 2 m, N + 2 m) uint8 or uint32 array
        Adjacent pixels of equal value, not 0, belong together.
    labels : (M, N) uint32 array
        Their components 1..count, without the margin.
    count : int
    grey : (M + 2 m, N + 2 m) uint16 array
    valid : (M + 2 m, N + 2 m) uint8 array
        Edges to an invalid pixel do not count.

    Returns
    -------
    steps : (count, 2) int64 array
        Of each component the sum of absolute differences of grey, and the number of edges.

    Examples
    --------
    >>> image = np.array([[0, 1, 1, 0]], np.uint8)
    >>> grey = np.array([[10, 50, 60, 90]], np.uint16)
    >>> border_steps(image, image.astype(np.uint32), 1, grey, np.ones_like(image)).tolist()
    [[70, 2]]
    """
    steps = np.zeros((count, 2), np.int64)
    margin = (image.shape[0] - labels.shape[0]) // 2
    if image.dtype != np.uint8:
        _steps_u4(image, np.empty((0, 0), np.uint64), margin, labels, grey, valid, steps)
        return steps
    words = view_as_words(image) if margin > 0 and margin % WORD == 0 else np.empty((0, 0), np.uint64)
    _steps_u1(image, words, margin, labels, grey, valid, steps)
    return steps


@inlined
def _add_step(steps, labels, margin, step, row, col):  # type: ignore[no-untyped-def]
    """Add a difference to the component of a pixel, if the tile has it."""
    r = row - margin
    c = col - margin
    if 0 <= r < labels.shape[0] and 0 <= c < labels.shape[1]:
        owner = np.int64(labels[r, c]) - 1
        steps[owner, 0] += step
        steps[owner, 1] += 1


@inlined
def _add_edge(image, grey, valid, labels, margin, steps, row, col, down):  # type: ignore[no-untyped-def]
    """Add the difference of a pixel to the one above it, or to its left, across a border."""
    row_before = row - down
    col_before = col - (1 - down)
    value = image[row, col]
    before = image[row_before, col_before]
    if value != before and valid[row, col] != 0 and valid[row_before, col_before] != 0:
        step = abs(np.int64(grey[row, col]) - np.int64(grey[row_before, col_before]))
        if value != 0:
            _add_step(steps, labels, margin, step, row, col)
        if before != 0:
            _add_step(steps, labels, margin, step, row_before, col_before)


def _sum_steps(image, words, margin, labels, grey, valid, steps):  # type: ignore[no-untyped-def]
    # Where eight pixels equal those before them, there is no border; words is empty if it cannot be used.
    rows, cols = labels.shape
    ones = np.uint64(0x0101010101010101)
    for row in range(margin, margin + rows + 1):
        if row >= image.shape[0]:
            break
        for part in range((cols + 8) >> 3):
            first = margin + 8 * part
            across = row < margin + rows
            down = row > 0
            if words.shape[0] > 0 and part < cols >> 3:
                word = words[row, first >> 3]
                down = down and word != words[row - 1, first >> 3]
                uniform = word == (word & np.uint64(255)) * ones
                across = across and not (uniform and word == words[row, (first >> 3) - 1])
            if not (across or down):
                continue
            for col in range(first, min(first + 8, margin + cols + 1, image.shape[1])):
                if down and col < margin + cols:
                    _add_edge(image, grey, valid, labels, margin, steps, row, col, 1)
                if across and col > 0:
                    _add_edge(image, grey, valid, labels, margin, steps, row, col, 0)


_SIGNATURE = "void({}[:,::1], u8[:,::1], i8, u4[:,::1], u2[:,::1], u1[:,::1], i8[:,::1])"
_steps_u1 = kernel(_SIGNATURE.format("u1"))(_sum_steps)
_steps_u4 = kernel(_SIGNATURE.format("u4"))(_sum_steps)
