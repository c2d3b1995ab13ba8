"""Regions of several classes, each with its own likeness: tiles are refined class by class, then decided."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.lazy_sequence import LazySequence
from uavseg.raster.tiling import TilePass, Window, cells_around
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.refined_kinds import KindOutlines, KindsByPixel, stitch_kinds
from uavseg.segmentation.params import IntensityRange, Refinement
from uavseg.segmentation.pipeline import refine_tile
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource

_Job = tuple[Window, tuple[NDArray[np.uint8], ...]]


def outline_likely_classes(
    grey: GreySource,
    likenesses: Sequence[GreySource],
    cells: Sequence[NDArray[np.uint8]],
    refine: Refinement,
    tile_pass: TilePass,
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

    Returns
    -------
    outlined : RegionOutlines
    kinds : KindsByPixel
        1 for the first class, and so on.
    """
    windows = tile_pass.windows
    jobs = LazySequence(len(windows), partial(_job, windows, cells))
    tiles = tile_pass.run(partial(_outline_tile, grey, likenesses, refine), jobs)
    return stitch_kinds(grey.shape, windows, tiles)


LIKELY = IntensityRange(0.5, 1)


def _job(windows: Sequence[Window], cells: Sequence[NDArray[np.uint8]], k: int) -> _Job:
    return windows[k], tuple(cells_around(one, windows[k], REFINE_HALO) for one in cells)


def _outline_tile(
    grey: GreySource, likenesses: Sequence[GreySource], refine: Refinement, job: _Job
) -> KindOutlines | None:
    window, cells = job
    if not any(one.any() for one in cells):
        return None
    tile = grey.read(window, REFINE_HALO, beyond=True)
    kinds = np.zeros(tile.grey.shape, np.uint8)
    most = np.zeros(tile.grey.shape, np.int32)
    for kind, (source, own) in enumerate(zip(likenesses, cells, strict=True), 1):
        found = refine_tile(source, own, LIKELY, refine, window)
        if found is None:
            continue
        likeness = np.where(found[0] & tile.valid, found[1].grey.astype(np.int32) + 1, 0)
        more = likeness > most
        kinds[more], most[more] = kind, likeness[more]
    return KindOutlines.of(kinds, tile, window, grey.shape[1])
