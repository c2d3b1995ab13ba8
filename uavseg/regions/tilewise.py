"""From a raster to regions: tiles are refined, numbered and outlined one by one, and joined at the end."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.parallel import Map, Progress, serial
from uavseg.raster.tiling import Window
from uavseg.regions.outline import Rings, Sketch, Sketches, link
from uavseg.regions.tracing import Chains, trace_tile
from uavseg.segmentation.blockmap import BlockMap, cell_sums
from uavseg.segmentation.components import Sums, component_sums, components, united
from uavseg.segmentation.pipeline import Refinement, cells_around, refined, window_cells
from uavseg.segmentation.refinement import REACH
from uavseg.segmentation.segments import IntensityRange
from uavseg.segmentation.source import GreySource


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
class _Tile:
    """What one tile adds: its components, their boundaries, and which of them touch the tile's borders."""

    sums: Sums
    chains: Chains
    top: NDArray[np.uint32]
    bottom: NDArray[np.uint32]
    left: NDArray[np.uint32]
    right: NDArray[np.uint32]


def outline_regions(
    source: GreySource,
    inside: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    windows: Sequence[Window],
    map: Map = serial,
    progress: Progress | None = None,
    expected: BlockMap | None = None,
) -> Outlined:
    """Regions of a raster, refined to the pixel.

    Parameters
    ----------
    source : GreySource
    inside : (m, n) uint8 array
        Cells of the leaves in range, from `segments.in_range`.
    interval : IntensityRange
    refine : {"none", "scan", "smooth"}
        With "none", leaves that share an edge are one region also where invalid pixels part their pixels.
    windows : sequence of Window
        Tiles that cover the raster, each after those above it and to its left.
    map, progress
        Who runs the work, and who is told.
    expected : BlockMap, optional
        What the raster's cells must add up to, where the block map was made at another time.

    Raises
    ------
    RasterError
        If they do not.
    """
    jobs = _Jobs(inside, windows, expected)
    tiles = map(partial(_outline_tile, source, interval, refine), jobs, progress)
    found = _Joined(source.shape)
    for window, tile in zip(windows, tiles, strict=True):
        found.add(window, tile)
    sums, parts, pieces = found.result()
    of_leaves = _components_of_cells(inside, sums.firsts) if refine == "none" else None
    return _in_order(sums, parts, pieces, parts if of_leaves is None else of_leaves)


@dataclass(frozen=True, slots=True)
class _Job:
    """A tile, its cells in range with those around it, and the sums and counts its cells must have."""

    window: Window
    inside: NDArray[np.uint8]
    cells: tuple[NDArray[np.uint32], NDArray[np.uint8]] | None


class _Jobs(Sequence[_Job]):
    """The jobs of all tiles, each made when it is asked for: workers get no more than they need."""

    def __init__(
        self, inside: NDArray[np.uint8], windows: Sequence[Window], expected: BlockMap | None
    ) -> None:
        self._inside = inside
        self._windows = windows
        self._expected = expected

    def __len__(self) -> int:
        return len(self._windows)

    def __getitem__(self, k: Any) -> Any:
        window = self._windows[k]
        here, known = window_cells(window), self._expected
        cells = None if known is None else (known.sums[here], known.counts[here])
        return _Job(window, cells_around(self._inside, window), cells)


def _outline_tile(
    source: GreySource, interval: IntensityRange, refine: Refinement, job: _Job
) -> _Tile | None:
    window = job.window
    found = refined(source, job.inside, interval, refine, window)
    if found is None:
        return None
    pixels, tile = found
    if job.cells is not None and not _same(job.cells, cell_sums(tile.grey, tile.valid, REACH)):
        raise RasterError(
            f"{source.dataset.source} is not as it was when its block map was made; make the block map again "
            "with uavseg divide, or give --refine none"
        )
    labels, count = components(pixels, REACH)
    if count == 0:
        return None
    sums = component_sums(labels, count, tile.grey, REACH)
    sums.firsts[:] += (window.row, window.col)
    chains = trace_tile(pixels, labels, REACH, (window.row, window.col), source.shape[1])
    own = labels[: window.rows, : window.cols]
    return _Tile(sums, chains, own[0].copy(), own[-1].copy(), own[:, 0].copy(), own[:, -1].copy())


def _same(first: tuple[NDArray[Any], ...], second: tuple[NDArray[Any], ...]) -> bool:
    return all(np.array_equal(one, other) for one, other in zip(first, second, strict=True))


class _Joined:
    """Tiles put together, each after those above it and to its left; of these only the borders are held."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._sums: list[Sums] = []
        self._pieces: list[Chains] = []
        self._pairs: list[NDArray[np.int64]] = []
        self._count = 0
        # Components along the lowest row, and along the rightmost column, of what is there; 0 for none.
        self._above = np.zeros(shape[1], np.int64)
        self._beside = np.zeros(shape[0], np.int64)

    def add(self, window: Window, tile: _Tile | None) -> None:
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

    def result(self) -> tuple[Sums, NDArray[np.int64], list[Chains]]:
        """Sums of all components, the root of each, and all chains."""
        pairs = np.concatenate([np.empty((0, 2), np.int64), *self._pairs])
        return _concatenated(self._sums), united(pairs, self._count), self._pieces

    def _numbered(self, border: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Components of a border, counted from 1 over all tiles; 0 for none."""
        return np.where(border > 0, border + np.int64(self._count), 0)

    def _meet(self, first: NDArray[np.int64], second: NDArray[np.int64]) -> None:
        touching = (first > 0) & (second > 0)
        if touching.any():
            self._pairs.append(np.unique(np.stack([first[touching], second[touching]], 1), axis=0) - 1)


def _components_of_cells(inside: NDArray[np.uint8], firsts: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each component of pixels, the component of cells in which its first pixel lies."""
    cells, _ = components(inside)
    return cells[firsts[:, 0] // 8, firsts[:, 1] // 8].astype(np.int64)


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


def summed(source: GreySource, outlined: Outlined, windows: Sequence[Window], map: Map) -> Sums:
    """Sums over the valid pixels that regions enclose, read again from the raster."""
    sums = outlined.sums
    greys, squares = np.zeros_like(sums.greys), np.zeros_like(sums.squares)
    counts = np.zeros_like(sums.counts)
    for found in map(partial(_sum_tile, source), Sketches(outlined.rings, windows)):
        if found is not None:
            names, parts = found
            counts[names - 1] += parts.counts
            greys[names - 1] += parts.greys
            squares[names - 1] += parts.squares
    return Sums(counts, greys, squares, sums.firsts)


def _sum_tile(source: GreySource, sketch: Sketch) -> tuple[NDArray[np.int64], Sums] | None:
    """Labels in a tile, and the sums of each over its valid pixels."""
    window, labels = sketch.window, sketch.paint()
    names = np.unique(labels).astype(np.int64)
    names = names[names > 0]
    if len(names) == 0:
        return None
    tile = source.read(window, 0)
    valid = tile.valid[: window.rows, : window.cols] > 0
    numbers = np.searchsorted(names, labels) + 1
    numbers[(labels == 0) | ~valid] = 0
    grey = np.ascontiguousarray(tile.grey[: window.rows, : window.cols])
    return names, component_sums(numbers.astype(np.uint32), len(names), grey)


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
        np.zeros(count, np.uint64),
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
