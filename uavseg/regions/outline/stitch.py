"""Stitch tiles: merge the components that meet at tile borders (union-find), and link their outlines."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import trim_heap
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.chains import OWNER, Chains, PackedChains, pack_chains, trace_tile
from uavseg.regions.outline.rings import RegionOutlines, merge_sums, select_sums, size_order
from uavseg.regions.outline.trace import link_rings
from uavseg.segmentation.border_steps import border_steps
from uavseg.segmentation.components import Sums, component_sums, label_equal_values, union_roots, with_beyond
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
    image: NDArray[Any],
    labels: NDArray[np.uint32],
    count: int,
    tile: GreyTile,
    window: Window,
    width: int,
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
    beyond = None if tile.beyond is None else tile.beyond[inner]
    sums = with_beyond(component_sums(labels, count, tile.grey, halo), labels, beyond)
    sums.firsts[:] += (window.row, window.col)
    sums = replace(sums, steps=border_steps(image, labels, count, tile.grey, tile.valid))
    chains = trace_tile(image, labels, halo, (window.row, window.col), width)
    own = labels[: window.rows, : window.cols]
    return TileOutlines(sums, chains, own[0].copy(), own[-1].copy(), own[:, 0].copy(), own[:, -1].copy())


def stitch_tiles(
    shape: tuple[int, int], windows: Sequence[Window], tiles: Iterable[TileOutlines | None]
) -> "TileStitcher":
    """A stitcher that holds all tiles of a raster.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raster.
    windows : sequence of Window
        Each after those above it and to its left.
    tiles : iterable of TileOutlines or None
        One for each window.
    """
    stitcher = TileStitcher(shape)
    for window, tile in zip(windows, tiles, strict=True):
        stitcher.add(window, tile)
    return stitcher


class TileStitcher:
    """Collects tiles, and merges the components that meet at tile borders.

    Only the labels along the border of what was added are held, so tiles must be added each after those above
    it and to its left.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raster.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._sums: list[Sums] = []
        self._chains: list[PackedChains] = []
        self._pairs: list[NDArray[np.int64]] = []
        self._count = 0
        # Components along the last row, and along the last column, of the tiles so far; 0 for none.
        self._above = np.zeros(shape[1], np.int64)
        self._beside = np.zeros(shape[0], np.int64)

    def add(self, window: Window, tile: TileOutlines | None) -> None:
        """Add the next tile; None for one without components."""
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
        self, leaves: NDArray[Any] | None = None, kinds: NDArray[np.uint8] | None = None
    ) -> RegionOutlines:
        """All regions: components that meet at tile borders, or belong to the same leaves, are one.

        Parameters
        ----------
        leaves : (m, n) uint8 or uint32 array, optional
            The cells that the pixels come from, where they were not refined: 0 for no region, and the same
            number where adjacent cells belong together. Then components of different numbers stay apart, and
            cells that share an edge are one region also where invalid pixels separate their pixels.
        kinds : (n,) uint8 array, optional
            In place of leaves: the kind of each component, in the order in which tiles were added. Components
            of different kinds stay apart.
        """
        trim_heap()  # tiles are not needed any more
        sums = _concatenate_sums(self._sums)
        pairs = np.concatenate([np.empty((0, 2), np.int64), *self._pairs])
        if kinds is not None:
            pairs = pairs[kinds[pairs[:, 0]] == kinds[pairs[:, 1]]]
        if leaves is None:
            parts = union_roots(pairs, self._count)
            return _number_regions(sums, parts, parts, self._chains)
        row, col = sums.firsts.T // CELL
        numbers = leaves[row, col]
        parts = union_roots(pairs[numbers[pairs[:, 0]] == numbers[pairs[:, 1]]], self._count)
        segments, _ = label_equal_values(leaves)
        return _number_regions(sums, segments[row, col].astype(np.int64), parts, self._chains)

    def _numbered(self, border: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Components of a border, numbered from 1 over all tiles; 0 for none."""
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
    return Sums(
        np.concatenate([np.empty(0, np.int64), *(part.counts for part in parts)]),
        np.concatenate([np.empty(0, np.uint64), *(part.greys for part in parts)]),
        np.concatenate([np.empty(0, np.uint64), *(part.squares for part in parts)]),
        np.concatenate([np.empty((0, 2), np.int64), *(part.firsts for part in parts)]),
        _concatenate_beyond(parts),
        _concatenate_known([part.steps for part in parts]),
        _concatenate_known([part.alike for part in parts]),
    )


def _concatenate_beyond(parts: Sequence[Sums]) -> NDArray[np.int64] | None:
    if all(part.beyond is None for part in parts):
        return None
    return np.concatenate(
        [np.zeros_like(part.counts) if part.beyond is None else part.beyond for part in parts]
    )


def _concatenate_known(parts: Sequence[NDArray[np.int64] | None]) -> NDArray[np.int64] | None:
    known = [part for part in parts if part is not None]
    return np.concatenate(known) if known else None
