"""Recovery of thin obstacles after the scans: walls, poles and furniture of one or two cells.

A wall of one or two cells lies in blocks whose mean is free, and no scan reaches it. So the cells that are
occupied by their own value, but not by their segment (candidates), are grouped into 8-connected structures;
see `obstacle_evidence` for the tests:

- one of three cells or more with no occupied cell beside it is an obstacle, which would be lost;
- one of strong cells whose likelihood ratio is large enough is an obstacle, or part of the one beside it.

The rest is explained by the noise of the map, and stays as it is. In a trinary map every cell that is
occupied by its own value is part of an obstacle.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.raster.tiling import TilePass, Window, whole_blocks
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.obstacle_evidence import EvidenceRule
from uavseg.segmentation.states.state_image import StateImage
from uavseg.segmentation.states.state_scans import Codes
from uavseg.segmentation.states.thin_components import ThinComponents, label_8_connected
from uavseg.units import BLOCK, FREE, OCCUPIED, UNKNOWN

_CHUNK_PIXELS = 1 << 22  # pixels of the rows that are labelled at once, unless 64 rows have more

_LEFT_OUT = FREE | OCCUPIED << 2, UNKNOWN | OCCUPIED << 2  # occupied by the own value, not by the segment
_KEPT = OCCUPIED | OCCUPIED << 2
# A candidate has a code that no other pixel has: its state, shifted left twice where its evidence is strong.
_WEAK, _STRONG = (1, 2), (4, 8)

_IS_LEFT_OUT: NDArray[np.bool_] = np.isin(np.arange(16), _LEFT_OUT)
_IS_STRONG: NDArray[np.bool_] = np.isin(np.arange(16), _STRONG)
_IS_CANDIDATE: NDArray[np.bool_] = np.isin(np.arange(16), _WEAK + _STRONG)
_RESTORED, _PLAIN = np.arange(16, dtype=np.uint8), np.arange(16, dtype=np.uint8)
_RESTORED[list(_LEFT_OUT)] = _KEPT
_PLAIN[list(_WEAK)] = _PLAIN[list(_STRONG)] = _LEFT_OUT  # as they were


@dataclass(frozen=True, slots=True)
class ThinObstacles:
    """What was found of thin obstacles.

    Parameters
    ----------
    restored : dict of int to int
        Number of pixels that became occupied, by the state that they had: 1 free, 2 unknown.
    lost : int
        Number of obstacles without an occupied pixel.
    """

    restored: dict[int, int]
    lost: int


def count_left_out(codes: NDArray[np.int64]) -> dict[int, int]:
    """Pixels that are occupied by their own value alone, by their state, from the histogram of codes."""
    return {FREE: int(codes[_LEFT_OUT[0]]), UNKNOWN: int(codes[_LEFT_OUT[1]])}


def restore_all(codes: Codes) -> None:
    """Every pixel that is occupied by its own value becomes occupied, in place."""
    codes[:] = _RESTORED[codes]


def find_thin_obstacles(
    source: GreySource, image: StateImage, rule: EvidenceRule, tile_pass: TilePass, restore: bool
) -> ThinObstacles:
    """Find thin obstacles, and make them occupied if they are to be restored.

    Parameters
    ----------
    source : GreySource
    image : StateImage
        Changed in place if `restore` is set.
    rule : EvidenceRule
    tile_pass : TilePass
        Over the tiles of `state_strips`; the result does not depend on them.
    restore : bool
        Whether they become occupied; otherwise those without an occupied pixel are counted.
    """
    weak, strong = ThinComponents(image.cols), ThinComponents(image.cols)
    chunks = []
    for row, codes, evidence in _read_chunks(source, image, rule, tile_pass):
        masks = np.zeros((3, *evidence.shape), np.uint8)
        _mark_candidates(codes, evidence, *masks)
        weak.add(masks[0], evidence, masks[2])
        strong.add(masks[1], evidence, masks[2])
        chunks.append((row, len(evidence)))
        if restore:
            image.write_codes(row, codes[1:-1])
    roots, (cells, odds, attached) = weak.totals()
    obstacles = (attached == 0) & ((cells >= rule.min_cells) | (odds >= rule.min_evidence)) & (cells > 0)
    if not restore:
        return ThinObstacles({FREE: 0, UNKNOWN: 0}, int(obstacles.sum()))
    strong_roots, (_, strong_odds, _) = strong.totals()
    parts = (strong_odds >= rule.min_evidence)[strong_roots]
    return ThinObstacles(_restore(image, chunks, obstacles[roots], parts), 0)


def _restore(
    image: StateImage,
    chunks: Sequence[tuple[int, int]],
    obstacles: NDArray[np.bool_],
    parts: NDArray[np.bool_],
) -> dict[int, int]:
    """Candidates of the chosen components become occupied, the others what they were; counts by state."""
    restored = {FREE: 0, UNKNOWN: 0}
    for row, rows in chunks:
        codes = image.read_codes(row, rows)
        obstacle, obstacles = _chosen(_IS_CANDIDATE[codes], obstacles)
        part, parts = _chosen(_IS_STRONG[codes], parts)
        obstacle |= part
        codes = _PLAIN[codes]
        for state in restored:
            restored[state] += int(np.count_nonzero(obstacle & (codes & 3 == state)))
        codes[obstacle] = _KEPT
        image.write_codes(row, codes)
    return restored


def _chosen(
    mask: NDArray[np.bool_], chosen: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Pixels of the chosen components of a chunk, and the choices of those of later chunks."""
    labels, count = label_8_connected(mask.view(np.uint8))
    return np.concatenate([[False], chosen[:count]])[labels], chosen[count:]


def _read_chunks(
    source: GreySource, image: StateImage, rule: EvidenceRule, tile_pass: TilePass
) -> Iterator[tuple[int, Codes, NDArray[np.uint8]]]:
    """First row of each chunk, its codes with a row above and below, and the evidence of its pixels."""
    strips = [list(strip) for _, strip in groupby(tile_pass.windows, key=lambda window: window.row)]
    needed = [tile for strip in strips for tile in _tiles_with_candidates(image, strip)]
    results = zip(needed, tile_pass.run(partial(_evidence_of_tile, source, rule), needed), strict=True)
    at_once = max(_CHUNK_PIXELS // image.cols // BLOCK, 1) * BLOCK
    waiting = next(results, None)
    for strip in strips:
        top, rows = strip[0].row, whole_blocks(strip[0].rows)
        evidence = np.zeros((rows, image.cols), np.uint8)
        while waiting is not None and waiting[0].row == top:
            tile, part = waiting
            evidence[: part.shape[0], tile.col : tile.col + part.shape[1]] = part
            waiting = next(results, None)
        for row in range(top, top + rows, at_once):
            part = evidence[row - top : row - top + at_once]
            yield row, image.read_codes(row - 1, len(part) + 2), part


def _tiles_with_candidates(image: StateImage, strip: Sequence[Window]) -> list[Window]:
    """The tiles of a strip that hold pixels occupied by their own value alone."""
    codes = image.read_codes(strip[0].row, strip[0].rows)
    left_out = np.any(_IS_LEFT_OUT[codes], axis=0)
    return [tile for tile in strip if left_out[tile.col : tile.col + tile.cols].any()]


def _evidence_of_tile(source: GreySource, rule: EvidenceRule, window: Window) -> NDArray[np.uint8]:
    """The evidence of a tile's pixels; 0 where they are invalid, as their grey is."""
    evidence: NDArray[np.uint8] = rule.codes[source.read(window, 0).grey]
    return evidence


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _mark_candidates(codes, evidence, weak, strong, attached):  # type: ignore[no-untyped-def]
    # `codes` has one more row above and below.
    rows, cols = evidence.shape
    for r in range(rows):
        for c in range(cols):
            code = codes[r + 1, c]
            if code >> np.uint8(2) != np.uint8(3) or code == np.uint8(_KEPT) or evidence[r, c] == 0:
                continue
            weak[r, c] = 1
            strong[r, c] = evidence[r, c] >> np.uint8(7)
            for i in range(r, r + 3):
                for k in range(max(c - 1, 0), min(c + 2, cols)):
                    if codes[i, k] == np.uint8(_KEPT):
                        attached[r, c] = 1
            state = code & np.uint8(3)
            codes[r + 1, c] = state << np.uint8(2) if strong[r, c] else state
