"""Segments of whole cells, of a state, or of several refined classes that share borders, by tiles."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, whole_blocks
from uavseg.regions.outline.rings import RegionOutlines, rasterise, renumber_by_size
from uavseg.regions.outline.stitch import TileOutlines, TileStitcher, outline_tile
from uavseg.regions.outline.trace import trace
from uavseg.regions.tiles.range_tiles import TileJob, check_sums, tile_jobs, with_detail
from uavseg.segmentation import components
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.params.segment import IntensityRange, Partition, Refinement
from uavseg.segmentation.pipeline import every_cell, refine_tile, refine_tile_classes
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.segmentation.states.state_image import StateImage
from uavseg.segmentation.states.state_scans import decode_states
from uavseg.units import CELL

Firsts = NDArray[np.int64]

LIKELY = IntensityRange(0.5, 1)  # similarities at which a pixel may belong to a class
_Job = tuple[Window, NDArray[Any]]
# Outlines of the components of a tile, and the class of each; None for a tile without components.
ClassOutlines = tuple[TileOutlines, NDArray[np.uint8]] | None


def outline_segments(source: GreySource, cells: NDArray[Any], tile_pass: TilePass) -> RegionOutlines:
    """Outline segments: cells of the same class that share an edge, not refined.

    `cells`, (m, n), are the class of each cell, such as its level; 0 for no segment.
    """
    tiles = tile_pass.run(partial(_outline_cells, source), cell_jobs(cells, tile_pass.windows, CELL))
    return TileStitcher(source.shape, tile_pass.windows, tiles).finish(cells)


def outline_state(
    source: GreySource,
    image: StateImage,
    state: int,
    tile_pass: TilePass,
    leaves: NDArray[np.uint8] | None = None,
) -> RegionOutlines:
    """Outline the connected components of the pixels of one state.

    It is quickest if tiles of the same rows follow each other. `leaves`, (m, n), are the states of cells,
    where they were not refined: those that share an edge are then one object.
    """
    tiles = tile_pass.run(partial(_outline_pixels, source), _state_jobs(image, state, tile_pass.windows))
    of_state = None if leaves is None else (leaves == state).view(np.uint8)
    return TileStitcher(source.shape, tile_pass.windows, tiles).finish(of_state)


def cell_jobs(cells: NDArray[Any], windows: Sequence[Window], halo: int) -> LazySequence[_Job]:
    """Return tiles with their values of the (m, n) cells, and those within `halo` pixels around them."""
    return LazySequence(len(windows), lambda k: (windows[k], cells_around(cells, windows[k], halo)))


def _state_jobs(image: StateImage, state: int, windows: Sequence[Window]) -> LazySequence[_Job]:
    """Return tiles with a mask of one state, and 8 pixels around them, one bit per pixel."""

    @lru_cache(maxsize=1)  # tiles of the same rows follow each other
    def mask_of_rows(row: int, rows: int) -> NDArray[np.bool_]:
        return np.pad(decode_states(image.read_codes(row, rows)) == state, ((0, 0), (CELL, CELL)))

    def job(k: int) -> _Job:
        window = windows[k]
        mask = mask_of_rows(window.row - CELL, whole_blocks(window.rows) + 2 * CELL)
        part = mask[:, window.col : window.col + whole_blocks(window.cols) + 2 * CELL]
        return window, np.packbits(part, axis=1)

    return LazySequence(len(windows), job)


def _outline_cells(source: GreySource, job: _Job) -> TileOutlines | None:
    window, cells = job
    if not cells.any():
        return None
    tile = source.read(window, CELL, excess=True)
    pixels = cells_to_pixels(cells, tile.valid)
    return outline_tile(pixels, *components.label_equal_values(pixels, CELL), tile, window, source.shape[1])


def _outline_pixels(source: GreySource, job: _Job) -> TileOutlines | None:
    window, bits = job
    if not bits.any():
        return None
    tile = source.read(window, CELL, excess=True)
    pixels = np.unpackbits(bits, axis=1, count=tile.grey.shape[1])
    return outline_tile(pixels, *components.label_components(pixels, CELL), tile, window, source.shape[1])


def outline_block_map(blocks: BlockMap, classes: NDArray[Any]) -> RegionOutlines:
    """Outline segments of adjacent cells of one class; cells without valid pixels are left out.

    `classes`, (8 B, 8 C), are 1 for cells in range, or the level of each; 0 for no segment. Outlines are in
    pixels.
    """
    rows, cols = _cell_shape(blocks)
    leaves, count = components.label_equal_values(np.ascontiguousarray(classes[:rows, :cols]))
    leaves[blocks.counts[:rows, :cols] == 0] = 0
    rings = trace(leaves)
    limit = np.array(blocks.shape, np.int32)
    on_pixels = replace(rings, vertices=np.minimum(rings.vertices * np.int32(CELL), limit))
    return renumber_by_size(on_pixels, _sum_cells(blocks, leaves, count))


def count_segments(blocks: BlockMap, classes: NDArray[Any], count: int) -> NDArray[np.int64]:
    """Count the segments of `outline_block_map` by class, (count,) int64, without outlining them.

    `classes`, (8 B, 8 C), are 1..count for each cell; 0 for no segment.
    """
    rows, cols = _cell_shape(blocks)
    cells = np.ascontiguousarray(classes[:rows, :cols])
    labels, segments = components.label_equal_values(cells)
    of_segment = np.zeros(segments + 1, cells.dtype)
    of_segment[labels] = cells
    return np.bincount(of_segment[1:], minlength=count + 1)[1:].astype(np.int64)


def sum_enclosed_cells(blocks: BlockMap, outlined: RegionOutlines) -> RegionOutlines:
    """Return the outlines of `outline_block_map` with the sums of all cells that they enclose."""
    on_cells = replace(outlined.rings, vertices=-(-outlined.rings.vertices // np.int32(CELL)))
    labels = rasterise(on_cells, Window(0, 0, *_cell_shape(blocks)))
    return replace(outlined, sums=_sum_cells(blocks, labels, len(outlined.sums.counts)))


def _cell_shape(blocks: BlockMap) -> tuple[int, int]:
    """Return the rows and columns of cells that hold pixels of the raster."""
    return -(-blocks.shape[0] // CELL), -(-blocks.shape[1] // CELL)


def _sum_cells(blocks: BlockMap, labels: NDArray[np.uint32], count: int) -> components.Sums:
    flat = labels.reshape(-1)
    rows, cols = labels.shape
    greys = np.zeros(count + 1, np.uint64)
    counts = np.zeros(count + 1, np.int64)
    np.add.at(greys, flat, blocks.sums[:rows, :cols].reshape(-1).astype(np.uint64))
    np.add.at(counts, flat, blocks.counts[:rows, :cols].reshape(-1))
    names, first = np.unique(flat, return_index=True)
    firsts = np.zeros((count + 1, 2), np.int64)
    firsts[names] = CELL * np.stack(np.divmod(first, cols), axis=1)
    return components.Sums(counts[1:], greys[1:], np.full(count, np.nan), firsts[1:])


@dataclass(frozen=True, slots=True)
class ClassesByPixel:
    """Class of each segment by its first pixel: known however segments are renumbered."""

    firsts: Firsts  # (n, 2): in raster order
    classes: NDArray[np.uint8]  # (n,)

    @classmethod
    def of(cls, firsts: Firsts, classes: NDArray[np.uint8]) -> "ClassesByPixel":
        """Sort components, (n, 2) first pixels and (n,) classes, by their first pixels."""
        order = np.lexsort((firsts[:, 1], firsts[:, 0]))
        return cls(firsts[order], classes[order])

    def at(self, firsts: Firsts) -> NDArray[np.int64]:
        """Return the classes of some of the components by their first pixels, (k, 2): (k,) int64."""
        width = 1 + max(int(self.firsts[:, 1].max(initial=0)), int(firsts[:, 1].max(initial=0)))
        place = np.searchsorted(self.firsts @ (width, 1), firsts @ (width, 1))
        return self.classes[place].astype(np.int64)


def outline_refined_classes(
    source: GreySource,
    partition: Partition,
    refine: Refinement,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
    detail: Detail | None = None,
) -> tuple[RegionOutlines, ClassesByPixel]:
    """Outline segments of a partition, refined together: none overlap, and borders are shared.

    Refinement is by "tv" or "pixels". `expected` are the sums and counts that cells must have, if the block
    map was made earlier, see `check_sums`; structures narrower than `detail` are removed after refinement.
    """
    jobs = tile_jobs(every_cell(source.shape), tile_pass.windows, expected, detail)
    tiles = tile_pass.run(partial(_outline_tile, source, partition.grey_table, refine, detail), jobs)
    return stitch_classes(source.shape, tile_pass.windows, tiles)


def outline_likely_classes(
    grey: GreySource,
    similarities: Sequence[GreySource],
    cells: Sequence[NDArray[np.uint8]],
    refine: Refinement,
    tile_pass: TilePass,
    detail: Detail | None = None,
) -> tuple[RegionOutlines, ClassesByPixel]:
    """Outline the regions of classes: each pixel belongs to the likeliest of the possible classes, if any.

    Regions are measured in the intensity `grey`. A class is possible where its similarity is one half or
    more, refined by "tv" or "none"; there are cells, (m, n), of each class, from `pipeline.cells_to_refine`.
    Structures narrower than `detail`, not with "none", are assigned to adjacent classes, or to none. The sums
    of the outlines are of grey, and of the similarity of each region to its class; classes are counted from
    1.
    """
    windows = tile_pass.windows
    jobs = [tile_jobs(one, windows, detail=detail) for one in cells]
    tiles = tile_pass.run(
        partial(_outline_likely_tile, grey, similarities, refine, detail),
        LazySequence(len(windows), lambda k: tuple(of_class[k] for of_class in jobs)),
    )
    return stitch_classes(grey.shape, windows, tiles)


def stitch_classes(
    shape: tuple[int, int], windows: Sequence[Window], tiles: Iterable[ClassOutlines]
) -> tuple[RegionOutlines, ClassesByPixel]:
    """Stitch tiles to regions; those of different classes stay apart."""
    all_firsts, all_classes = [np.empty((0, 2), np.int64)], [np.empty(0, np.uint8)]

    def outlines() -> Iterator[TileOutlines | None]:
        for tile in tiles:
            if tile is not None:
                all_firsts.append(tile[0].sums.firsts)
                all_classes.append(tile[1])
            yield tile and tile[0]

    stitcher = TileStitcher(shape, windows, outlines())
    classes = np.concatenate(all_classes)
    return stitcher.finish(classes=classes), ClassesByPixel.of(np.concatenate(all_firsts), classes)


def _outline_tile(
    source: GreySource, table: NDArray[np.uint8], refine: Refinement, detail: Detail | None, job: TileJob
) -> ClassOutlines:
    refined = refine_tile_classes(source, table, refine, job.refined)
    if refined is None:
        return None
    pixels, tile = refined if detail is None else with_detail(*refined, detail)
    check_sums(source, job, tile)
    labels, count = components.label_equal_values(pixels, REFINE_HALO)
    outlines = outline_tile(pixels, labels, count, tile, job.window, source.shape[1])
    return _with_classes(pixels, outlines, job.window)


def _with_classes(pixels: NDArray[np.uint8], outlines: TileOutlines | None, window: Window) -> ClassOutlines:
    """Return outlines with the class of each component, from the classes of pixels with REFINE_HALO."""
    if outlines is None:
        return None
    row, col = (outlines.sums.firsts - (window.row, window.col) + REFINE_HALO).T
    return outlines, pixels[row, col]


def _outline_likely_tile(
    grey: GreySource,
    similarities: Sequence[GreySource],
    refine: Refinement,
    detail: Detail | None,
    jobs: tuple[TileJob, ...],
) -> ClassOutlines:
    if not any(job.cells.any() for job in jobs):
        return None
    window, refined = jobs[0].window, jobs[0].refined
    tile = grey.read(refined, REFINE_HALO, excess=True)
    pixels, tiles = np.zeros(tile.grey.shape, np.uint8), {}
    best = np.zeros(tile.grey.shape, np.int32)
    for number, (source, job) in enumerate(zip(similarities, jobs, strict=True), 1):
        possible = refine_tile(source, job.cells, LIKELY, refine, refined)
        if possible is None:
            continue
        inside, tiles[number] = possible
        similarity = np.where(inside & tile.valid, tiles[number].grey.astype(np.int32) + 1, 0)
        better = similarity > best
        pixels[better], best[better] = number, similarity[better]
    if detail is not None:
        pixels, tile = with_detail(pixels, tile, detail)
        tiles = {number: of_class.cropped(detail.halo) for number, of_class in tiles.items()}
    labels, count = components.label_equal_values(pixels, REFINE_HALO)
    outlines = outline_tile(pixels, labels, count, tile, window, grey.shape[1])
    if outlines is not None:
        outlines = replace(outlines, sums=_with_similarity(outlines.sums, pixels, labels, tiles))
    return _with_classes(pixels, outlines, window)


def _with_similarity(
    sums: components.Sums,
    pixels: NDArray[np.uint8],
    labels: NDArray[np.uint32],
    tiles: Mapping[int, GreyTile],
) -> components.Sums:
    """Return sums with those of the similarity of each region to its class; `tiles` has it by class."""
    similarity, steps = np.zeros(pixels.shape, np.uint16), np.zeros((len(sums.counts), 3), np.int64)
    for number, tile in tiles.items():
        here = pixels == number
        np.copyto(similarity, tile.grey, where=here)
        found = here.view(np.uint8), labels, len(steps), tile.grey, tile.valid, tile.large_step
        steps += components.border_steps(*found)
    total = components.component_sums(labels, len(steps), similarity, REFINE_HALO)
    columns = [part.astype(np.int64) for part in (total.counts, total.greys, total.squares, *steps.T[:2])]
    return replace(sums, similarity=np.stack(columns, 1))
