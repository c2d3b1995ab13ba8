"""From leaves to the states of pixels, strip by strip: nothing of the size of the raster is held in memory.

The scans of `statescans` run along whole lines. So the raster is taken in strips of whole rows, and the
eight scans are four passes over the strips, up and down in turn:

up    tiles are read; compaction along rows, then from bottom to top
down  compaction from top to bottom; free against occupied along rows
up    free against occupied from bottom to top
down  free against occupied from top to bottom

Between passes a pixel is half a byte, see `StateImage`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import Map, Progress, serial
from uavseg.execution.lazy_sequence import LazySequence
from uavseg.raster.tiling import Window, tile_side, tiles, whole_blocks, window_cells
from uavseg.segmentation.blocks.leaves import pixels_of
from uavseg.segmentation.intervals import StateLimits
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.state_image import StateImage, packed, unpack
from uavseg.segmentation.states.state_scans import (
    AHEAD,
    Codes,
    codes_of,
    compact_columns,
    compact_rows,
    count_codes,
    settle_columns,
    settle_rows,
)
from uavseg.units import BLOCK, FREE, OCCUPIED, UNKNOWN

StateRefinement = Literal["none", "scan"]

_MOST = 1 << 25  # pixels of a strip, unless 64 rows have more


@dataclass(frozen=True)
class Classified:
    """The states of a raster's pixels.

    Parameters
    ----------
    image : StateImage
    codes : (16,) int64 array
        How many pixels have each code, see `statescans`.
    """

    image: StateImage
    codes: NDArray[np.int64]

    @property
    def pixels(self) -> dict[int, int]:
        """How many pixels have each state: 1 free, 2 unknown, 3 occupied, and 0 for all others."""
        found = {state: int(self.codes[state::4].sum()) for state in (FREE, UNKNOWN, OCCUPIED)}
        rows, cols = self.image.shape
        return {0: rows * cols - sum(found.values())} | found

    @property
    def occupied_in_free(self) -> int:
        """Pixels that are called free and whose own v is that of an occupied one: thin walls, perhaps."""
        return int(self.codes[FREE | OCCUPIED << 2])

    @property
    def occupied_by_value(self) -> int:
        """Pixels whose own v is that of an occupied one, whatever they are called."""
        return int(self.codes[OCCUPIED << 2 :].sum())


def classified(
    source: GreySource,
    cells: NDArray[np.uint8],
    limits: StateLimits,
    refine: StateRefinement,
    strips: Sequence[Sequence[Window]],
    map: Map = serial,
    progress: Progress | None = None,
) -> Classified:
    """The state of every pixel.

    Parameters
    ----------
    source : GreySource
    cells : (8 B, 8 C) uint8 array
        The states of the leaves, from `segments.states_of`.
    limits : StateLimits
    refine : {"scan", "none"}
        With "none", states end at block edges.
    strips : sequence of sequences of Window
        Tiles that cover the raster, see `strips_of`; how it is cut changes nothing.
    map, progress
        Who reads the tiles, and who is told.
    """
    image = StateImage(source.shape)
    passes = _Passes(image, [_rows_of(strip) for strip in strips])
    upwards = [tile for strip in reversed(strips) for tile in strip]
    found = zip(
        upwards, map(partial(_codes_tile, source, limits), _jobs(cells, upwards), progress), strict=True
    )
    codes = np.zeros(16, np.int64)
    before = np.zeros(image.cols, np.uint8)
    for strip in reversed(strips):
        part = _assembled(strip, [next(found) for _ in strip], image.cols)
        if refine == "scan":
            compact_rows(part)
            compact_columns(part, before, True)
        else:
            codes += count_codes(part)
        image.put(strip[0].row, part)
    next(found, None)  # lets the map end, and tell that it did
    return Classified(image, passes.settled() if refine == "scan" else codes)


def strips_of(
    shape: tuple[int, int], file_block: tuple[int, int], tile: int | None = None
) -> list[list[Window]]:
    """Tiles that cover a raster in strips of whole rows, from the top.

    Parameters
    ----------
    shape, file_block : (int, int)
        Rows and columns of the raster, and of one block of its file.
    tile : int, optional
        Columns of a tile, and rows unless the raster is very wide; else what suits the file.

    Raises
    ------
    ParameterError
        If the tile's side is not a positive multiple of 64.
    """
    rows, cols = tile_side(shape, file_block) if tile is None else (tile, tile)
    most = max(_MOST // whole_blocks(shape[1]) // BLOCK, 1) * BLOCK
    windows = tiles(shape, (min(rows, most), cols))
    across = -(-shape[1] // cols)
    return [windows[k : k + across] for k in range(0, len(windows), across)]


class _Passes:
    """The passes after the first one."""

    def __init__(self, image: StateImage, rows: Sequence[tuple[int, int]]) -> None:
        self._image = image
        self._rows = rows  # the first row of each strip, and how many there are

    def settled(self) -> NDArray[np.int64]:
        """All of them; how many pixels have each code in the end."""
        self._compact_down()
        self._settle_up()
        return self._settle_down()

    def _compact_down(self) -> None:
        before = np.zeros(self._image.cols, np.uint8)
        for row, rows in self._rows:
            codes = self._image.codes(row, rows)
            compact_columns(codes, before, False)
            settle_rows(codes)
            self._image.put(row, codes)

    def _settle_up(self) -> None:
        before = np.zeros(self._image.cols, np.uint8)
        for row, rows in reversed(self._rows):
            codes = self._image.codes(row - AHEAD, rows + AHEAD)
            settle_columns(codes, before, True)
            self._image.put(row, codes[AHEAD:])

    def _settle_down(self) -> NDArray[np.int64]:
        before = np.zeros(self._image.cols, np.uint8)
        counts = np.zeros(16, np.int64)
        for row, rows in self._rows:
            codes = self._image.codes(row, rows + AHEAD)
            settle_columns(codes, before, False)
            self._image.put(row, codes[:-AHEAD])
            counts += count_codes(codes[:-AHEAD])
        return counts


def _rows_of(strip: Sequence[Window]) -> tuple[int, int]:
    return strip[0].row, whole_blocks(strip[0].rows)


@dataclass(frozen=True, slots=True)
class _Job:
    """A tile, and the states of its cells."""

    window: Window
    cells: NDArray[np.uint8]


def _jobs(cells: NDArray[np.uint8], windows: Sequence[Window]) -> LazySequence[_Job]:
    """The jobs of all tiles, each made when it is asked for."""
    return LazySequence(len(windows), partial(_job, cells, windows))


def _job(cells: NDArray[np.uint8], windows: Sequence[Window], k: int) -> _Job:
    window = windows[k]
    return _Job(window, np.ascontiguousarray(cells[window_cells(window)]))


def _codes_tile(source: GreySource, limits: StateLimits, job: _Job) -> NDArray[np.uint8] | None:
    """The codes of a tile's whole blocks, packed; None where no pixel is valid."""
    if not job.cells.any():
        return None
    tile = source.read(job.window, 0)
    return packed(codes_of(pixels_of(job.cells, tile.valid), _own_states(limits)[tile.grey]))


@lru_cache(maxsize=8)
def _own_states(limits: StateLimits) -> NDArray[np.uint8]:
    return limits.table


def _assembled(
    strip: Sequence[Window], parts: Sequence[tuple[Window, NDArray[np.uint8] | None]], cols: int
) -> Codes:
    """The codes of a strip from those of its tiles."""
    codes = np.zeros((whole_blocks(strip[0].rows), cols), np.uint8)
    for window, pairs in parts:
        if pairs is not None:
            unpack(pairs, codes[:, window.col : window.col + 2 * pairs.shape[1]])
    return codes
