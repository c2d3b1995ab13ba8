"""Regions of a range in partitions, squares of a raster of any size whose tiles are joined by one worker.

Joins form a tree of two levels. First a worker outlines each partition. It keeps complete regions, and the
components that reach a border with another partition, in a shared folder. Labels along borders are united
(union-find). Then each region is put together by a worker, for the partition that has its first pixel.

Where leaves decide, the contrast of the whole raster is counted before, and the worker of a partition
measures the block map of its partition.
"""

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError
from uavseg.execution.checkpoint import DamagedResultError, decode_result, encode_result
from uavseg.output.atomic import atomic_file
from uavseg.output.renames import recover
from uavseg.raster.grid.tiling import TilePass, Window, tiles, whole_blocks
from uavseg.regions.outline import stitch
from uavseg.regions.outline.chains import OWNER
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.range_tiles import outline, tile_jobs
from uavseg.segmentation import pipeline
from uavseg.segmentation.blocks.lbp import contrast_bin_edges
from uavseg.segmentation.components import union_roots
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.refine.detail import Detail, ThinLines
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_LEVELS

PARTITION = 8192  # side of a partition in pixels; independent of the tiles of the processing, as results are


@dataclass(frozen=True, slots=True)
class PartitionJob:
    """A partition, by number, and the components of its regions: by partition, number in it, and region."""

    number: int
    partitions: Integers
    components: Integers
    regions: Integers

    def outlines(self, folder: str) -> RegionOutlines:
        """Put the regions of the partition together, from the files of `join_partitions`."""
        pieces = [_read(folder, "within", self.number)]
        groups = [np.arange(len(pieces[0].sums.counts))]
        for number in np.unique(self.partitions):
            here = self.partitions == number  # components of a partition are in order
            pieces.append(_read(folder, "reaching", number).select(self.components[here]))
            groups.append(self.regions[here] + len(groups[0]))
        offset = 0
        for piece in pieces:
            piece.chains.table[:, OWNER] += offset
            offset += len(piece.sums.counts)
        sums, group = stitch.concatenate_sums([piece.sums for piece in pieces]), np.concatenate(groups)
        return stitch.number_regions(sums, group, group, [piece.chains for piece in pieces])


def join_partitions(
    source: GreySource,
    interval: IntensityRange,
    segment: SegmentParams,
    tile_pass: TilePass,
    folder: Path,
    detail: Detail | ThinLines | None = None,
    side: int = PARTITION,
) -> list[PartitionJob]:
    """Outline the partitions of a raster, and find the components that are one region.

    Parameters are those of `outline_regions`, with a refinement other than "none". The workers share the
    `folder`, which holds components until their regions are put together; otherwise an OutputError is raised.
    `side` is that of a partition in pixels, a multiple of 64. There is a job for each partition with
    components, row by row.
    """
    first, windows = tile_pass.windows[0], tiles(source.shape, side)
    tile = whole_blocks(first.rows), whole_blocks(first.cols)
    edges = None
    if not segment.decides_pixels:
        counting, tile_pass = tile_pass.stages(2)
        contrasts = np.zeros(GREY_LEVELS, np.int64)
        for part in counting.run(partial(_sum_contrasts, source, tile), windows):
            contrasts += part
        edges = contrast_bin_edges(contrasts)
    outline_one = partial(
        _outline_partition, source, interval, segment, edges, detail, tile, str(folder.absolute())
    )
    contacts, firsts = stitch.Contacts(source.shape, windows[0]), dict[int, Integers]()
    for number, joined in enumerate(tile_pass.run(outline_one, list(enumerate(windows)))):
        if joined is not None:
            firsts[number] = joined[0]
        contacts.add(windows[number], len(firsts.get(number, ())), None if joined is None else joined[1])
    recover(folder)  # what workers left that were killed
    if not all(_path(folder, "within", number).is_file() for number in firsts):
        raise OutputError("what workers wrote is not here; workers must share the folder of the output")
    regions = union_roots(contacts.pairs, contacts.count)
    width = source.shape[1]
    partitions = np.repeat(list(firsts), [len(first) for first in firsts.values()])
    components = np.concatenate([np.empty(0, int), *(np.arange(len(first)) for first in firsts.values())])
    pixels = np.concatenate([np.empty(0, int), *(first @ (width, 1) for first in firsts.values())])
    first_pixels = np.full(len(regions), np.iinfo(np.int64).max)
    np.minimum.at(first_pixels, regions, pixels)
    row, col = np.divmod(first_pixels[regions], width)
    owners = row // side * -(-width // side) + col // side
    order = np.argsort(owners, kind="stable")
    begins, ends = (np.searchsorted(owners[order], list(firsts), at) for at in ("left", "right"))
    columns = [column[order] for column in (partitions, components, regions)]
    return [
        PartitionJob(number, *(column[begin:end] for column in columns))
        for number, begin, end in zip(firsts, begins.tolist(), ends.tolist(), strict=True)
    ]


def _outline_partition(
    source: GreySource,
    interval: IntensityRange,
    segment: SegmentParams,
    bin_edges: NDArray[np.int32] | None,
    detail: Detail | ThinLines | None,
    tile: tuple[int, int],
    folder: str,
    item: tuple[int, Window],
) -> tuple[Integers, stitch.Borders] | None:
    """Outline a partition into a folder; return its borders, and first pixels of what reaches them."""
    number, window = item
    around, windows = window, _tiles_of(window, tile)
    if bin_edges is None:
        cells = pipeline.every_cell((window.rows, window.cols))
    else:
        around = window.grown(whole_blocks(REFINE_HALO)).clipped(source.shape)
        part = pipeline.Part(around, bin_edges)
        blocks = pipeline.measure_block_map_for(
            source, interval, segment, TilePass(_tiles_of(around, tile)), part
        )
        cells = pipeline.cells_to_refine(blocks, interval, segment)
    jobs = tile_jobs(cells, windows, detail=detail, part=around)
    outlined = map(partial(outline, source, interval, segment.refine, detail), jobs)
    joined = stitch.TileStitcher(source.shape, windows, outlined).join(window)
    if joined is None:
        return None
    for name, components in (("reaching", joined[1]), ("within", joined[2])):
        path = _path(folder, name, number)
        with atomic_file(path, overwrite=True, sync=False) as file:
            file.write_bytes(encode_result(components, path.name))
    return joined[1].sums.firsts, joined[0]


def _sum_contrasts(source: GreySource, tile: tuple[int, int], window: Window) -> NDArray[np.int64]:
    return pipeline.sum_contrasts(source, _tiles_of(window, tile))


def _tiles_of(part: Window, tile: tuple[int, int]) -> list[Window]:
    """Return the tiles of a part of a raster that begins at a block."""
    inner = tiles((part.rows, part.cols), tile)
    return [Window(part.row + one.row, part.col + one.col, one.rows, one.cols) for one in inner]


def _read(folder: str, name: str, number: int) -> stitch.Components:
    path = _path(folder, name, number)
    try:
        components: stitch.Components = decode_result(path.read_bytes(), path.name)
    except DamagedResultError as error:
        raise OutputError(f"{path} is damaged: {error}; delete its folder, and start again") from None
    return components


def _path(folder: str | Path, name: str, number: int) -> Path:
    return Path(folder) / f"{number}.{name}.npz"
