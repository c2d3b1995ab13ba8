"""Rings: outlines of regions as closed rings of pixel corners, in flat arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel


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
            *gathered(self.vertices, self.starts, order),
            np.sort(named, kind="stable"),
            np.cumsum(np.diff(parts, prepend=parts[:1]) != 0),
        )


def gathered(
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
