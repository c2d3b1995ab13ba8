"""Stitch tiles: merge the components that meet at tile borders (union-find), and link their outlines."""

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.execution.executors import trim_heap
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.chains import OWNER, Chains, PackedChains, pack_chains, trace_tile
from uavseg.regions.outline.rings import RegionOutlines, merge_sums, select_sums, size_order
from uavseg.regions.outline.trace import link_rings
from uavseg.segmentation.components import (
    Sums,
    border_steps,
    component_sums,
    label_equal_values,
    union_roots,
    with_excess,
)
from uavseg.segmentation.source import GreyTile
from uavseg.units import CELL


@dataclass(frozen=True, slots=True)
class TileOutlines:
    """Components of one tile: their sums, boundary chains, and labels along the tile's borders.

    Parameters
    ----------
    sums : Sums
        Of components 1..n.
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


def outline_tile(
    image: NDArray[Any], labels: NDArray[np.uint32], count: int, tile: GreyTile, window: Window, width: int
) -> TileOutlines | None:
    """Sum and trace the components of one tile.

    Parameters
    ----------
    image : (M + 2 m, N + 2 m) uint8 or uint32 array
        The tile with a halo of m pixels, a multiple of 8. Adjacent pixels of equal value, not 0, belong
        together.
    labels : (M, N) uint32 array
        Connected components 1..count of the tile without its halo.
    count : int
    tile : GreyTile
        Grey levels 0..65535 of the tile with its halo.
    window : Window
        The tile; M and N may exceed it, up to whole blocks.
    width : int
        Columns of the raster.

    Returns
    -------
    TileOutlines or None
        None if the tile has no component.
    """
    if count == 0:
        return None
    halo = (image.shape[0] - labels.shape[0]) // 2
    rows, cols = labels.shape
    inner = slice(halo, halo + rows), slice(halo, halo + cols)
    beyond = None if tile.excess is None else tile.excess[inner]
    sums = with_excess(component_sums(labels, count, tile.grey, halo), labels, beyond)
    sums.firsts[:] += (window.row, window.col)
    clipped = labels[: window.rows, : window.cols]
    return TileOutlines(
        sums=replace(sums, steps=border_steps(image, labels, count, tile.grey, tile.valid)),
        chains=trace_tile(image, labels, halo, (window.row, window.col), width),
        top=clipped[0].copy(),
        bottom=clipped[-1].copy(),
        left=clipped[:, 0].copy(),
        right=clipped[:, -1].copy(),
    )


class TileStitcher:
    """Stitcher that merges the components that meet at tile borders.

    It holds only the last labels along the border, so each tile comes after those above it and to its left.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raster.
    windows : sequence of Window
    tiles : iterable of TileOutlines or None
        One for each window; None for one without components.
    """

    def __init__(
        self, shape: tuple[int, int], windows: Sequence[Window], tiles: Iterable[TileOutlines | None]
    ) -> None:
        self._sums: list[Sums] = []
        self._chains: list[PackedChains] = []
        self._pairs: list[NDArray[np.int64]] = []
        self._count = 0
        # Components along the last row, and along the last column, of the tiles so far; 0 for none.
        self._above = np.zeros(shape[1], np.int64)
        self._beside = np.zeros(shape[0], np.int64)
        for window, tile in zip(windows, tiles, strict=True):
            self._add(window, tile)

    def _add(self, window: Window, tile: TileOutlines | None) -> None:
        rows, cols = window.slices
        if tile is None:
            self._above[cols] = self._beside[rows] = 0
            return
        self._add_contacts(self._above[cols], self._numbered(tile.top))
        self._add_contacts(self._beside[rows], self._numbered(tile.left))
        self._above[cols] = self._numbered(tile.bottom)
        self._beside[rows] = self._numbered(tile.right)
        tile.chains.table[:, OWNER] += self._count - 1
        self._sums.append(tile.sums)
        self._chains.append(pack_chains(tile.chains))
        self._count += len(tile.sums.counts)

    def finish(
        self, leaves: NDArray[Any] | None = None, classes: NDArray[np.uint8] | None = None
    ) -> RegionOutlines:
        """Return all regions: components that meet at tile borders, or belong to the same leaves, are one.

        Parameters
        ----------
        leaves : (m, n) uint8 or uint32 array, optional
            The cells that the pixels come from, where they were not refined: 0 for no region, and the same
            number where adjacent cells belong together. Then components of different numbers stay apart, and
            cells that share an edge are one region also where invalid pixels separate their pixels.
        classes : (n,) uint8 array, optional
            In place of leaves: the class of each component, in the order in which tiles were added.
            Components of different classes stay apart.
        """
        trim_heap()  # tiles are not needed any more
        sums = _concatenate_sums(self._sums)
        pairs = np.concatenate([np.empty((0, 2), np.int64), *self._pairs])
        if classes is not None:
            pairs = pairs[classes[pairs[:, 0]] == classes[pairs[:, 1]]]
        if leaves is None:
            parts = union_roots(pairs, self._count)
            return _number_regions(sums, parts, parts, self._chains)
        row, col = sums.firsts.T // CELL
        numbers = leaves[row, col]
        parts = union_roots(pairs[numbers[pairs[:, 0]] == numbers[pairs[:, 1]]], self._count)
        segments, _ = label_equal_values(leaves)
        return _number_regions(sums, segments[row, col].astype(np.int64), parts, self._chains)

    def _numbered(self, border: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return the components of a border, numbered from 1 over all tiles; 0 for none."""
        return np.where(border > 0, border + np.int64(self._count), 0)

    def _add_contacts(self, first: NDArray[np.int64], second: NDArray[np.int64]) -> None:
        touching = (first > 0) & (second > 0)
        if touching.any():
            self._pairs.append(np.unique(np.stack([first[touching], second[touching]], 1), axis=0) - 1)


def _number_regions(
    sums: Sums, groups: NDArray[np.int64], parts: NDArray[np.int64], chains: list[PackedChains]
) -> RegionOutlines:
    """Number regions by size: components of one group are one region, those of one part one polygon."""
    names, group = np.unique(groups, return_inverse=True)
    merged = merge_sums(sums, group, len(names))
    order = size_order(merged)
    labels = np.empty(len(order), np.int64)
    labels[order] = np.arange(1, len(order) + 1)
    _, part = np.unique(parts, return_inverse=True)
    firsts = merge_sums(sums, part, int(part.max(initial=-1)) + 1).firsts
    raster_rank = np.empty(len(firsts), np.int64)
    raster_rank[np.lexsort((firsts[:, 1], firsts[:, 0]))] = np.arange(len(firsts))
    return RegionOutlines(link_rings(chains, labels[group], raster_rank[part]), select_sums(merged, order))


def _concatenate_sums(parts: Sequence[Sums]) -> Sums:
    if any(part.excess is not None for part in parts):  # None stands for zeros
        parts = [replace(p, excess=np.zeros_like(p.counts)) if p.excess is None else p for p in parts]
    empty = [np.empty(shape, dtype) for shape, dtype in ((0, "i8"), (0, "u8"), (0, "u8"), ((0, 2), "i8"))]
    known: dict[str, Any] = {}
    for field in fields(Sums):
        columns = [getattr(part, field.name) for part in (Sums(*empty), *parts)]
        columns = [column for column in columns if column is not None]
        known[field.name] = np.concatenate(columns) if columns else None
    return Sums(**known)
