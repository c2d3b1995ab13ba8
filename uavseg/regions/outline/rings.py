"""Rings: outlines of numbered regions on pixel corners, with their pixel sums; scan-line rasteriser."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.dataclass import dataclass
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import Window
from uavseg.segmentation.components import Sums

MAX_EDGE_ROWS = 256  # longer vertical edges are split, so that one binary search finds those of a window
_COLUMN_0 = np.array([1, 1, 0], np.int32)


@dataclass(frozen=True, slots=True)
class Rings:
    """Outlines of regions: simple closed rings along pixel edges.

    Rings are ordered by label; within a label each exterior, ordered by first vertex, is followed by its
    holes. A ring begins at its uppermost, then leftmost vertex. Exteriors run clockwise in the image (rows
    downwards), holes counter-clockwise.

    Vertices are turns, and nodes: corners where the neighbour across the outline changes. A region whose
    pixels do not all share edges has several polygons.
    """

    vertices: NDArray[np.int32]  # (v, 2): row and column of pixel corners; the first is not repeated
    starts: NDArray[np.int64]  # (r + 1,): offset of each ring in `vertices`; v at the end
    labels: NDArray[np.int64]  # (r,): the region, 1..n, that each ring belongs to
    parts: NDArray[np.int64]  # (r,): the polygon, 0..p - 1, that each ring belongs to, exterior first

    @property
    def exteriors(self) -> NDArray[np.bool_]:
        """Mask of the rings that are exteriors."""
        return self.exteriors_of(0, len(self.parts))

    def exteriors_of(self, first: int, last: int) -> NDArray[np.bool_]:
        """Return the mask of exteriors; parameters are a slice of rings, first and end."""
        before = self.parts[first - 1] if first else -1
        return np.diff(self.parts[first:last], prepend=before) > 0

    def pixel_areas(self) -> NDArray[np.int64]:
        """Return the number of pixels within each ring; negative for a hole."""
        return self._measured(False)

    def pixel_perimeters(self) -> NDArray[np.int64]:
        """Return the number of pixel edges along each ring."""
        return self._measured(True)

    def _measured(self, by_length: bool) -> NDArray[np.int64]:
        measures = np.empty(len(self.labels), np.int64)
        _measure(self.vertices, self.starts, by_length, measures)
        return measures

    def select(self, rings: NDArray[np.bool_], labels: NDArray[np.int64] | None = None) -> "Rings":
        """Return a subset of the rings, in the order of the labels; rings of one label keep their order.

        With `labels`, those that are kept are relabelled; all rings of a polygon have the same.
        """
        kept_labels = self.labels[rings] if labels is None else labels
        order = np.flatnonzero(rings)[np.argsort(kept_labels, kind="stable")]
        vertices, starts = reorder_rings(self.vertices, self.starts, order)
        return Rings(
            vertices=vertices,
            starts=starts,
            labels=np.sort(kept_labels, kind="stable"),
            parts=dense_parts(self.parts[order]),
        )


def dense_parts(parts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Renumber runs of equal parts from 0."""
    return np.cumsum(np.diff(parts, prepend=parts[:1]) != 0)


def reorder_rings(
    vertices: NDArray[np.int32], starts: NDArray[np.int64], order: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return vertices, (v, 2), and starts, (r + 1,), of the rings with the indices in `order`, (k,)."""
    new_starts = np.concatenate([[0], np.cumsum(np.diff(starts)[order])])
    reordered = np.empty((int(new_starts[-1]), 2), np.int32)
    _gather(vertices, starts, order, reordered)
    return reordered, new_starts


@kernel("void(i4[:,::1], i8[::1], i8[::1], i4[:,::1])")
def _gather(vertices, starts, order, gathered):  # type: ignore[no-untyped-def]
    used = 0
    for ring in order:
        for v in range(starts[ring], starts[ring + 1]):
            gathered[used, 0] = vertices[v, 0]
            gathered[used, 1] = vertices[v, 1]
            used += 1


@kernel("void(i4[:,::1], i8[::1], b1, i8[::1])")
def _measure(vertices, starts, by_length, measures):  # type: ignore[no-untyped-def]
    for ring in range(measures.shape[0]):
        doubled, length = np.int64(0), np.int64(0)
        row, col = np.int64(vertices[starts[ring + 1] - 1, 0]), np.int64(vertices[starts[ring + 1] - 1, 1])
        for v in range(starts[ring], starts[ring + 1]):
            row_before, col_before, row, col = row, col, np.int64(vertices[v, 0]), np.int64(vertices[v, 1])
            doubled += col_before * row - col * row_before
            length += abs(row - row_before) + abs(col - col_before)
        measures[ring] = length if by_length else doubled // 2


@dataclass(frozen=True)
class RegionOutlines:
    """Rings and pixel sums of regions 1..n, largest first; ties in raster order of the first pixel."""

    rings: Rings
    sums: Sums


def renumber_by_size(rings: Rings, sums: Sums, kept: NDArray[np.bool_] | None = None) -> RegionOutlines:
    """Number regions 1..n: the one that encloses most pixels first, ties in raster order.

    `sums` are in the order of the labels of `rings`; `kept`, (r,), tells which rings are kept, all by
    default.
    """
    kept = np.ones(len(rings.labels), bool) if kept is None else kept
    left = np.unique(rings.labels[kept])
    pixels = np.bincount(rings.labels[kept], rings.pixel_areas()[kept], len(sums.counts) + 1)[left]
    firsts = sums.firsts[left - 1]
    order = np.lexsort((firsts[:, 1], firsts[:, 0], -pixels))
    labels = np.argsort(order)[np.searchsorted(left, rings.labels[kept])] + 1
    return RegionOutlines(rings.select(kept, labels), select_sums(sums, left[order] - 1))


def size_order(sums: Sums) -> NDArray[np.int64]:
    """Return indices that sort regions: most pixels first, ties in raster order of the first pixel."""
    return np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -sums.counts))


def select_sums(sums: Sums, which: NDArray[np.int64] | NDArray[np.bool_]) -> Sums:
    """Return the sums of some regions, by index or mask."""
    parts = {field.name: getattr(sums, field.name) for field in fields(sums)}
    chosen: dict[str, Any] = {n: None if part is None else part[which] for n, part in parts.items()}
    return Sums(**chosen)


def merge_sums(sums: Sums, group: NDArray[np.int64], count: int) -> Sums:
    """Add the sums of groups 0..count - 1 of n components; `group`, (n,), is that of each."""
    merged: dict[str, Any] = {}
    for field in fields(sums):
        part = getattr(sums, field.name)
        merged[field.name] = None if part is None else np.zeros((count, *part.shape[1:]), part.dtype)
        if part is not None and field.name != "firsts":
            np.add.at(merged[field.name], group, part)
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0]))[::-1]
    merged["firsts"][group[order]] = sums.firsts[order]  # the first in raster order is written last
    return Sums(**merged)


def rasterise(rings: Rings, window: Window) -> NDArray[np.uint32]:
    """Rasterise the regions in a window to a label image, (rows, cols) uint32; the inverse of `trace`."""
    return Rasteriser(rings)(window)


def edge_tables(rings: Rings, windows: Sequence[Window]) -> "LazySequence[EdgeTable]":
    """Return the edge table of each window, made when it is indexed: workers get only what they need."""
    rasteriser = Rasteriser(rings)
    return LazySequence(len(windows), lambda k: rasteriser.edge_table(windows[k]))


@dataclass(frozen=True, slots=True)
class EdgeTable:
    """Edge table of one window for scan-line fill: all that is needed to rasterise its labels."""

    window: Window
    first: NDArray[np.uint32]  # (rows,): labels of the first column
    edges: NDArray[np.int32]  # (e, 3): vertical edges to the right of it: first row, end row, column
    steps: NDArray[np.uint32]  # (e,): added to the label, modulo 2^32, from left to right across an edge

    def rasterise(self) -> NDArray[np.uint32]:
        """Return the labels of the window, (rows, cols) uint32."""
        labels = np.zeros((self.window.rows, self.window.cols), np.uint32)
        labels[:, 0] = self.first
        _add_steps(self.edges, self.steps, labels)
        return np.cumsum(labels, axis=1, dtype=np.uint32, out=labels)


@dataclass(frozen=True, slots=True)
class LazyLabels:
    """Label image whose rows are rasterised when they are indexed."""

    rasteriser: "Rasteriser"
    shape: tuple[int, int]  # of the raster
    numbers: NDArray[np.uint32] | None = None  # (n + 1,): they replace the labels

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
