"""From a raster to regions: tiles are refined, numbered and outlined one by one, and joined at the end."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.raster.tiling import TilePass, Window, cells_around, window_cells
from uavseg.regions.outline.rasterise import Sketch, Sketches
from uavseg.regions.outline.stitch import Outlined, Tile, joined, outlined_tile
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.components import Sums, component_sums, label_components
from uavseg.segmentation.params import IntensityRange, Refinement
from uavseg.segmentation.pipeline import refine_tile
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.source import GreySource


def outline_regions(
    source: GreySource,
    inside: NDArray[np.uint8],
    interval: IntensityRange,
    refine: Refinement,
    tile_pass: TilePass,
    expected: BlockMap | None = None,
) -> Outlined:
    """Regions of a raster, refined to the pixel.

    Parameters
    ----------
    source : GreySource
    inside : (m, n) uint8 array
        What is known of cells, from `pipeline.cells_to_refine`.
    interval : IntensityRange
    refine : {"none", "scan", "smooth", "tv"}
        With "none", leaves that share an edge are one region also where invalid pixels part their pixels.
    tile_pass : TilePass
    expected : BlockMap, optional
        What the raster's cells must add up to, where the block map was made at another time.

    Raises
    ------
    RasterError
        If they do not.
    """
    jobs = _Jobs(inside, tile_pass.windows, expected)
    tiles = tile_pass.run(partial(_outline_tile, source, interval, refine), jobs)
    return joined(source.shape, tile_pass.windows, tiles).outlined(inside if refine == "none" else None)


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
        return _Job(window, cells_around(self._inside, window, REFINE_HALO), cells)


def _outline_tile(source: GreySource, interval: IntensityRange, refine: Refinement, job: _Job) -> Tile | None:
    found = refine_tile(source, job.inside, interval, refine, job.window)
    if found is None:
        return None
    pixels, tile = found
    if job.cells is not None and not _same(job.cells, cell_sums(tile.grey, tile.valid, REFINE_HALO)):
        raise RasterError(
            f"{source.dataset.source} is not as it was when its block map was made; make the block map again "
            "with uavseg divide, or give --refine none"
        )
    return outlined_tile(
        pixels, *label_components(pixels, REFINE_HALO), tile.grey, job.window, source.shape[1]
    )


def _same(first: tuple[NDArray[Any], ...], second: tuple[NDArray[Any], ...]) -> bool:
    return all(np.array_equal(one, other) for one, other in zip(first, second, strict=True))


def summed(source: GreySource, outlined: Outlined, tile_pass: TilePass) -> Sums:
    """Sums over the valid pixels that regions enclose, read again from the raster."""
    sums = outlined.sums
    greys, squares = np.zeros_like(sums.greys), np.zeros_like(sums.squares)
    counts = np.zeros_like(sums.counts)
    jobs = Sketches(outlined.rings, tile_pass.windows)
    for found in tile_pass.silent.run(partial(_sum_tile, source), jobs):
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
