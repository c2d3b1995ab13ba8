"""Region outlines: rings of numbered regions with the pixel sums of each; merging and renumbering."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.regions.outline.rings import Rings
from uavseg.segmentation.components import Sums


@dataclass(frozen=True)
class RegionOutlines:
    """Rings and pixel sums of regions 1..n, largest first; ties in raster order of the first pixel.

    Parameters
    ----------
    rings : Rings
    sums : Sums
        Of each region, in the order of the labels.
    """

    rings: Rings
    sums: Sums


def renumber_by_size(rings: Rings, sums: Sums, kept: NDArray[np.bool_] | None = None) -> RegionOutlines:
    """Number regions 1..n: the one that encloses most pixels first, ties in raster order.

    Parameters
    ----------
    rings : Rings
    sums : Sums
        Of the regions of `rings`, in the order of their labels.
    kept : (r,) bool array, optional
        The rings that are kept; all by default.
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
    """Indices that sort regions: most pixels first, ties in raster order of the first pixel."""
    return np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -sums.counts))


def select_sums(sums: Sums, which: NDArray[np.int64] | NDArray[np.bool_]) -> Sums:
    """Sums of some regions, by index or mask."""
    return Sums(sums.counts[which], sums.greys[which], sums.squares[which], sums.firsts[which])


def merge_sums(sums: Sums, group: NDArray[np.int64], count: int) -> Sums:
    """Sums of groups 0..count - 1 of components.

    Parameters
    ----------
    sums : Sums
        Of n components.
    group : (n,) int64 array
        The group of each.
    count : int
    """
    merged = Sums(
        np.zeros(count, np.int64),
        np.zeros(count, np.uint64),
        np.zeros(count, sums.squares.dtype),  # NaN where they are not known
        np.zeros((count, 2), np.int64),
    )
    np.add.at(merged.counts, group, sums.counts)
    np.add.at(merged.greys, group, sums.greys)
    np.add.at(merged.squares, group, sums.squares)
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0]))[::-1]
    merged.firsts[group[order]] = sums.firsts[order]  # the first in raster order is written last
    return merged
