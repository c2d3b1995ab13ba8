"""Out-of-core classification of pixels into states, by passes over strips of whole rows.

The scans of `state_scans` run along whole lines. So the raster is processed in strips of whole rows, and the
eight scans are four passes over the strips, upwards and downwards in turn:

up    read the tiles; compaction along rows, then from bottom to top
down  compaction from top to bottom; free against occupied along rows
up    free against occupied from bottom to top
down  free against occupied from top to bottom

Then thin obstacles are restored in two more passes, see `thin_structures`. In a trinary map a value is a
decision: there one pass gives each pixel the state of its own value, see `own_states`.

Between passes a pixel takes 4 bits, see `StateImage`.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import groupby
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, tile_side, tiles, whole_blocks, window_cells
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.params.segment import StateLimits
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.classified_states import ClassifiedStates
from uavseg.segmentation.states.obstacle_evidence import STRONG_ABOVE, evidence_rule
from uavseg.segmentation.states.state_image import StateImage, pack_codes, unpack_codes
from uavseg.segmentation.states.state_scans import (
    LOOKAHEAD,
    Codes,
    compact_columns,
    compact_rows,
    count_codes,
    encode_states,
    resolve_columns,
    resolve_rows,
)
from uavseg.segmentation.states.thin_structures import (
    ThinObstacles,
    count_left_out,
    find_thin_obstacles,
    with_restored,
)
from uavseg.segmentation.states.value_statistics import (
    ValueStatistics,
    value_levels,
    value_statistics,
)
from uavseg.units import BLOCK, CELL, FREE, GREY_MAX, UNKNOWN

StateRefinement = Literal["none", "scan"]

_MAX_STRIP_PIXELS = 1 << 25  # pixels of a strip, unless 64 rows have more


def classify_states(
    source: GreySource,
    cells: NDArray[np.uint8],
    limits: StateLimits,
    refine: StateRefinement,
    tile_pass: TilePass,
    restore: bool = False,
) -> ClassifiedStates:
    """Classify every pixel.

    Parameters
    ----------
    source : GreySource
    cells : (8 B, 8 C) uint8 array
        The states of the leaves, from `leaves.cell_states`.
    limits : StateLimits
    refine : {"scan", "none"}
        With "none", states end at block edges.
    tile_pass : TilePass
        Over the tiles of `state_strips`, strip by strip from the top; the result does not depend on them.
    restore : bool
        Whether thin obstacles become occupied, and unknown means evidence near 0.5, not the mean of free and
        occupied pixels; with refine "scan" alone.
    """
    image = StateImage(source.shape)
    strips = [list(strip) for _, strip in groupby(tile_pass.windows, key=lambda window: window.row)]
    passes = _Passes(image, [_strip_rows(strip) for strip in strips])
    upwards = [tile for strip in reversed(strips) for tile in strip]
    encoding, finding = tile_pass.stages(2)
    encode_tile = partial(_encode_tile, source, limits, restore)
    results = zip(upwards, encoding.run(encode_tile, _jobs(cells, upwards)), strict=True)
    codes, statistics = np.zeros(16, np.int64), ValueStatistics.empty()
    previous = np.zeros(image.cols, np.uint8)
    for strip in reversed(strips):
        tiles_of_strip = [next(results) for _ in strip]
        part = _assemble_strip(strip, tiles_of_strip, image.cols)
        for _, tile in tiles_of_strip:
            statistics = statistics if tile is None else statistics.merged(tile.statistics)
        if refine == "scan":
            compact_rows(part)
            compact_columns(part, previous, True)
        else:
            codes += count_codes(part)
        image.write_codes(strip[0].row, part)
    next(results, None)  # lets the executor finish and report it
    if refine == "scan":
        codes = passes.scan()
    thin = ThinObstacles({FREE: 0, UNKNOWN: 0}, 0)
    found = ClassifiedStates(image, codes, thin, statistics.noise, statistics.trinary)
    return _with_thin_obstacles(source, found, limits, restore, finding)


def own_states(source: GreySource, limits: StateLimits, tile_pass: TilePass) -> ClassifiedStates | None:
    """Each pixel's own state, where free, unknown and occupied pixels have one value each; else None.

    A map of probabilities is recognised in its first tiles.

    Parameters
    ----------
    source : GreySource
    limits : StateLimits
    tile_pass : TilePass
        As for `classify_states`.
    """
    image = StateImage(source.shape)
    statistics, codes = ValueStatistics.empty(), np.zeros(16, np.int64)
    with closing(tile_pass.run(partial(_encode_own, source, limits))) as tiles_in_turn:
        results = zip(tile_pass.windows, tiles_in_turn, strict=True)
        for row, of_strip in groupby(results, key=lambda result: result[0].row):
            strip, parts = [], []
            for window, tile in of_strip:
                statistics = statistics.merged(tile.statistics)
                if not statistics.trinary:
                    return None
                strip.append(window)
                parts.append((window, tile))
            part = _assemble_strip(strip, parts, image.cols)
            image.write_codes(row, part)
            codes += count_codes(part)
    return ClassifiedStates(image, codes, ThinObstacles({FREE: 0, UNKNOWN: 0}, 0), 0.0, True)


def _with_thin_obstacles(
    source: GreySource,
    found: ClassifiedStates,
    limits: StateLimits,
    restore: bool,
    tile_pass: TilePass,
) -> ClassifiedStates:
    """The states with thin obstacles, if any pixel is occupied by its own value alone."""
    if not any(count_left_out(found.codes).values()):
        if tile_pass.progress is not None:
            tile_pass.progress(1, 1)
        return found
    rule = evidence_rule(limits, int(found.codes.sum() - found.codes[0]), found.noise, found.trinary)
    thin = find_thin_obstacles(source, found.image, rule, tile_pass, restore)
    codes = with_restored(found.codes, thin.restored)
    return replace(found, codes=codes, thin=thin)


def state_strips(
    shape: tuple[int, int], file_block: tuple[int, int], tile: int | None = None
) -> list[list[Window]]:
    """Tiles that cover a raster in strips of whole rows, from the top.

    Parameters
    ----------
    shape, file_block : (int, int)
        Rows and columns of the raster, and of one block of its file.
    tile : int, optional
        Columns of a tile, and rows unless the raster is very wide; by default from the blocks of the file.

    Raises
    ------
    ParameterError
        If the tile's side is not a positive multiple of 64.
    """
    rows, cols = tile_side(shape, file_block) if tile is None else (tile, tile)
    max_rows = max(_MAX_STRIP_PIXELS // whole_blocks(shape[1]) // BLOCK, 1) * BLOCK
    windows = tiles(shape, (min(rows, max_rows), cols))
    across = -(-shape[1] // cols)
    return [windows[k : k + across] for k in range(0, len(windows), across)]


class _Passes:
    """The passes after the first."""

    def __init__(self, image: StateImage, rows: Sequence[tuple[int, int]]) -> None:
        self._image = image
        self._rows = rows  # first row and number of rows of each strip

    def scan(self) -> NDArray[np.int64]:
        """Run all passes; return the number of pixels by code."""
        self._compact_down()
        self._resolve_up()
        return self._resolve_down()

    def _compact_down(self) -> None:
        previous = np.zeros(self._image.cols, np.uint8)
        for row, rows in self._rows:
            codes = self._image.read_codes(row, rows)
            compact_columns(codes, previous, False)
            resolve_rows(codes)
            self._image.write_codes(row, codes)

    def _resolve_up(self) -> None:
        previous = np.zeros(self._image.cols, np.uint8)
        for row, rows in reversed(self._rows):
            codes = self._image.read_codes(row - LOOKAHEAD, rows + LOOKAHEAD)
            resolve_columns(codes, previous, True)
            self._image.write_codes(row, codes[LOOKAHEAD:])

    def _resolve_down(self) -> NDArray[np.int64]:
        previous = np.zeros(self._image.cols, np.uint8)
        counts = np.zeros(16, np.int64)
        for row, rows in self._rows:
            codes = self._image.read_codes(row, rows + LOOKAHEAD)
            resolve_columns(codes, previous, False)
            part = codes[:-LOOKAHEAD]
            self._image.write_codes(row, part)
            counts += count_codes(part)
        return counts


def _strip_rows(strip: Sequence[Window]) -> tuple[int, int]:
    """First row and number of rows, rounded up to whole blocks."""
    return strip[0].row, whole_blocks(strip[0].rows)


@dataclass(frozen=True, slots=True)
class _Job:
    """A tile and the states of its cells."""

    window: Window
    cells: NDArray[np.uint8]


def _jobs(cells: NDArray[np.uint8], windows: Sequence[Window]) -> LazySequence[_Job]:
    """The jobs of all tiles, each made when it is indexed."""
    return LazySequence(len(windows), partial(_job, cells, windows))


def _job(cells: NDArray[np.uint8], windows: Sequence[Window], k: int) -> _Job:
    window = windows[k]
    return _Job(window, np.ascontiguousarray(cells[window_cells(window)]))


@dataclass(frozen=True, slots=True)
class _EncodedTile:
    """The codes of a tile's whole blocks, packed, and the statistics of its values."""

    pairs: NDArray[np.uint8]
    statistics: ValueStatistics


def _encode_tile(source: GreySource, limits: StateLimits, part: bool, job: _Job) -> _EncodedTile | None:
    """Encode a tile; None where no pixel is valid.

    With `part`, free pixels of unknown leaves that mix free and occupied ones are free; their occupied ones
    are thin obstacles.
    """
    if not job.cells.any():
        return None
    tile = source.read(job.window, 0)
    own = _own_states(limits)[tile.grey]
    states = cells_to_pixels(job.cells, tile.valid)
    if part:
        surely_free = min(1 - STRONG_ABOVE, limits.free_below)
        surely_occupied = max(STRONG_ABOVE, limits.occupied_above)
        _free_mixed(tile.grey, states, GREY_MAX * surely_free, GREY_MAX * surely_occupied)
    pairs = pack_codes(encode_states(states, own))
    return _EncodedTile(pairs, value_statistics(tile.grey, tile.valid, own))


def _encode_own(source: GreySource, limits: StateLimits, window: Window) -> _EncodedTile:
    """Encode a tile by the own values of its pixels."""
    tile = source.read(window, 0)
    own = _own_states(limits)[tile.grey] * tile.valid
    pairs = pack_codes(own | own << np.uint8(2))
    return _EncodedTile(pairs, value_levels(tile.grey, tile.valid, own))


@lru_cache(maxsize=8)
def _own_states(limits: StateLimits) -> NDArray[np.uint8]:
    """Lookup table from grey to state."""
    return limits.table


def _assemble_strip(
    strip: Sequence[Window], parts: Sequence[tuple[Window, _EncodedTile | None]], cols: int
) -> Codes:
    """Assemble the codes of a strip from those of its tiles."""
    codes = np.zeros((whole_blocks(strip[0].rows), cols), np.uint8)
    for window, tile in parts:
        if tile is not None:
            unpack_codes(tile.pairs, codes[:, window.col : window.col + 2 * tile.pairs.shape[1]])
    return codes


@kernel("void(u2[:,::1], u1[:,::1], f8, f8)")
def _free_mixed(grey, states, free, occupied):  # type: ignore[no-untyped-def]
    # A cell is mixed where more than a quarter of its pixels are far from 0.5: noise hardly lifts so many.
    for top in range(0, grey.shape[0], CELL):
        for left in range(0, grey.shape[1], CELL):
            unknown, far = 0, 0
            for r in range(top, top + CELL):
                for c in range(left, left + CELL):
                    if states[r, c] == np.uint8(UNKNOWN):
                        unknown += 1
                        far += grey[r, c] < free or grey[r, c] > occupied
            if 4 * far <= unknown:
                continue
            for r in range(top, top + CELL):
                for c in range(left, left + CELL):
                    if states[r, c] == np.uint8(UNKNOWN) and grey[r, c] < free:
                        states[r, c] = np.uint8(FREE)
