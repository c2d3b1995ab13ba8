"""Rings: outlines of numbered regions on pixel corners, with the pixel sums of each region."""

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.dataclass import dataclass
from uavseg.segmentation.components import Sums


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
        areas = np.empty(len(self.labels), np.int64)
        _pixel_areas(self.vertices, self.starts, areas)
        return areas

    def pixel_perimeters(self) -> NDArray[np.int64]:
        """Return the number of pixel edges along each ring."""
        lengths = np.empty(len(self.labels), np.int64)
        _pixel_perimeters(self.vertices, self.starts, lengths)
        return lengths

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


@kernel("void(i4[:,::1], i8[::1], i8[::1])")
def _pixel_perimeters(vertices, starts, lengths):  # type: ignore[no-untyped-def]
    for ring in range(lengths.shape[0]):
        length = np.int64(0)
        before = starts[ring + 1] - 1
        for v in range(starts[ring], starts[ring + 1]):
            length += abs(np.int64(vertices[v, 0]) - np.int64(vertices[before, 0]))
            length += abs(np.int64(vertices[v, 1]) - np.int64(vertices[before, 1]))
            before = v
        lengths[ring] = length


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
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(1, len(order) + 1)
    labels = number[np.searchsorted(left, rings.labels[kept])]
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
