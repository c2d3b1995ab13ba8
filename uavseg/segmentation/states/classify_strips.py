"""Out-of-core classification of pixels into free, unknown and occupied, by passes over strips of rows.

The scans of `state_scans` run along whole lines. So the raster is processed in strips of whole rows, and the
eight scans are four passes over the strips, upwards and downwards in turn:

up    read the tiles; compaction along rows, then from bottom to top
down  compaction from top to bottom; free against occupied along rows
up    free against occupied from bottom to top
down  free against occupied from top to bottom

Then thin obstacles are restored in two more passes, see `thin_structures`. In a trinary map a value is a
decision: there one pass gives each pixel the state of its value, see `states_by_value`.

Between passes a pixel takes 4 bits, see `StateImage`.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import lru_cache, partial
from itertools import groupby
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.arrays import Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, tile_side, tiles, whole_blocks, window_cells
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.params.segment import StateLimits
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states import obstacle_evidence, state_scans
from uavseg.segmentation.states.state_image import StateImage, pack_codes, unpack_codes
from uavseg.segmentation.states.thin_structures import BY_VALUE_ALONE, ThinObstacles, find_thin_obstacles
from uavseg.units import BLOCK, CELL, FREE, GREY_MAX, OCCUPIED, UNKNOWN

StateRefinement = Literal["none", "scan"]

NO_OBSTACLES = ThinObstacles({FREE: 0, UNKNOWN: 0}, 0)
_MAX_STRIP_PIXELS = 1 << 25  # pixels of a strip, unless 64 rows have more


@dataclass(frozen=True)
class ClassifiedStates:
    """States of a raster's pixels, with counts by state and by the state of their value."""

    image: StateImage
    codes: Integers  # (16,): numbers of pixels by code, see `state_scans`
    thin: ThinObstacles  # restored or lost
    noise: float  # standard deviation of the noise of v
    trinary: bool  # free, unknown and occupied pixels have one value each

    @property
    def pixels(self) -> dict[int, int]:
        """Number of pixels by state: 1 free, 2 unknown, 3 occupied, 0 for all others."""
        counts = {state: int(self.codes[state::4].sum()) for state in (FREE, UNKNOWN, OCCUPIED)}
        rows, cols = self.image.shape
        return {0: rows * cols - sum(counts.values())} | counts

    @property
    def occupied_in_free(self) -> int:
        """Number of pixels in state free whose v is occupied: possibly thin walls."""
        return int(self.codes[FREE | OCCUPIED << 2])

    @property
    def unknown_in_free(self) -> int:
        """Number of pixels in state free whose v is unknown."""
        return int(self.codes[FREE | UNKNOWN << 2])

    @property
    def occupied_by_value(self) -> int:
        """Number of pixels whose v is occupied, in any state."""
        return int(self.codes[OCCUPIED << 2 :].sum())


def classify_states(
    source: GreySource,
    cells: Uint8s,
    limits: StateLimits,
    refine: StateRefinement,
    tile_pass: TilePass,
    restore: bool = False,
) -> ClassifiedStates:
    """Classify every pixel.

    `cells`, (8 B, 8 C), are the states of the leaves, of `cell_intervals`. With `refine` "none", states
    end at block edges. The pass is over the tiles of `state_strips`, strip by strip from the top; the result
    does not depend on them. With `restore`, thin obstacles become occupied, and unknown means evidence near
    0.5, not the mean of free and occupied pixels; with refine "scan" alone.
    """
    image = StateImage(source.shape)
    strips = [list(strip) for _, strip in groupby(tile_pass.windows, key=lambda window: window.row)]
    upwards = [tile for strip in reversed(strips) for tile in strip]
    encoding, finding = tile_pass.stages(2)
    encode_tile = partial(_encode_tile, source, limits, restore)
    parts = LazySequence(len(upwards), lambda k: np.ascontiguousarray(cells[window_cells(upwards[k])]))
    jobs = LazySequence(len(upwards), lambda k: (upwards[k], parts[k]))
    results = zip(upwards, encoding.run(encode_tile, jobs), strict=True)
    codes, statistics = np.zeros(16, np.int64), obstacle_evidence.ValueStatistics.empty()
    previous = np.zeros(image.cols, np.uint8)
    for strip in reversed(strips):
        tiles_of_strip = [next(results) for _ in strip]
        part = _assemble_strip(strip, tiles_of_strip, image.cols)
        for _, tile in tiles_of_strip:
            statistics = statistics if tile is None else statistics.merged(tile.statistics)
        if refine == "scan":
            state_scans.compact_rows(part)
            state_scans.compact_columns(part, previous, True)
        else:
            codes += state_scans.count_codes(part)
        image.write_codes(strip[0].row, part)
    next(results, None)  # lets the executor finish and report it
    if refine == "scan":
        codes = _scan(image, [(strip[0].row, whole_blocks(strip[0].rows)) for strip in strips])
    noise, trinary = statistics.noise, statistics.trinary
    states = ClassifiedStates(image=image, codes=codes, thin=NO_OBSTACLES, noise=noise, trinary=trinary)
    return _with_thin_obstacles(source, states, limits, restore, finding)


def states_by_value(source: GreySource, limits: StateLimits, tile_pass: TilePass) -> ClassifiedStates | None:
    """Classify each pixel by its value if free, unknown and occupied pixels have one value each; else None.

    A map of probabilities is recognised in its first tiles. The pass is that of `classify_states`.
    """
    image = StateImage(source.shape)
    statistics, codes = obstacle_evidence.ValueStatistics.empty(), np.zeros(16, np.int64)
    with closing(tile_pass.run(partial(_encode_by_value, source, limits))) as tiles_in_turn:
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
            codes += state_scans.count_codes(part)
    return ClassifiedStates(image=image, codes=codes, thin=NO_OBSTACLES, noise=0.0, trinary=True)


def _with_thin_obstacles(
    source: GreySource, states: ClassifiedStates, limits: StateLimits, restore: bool, tile_pass: TilePass
) -> ClassifiedStates:
    """Restore or count thin obstacles, if any pixel is occupied by its value alone."""
    if not any(states.codes[list(BY_VALUE_ALONE)]):
        if tile_pass.progress is not None:
            tile_pass.progress(1, 1)
        return states
    valid = int(states.codes.sum() - states.codes[0])
    rule = obstacle_evidence.evidence_rule(limits, valid, states.noise, states.trinary)
    thin = find_thin_obstacles(source, states.image, rule, tile_pass, restore)
    codes = states.codes.copy()
    for state, number in thin.restored.items():
        codes[state | OCCUPIED << 2] -= number
        codes[OCCUPIED | OCCUPIED << 2] += number
    return replace(states, codes=codes, thin=thin)


def state_strips(
    shape: tuple[int, int], file_block: tuple[int, int], tile: int | None = None
) -> list[list[Window]]:
    """Split a raster into strips of tiles in whole rows, from the top.

    `tile` is the number of columns of a tile, and of rows unless the raster is very wide, by default from
    `file_block`, the rows and columns of one block of the file. ParameterError is raised if it is not a
    positive multiple of 64.
    """
    rows, cols = tile_side(shape, file_block) if tile is None else (tile, tile)
    max_rows = max(_MAX_STRIP_PIXELS // whole_blocks(shape[1]) // BLOCK, 1) * BLOCK
    windows = tiles(shape, (min(rows, max_rows), cols))
    across = -(-shape[1] // cols)
    return [windows[k : k + across] for k in range(0, len(windows), across)]


def _scan(image: StateImage, strips: Sequence[tuple[int, int]]) -> Integers:
    """Run the passes after the first over strips (first row, rows); return the number of pixels by code."""
    previous = np.zeros(image.cols, np.uint8)
    for row, rows in strips:
        codes = image.read_codes(row, rows)
        state_scans.compact_columns(codes, previous, False)
        state_scans.resolve_rows(codes)
        image.write_codes(row, codes)
    previous[:] = 0
    for row, rows in reversed(strips):
        codes = image.read_codes(row - state_scans.LOOKAHEAD, rows + state_scans.LOOKAHEAD)
        state_scans.resolve_columns(codes, previous, True)
        image.write_codes(row, codes[state_scans.LOOKAHEAD :])
    previous[:] = 0
    counts = np.zeros(16, np.int64)
    for row, rows in strips:
        codes = image.read_codes(row, rows + state_scans.LOOKAHEAD)
        state_scans.resolve_columns(codes, previous, False)
        image.write_codes(row, codes[: -state_scans.LOOKAHEAD])
        counts += state_scans.count_codes(codes[: -state_scans.LOOKAHEAD])
    return counts


_Job = tuple[Window, NDArray[np.uint8]]  # a tile and the states of its cells


@dataclass(frozen=True, slots=True)
class _EncodedTile:
    """Codes of a tile's whole blocks, packed, and the statistics of its values."""

    pairs: Uint8s
    statistics: obstacle_evidence.ValueStatistics


def _encode_tile(source: GreySource, limits: StateLimits, restore: bool, job: _Job) -> _EncodedTile | None:
    """Encode a tile; None where no pixel is valid."""
    # With `restore`, free pixels of unknown leaves that mix free and occupied ones are free; their occupied
    # ones are thin obstacles.
    window, cells = job
    if not cells.any():
        return None
    tile = source.read(window, 0)
    by_value = _state_table(limits)[tile.grey]
    states = cells_to_pixels(cells, tile.valid)
    if restore:
        surely_free = min(1 - obstacle_evidence.STRONG_ABOVE, limits.free_below)
        surely_occupied = max(obstacle_evidence.STRONG_ABOVE, limits.occupied_above)
        _free_mixed(tile.grey, states, GREY_MAX * surely_free, GREY_MAX * surely_occupied)
    pairs = pack_codes(state_scans.encode_states(states, by_value))
    return _EncodedTile(pairs, obstacle_evidence.value_statistics(tile.grey, tile.valid, by_value))


def _encode_by_value(source: GreySource, limits: StateLimits, window: Window) -> _EncodedTile:
    """Encode a tile by the values of its pixels."""
    tile = source.read(window, 0)
    by_value = _state_table(limits)[tile.grey] * tile.valid
    pairs = pack_codes(by_value | by_value << np.uint8(2))
    return _EncodedTile(pairs, obstacle_evidence.value_levels(tile.grey, tile.valid, by_value))


@lru_cache(maxsize=8)
def _state_table(limits: StateLimits) -> Uint8s:
    return limits.table


def _assemble_strip(
    strip: Sequence[Window], parts: Sequence[tuple[Window, _EncodedTile | None]], cols: int
) -> Uint8s:
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
