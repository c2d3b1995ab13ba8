"""Labels to rings on pixel edges, and back; tile by tile without seams."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.raster.tiling import Window
from uavseg.regions.linking import joined_chains, simple_rings
from uavseg.regions.tracing import OWNER, START, Chains, trace_tile
from uavseg.segmentation.components import equal_components

LONGEST = 256  # rows: upright edges are cut to this, so that those of a window are found at once
_COLUMN_0 = np.array([1, 1, 0], np.int32)


@dataclass(frozen=True, slots=True)
class Rings:
    """Outlines of regions: closed rings along pixel edges, each of them simple.

    Rings are ordered by label; within it each exterior, by its first vertex, is followed by its holes. A ring
    begins at its uppermost, then leftmost vertex. Exteriors run clockwise as one sees the picture.

    Parameters
    ----------
    vertices : (v, 2) int32 array
        Row and column of pixel corners; a ring is not closed, and turns at each of its vertices.
    starts : (r + 1,) int64 array
        Where each ring begins in `vertices`.
    labels : (r,) int64 array
        The region, 1..n, that each ring belongs to.
    parts : (r,) int64 array
        The polygon, 0..p - 1, that each ring belongs to: its exterior comes first. A region has several
        where its pixels do not all share edges.
    """

    vertices: NDArray[np.int32]
    starts: NDArray[np.int64]
    labels: NDArray[np.int64]
    parts: NDArray[np.int64]

    @property
    def exteriors(self) -> NDArray[np.bool_]:
        """Which rings are exteriors."""
        return self.exteriors_of(0, len(self.parts))

    def exteriors_of(self, first: int, last: int) -> NDArray[np.bool_]:
        """Which of the rings from `first` up to `last` are exteriors."""
        before = self.parts[first - 1] if first else -1
        return np.diff(self.parts[first:last], prepend=before) > 0

    def pixel_areas(self) -> NDArray[np.int64]:
        """Pixels within each ring; negative for a hole."""
        areas = np.empty(len(self.labels), np.int64)
        _pixel_areas(self.vertices, self.starts, areas)
        return areas

    def chosen(self, rings: NDArray[np.bool_], labels: NDArray[np.int64] | None = None) -> "Rings":
        """Some of the rings, in order, with new labels if they are given (one for each ring kept).

        New labels may be in any order; whole polygons are put in the order of theirs.
        """
        named = self.labels[rings] if labels is None else labels
        order = np.flatnonzero(rings)[np.argsort(named, kind="stable")]
        parts = self.parts[order]
        return Rings(
            *_gathered(self.vertices, self.starts, order),
            np.sort(named, kind="stable"),
            np.cumsum(np.diff(parts, prepend=parts[:1]) != 0),
        )


def trace(labels: NDArray[np.uint32]) -> Rings:
    """Outlines of the regions of a label image.

    Parameters
    ----------
    labels : (M, N) uint32 array
        0 is nothing; pixels of one label that share no edges become several polygons of one region.

    Examples
    --------
    >>> rings = trace(np.array([[1, 1], [1, 0]], np.uint32))
    >>> rings.vertices.tolist()
    [[0, 0], [0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
    """
    image = np.pad(np.ascontiguousarray(labels, np.uint32), 1)
    pieces, count = equal_components(np.ascontiguousarray(labels, np.uint32))
    names = np.zeros(count, np.int64)  # label of each piece
    names[pieces[labels > 0] - 1] = labels[labels > 0]
    chains = trace_tile(image, pieces, 1, (0, 0), labels.shape[1])
    chains.table[:, OWNER] -= 1
    return link([chains], names, np.arange(count))


def link(pieces: Sequence[Chains], labels: NDArray[np.int64], parts: NDArray[np.int64]) -> Rings:
    """Rings from the chains of all tiles.

    Parameters
    ----------
    pieces : sequence of Chains
        Their owners are numbers of components, over all tiles.
    labels : (n,) int64 array
        Label of each component.
    parts : (n,) int64 array
        A number for each connected piece of pixels, in raster order of their first pixels.
    """
    offsets = np.cumsum([0] + [len(chains.vertices) for chains in pieces])
    vertices = _stacked([chains.vertices for chains in pieces], (0, 2), np.int32)
    pinched = _stacked([chains.pinched for chains in pieces], (0,), np.uint8)
    table = _stacked([chains.table for chains in pieces], (0, 6), np.int64)
    table[:, START] += np.repeat(offsets[:-1], [len(chains.table) for chains in pieces])
    vertices, pinched, starts, owners = joined_chains(vertices, pinched, table)
    vertices, starts, owners, hole = simple_rings(vertices, pinched, starts, owners)
    first = vertices[starts[:-1]]
    order = np.lexsort((first[:, 1], first[:, 0], hole, parts[owners], labels[owners]))
    part = parts[owners][order]
    return Rings(
        *_gathered(vertices, starts, order),
        labels[owners][order],
        np.cumsum(np.diff(part, prepend=part[:1]) != 0),
    )


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


def _stacked(arrays: Sequence[NDArray], empty: tuple[int, ...], dtype: type) -> NDArray:  # type: ignore[type-arg]
    return np.concatenate([np.empty(empty, dtype), *arrays])


def _gathered(
    vertices: NDArray[np.int32], starts: NDArray[np.int64], order: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The rings in another order."""
    after = np.concatenate([[0], np.cumsum(np.diff(starts)[order])])
    gathered = np.empty((int(after[-1]), 2), np.int32)
    _gather(vertices, starts, order, gathered)
    return gathered, after


@kernel("void(i4[:,::1], i8[::1], i8[::1], i4[:,::1])")
def _gather(vertices, starts, order, gathered):  # type: ignore[no-untyped-def]
    used = 0
    for ring in order:
        for v in range(starts[ring], starts[ring + 1]):
            gathered[used, 0] = vertices[v, 0]
            gathered[used, 1] = vertices[v, 1]
            used += 1


@kernel("void(i4[:,::1], i8[::1], i8[::1])")
def _pixel_areas(vertices, starts, areas):  # type: ignore[no-untyped-def]
    for ring in range(areas.shape[0]):
        doubled = np.int64(0)
        before = starts[ring + 1] - 1
        for v in range(starts[ring], starts[ring + 1]):
            doubled += np.int64(vertices[before, 1]) * np.int64(vertices[v, 0])
            doubled -= np.int64(vertices[v, 1]) * np.int64(vertices[before, 0])
            before = v
        areas[ring] = doubled // 2


@kernel("void(i4[:,::1], u4[::1], u4[:,::1])")
def _paint(edges, steps, labels):  # type: ignore[no-untyped-def]
    for k in range(steps.shape[0]):
        col = edges[k, 2]
        for r in range(edges[k, 0], edges[k, 1]):
            labels[r, col] += steps[k]
