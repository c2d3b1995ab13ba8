"""LBP/C, the original unsupervised texture segmentation, in full: the baseline for comparison.

Ojala and Pietikäinen, "Unsupervised texture segmentation using feature distributions", Pattern Recognition 32
(1999) 477-486: hierarchical division by texture, agglomerative merging of the most similar adjacent regions
until the next pair is much less similar than all before, then pixelwise classification of the boundaries by
the texture around each pixel. The merging importance MI of two regions is p G, where p is the number of
counted pixels of the smaller one. The whole image is held in memory.
"""

import heapq
from typing import Any

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats, Integers, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError
from uavseg.segmentation.blocks import lbp
from uavseg.segmentation.blocks.block_map import find_leaves
from uavseg.segmentation.blocks.g_statistic import g_of_region, n_ln_n_table
from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.components import border_lengths, number_by_size, union_roots
from uavseg.segmentation.in_memory import block_map_of_array, pad_to_blocks
from uavseg.segmentation.params.segment import DivisionParams
from uavseg.units import CELL

MAX_PIXELS = 4096 * 4096
MIN_LEAF = 16  # pixels: side of the smallest leaf


@dataclass(frozen=True, slots=True)
class LbpcParams:
    """Parameters of LBP/C; the defaults are the usual values of the literature.

    A ParameterError says that a parameter is out of bounds.
    """

    threshold: float = 1.2  # X, at least 0: a block is divided where R = G_max / G_min is larger
    stop: float = 2.0  # Y, at least 1: merging stops where MI / (largest MI so far) is larger
    untested: float = 0.1  # share of all possible merges, 0 to 1, during which the stop is not tested
    radius: int = 11  # radius of the disc around a pixel, 1 to 128 pixels
    sweeps: int = 32  # largest number of sweeps over the boundary pixels; 0 keeps the merged blocks

    def __post_init__(self) -> None:
        if not self.threshold >= 0:
            raise ParameterError(f"the threshold X of the division is at least 0, not {self.threshold:g}")
        if not self.stop >= 1:
            raise ParameterError(f"the stop Y of merging is at least 1, not {self.stop:g}")
        if not 0 <= self.untested <= 1:
            raise ParameterError(f"the share of untested merges lies in 0..1, not {self.untested:g}")
        if not 1 <= self.radius <= 128:
            raise ParameterError(f"the radius of the disc is 1 to 128 pixels, not {self.radius}")
        if not self.sweeps >= 0:
            raise ParameterError(f"the number of sweeps is at least 0, not {self.sweeps}")


def check_lbpc_size(shape: tuple[int, int]) -> None:
    """Refuse an image of more than 4096 x 4096 pixels with RasterError: it is held in memory."""
    rows, cols = shape
    if rows * cols > MAX_PIXELS:
        raise RasterError(
            f"the original algorithm holds the whole image, at most {MAX_PIXELS:,} pixels, and this one has "
            f"{rows:,} x {cols:,}: read a part (--bounds), or take a coarser copy (gdal_translate -outsize)"
        )


def segment_lbpc(grey: Uint16s, valid: Bools | None = None, params: LbpcParams = LbpcParams()) -> Uint32s:
    """Label the segments of an (M, N) image by LBP/C; all pixels are valid without `valid`.

    The labels are 1..n, most pixels first, ties in raster order of the first pixel; 0 where invalid. A
    RasterError says that the image has more than 4096 x 4096 pixels.

    Examples
    --------
    >>> segment_lbpc(np.tile(np.array([[0, 9]], np.uint16), (32, 32)))[:2, :3]
    array([[1, 1, 1],
           [1, 1, 1]], dtype=uint32)
    """
    check_lbpc_size(grey.shape)
    mask = np.ones(grey.shape, np.bool_) if valid is None else valid
    image, padded_mask = pad_to_blocks(grey, mask)
    edges = lbp.contrast_bin_edges(lbp.contrast_histogram(image, padded_mask))
    symbols = lbp.lbp_symbols(image, padded_mask, edges)
    symbols = np.ascontiguousarray(symbols[: grey.shape[0], : grey.shape[1]])
    leaves = _leaf_labels(grey, mask, params.threshold)
    labels, models = _merge_regions(leaves, symbols, params.stop, params.untested)
    _classify_boundaries(labels, symbols, models, params)
    return number_by_size(labels, len(models) - 1, np.ascontiguousarray(grey))[labels]


def _leaf_labels(grey: Uint16s, mask: Bools, threshold: float) -> Uint32s:
    """Label the leaf of each valid pixel, 1..n in raster order of the leaves' corners; 0 where invalid."""
    sides, _ = find_leaves(block_map_of_array(grey, mask), DivisionParams(threshold, np.inf))
    side = np.maximum(sides, MIN_LEAF).astype(np.int64)
    rows, cols = np.indices(side.shape) * CELL
    corners = 1 + rows // side * side * grey.shape[1] + cols // side * side
    on_pixels = corners.repeat(CELL, 0).repeat(CELL, 1)[: grey.shape[0], : grey.shape[1]] * mask
    leaf_ids, labels = np.unique(on_pixels, return_inverse=True)
    return (labels.reshape(grey.shape) + int(leaf_ids.size > 0 and leaf_ids[0] > 0)).astype(np.uint32)


def _classify_boundaries(labels: Uint32s, symbols: Uint16s, models: Uint32s, params: LbpcParams) -> None:
    """Assign each boundary pixel to the adjacent region with the most similar model, in place."""
    # Models stay as merging left them, and a sweep reads the labels of the sweep before, so the result does
    # not depend on the order of pixels. After the first sweep, only pixels near a change are active.
    offsets = np.arange(-params.radius, params.radius + 1)
    half_widths = np.sqrt(params.radius**2 - offsets**2).astype(np.int64)  # of the rows of the disc
    totals = models.sum(axis=1, dtype=np.int64)
    table = n_ln_n_table(int(totals.max(initial=0)) + len(offsets) ** 2)
    counts, present = np.zeros((2, models.shape[1]), np.int64)
    constant = symbols, models, totals, half_widths, table, counts, present
    active = np.ones(labels.shape, np.uint8)
    for _ in range(params.sweeps):
        before, active_before = labels.copy(), active.copy()
        active[:] = 0
        if not _sweep(before, *constant, active_before, labels, active):
            break


@inlined
def disc_histogram(symbols, half_widths, row, col, counts, present):  # type: ignore[no-untyped-def]
    """Count the symbols in a disc and list those present; return the number of the latter."""
    rows, cols = symbols.shape
    radius = half_widths.shape[0] // 2
    n_present = 0
    for k in range(half_widths.shape[0]):
        r = row + k - radius
        if r < 0 or r >= rows:
            continue
        for c in range(max(col - half_widths[k], 0), min(col + half_widths[k] + 1, cols)):
            symbol = symbols[r, c]
            if symbol != UNCOUNTED:
                if counts[symbol] == 0:
                    present[n_present] = symbol
                    n_present += 1
                counts[symbol] += 1
    return n_present


@kernel(
    "i8(u4[:,::1], u2[:,::1], u4[:,::1], i8[::1], i8[::1], f8[::1], i8[::1], i8[::1], u1[:,::1],"
    " u4[:,::1], u1[:,::1])"
)
def _sweep(  # type: ignore[no-untyped-def]
    before, symbols, models, totals, half_widths, table, counts, present, active_before, labels, active
):
    # Returns the number of changed pixels; `active` is set at them and at their neighbours.
    rows, cols = before.shape
    changes = 0
    for row in range(rows):
        for col in range(cols):
            here = before[row, col]
            if here == 0 or not active_before[row, col]:
                continue
            north = before[row - 1, col] if row > 0 else here
            south = before[row + 1, col] if row + 1 < rows else here
            west = before[row, col - 1] if col > 0 else here
            east = before[row, col + 1] if col + 1 < cols else here
            around = (north, south, west, east)
            if max(around) == here and min(around) == here:
                continue
            n_present = disc_histogram(symbols, half_widths, row, col, counts, present)
            best = here
            smallest_g = g_of_region(models, totals, here, counts, present, n_present, table)
            for label in around:
                if n_present and label != 0 and label != here:
                    g = g_of_region(models, totals, label, counts, present, n_present, table)
                    if g < smallest_g or (g == smallest_g and best != here and label < best):
                        smallest_g, best = g, label
            for k in range(n_present):
                counts[present[k]] = 0
            if best != here:
                changes += 1
                labels[row, col] = best
                active[row, col] = 1
                active[max(row - 1, 0), col] = 1
                active[min(row + 1, rows - 1), col] = 1
                active[row, max(col - 1, 0)] = 1
                active[row, min(col + 1, cols - 1)] = 1
    return changes


def _merge_regions(
    labels: Uint32s, symbols: Uint16s, stop: float, untested: float
) -> tuple[Uint32s, Uint32s]:
    """Merge adjacent regions by texture, the most similar first, until MI exceeds Y times the largest."""
    # Of two pairs with the same MI, the one with the smaller lower label comes first, then the one with the
    # smaller upper label. The new labels are 1..k in the order of the smallest label merged into each; the
    # models, (k + 1, 2048), are the histograms of the regions, row 0 is empty.
    count = int(labels.max(initial=0))
    regions = _Regions.of(labels, symbols, count)
    pairs, _ = border_lengths(labels)
    possible = count - len(np.unique(union_roots(pairs, count + 1)[1:]))
    parents = _merge(regions, pairs, stop, untested * possible)
    roots, numbers = np.unique(parents, return_inverse=True)
    return numbers.astype(np.uint32)[labels], np.ascontiguousarray(regions.histograms[roots])


@dataclass(frozen=True)
class _Regions:
    """Histograms of regions, (n + 1, 2048), their sums, and a table of n ln n; region 0 is empty."""

    histograms: Uint32s
    totals: Integers
    table: Floats

    @classmethod
    def of(cls, labels: Uint32s, symbols: Uint16s, count: int) -> "_Regions":
        histograms = np.zeros((count + 1, SYMBOLS), np.uint32)
        _count_symbols(labels, symbols, histograms)
        histograms[0] = 0
        totals = histograms.sum(axis=1, dtype=np.int64)
        return cls(histograms, totals, n_ln_n_table(int(totals.sum())))

    def importance(self, region: int, others: Integers) -> list[float]:
        """Compute MI of a region with each of some others."""
        g = np.empty(len(others))
        present = np.flatnonzero(self.histograms[region])
        counts = self.histograms[region].astype(np.int64)
        _g_of_regions(self.histograms, self.totals, others, counts, present, self.table, g)
        scaled: list[float] = (g * np.minimum(self.totals[others], self.totals[region])).tolist()
        return scaled


def _merge(regions: _Regions, pairs: Integers, stop: float, untested: float) -> Integers:
    """Return the region that each region was merged into."""
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
        regions.histograms[one] += regions.histograms[other]
        regions.totals[one] += regions.totals[other]
        for third in neighbours[other]:
            neighbours[third].discard(other)
            if third != one:
                neighbours[third].add(one)
                neighbours[one].add(third)
        neighbours[other].clear()
        versions[one], versions[other] = versions[one] + 1, -1  # queue entries of either are out of date
        parents[other] = one
        for entry in _entries(regions, one, neighbours, versions):
            heapq.heappush(queue, entry)
    for k in range(count):  # a parent is smaller than its child, so that of the parent is final
        parents[k] = parents[parents[k]]
    return np.array(parents, np.int64)


def _entries(
    regions: _Regions, region: int, neighbours: list[set[int]], versions: list[int], above: int = 0
) -> list[tuple[Any, ...]]:
    """List the queue entries of a region's pairs: MI, the two labels, and the versions of the two regions."""
    others = sorted(other for other in neighbours[region] if other > above)
    entries = []
    for other, value in zip(others, regions.importance(region, np.array(others, np.int64)), strict=True):
        one, two = min(region, other), max(region, other)
        entries.append((value, one, two, versions[one], versions[two]))
    return entries


@kernel("void(u4[:,::1], i8[::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[::1])")
def _g_of_regions(histograms, totals, regions, counts, present, table, result):  # type: ignore[no-untyped-def]
    for k in range(regions.shape[0]):
        result[k] = g_of_region(histograms, totals, regions[k], counts, present, present.shape[0], table)


@kernel("void(u4[:,::1], u2[:,::1], u4[:,::1])")
def _count_symbols(labels, symbols, histograms):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if symbols[r, c] < SYMBOLS:
                histograms[labels[r, c], symbols[r, c]] += 1
