"""Stitch tiles: merge the components that meet at tile borders (union-find), and link their outlines."""

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.execution.executors import trim_heap
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.chains import OWNER, Chains, PackedChains, join_packed, pack_chains, trace_tile
from uavseg.regions.outline.rings import RegionOutlines, merge_sums, select_sums, size_order
from uavseg.regions.outline.trace import link_rings
from uavseg.segmentation import components
from uavseg.segmentation.source import GreyTile
from uavseg.units import CELL

# Component of each pixel along the top, the bottom, the left and the right border of a window, 0 for none.
Borders = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32]]


@dataclass(frozen=True, slots=True)
class TileOutlines:
    """Components of one tile: their sums, boundary chains, and labels along the tile's borders."""

    sums: components.Sums  # of components 1..n
    chains: Chains
    borders: Borders


def outline_tile(
    image: NDArray[Any], labels: NDArray[np.uint32], count: int, tile: GreyTile, window: Window, width: int
) -> TileOutlines | None:
    """Sum and trace the components of one tile.

    `image`, (M + 2 m, N + 2 m) uint8 or uint32, is the tile with a halo of m pixels, a multiple of 8;
    adjacent pixels of equal value, not 0, belong together. `labels`, (M, N), are the connected components
    1..count without the halo; M and N may exceed the window, up to whole blocks. `tile` is grey with the
    halo, `width` the columns of the raster. None if there is no component.
    """
    if count == 0:
        return None
    halo = (image.shape[0] - labels.shape[0]) // 2
    rows, cols = labels.shape
    inner = slice(halo, halo + rows), slice(halo, halo + cols)
    beyond = None if tile.excess is None else tile.excess[inner]
    sums = components.with_excess(components.component_sums(labels, count, tile.grey, halo), labels, beyond)
    sums.firsts[:] += (window.row, window.col)
    inside = labels[: window.rows, : window.cols]
    steps = components.border_steps(image, labels, count, tile.grey, tile.valid, tile.large_step)
    return TileOutlines(
        sums=replace(sums, steps=steps),
        chains=trace_tile(image, labels, halo, (window.row, window.col), width),
        borders=(inside[0].copy(), inside[-1].copy(), inside[:, 0].copy(), inside[:, -1].copy()),
    )


@dataclass(frozen=True, slots=True)
class Components:
    """Sums of connected components 0..n - 1, and the chains of their boundaries."""

    sums: components.Sums
    chains: PackedChains

    def select(self, which: NDArray[np.int64]) -> "Components":
        """Return some of the components, by increasing number."""
        kept = np.flatnonzero(np.isin(self.chains.table[:, OWNER], which))
        chains = pack_chains(self.chains.unpacked(kept))
        chains.table[:, OWNER] = np.searchsorted(which, chains.table[:, OWNER])
        return Components(select_sums(self.sums, which), chains)


class Contacts:
    """Pairs of components that meet at the borders of windows; components are numbered over all windows.

    `shape` is rows and columns of the raster. It holds only the last labels along the border, so each window
    comes after those above it and to its left; the `first` has the first row and column of all.
    """

    def __init__(self, shape: tuple[int, int], first: Window) -> None:
        self.count = 0
        self._first = first
        self._pairs: list[NDArray[np.int64]] = []
        # Components along the outer borders of the windows so far, from 1; 0 for none.
        self.top, self.bottom = np.zeros(shape[1], np.int64), np.zeros(shape[1], np.int64)
        self.left, self.right = np.zeros(shape[0], np.int64), np.zeros(shape[0], np.int64)

    @property
    def pairs(self) -> NDArray[np.int64]:
        """Pairs of components, (k, 2), counted from 0."""
        return np.concatenate([np.empty((0, 2), np.int64), *self._pairs])

    def add(self, window: Window, count: int, borders: Borders | None) -> None:
        """Add a window with components 1..count; None for one without components."""
        rows, cols = window.slices
        if borders is None:
            self.bottom[cols] = self.right[rows] = 0
            return
        top, bottom, left, right = (
            np.where(border > 0, border + np.int64(self.count), 0) for border in borders
        )
        self._add_pairs(self.bottom[cols], top)
        self._add_pairs(self.right[rows], left)
        if window.row == self._first.row:
            self.top[cols] = top
        if window.col == self._first.col:
            self.left[rows] = left
        self.bottom[cols], self.right[rows] = bottom, right
        self.count += count

    def _add_pairs(self, first: NDArray[np.int64], second: NDArray[np.int64]) -> None:
        touching = (first > 0) & (second > 0)
        if touching.any():
            self._pairs.append(np.unique(np.stack([first[touching], second[touching]], 1), axis=0) - 1)


class TileStitcher:
    """Stitcher that merges the components that meet at tile borders.

    `shape` is rows and columns of the raster. Windows are in the order of `Contacts`; there is one of `tiles`
    for each, None for one without components.
    """

    def __init__(
        self, shape: tuple[int, int], windows: Sequence[Window], tiles: Iterable[TileOutlines | None]
    ) -> None:
        self._sums: list[components.Sums] = []
        self._chains: list[PackedChains] = []
        self._contacts = Contacts(shape, windows[0])
        for window, tile in zip(windows, tiles, strict=True):
            if tile is None:
                self._contacts.add(window, 0, None)
                continue
            tile.chains.table[:, OWNER] += self._contacts.count - 1
            self._sums.append(tile.sums)
            self._chains.append(pack_chains(tile.chains))
            self._contacts.add(window, len(tile.sums.counts), tile.borders)

    def finish(
        self, leaves: NDArray[Any] | None = None, classes: NDArray[np.uint8] | None = None
    ) -> RegionOutlines:
        """Return all regions: components that meet at tile borders, or belong to the same leaves, are one.

        `leaves`, (m, n), are numbers of the cells that the pixels come from, where they were not refined: 0
        for no region, and the same where adjacent cells belong together. Then components of different numbers
        stay apart, and cells that share an edge are one region also where invalid pixels separate their
        pixels. In their place, `classes`, (n,), are those of the components, in the order in which tiles were
        added; components of different classes stay apart.
        """
        trim_heap()  # tiles are not needed any more
        sums, pairs, count = concatenate_sums(self._sums), self._contacts.pairs, self._contacts.count
        if classes is not None:
            pairs = pairs[classes[pairs[:, 0]] == classes[pairs[:, 1]]]
        if leaves is None:
            parts = components.union_roots(pairs, count)
            return number_regions(sums, parts, parts, self._chains)
        row, col = sums.firsts.T // CELL
        numbers = leaves[row, col]
        parts = components.union_roots(pairs[numbers[pairs[:, 0]] == numbers[pairs[:, 1]]], count)
        segments, _ = components.label_equal_values(leaves)
        return number_regions(sums, segments[row, col].astype(np.int64), parts, self._chains)

    def join(self, window: Window) -> tuple[Borders, Components, Components] | None:
        """Join the tiles of a part of the raster, `window`; None if there is no component.

        The components are those that reach a border with another part, which the borders number, and
        complete regions.
        """
        found, (rows, cols) = self._contacts, window.slices
        if found.count == 0:
            return None
        names, group = np.unique(components.union_roots(found.pairs, found.count), return_inverse=True)
        chains = join_packed(self._chains)
        chains.table[:, OWNER] = group[chains.table[:, OWNER]]
        joined = Components(merge_sums(concatenate_sums(self._sums), group, len(names)), chains)
        inner = rows.start > 0, rows.stop < len(found.left), cols.start > 0, cols.stop < len(found.top)
        sides = found.top[cols], found.bottom[cols], found.left[rows], found.right[rows]
        of_label = np.append(0, group + 1)
        labels = [of_label[side * is_inner] for side, is_inner in zip(sides, inner, strict=True)]
        reached = np.union1d(np.concatenate(labels), 0)
        top, bottom, left, right = (np.searchsorted(reached, side).astype(np.uint32) for side in labels)
        reaching, within = reached[1:] - 1, np.setdiff1d(np.arange(len(names)), reached[1:] - 1)
        return (top, bottom, left, right), joined.select(reaching), joined.select(within)


def number_regions(
    sums: components.Sums, groups: NDArray[np.int64], parts: NDArray[np.int64], chains: list[PackedChains]
) -> RegionOutlines:
    """Number regions by size: components of one group are one region, those of one part one polygon."""
    names, group = np.unique(groups, return_inverse=True)
    merged = merge_sums(sums, group, len(names))
    order = size_order(merged)
    labels = np.argsort(order) + 1
    _, part = np.unique(parts, return_inverse=True)
    firsts = merge_sums(sums, part, int(part.max(initial=-1)) + 1).firsts
    raster_rank = np.argsort(np.lexsort((firsts[:, 1], firsts[:, 0])))
    return RegionOutlines(link_rings(chains, labels[group], raster_rank[part]), select_sums(merged, order))


def concatenate_sums(parts: Sequence[components.Sums]) -> components.Sums:
    """Return the sums of the components of several tiles, one after the other."""
    if any(part.excess is not None for part in parts):  # None stands for zeros
        parts = [replace(p, excess=np.zeros_like(p.counts)) if p.excess is None else p for p in parts]
    empty = [np.empty(shape, dtype) for shape, dtype in ((0, "i8"), (0, "u8"), (0, "u8"), ((0, 2), "i8"))]
    known: dict[str, Any] = {}
    for field in fields(components.Sums):
        columns = [getattr(part, field.name) for part in (components.Sums(*empty), *parts)]
        columns = [column for column in columns if column is not None]
        known[field.name] = np.concatenate(columns) if columns else None
    return components.Sums(**known)
