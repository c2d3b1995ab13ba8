"""What tiles add, and all of it put together: components that meet at borders, outlines of the whole."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import Window
from uavseg.regions.outline.chains import Chains, trace_tile
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import link
from uavseg.segmentation.components import Sums, component_sums, label_equal_values, union_roots
from uavseg.units import CELL


@dataclass(frozen=True)
class Outlined:
    """Regions 1..n, the one with most pixels first, ties in raster order of the first pixel.

    Parameters
    ----------
    rings : Rings
    sums : Sums
        Of each region, in the order of their labels.
    """

    rings: Rings
    sums: Sums


@dataclass(frozen=True, slots=True)
class Tile:
    """What one tile adds: its components, their boundaries, and which of them touch the tile's borders.

    Parameters
    ----------
    sums : Sums
        Of its components 1..n.
    chains : Chains
    top, bottom, left, right : uint32 arrays
        The component of each pixel along a border, 0 for none.
    """

    sums: Sums
    chains: Chains
    top: NDArray[np.uint32]
    bottom: NDArray[np.uint32]
    left: NDArray[np.uint32]
    right: NDArray[np.uint32]


def outlined_tile(
    image: NDArray[Any],
    labels: NDArray[np.uint32],
    count: int,
    grey: NDArray[np.uint16],
    window: Window,
    width: int,
) -> Tile | None:
    """What a tile adds; None if it has no component.

    Parameters
    ----------
    image : (M + 2 m, N + 2 m) uint8 or uint32 array
        Adjacent pixels of equal value, not 0, belong together; m is a multiple of 8.
    labels : (M, N) uint32 array
        Their components 1..count within the margin.
    count : int
    grey : (M + 2 m, N + 2 m) uint16 array
    window : Window
        The tile; M and N may go beyond it, to whole blocks.
    width : int
        Columns of the raster.
    """
    if count == 0:
        return None
    margin = (image.shape[0] - labels.shape[0]) // 2
    sums = component_sums(labels, count, grey, margin)
    sums.firsts[:] += (window.row, window.col)
    chains = trace_tile(image, labels, margin, (window.row, window.col), width)
    own = labels[: window.rows, : window.cols]
    return Tile(sums, chains, own[0].copy(), own[-1].copy(), own[:, 0].copy(), own[:, -1].copy())


def joined(shape: tuple[int, int], windows: Sequence[Window], tiles: Iterable[Tile | None]) -> "Joined":
    """The tiles of a raster of `shape` put together, each after those above it and to its left."""
    found = Joined(shape)
    for window, tile in zip(windows, tiles, strict=True):
        found.add(window, tile)
    return found


class Joined:
    """Tiles put together, each after those above it and to its left; of these only the borders are held."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._sums: list[Sums] = []
        self._pieces: list[Chains] = []
        self._pairs: list[NDArray[np.int64]] = []
        self._count = 0
        # Components along the lowest row, and along the rightmost column, of what is there; 0 for none.
        self._above = np.zeros(shape[1], np.int64)
        self._beside = np.zeros(shape[0], np.int64)

    def add(self, window: Window, tile: Tile | None) -> None:
        """Take in the next tile."""
        rows, cols = window.slices
        if tile is None:
            self._above[cols] = self._beside[rows] = 0
            return
        self._meet(self._above[cols], self._numbered(tile.top))
        self._meet(self._beside[rows], self._numbered(tile.left))
        self._above[cols] = self._numbered(tile.bottom)
        self._beside[rows] = self._numbered(tile.right)
        tile.chains.table[:, 0] += self._count - 1
        self._sums.append(tile.sums)
        self._pieces.append(tile.chains)
        self._count += len(tile.sums.counts)

    def outlined(self, leaves: NDArray[Any] | None = None) -> Outlined:
        """All regions: components that meet at borders, and those of the same leaves, are one.

        Parameters
        ----------
        leaves : (m, n) uint8 or uint32 array, optional
            The cells that the pixels come from, where they were not refined: 0 for nothing, and the same
            number where adjacent cells belong together. Then components of different numbers stay apart, and
            cells that share an edge are one region also where invalid pixels part their pixels.
        """
        sums = _concatenated(self._sums)
        pairs = np.concatenate([np.empty((0, 2), np.int64), *self._pairs])
        if leaves is None:
            parts = union_roots(pairs, self._count)
            return _in_order(sums, parts, self._pieces, parts)
        row, col = sums.firsts.T // CELL
        kinds = leaves[row, col]
        parts = union_roots(pairs[kinds[pairs[:, 0]] == kinds[pairs[:, 1]]], self._count)
        segments, _ = label_equal_values(leaves)
        return _in_order(sums, parts, self._pieces, segments[row, col].astype(np.int64))

    def _numbered(self, border: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Components of a border, counted from 1 over all tiles; 0 for none."""
        return np.where(border > 0, border + np.int64(self._count), 0)

    def _meet(self, first: NDArray[np.int64], second: NDArray[np.int64]) -> None:
        touching = (first > 0) & (second > 0)
        if touching.any():
            self._pairs.append(np.unique(np.stack([first[touching], second[touching]], 1), axis=0) - 1)


def _in_order(
    sums: Sums, parts: NDArray[np.int64], pieces: list[Chains], groups: NDArray[np.int64]
) -> Outlined:
    """Number regions by size; components of one group are one region, of one part one polygon."""
    names, group = np.unique(groups, return_inverse=True)
    merged = merged_sums(sums, group, len(names))
    order = by_size(merged)
    labels = np.empty(len(order), np.int64)
    labels[order] = np.arange(1, len(order) + 1)
    _, part = np.unique(parts, return_inverse=True)
    places = merged_sums(sums, part, int(part.max(initial=-1)) + 1).firsts
    in_raster_order = np.empty(len(places), np.int64)
    in_raster_order[np.lexsort((places[:, 1], places[:, 0]))] = np.arange(len(places))
    return Outlined(link(pieces, labels[group], in_raster_order[part]), taken(merged, order))


def by_size(sums: Sums) -> NDArray[np.int64]:
    """The order of regions: most pixels first, ties in raster order of the first pixel."""
    return np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -sums.counts))


def taken(sums: Sums, which: NDArray[np.int64] | NDArray[np.bool_]) -> Sums:
    """Sums of some regions."""
    return Sums(sums.counts[which], sums.greys[which], sums.squares[which], sums.firsts[which])


def merged_sums(sums: Sums, group: NDArray[np.int64], count: int) -> Sums:
    """Sums of groups 0..count - 1 of components."""
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


def _concatenated(parts: Sequence[Sums]) -> Sums:
    return Sums(
        np.concatenate([np.empty(0, np.int64), *(part.counts for part in parts)]),
        np.concatenate([np.empty(0, np.uint64), *(part.greys for part in parts)]),
        np.concatenate([np.empty(0, np.uint64), *(part.squares for part in parts)]),
        np.concatenate([np.empty((0, 2), np.int64), *(part.firsts for part in parts)]),
    )
