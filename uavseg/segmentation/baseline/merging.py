"""Agglomerative merging of adjacent regions by texture, the most similar pair first.

Part of the original LBP/C (Ojala and Pietikäinen 1999): the merging importance MI of two adjacent
regions is p G, where p is the number of counted pixels of the smaller one, and G the log-likelihood ratio of
their histograms. Merging stops where the smallest MI is more than Y times the largest MI so far.
"""

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.blocks.g_statistic import g_of_region, n_ln_n_table
from uavseg.segmentation.blocks.lbp import SYMBOLS
from uavseg.segmentation.components import union_roots


def merge_regions(
    labels: NDArray[np.uint32], symbols: NDArray[np.uint16], stop: float, untested: float
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Merge the regions of a label image.

    Of two pairs with the same MI, the one with the smaller lower label comes first, then the one with the
    smaller upper label. A merged region keeps the smaller of its two labels.

    Parameters
    ----------
    labels : (M, N) uint32 array
        1..n, 0 nothing.
    symbols : (M, N) uint16 array
        From `lbp.lbp_symbols`.
    stop : float
        Y: merging stops where MI is more than Y times the largest MI of the merges so far.
    untested : float
        Share of all possible merges during which the stop is not tested.

    Returns
    -------
    labels : (M, N) uint32 array
        1..k in the order of the smallest label merged into each.
    models : (k + 1, 2048) uint32 array
        The histogram of each region; row 0 is empty.
    """
    count = int(labels.max(initial=0))
    regions = _Regions.of(labels, symbols, count)
    pairs = _adjacent_pairs(labels)
    possible = count - len(np.unique(union_roots(pairs, count + 1)[1:]))
    parents = _merge(regions, pairs, stop, untested * possible)
    roots, numbers = np.unique(parents, return_inverse=True)
    return numbers.astype(np.uint32)[labels], np.ascontiguousarray(regions.histograms[roots])


@dataclass(frozen=True)
class _Regions:
    """Histograms of regions; region 0 is empty.

    Parameters
    ----------
    histograms : (n + 1, 2048) uint32 array
    totals : (n + 1,) int64 array
        Counted pixels.
    table : float64 array
        n ln n, see `n_ln_n_table`.
    """

    histograms: NDArray[np.uint32]
    totals: NDArray[np.int64]
    table: NDArray[np.float64]

    @classmethod
    def of(cls, labels: NDArray[np.uint32], symbols: NDArray[np.uint16], count: int) -> "_Regions":
        histograms = np.zeros((count + 1, SYMBOLS), np.uint32)
        _count_symbols(labels, symbols, histograms)
        histograms[0] = 0
        totals = histograms.sum(axis=1, dtype=np.int64)
        return cls(histograms, totals, n_ln_n_table(int(totals.sum())))

    def importance(self, region: int, others: NDArray[np.int64]) -> list[float]:
        """MI of a region with each of some others."""
        g = np.empty(len(others))
        present = np.flatnonzero(self.histograms[region])
        counts = self.histograms[region].astype(np.int64)
        _g_of_regions(self.histograms, self.totals, others, counts, present, self.table, g)
        scaled: list[float] = (g * np.minimum(self.totals[others], self.totals[region])).tolist()
        return scaled

    def join(self, one: int, other: int) -> None:
        """Add a region's histogram to another's."""
        self.histograms[one] += self.histograms[other]
        self.totals[one] += self.totals[other]


def _merge(regions: _Regions, pairs: NDArray[np.int64], stop: float, untested: float) -> NDArray[np.int64]:
    """The region that each region was merged into."""
    count = len(regions.totals)
    parents, versions = list(range(count)), [0] * count
    neighbours: list[set[int]] = [set() for _ in range(count)]
    for one, other in pairs.tolist():
        neighbours[one].add(other)
        neighbours[other].add(one)
    queue = [entry for one in range(count) for entry in _entries(regions, one, neighbours, versions, one)]
    heapq.heapify(queue)
    largest, merges = 0.0, 0
    while queue:
        smallest, one, other, *entry_versions = heapq.heappop(queue)
        if entry_versions != [versions[one], versions[other]]:
            continue
        if merges >= untested and smallest > stop * largest:
            break
        largest, merges = max(largest, smallest), merges + 1
        _merge_pair(regions, one, other, neighbours, versions)
        parents[other] = one
        for entry in _entries(regions, one, neighbours, versions):
            heapq.heappush(queue, entry)
    for k in range(count):  # a parent is smaller than its child, so its own is final
        parents[k] = parents[parents[k]]
    return np.array(parents, np.int64)


def _entries(
    regions: _Regions, region: int, neighbours: list[set[int]], versions: list[int], above: int = 0
) -> list[tuple[Any, ...]]:
    """Queue entries of the pairs of a region: MI, the two labels, and the versions of the two regions."""
    others = sorted(other for other in neighbours[region] if other > above)
    entries = []
    for other, value in zip(others, regions.importance(region, np.array(others, np.int64)), strict=True):
        one, two = min(region, other), max(region, other)
        entries.append((value, one, two, versions[one], versions[two]))
    return entries


def _merge_pair(
    regions: _Regions, one: int, other: int, neighbours: list[set[int]], versions: list[int]
) -> None:
    """Merge region `other` into `one`; queue entries of either become out of date."""
    regions.join(one, other)
    for third in neighbours[other]:
        neighbours[third].discard(other)
        if third != one:
            neighbours[third].add(one)
            neighbours[one].add(third)
    neighbours[other].clear()
    versions[one] += 1
    versions[other] = -1


def _adjacent_pairs(labels: NDArray[np.uint32]) -> NDArray[np.int64]:
    """The pairs of adjacent labels, the smaller first; (k, 2)."""
    size = int(labels.max(initial=0)) + 1
    keys = []
    for one, other in ((labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])):
        apart = (one != other) & (one > 0) & (other > 0)
        low, high = np.minimum(one[apart], other[apart]), np.maximum(one[apart], other[apart])
        keys.append(np.unique(low.astype(np.int64) * size + high))
    return np.stack(np.divmod(np.unique(np.concatenate(keys)), size), axis=1)


@kernel("void(u4[:,::1], i8[::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[::1])")
def _g_of_regions(histograms, totals, regions, counts, present, table, found):  # type: ignore[no-untyped-def]
    for k in range(regions.shape[0]):
        found[k] = g_of_region(histograms, totals, regions[k], counts, present, present.shape[0], table)


@kernel("void(u4[:,::1], u2[:,::1], u4[:,::1])")
def _count_symbols(labels, symbols, histograms):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if symbols[r, c] < SYMBOLS:
                histograms[labels[r, c], symbols[r, c]] += 1
