"""Segments of several kinds, refined to the pixel: tiles are refined, labelled and traced, then stitched."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.stitch import TileOutlines, outline_tile, stitch_tiles
from uavseg.regions.tiles.detail_tiles import with_detail
from uavseg.regions.tiles.range_tiles import TileJob, check_sums, tile_jobs
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.components import label_equal_values
from uavseg.segmentation.kinds import refine_kinds_of_tile
from uavseg.segmentation.params.partition import Partition
from uavseg.segmentation.params.segment import Refinement
from uavseg.segmentation.pipeline import every_cell
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource, GreyTile

Firsts = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class KindsByPixel:
    """The kinds of segments, by their first pixels, so that they are known however segments are renumbered.

    Parameters
    ----------
    firsts : (n, 2) int64 array
        In raster order.
    kinds : (n,) uint8 array
    """

    firsts: Firsts
    kinds: NDArray[np.uint8]

    @classmethod
    def of(cls, firsts: Firsts, kinds: NDArray[np.uint8]) -> "KindsByPixel":
        """Of components in any order."""
        order = np.lexsort((firsts[:, 1], firsts[:, 0]))
        return cls(firsts[order], kinds[order])

    def at(self, firsts: Firsts) -> NDArray[np.int64]:
        """The kinds of some of the components, by their first pixels, (k,) int64.

        Parameters
        ----------
        firsts : (k, 2) int64 array
        """
        width = 1 + max(int(self.firsts[:, 1].max(initial=0)), int(firsts[:, 1].max(initial=0)))
        place = np.searchsorted(self.firsts @ (width, 1), firsts @ (width, 1))
        return self.kinds[place].astype(np.int64)


def outline_refined_kinds(
    source: GreySource,
    partition: Partition,
    refine: Refinement,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
    detail: Detail | None = None,
) -> tuple[RegionOutlines, KindsByPixel]:
    """Outline segments of several kinds, refined to the pixel together: none overlap, and borders are shared.

    Parameters
    ----------
    source : GreySource
    partition : Partition
    refine : {"tv", "pixels"}
    tile_pass : TilePass
    expected : BlockMap, optional
        The sums and counts that cells must have, if the block map was made earlier.
    detail : Detail, optional
        Structures that are narrower vanish from what was refined.

    Raises
    ------
    RasterError
        If a cell has other sums or counts than expected.
    """
    jobs = tile_jobs(every_cell(source.shape), tile_pass.windows, expected, detail)
    tiles = tile_pass.run(partial(_outline_tile, source, partition.grey_table, refine, detail), jobs)
    return stitch_kinds(source.shape, tile_pass.windows, tiles)


def stitch_kinds(
    shape: tuple[int, int], windows: Sequence[Window], tiles: Iterable["KindOutlines | None"]
) -> tuple[RegionOutlines, KindsByPixel]:
    """All regions of several kinds; those of different kinds stay apart.

    Parameters
    ----------
    shape, windows
        As of `stitch_tiles`.
    tiles : iterable of KindOutlines or None
        One for each window.
    """
    found: list[tuple[Firsts, NDArray[np.uint8]]] = []
    stitcher = stitch_tiles(shape, windows, _outlines(tiles, found))
    firsts = np.concatenate([np.empty((0, 2), np.int64), *(firsts for firsts, _ in found)])
    kinds = np.concatenate([np.empty(0, np.uint8), *(kinds for _, kinds in found)])
    return stitcher.finish(kinds=kinds), KindsByPixel.of(firsts, kinds)


@dataclass(frozen=True, slots=True)
class KindOutlines:
    """Components of a tile, and the kind of each."""

    outlines: TileOutlines
    kinds: NDArray[np.uint8]

    @classmethod
    def of(
        cls, pixels: NDArray[np.uint8], tile: GreyTile, window: Window, width: int
    ) -> "KindOutlines | None":
        """Those of a tile whose pixels have kinds; None where all are 0.

        Parameters
        ----------
        pixels : (M + 2 REFINE_HALO, N + 2 REFINE_HALO) uint8 array
        tile : GreyTile
            Grey of the same pixels.
        window : Window
        width : int
            Columns of the raster.
        """
        return cls.of_labels(pixels, *label_equal_values(pixels, REFINE_HALO), tile, window, width)

    @classmethod
    def of_labels(
        cls,
        pixels: NDArray[np.uint8],
        labels: NDArray[np.uint32],
        count: int,
        tile: GreyTile,
        window: Window,
        width: int,
    ) -> "KindOutlines | None":
        """As `of`, with the components of the pixels, from `label_equal_values`."""
        outlines = outline_tile(pixels, labels, count, tile, window, width)
        if outlines is None:
            return None
        row, col = (outlines.sums.firsts - (window.row, window.col) + REFINE_HALO).T
        return cls(outlines, pixels[row, col])


def _outlines(
    tiles: Iterable[KindOutlines | None], found: list[tuple[Firsts, NDArray[np.uint8]]]
) -> Iterator[TileOutlines | None]:
    """The outlines of tiles; the first pixels and kinds of their components are appended to `found`."""
    for tile in tiles:
        if tile is None:
            yield None
            continue
        found.append((tile.outlines.sums.firsts, tile.kinds))
        yield tile.outlines


def _outline_tile(
    source: GreySource, table: NDArray[np.uint8], refine: Refinement, detail: Detail | None, job: TileJob
) -> KindOutlines | None:
    refined = refine_kinds_of_tile(source, table, refine, job.refined)
    if refined is None:
        return None
    pixels, tile = refined if detail is None else with_detail(*refined, detail)
    check_sums(source, job, tile)
    return KindOutlines.of(pixels, tile, job.window, source.shape[1])
