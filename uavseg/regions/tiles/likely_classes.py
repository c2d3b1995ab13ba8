"""Regions of several classes, each with its own likeness: tiles are refined class by class, then decided."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.lazy_sequence import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.detail_tiles import with_detail
from uavseg.regions.tiles.range_tiles import TileJob, tile_jobs
from uavseg.regions.tiles.refined_kinds import KindOutlines, KindsByPixel, stitch_kinds
from uavseg.segmentation.border_steps import border_steps
from uavseg.segmentation.components import component_sums, label_equal_values
from uavseg.segmentation.params.segment import IntensityRange, Refinement
from uavseg.segmentation.pipeline import refine_tile
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource, GreyTile


def outline_likely_classes(
    grey: GreySource,
    likenesses: Sequence[GreySource],
    cells: Sequence[NDArray[np.uint8]],
    refine: Refinement,
    tile_pass: TilePass,
    detail: Detail | None = None,
) -> tuple[RegionOutlines, KindsByPixel]:
    """Outline the regions of classes: each pixel is of the likeliest class that it may be of, or none.

    Parameters
    ----------
    grey : GreySource
        The intensity that regions are measured in.
    likenesses : sequence of GreySource
        The likeness of each class; a pixel may be of a class where it is one half and more, refined.
    cells : sequence of (m, n) uint8 array
        Of each class, from `pipeline.cells_to_refine`.
    refine : {"tv", "none"}
    tile_pass : TilePass
    detail : Detail, optional
        Structures that are narrower go to the classes beside them, or to none; not with "none".

    Returns
    -------
    outlined : RegionOutlines
        With the sums of grey, and of the likeness of each region to its own class.
    kinds : KindsByPixel
        1 for the first class, and so on.
    """
    windows = tile_pass.windows
    jobs = [tile_jobs(one, windows, None, detail) for one in cells]
    tiles = tile_pass.run(
        partial(_outline_tile, grey, likenesses, refine, detail),
        LazySequence(len(windows), partial(_same_tile, jobs)),
    )
    return stitch_kinds(grey.shape, windows, tiles)


LIKELY = IntensityRange(0.5, 1)


def _same_tile(jobs: Sequence[Sequence[TileJob]], k: int) -> tuple[TileJob, ...]:
    return tuple(of_class[k] for of_class in jobs)


def _outline_tile(
    grey: GreySource,
    likenesses: Sequence[GreySource],
    refine: Refinement,
    detail: Detail | None,
    jobs: tuple[TileJob, ...],
) -> KindOutlines | None:
    if not any(job.cells.any() for job in jobs):
        return None
    window, refined = jobs[0].window, jobs[0].refined
    tile = grey.read(refined, REFINE_HALO, beyond=True)
    kinds, tiles = np.zeros(tile.grey.shape, np.uint8), {}
    most = np.zeros(tile.grey.shape, np.int32)
    for kind, (source, job) in enumerate(zip(likenesses, jobs, strict=True), 1):
        found = refine_tile(source, job.cells, LIKELY, refine, refined)
        if found is None:
            continue
        pixels, tiles[kind] = found
        likeness = np.where(pixels & tile.valid, tiles[kind].grey.astype(np.int32) + 1, 0)
        more = likeness > most
        kinds[more], most[more] = kind, likeness[more]
    if detail is not None:
        kinds, tile = with_detail(kinds, tile, detail)
        tiles = {kind: found.cropped(detail.halo) for kind, found in tiles.items()}
    return _with_likeness(kinds, tiles, tile, window, grey.shape[1])


def _with_likeness(
    kinds: NDArray[np.uint8], tiles: Mapping[int, GreyTile], grey: GreyTile, window: Window, width: int
) -> KindOutlines | None:
    """Outlines of a tile, with sums of grey, and of the likeness of each region to its own class.

    Parameters
    ----------
    kinds : (M + 2 REFINE_HALO, N + 2 REFINE_HALO) uint8 array
    tiles : mapping of int to GreyTile
        The likeness of each kind that occurs.
    grey : GreyTile
    window : Window
    width : int
        Columns of the raster.
    """
    labels, count = label_equal_values(kinds, REFINE_HALO)
    found = KindOutlines.of_labels(kinds, labels, count, grey, window, width)
    if found is None:
        return None
    own, steps = np.zeros_like(grey.grey), np.zeros((count, 2), np.int64)
    for kind, tile in tiles.items():
        here = kinds == kind
        np.copyto(own, tile.grey, where=here)
        steps += border_steps(here.view(np.uint8), labels, count, tile.grey, tile.valid)
    sums = component_sums(labels, count, own, REFINE_HALO)
    alike = np.stack([part.astype(np.int64) for part in (sums.counts, sums.greys, sums.squares)], 1)
    outlines = replace(found.outlines, sums=replace(found.outlines.sums, steps=steps, alike=alike))
    return replace(found, outlines=outlines)
