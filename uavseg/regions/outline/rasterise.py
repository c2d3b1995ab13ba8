"""Rings back to labels, window by window."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.raster.tiling import Window
from uavseg.regions.outline.rings import Rings

LONGEST = 256  # rows: upright edges are cut to this, so that those of a window are found at once
_COLUMN_0 = np.array([1, 1, 0], np.int32)


def rasterise(rings: Rings, window: Window) -> NDArray[np.uint32]:
    """The label image that rings enclose: `trace` undone.

    Parameters
    ----------
    rings : Rings
    window : Window
        Which part of the raster.

    Returns
    -------
    labels : (rows, cols) uint32 array
    """
    return Painter(rings)(window)


@dataclass(frozen=True, slots=True)
class Sketch:
    """All that is needed to paint the labels of a window.

    Parameters
    ----------
    window : Window
    first : (rows,) uint32 array
        Labels of the first column.
    edges : (e, 3) int32 array
        Upright edges right of it, in pixels of the window: the row of the upper end, of the lower end, and
        the column.
    steps : (e,) uint32 array
        What is added to the label, modulo 2^32, where a row crosses the edge to the right.
    """

    window: Window
    first: NDArray[np.uint32]
    edges: NDArray[np.int32]
    steps: NDArray[np.uint32]

    def paint(self) -> NDArray[np.uint32]:
        """The labels, (rows, cols) uint32."""
        labels = np.zeros((self.window.rows, self.window.cols), np.uint32)
        labels[:, 0] = self.first
        _paint(self.edges, self.steps, labels)
        return np.cumsum(labels, axis=1, dtype=np.uint32, out=labels)


class Sketches(Sequence[Sketch]):
    """A sketch of each window, made when it is asked for: who paints gets no more than that needs."""

    def __init__(self, rings: Rings, windows: Sequence[Window]) -> None:
        self._painter = Painter(rings)
        self._windows = windows

    def __len__(self) -> int:
        return len(self._windows)

    def __getitem__(self, k: Any) -> Any:
        return self._painter.sketch(self._windows[k])


@dataclass(frozen=True, slots=True)
class Canvas:
    """A label image that is painted when rows of it are looked at.

    Parameters
    ----------
    painter : Painter
    shape : (int, int)
        Rows and columns of the raster.
    """

    painter: "Painter"
    shape: tuple[int, int]

    def __getitem__(self, rows: slice) -> NDArray[np.uint32]:
        """The labels of some rows, (rows, cols) uint32."""
        start, stop, _ = rows.indices(self.shape[0])
        return self.painter(Window(start, 0, stop - start, self.shape[1]))


class Painter:
    """Paints label images from rings, window by window.

    Along a row a label begins at an edge that goes up and ends at one that goes down; the sum of what begins
    and ends, modulo 2^32, is the label. So the upright edges are all that is needed, sorted by their upper
    ends. Long ones are cut, so that those of a window lie close together.
    """

    def __init__(self, rings: Rings) -> None:
        rows, cols = rings.vertices[:, 0], rings.vertices[:, 1]
        after = np.arange(1, len(rows) + 1)
        after[rings.starts[1:] - 1] = rings.starts[:-1]
        upright = np.flatnonzero(cols == cols[after])
        upper = np.minimum(rows[upright], rows[after[upright]])
        lower = np.maximum(rows[upright], rows[after[upright]])
        upright, upper, lower = _cut(upright, upper, lower)
        order = np.argsort(upper, kind="stable")
        upright, self._upper, self._lower = upright[order], upper[order], lower[order]
        self._cols = cols[upright]
        ring = np.searchsorted(rings.starts, upright, "right") - 1
        label = rings.labels[ring].astype(np.uint32)
        self._steps = np.where(rows[after[upright]] < rows[upright], label, -label)

    def __call__(self, window: Window) -> NDArray[np.uint32]:
        """The labels of a window, (rows, cols) uint32."""
        return self.sketch(window).paint()

    def sketch(self, window: Window) -> Sketch:
        """What is needed to paint a window."""
        near, end = np.searchsorted(self._upper, (window.row - LONGEST, window.row + window.rows))
        cols = self._cols[near:end]
        crossing = (self._lower[near:end] > window.row) & (cols < window.col + window.cols)
        inside = np.flatnonzero(crossing & (cols > window.col)) + near
        left = np.flatnonzero(crossing & (cols <= window.col)) + near
        first = np.zeros((window.rows, 1), np.uint32)
        _paint(self._edges(left, window) * _COLUMN_0, self._steps[left], first)
        return Sketch(window, first[:, 0], self._edges(inside, window), self._steps[inside])

    def _edges(self, which: NDArray[np.int64], window: Window) -> NDArray[np.int32]:
        """Edges in pixels of a window, cut at its upper and lower end."""
        upper = np.maximum(self._upper[which] - np.int32(window.row), np.int32(0))
        lower = np.minimum(self._lower[which] - np.int32(window.row), np.int32(window.rows))
        return np.stack([upper, lower, self._cols[which] - np.int32(window.col)], 1)


def _cut(
    names: NDArray[np.int64], upper: NDArray[np.int32], lower: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int32]]:
    """Upright edges with none longer than LONGEST."""
    counts = np.maximum(-(-(lower - upper) // LONGEST), 1)
    which = np.repeat(np.arange(len(names)), counts)
    place = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    begin = (upper[which] + place * LONGEST).astype(np.int32)
    return names[which], begin, np.minimum(begin + np.int32(LONGEST), lower[which])


@kernel("void(i4[:,::1], u4[::1], u4[:,::1])")
def _paint(edges, steps, labels):  # type: ignore[no-untyped-def]
    for k in range(steps.shape[0]):
        col = edges[k, 2]
        for r in range(edges[k, 0], edges[k, 1]):
            labels[r, col] += steps[k]
