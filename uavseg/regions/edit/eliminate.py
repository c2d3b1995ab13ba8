"""Small segments eliminated: each becomes part of the neighbour with which it shares the longest border."""

import heapq
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geobox import GeoBox
from uavseg.regions.edit.adjacency import shared_borders
from uavseg.regions.edit.small import Area, region_areas
from uavseg.regions.outline.rasterise import Canvas, Painter
from uavseg.regions.outline.stitch import Outlined, merged_sums, taken
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.components import Sums

Integers = NDArray[np.int64]


def eliminate(
    outlined: Outlined, kinds: Integers, geobox: GeoBox, smallest: Area
) -> tuple[Outlined, Integers]:
    """Merge segments of less than an area into their neighbours.

    The smallest segment comes first, of equal ones the first in raster order. It becomes part of the
    neighbour with which it shares most pixel edges; where there are several, of the one whose mean is
    nearest, then of the one with the smallest label. What comes to touch a segment of its own kind by that
    becomes one with it. So it goes on: what has grown to the area stays, what has not is merged in its turn,
    and what has no neighbour stays as it is.

    Parameters
    ----------
    outlined : Outlined
        Segments, of which no two of one kind share an edge.
    kinds : (n,) int64 array
        The kind of each, such as its level; a merged segment has that of what it became part of.
    geobox : GeoBox
    smallest : Area

    Returns
    -------
    outlined : Outlined
        Labels are 1..m, the segment that encloses most pixels first, ties in raster order.
    kinds : (m,) int64 array

    Raises
    ------
    ParameterError
        If square metres are asked for where there is no CRS.
    """
    areas = region_areas(outlined, geobox, smallest)
    if not (areas < smallest.value).any():
        return outlined, kinds
    merging = _Merging.of(outlined, kinds, areas)
    merging.run(smallest.value)
    roots, group = np.unique(merging.roots(), return_inverse=True)
    sums = merged_sums(outlined.sums, group, len(roots))
    pixels = np.zeros(len(roots), np.int64)
    np.add.at(pixels, group[outlined.rings.labels - 1], outlined.rings.pixel_areas())
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -pixels))
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(1, len(order) + 1)
    painter = Painter(replace(outlined.rings, labels=number[group][outlined.rings.labels - 1]))
    return Outlined(trace(Canvas(painter, geobox.shape)), taken(sums, order)), kinds[roots][order]


@dataclass
class _Merging:
    """Segments 0..n - 1 while they are merged; the borders of each are pixel edges by neighbour."""

    areas: list[float]
    firsts: list[tuple[int, int]]
    counts: list[int]
    greys: list[int]
    kinds: list[int]
    borders: list[dict[int, int]]
    parents: list[int]

    @classmethod
    def of(cls, outlined: Outlined, kinds: Integers, areas: NDArray[np.float64]) -> "_Merging":
        sums: Sums = outlined.sums
        borders: list[dict[int, int]] = [{} for _ in range(len(areas))]
        pairs, lengths = shared_borders(outlined.rings)
        for (one, other), length in zip(pairs.tolist(), lengths.tolist(), strict=True):
            borders[one - 1][other - 1] = borders[other - 1][one - 1] = length
        firsts = [(row, col) for row, col in sums.firsts.tolist()]
        numbers = (sums.counts.tolist(), sums.greys.tolist(), kinds.tolist())
        return cls(areas.tolist(), firsts, *numbers, borders, list(range(len(areas))))

    def run(self, limit: float) -> None:
        """Merge until all that are less than the limit have no neighbour."""
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
        """The segment that each has become part of."""
        roots = np.array(self.parents)
        while (roots != roots[roots]).any():
            roots = roots[roots]
        return roots

    def _entry(self, one: int) -> tuple[float, tuple[int, int], int]:
        return self.areas[one], self.firsts[one], one

    def _nearest(self, one: int) -> int:
        """The neighbour with the longest border, then of the nearest mean, then the first."""
        longest = max(self.borders[one].values())
        able = [other for other, length in self.borders[one].items() if length == longest]
        if len(able) == 1:
            return able[0]
        mean = Fraction(self.greys[one], self.counts[one])
        return min(able, key=lambda k: (abs(Fraction(self.greys[k], self.counts[k]) - mean), k))

    def _absorb(self, one: int, into: int) -> None:
        """Make a segment part of another."""
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
