"""Eliminate small segments: merge each into the neighbour with which it shares the longest border."""

import heapq
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geobox import GeoBox
from uavseg.regions.edit.small import Area, region_areas
from uavseg.regions.outline.rasterise import LazyLabels, Rasteriser
from uavseg.regions.outline.rings import RegionOutlines, Rings, merge_sums, select_sums
from uavseg.regions.outline.trace import trace
from uavseg.regions.sorted_keys import sorted_unique
from uavseg.segmentation.components import Sums

Integers = NDArray[np.int64]


def eliminate(
    outlined: RegionOutlines, kinds: Integers, geobox: GeoBox, min_area: Area
) -> tuple[RegionOutlines, Integers]:
    """Merge segments below a minimum area into their neighbours.

    The smallest segment is merged first, of equal ones the first in raster order. It becomes part of the
    neighbour with which it shares most pixel edges; of several such neighbours, the one whose mean is
    nearest, then the one with the smallest label. A merged segment that now touches one of its own kind is
    merged with it. This repeats until all segments below the minimum have no neighbour.

    Parameters
    ----------
    outlined : RegionOutlines
        Segments; no two of one kind share an edge.
    kinds : (n,) int64 array
        The kind of each, such as its level; a merged segment takes that of the neighbour it became part of.
    geobox : GeoBox
    min_area : Area

    Returns
    -------
    outlined : RegionOutlines
        Labels are 1..m, the segment that encloses most pixels first; ties in raster order.
    kinds : (m,) int64 array

    Raises
    ------
    ParameterError
        If the area is in square metres and there is no CRS.
    """
    areas = region_areas(outlined, geobox, min_area)
    if not (areas < min_area.value).any():
        return outlined, kinds
    merging = _Merging.of(outlined, kinds, areas)
    merging.run(min_area.value)
    roots, group = np.unique(merging.roots(), return_inverse=True)
    sums = merge_sums(outlined.sums, group, len(roots))
    pixels = np.zeros(len(roots), np.int64)
    np.add.at(pixels, group[outlined.rings.labels - 1], outlined.rings.pixel_areas())
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -pixels))
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(1, len(order) + 1)
    rasteriser = Rasteriser(replace(outlined.rings, labels=number[group][outlined.rings.labels - 1]))
    rings = trace(LazyLabels(rasteriser, geobox.shape))
    return RegionOutlines(rings, select_sums(sums, order)), kinds[roots][order]


@dataclass
class _Merging:
    """State of merging segments 0..n - 1: attributes, parents (a forest), and shared edges by neighbour."""

    areas: list[float]
    firsts: list[tuple[int, int]]
    counts: list[int]
    greys: list[int]
    kinds: list[int]
    borders: list[dict[int, int]]
    parents: list[int]

    @classmethod
    def of(cls, outlined: RegionOutlines, kinds: Integers, areas: NDArray[np.float64]) -> "_Merging":
        sums: Sums = outlined.sums
        borders: list[dict[int, int]] = [{} for _ in range(len(areas))]
        pairs, lengths = border_lengths(outlined.rings)
        for (one, other), length in zip(pairs.tolist(), lengths.tolist(), strict=True):
            borders[one - 1][other - 1] = borders[other - 1][one - 1] = length
        firsts = [(row, col) for row, col in sums.firsts.tolist()]
        numbers = (sums.counts.tolist(), sums.greys.tolist(), kinds.tolist())
        return cls(areas.tolist(), firsts, *numbers, borders, list(range(len(areas))))

    def run(self, limit: float) -> None:
        """Merge until all segments below the limit have no neighbour."""
        queue = [self._entry(one) for one, area in enumerate(self.areas) if area < limit]
        heapq.heapify(queue)
        while queue:
            entry = heapq.heappop(queue)
            one = entry[2]
            if self.parents[one] != one or entry != self._entry(one) or not self.borders[one]:
                continue
            into = self._nearest(one)
            self._absorb(one, into)
            for alike in [k for k in self.borders[into] if self.kinds[k] == self.kinds[into]]:
                into, other = min(into, alike), max(into, alike)
                self._absorb(other, into)
            if self.areas[into] < limit:
                heapq.heappush(queue, self._entry(into))

    def roots(self) -> Integers:
        """The segment that each one has become part of."""
        roots = np.array(self.parents)
        while (roots != roots[roots]).any():
            roots = roots[roots]
        return roots

    def _entry(self, one: int) -> tuple[float, tuple[int, int], int]:
        return self.areas[one], self.firsts[one], one

    def _nearest(self, one: int) -> int:
        """The neighbour with the longest shared border, then the nearest mean, then the smallest number."""
        longest = max(self.borders[one].values())
        candidates = [other for other, length in self.borders[one].items() if length == longest]
        if len(candidates) == 1:
            return candidates[0]
        mean = Fraction(self.greys[one], self.counts[one])
        return min(candidates, key=lambda k: (abs(Fraction(self.greys[k], self.counts[k]) - mean), k))

    def _absorb(self, one: int, into: int) -> None:
        """Merge one segment into another."""
        self.parents[one] = into
        self.areas[into] += self.areas[one]
        self.counts[into] += self.counts[one]
        self.greys[into] += self.greys[one]
        self.firsts[into] = min(self.firsts[into], self.firsts[one])
        mine = self.borders[into]
        for other, length in self.borders[one].items():
            del self.borders[other][one]
            if other != into:
                mine[other] = self.borders[other][into] = mine.get(other, 0) + length
        self.borders[one] = {}


def border_lengths(rings: Rings) -> tuple[Integers, Integers]:
    """Length of the border that each pair of adjacent regions shares.

    Parameters
    ----------
    rings : Rings
        Along pixel edges.

    Returns
    -------
    pairs : (k, 2) int64 array
        Labels of adjacent regions, the smaller one first, in ascending order.
    lengths : (k,) int64 array
        Pixel edges that each pair shares.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> pairs, lengths = border_lengths(trace(np.array([[1, 1, 2], [3, 0, 2]], np.uint32)))
    >>> pairs.tolist(), lengths.tolist()
    ([[1, 2], [1, 3]], [1, 1])
    """
    found = [_shared_along(rings, axis) for axis in (0, 1)]
    one, other, lengths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    size = int(rings.labels.max(initial=0)) + 1
    keys, place = np.unique(np.minimum(one, other) * size + np.maximum(one, other), return_inverse=True)
    sums = np.zeros(len(keys), np.int64)
    np.add.at(sums, place, lengths)
    return np.stack(np.divmod(keys, size), axis=1), sums


def _shared_along(rings: Rings, axis: int) -> tuple[Integers, Integers, Integers]:
    """The regions on either side of each straight shared border along an axis, and its length."""
    vertices = rings.vertices.astype(np.int64)
    after = np.arange(1, len(vertices) + 1)
    after[rings.starts[1:] - 1] = rings.starts[:-1]
    here, there = vertices[:, axis], vertices[after, axis]
    edges = np.flatnonzero(here != there)
    stride = int(vertices[:, axis].max(initial=0)) + 2  # keys of different lines never overlap
    line = vertices[edges, 1 - axis] * stride
    starts, ends = line + np.minimum(here, there)[edges], line + np.maximum(here, there)[edges]
    labels = rings.labels[np.searchsorted(rings.starts, edges, "right") - 1]
    forward = (here < there)[edges]
    breaks = sorted_unique(np.concatenate([starts, ends]))
    sides = [_labels_at(starts[side], ends[side], labels[side], breaks[:-1]) for side in (forward, ~forward)]
    shared = (sides[0] > 0) & (sides[1] > 0)
    return sides[0][shared], sides[1][shared], np.diff(breaks)[shared]


def _labels_at(starts: Integers, ends: Integers, labels: Integers, positions: Integers) -> Integers:
    """The label of the edge that covers each position; 0 where none does."""
    order = np.argsort(starts)
    edge = np.searchsorted(starts[order], positions, "right") - 1
    found = np.where(edge >= 0, np.append(labels[order], 0)[edge], 0)
    return np.where(np.append(ends[order], 0)[edge] > positions, found, 0)
