"""Agglomerative merging: adjacent regions of like texture become one, the most alike first.

Of the original LBP/C (Ojala and Pietikäinen 1999): MI of two adjacent regions is p G, where p is the number
of counted pixels of the smaller one, and G the log-likelihood ratio of their histograms. Merging stops where
the smallest MI is more than Y times the largest there was before.
"""

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.labels.components import union_roots

SYMBOLS = 2048
SMALLEST_G = 1e-9  # per pixel of the pair, as in the division

_LONGEST_TABLE = 1 << 16


def merge_regions(
    labels: NDArray[np.uint32], texels: NDArray[np.uint16], stop: float, untested: float
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Merge the regions of a label image.

    Where two pairs have the same MI, the one whose smaller label is smaller comes first, then the one whose
    other label is; a merged region has the smaller of its labels.

    Parameters
    ----------
    labels : (M, N) uint32 array
        1..n, 0 nothing.
    texels : (M, N) uint16 array
        Symbols as of `texture.symbols`.
    stop : float
        Y: merging stops where MI is more than Y times the largest MI of the merges before.
    untested : float
        That is not tested during this share of all merges that could be made.

    Returns
    -------
    labels : (M, N) uint32 array
        1..k in the order of the smallest label that went into each.
    models : (k + 1, 2048) uint32 array
        The histogram of each.
    """
    count = int(labels.max(initial=0))
    regions = _Regions.of(labels, texels, count)
    pairs = _adjacent_pairs(labels)
    possible = count - len(np.unique(union_roots(pairs, count + 1)[1:]))
    parents = _merge(regions, pairs, stop, untested * possible)
    roots, numbers = np.unique(parents, return_inverse=True)
    return numbers.astype(np.uint32)[labels], np.ascontiguousarray(regions.histograms[roots])


def log_table(most: int) -> NDArray[np.float64]:
    """n ln n for n from 0 to `most`, or to where computing it is no slower than looking it up."""
    n = np.arange(min(most, _LONGEST_TABLE) + 1)
    return np.asarray(n * np.log(np.maximum(n, 1)), np.float64)


@dataclass(frozen=True)
class _Regions:
    """Histograms (n + 1, 2048) uint32 and counted pixels (n + 1,) int64 of regions; 0 is nothing."""

    histograms: NDArray[np.uint32]
    totals: NDArray[np.int64]
    table: NDArray[np.float64]

    @classmethod
    def of(cls, labels: NDArray[np.uint32], texels: NDArray[np.uint16], count: int) -> "_Regions":
        histograms = np.zeros((count + 1, SYMBOLS), np.uint32)
        _count_symbols(labels, texels, histograms)
        histograms[0] = 0
        totals = histograms.sum(axis=1, dtype=np.int64)
        return cls(histograms, totals, log_table(int(totals.sum())))

    def importance(self, region: int, others: NDArray[np.int64]) -> list[float]:
        """MI of a region with each of some others."""
        found = np.empty(len(others))
        listed = np.flatnonzero(self.histograms[region])
        counts = self.histograms[region].astype(np.int64)
        _g_of_regions(self.histograms, self.totals, others, counts, listed, self.table, found)
        scaled: list[float] = (found * np.minimum(self.totals[others], self.totals[region])).tolist()
        return scaled

    def join(self, one: int, other: int) -> None:
        """Add a region's histogram to another's."""
        self.histograms[one] += self.histograms[other]
        self.totals[one] += self.totals[other]


def _merge(regions: _Regions, pairs: NDArray[np.int64], stop: float, untested: float) -> NDArray[np.int64]:
    """The region that each region went into."""
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
        least, one, other, *known = heapq.heappop(queue)
        if known != [versions[one], versions[other]]:
            continue
        if merges >= untested and least > stop * largest:
            break
        largest, merges = max(largest, least), merges + 1
        _unite(regions, one, other, neighbours, versions)
        parents[other] = one
        for entry in _entries(regions, one, neighbours, versions):
            heapq.heappush(queue, entry)
    for k in range(count):  # a parent is smaller than its child, so its own is final
        parents[k] = parents[parents[k]]
    return np.array(parents, np.int64)


def _entries(
    regions: _Regions, region: int, neighbours: list[set[int]], versions: list[int], above: int = 0
) -> list[tuple[Any, ...]]:
    """What waits to be merged with a region: MI, the two labels, and their versions."""
    others = sorted(other for other in neighbours[region] if other > above)
    found = []
    for other, value in zip(others, regions.importance(region, np.array(others, np.int64)), strict=True):
        one, two = min(region, other), max(region, other)
        found.append((value, one, two, versions[one], versions[two]))
    return found


def _unite(regions: _Regions, one: int, other: int, neighbours: list[set[int]], versions: list[int]) -> None:
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
    """The pairs of labels that share an edge, the smaller first; (k, 2)."""
    size = int(labels.max(initial=0)) + 1
    keys = []
    for one, other in ((labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])):
        apart = (one != other) & (one > 0) & (other > 0)
        low, high = np.minimum(one[apart], other[apart]), np.maximum(one[apart], other[apart])
        keys.append(np.unique(low.astype(np.int64) * size + high))
    return np.stack(np.divmod(np.unique(np.concatenate(keys)), size), axis=1)


@inlined
def _n_ln_n(table, n):  # type: ignore[no-untyped-def]
    return table[n] if n < table.shape[0] else n * np.log(np.float64(n))


@inlined
def likelihood_ratio(histograms, totals, region, counts, listed, many, table):  # type: ignore[no-untyped-def]
    """G between a region's histogram and counts of which the first `many` listed symbols are not 0.

    A symbol that only one of the two has adds nothing.
    """
    total = np.int64(0)
    shared = 0.0
    for k in range(many):
        a = counts[listed[k]]
        b = np.int64(histograms[region, listed[k]])
        total += a
        if b:
            shared += _n_ln_n(table, a + b) - _n_ln_n(table, a) - _n_ln_n(table, b)
    whole = _n_ln_n(table, total + totals[region]) - _n_ln_n(table, total) - _n_ln_n(table, totals[region])
    g = 2.0 * (whole - shared)
    return g if g >= SMALLEST_G * (total + totals[region]) else 0.0


@kernel("void(u4[:,::1], i8[::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[::1])")
def _g_of_regions(histograms, totals, regions, counts, listed, table, found):  # type: ignore[no-untyped-def]
    for k in range(regions.shape[0]):
        found[k] = likelihood_ratio(histograms, totals, regions[k], counts, listed, listed.shape[0], table)


@kernel("void(u4[:,::1], u2[:,::1], u4[:,::1])")
def _count_symbols(labels, texels, histograms):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if texels[r, c] < SYMBOLS:
                histograms[labels[r, c], texels[r, c]] += 1
