"""Rasterise region outlines: scan-line fill of rings into label images, window by window."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.dataclass import dataclass
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import Rings

MAX_EDGE_ROWS = 256  # longer vertical edges are split, so that one binary search finds those of a window
_COLUMN_0 = np.array([1, 1, 0], np.int32)


def rasterise(rings: Rings, window: Window) -> NDArray[np.uint32]:
    """Rasterise the regions in a window to a label image, (rows, cols) uint32; the inverse of `trace`."""
    return Rasteriser(rings)(window)


def edge_tables(rings: Rings, windows: Sequence[Window]) -> "LazySequence[EdgeTable]":
    """Return the edge table of each window, made when it is indexed: workers get only what they need."""
    return LazySequence(len(windows), partial(_edge_table_of, Rasteriser(rings), windows))


def _edge_table_of(rasteriser: "Rasteriser", windows: Sequence[Window], k: int) -> "EdgeTable":
    return rasteriser.edge_table(windows[k])


@dataclass(frozen=True, slots=True)
class EdgeTable:
    """Edge table of one window for scan-line fill: all that is needed to rasterise its labels.

    Where a row crosses an edge from left to right, its step is added to the label, modulo 2^32.
    """

    window: Window
    first: NDArray[np.uint32]  # (rows,): labels of the first column
    edges: NDArray[np.int32]  # (e, 3): vertical edges to the right of it: first row, end row, column
    steps: NDArray[np.uint32]  # (e,)

    def rasterise(self) -> NDArray[np.uint32]:
        """Return the labels of the window, (rows, cols) uint32."""
        labels = np.zeros((self.window.rows, self.window.cols), np.uint32)
        labels[:, 0] = self.first
        _add_steps(self.edges, self.steps, labels)
        return np.cumsum(labels, axis=1, dtype=np.uint32, out=labels)


@dataclass(frozen=True, slots=True)
class LazyLabels:
    """Label image whose rows are rasterised when they are indexed.

    `shape` is that of the raster; `numbers`, (n + 1,), replace the labels, if given.
    """

    rasteriser: "Rasteriser"
    shape: tuple[int, int]
    numbers: NDArray[np.uint32] | None = None

    def __getitem__(self, rows: slice) -> NDArray[np.uint32]:
        """Return the labels of some rows, (rows, cols) uint32."""
        start, stop, _ = rows.indices(self.shape[0])
        labels = self.rasteriser(Window(start, 0, stop - start, self.shape[1]))
        return labels if self.numbers is None else self.numbers[labels]


class Rasteriser:
    """Scan-line rasteriser of rings, window by window.

    Along a row a label starts at an edge that runs up and ends at one that runs down; the running sum of
    these steps, modulo 2^32, is the label. So only the vertical edges are needed, sorted by their upper ends.
    Long edges are split, so that those of a window are neighbours in that order.
    """

    def __init__(self, rings: Rings) -> None:
        vertices, starts = np.ascontiguousarray(rings.vertices), rings.starts
        counts = np.zeros(int(vertices[:, 0].max(initial=0)) + 2, np.int64)
        _count_edges(vertices, starts, counts)
        ends = np.cumsum(counts)
        self._upper, self._lower, self._cols = (np.empty(int(ends[-1]), np.int32) for _ in range(3))
        self._steps = np.empty(int(ends[-1]), np.uint32)
        edges = self._upper, self._lower, self._cols, self._steps
        _sort_edges(vertices, starts, rings.labels, ends, *edges)

    def __call__(self, window: Window) -> NDArray[np.uint32]:
        """Return the labels of a window, (rows, cols) uint32."""
        return self.edge_table(window).rasterise()

    def edge_table(self, window: Window) -> EdgeTable:
        """Return the vertical edges that a window needs."""
        begin, end = np.searchsorted(self._upper, (window.row - MAX_EDGE_ROWS, window.row + window.rows))
        cols = self._cols[begin:end]
        crossing = (self._lower[begin:end] > window.row) & (cols < window.col + window.cols)
        inside = np.flatnonzero(crossing & (cols > window.col)) + begin
        left = np.flatnonzero(crossing & (cols <= window.col)) + begin
        first = np.zeros((window.rows, 1), np.uint32)
        _add_steps(self._edges(left, window) * _COLUMN_0, self._steps[left], first)
        return EdgeTable(window, first[:, 0], self._edges(inside, window), self._steps[inside])

    def _edges(self, which: NDArray[np.int64], window: Window) -> NDArray[np.int32]:
        """Return edges in pixels of a window, clipped to its rows."""
        upper = np.maximum(self._upper[which] - np.int32(window.row), np.int32(0))
        lower = np.minimum(self._lower[which] - np.int32(window.row), np.int32(window.rows))
        return np.stack([upper, lower, self._cols[which] - np.int32(window.col)], 1)


@kernel("void(i4[:,::1], i8[::1], i8[::1])")
def _count_edges(vertices, starts, counts):  # type: ignore[no-untyped-def]
    # Number of pieces of vertical edges that begin in the row before each: first step of a counting sort.
    for ring in range(starts.shape[0] - 1):
        for v in range(starts[ring], starts[ring + 1]):
            after = v + 1 if v + 1 < starts[ring + 1] else starts[ring]
            if vertices[v, 1] == vertices[after, 1]:
                end = max(vertices[v, 0], vertices[after, 0])
                for row in range(min(vertices[v, 0], vertices[after, 0]), end, MAX_EDGE_ROWS):
                    counts[row + 1] += 1


@kernel("void(i4[:,::1], i8[::1], i8[::1], i8[::1], i4[::1], i4[::1], i4[::1], u4[::1])")
def _sort_edges(vertices, starts, labels, ends, upper, lower, cols, steps):  # type: ignore[no-untyped-def]
    for ring in range(starts.shape[0] - 1):
        label = np.uint32(labels[ring])
        for v in range(starts[ring], starts[ring + 1]):
            after = v + 1 if v + 1 < starts[ring + 1] else starts[ring]
            if vertices[v, 1] == vertices[after, 1]:
                end = max(vertices[v, 0], vertices[after, 0])
                for row in range(min(vertices[v, 0], vertices[after, 0]), end, MAX_EDGE_ROWS):
                    at = ends[row]
                    ends[row] += 1
                    upper[at] = row
                    lower[at] = min(row + MAX_EDGE_ROWS, end)
                    cols[at] = vertices[v, 1]
                    steps[at] = label if vertices[after, 0] < vertices[v, 0] else np.uint32(0) - label


@kernel("void(i4[:,::1], u4[::1], u4[:,::1])")
def _add_steps(edges, steps, labels):  # type: ignore[no-untyped-def]
    for k in range(steps.shape[0]):
        col = edges[k, 2]
        for r in range(edges[k, 0], edges[k, 1]):
            labels[r, col] += steps[k]
