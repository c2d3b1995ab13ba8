"""Eliminate small segments: merge each into the neighbour with which it shares the longest border."""

import heapq
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geobox import GeoBox
from uavseg.regions.edit.adjacency import border_lengths
from uavseg.regions.edit.small import Area, region_areas
from uavseg.regions.outline.rasterise import LazyLabels, Rasteriser
from uavseg.regions.outline.region_outlines import RegionOutlines, merge_sums, select_sums
from uavseg.regions.outline.trace import trace
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
