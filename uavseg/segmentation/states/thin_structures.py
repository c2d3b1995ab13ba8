"""Recovery of thin obstacles after the scans: walls, poles and furniture of one or two cells.

A wall of one or two cells lies in blocks whose mean is free, and no scan reaches it. So the cells that are
occupied by their value, but not by their segment (candidates), are grouped into 8-connected structures;
see `obstacle_evidence` for the tests:

- one of three cells or more with no occupied cell beside it is an obstacle, which would be lost;
- one of three strong cells or more with no strong occupied cell beside it is an obstacle too: weaker cells
  that join it to an occupied one do not hide it;
- one of strong cells whose likelihood ratio is large enough is an obstacle, or part of the one beside it.

The rest is explained by the noise of the map, and stays as it is. In a trinary map every cell that is
occupied by its value is part of an obstacle; those that are lost are counted there, and the default
method loses none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import field
from functools import partial
from itertools import chain, groupby

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Integers, Uint8s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import TilePass, Window, whole_blocks
from uavseg.segmentation.components import WORD, label_components, union_roots
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.obstacle_evidence import MIN_CELLS, EvidenceRule
from uavseg.segmentation.states.state_image import StateImage
from uavseg.units import BLOCK, FREE, OCCUPIED, UNKNOWN

_CHUNK_PIXELS = 1 << 22  # pixels of the rows that are labelled at once, unless 64 rows have more

BY_VALUE_ALONE = FREE | OCCUPIED << 2, UNKNOWN | OCCUPIED << 2  # codes: the state alone is not occupied
_KEPT = OCCUPIED | OCCUPIED << 2
# A candidate has a code that no other pixel has: its state, shifted left twice where its evidence is strong.
_STRONG_SHIFT = 2
_CERTAIN = 1 << 20  # evidence of a cell with v = 1: more than any rule requires


@dataclass(frozen=True, slots=True)
class ThinObstacles:
    """Counts of thin obstacles."""

    restored: dict[int, int]  # pixels that became occupied, by the state they had: 1 free, 2 unknown
    lost: int  # obstacles without an occupied pixel


def find_thin_obstacles(
    source: GreySource, image: StateImage, rule: EvidenceRule, tile_pass: TilePass, restore: bool
) -> ThinObstacles:
    """Detect thin obstacles, and make them occupied, in the image, if they are to be restored.

    Otherwise those without an occupied pixel are counted. The pass is over the tiles of `state_strips`; the
    result does not depend on them.
    """
    weak, strong = ThinComponents(image.cols), ThinComponents(image.cols)
    chunks, around = [], [np.empty(0, np.int64)]  # the latter: the weak component of each strong one
    for row, codes, evidence in _read_chunks(source, image, rule, tile_pass):
        masks = np.zeros((4, len(evidence) - 2, image.cols), np.uint8)
        _mark_candidates(codes, evidence, *masks)
        wholes, before = weak.add(masks[0], evidence[1:-1], masks[2])
        parts, _ = strong.add(masks[1], evidence[1:-1], masks[3])
        if restore:
            chunks.append((row, len(evidence) - 2))
            image.write_codes(row, codes[1:-1])
        else:
            cells = np.flatnonzero(parts)
            _, first = np.unique(parts.ravel()[cells], return_index=True)
            around.append(wholes.ravel()[cells[first]] + np.int64(before - 1))
    roots, (size, odds, attached) = weak.totals()
    obstacles = (attached == 0) & ((size >= rule.min_cells) | (odds >= rule.min_evidence)) & (size > 0)
    strong_roots, (strong_cells, strong_odds, strong_attached) = strong.totals()
    hidden = (strong_attached == 0) & (strong_cells >= MIN_CELLS)
    if not restore:
        hidden &= ~obstacles[roots][np.concatenate(around)]
        return ThinObstacles({FREE: 0, UNKNOWN: 0}, int(obstacles.sum() + hidden.sum()))
    chosen = (hidden | (strong_odds >= rule.min_evidence))[strong_roots]
    return ThinObstacles(_restore(image, chunks, obstacles[roots], chosen), 0)


def _restore(
    image: StateImage, chunks: Sequence[tuple[int, int]], obstacles: Bools, parts: Bools
) -> dict[int, int]:
    """Make candidates of the chosen components occupied, reset the others; return counts by state."""
    restored = np.zeros(4, np.int64)
    for row, rows in chunks:
        codes = image.read_codes(row, rows)
        masks = np.zeros((2, *codes.shape), np.uint8)
        _find_candidates(codes, *masks)
        weak, obstacles = _chosen(masks[0], obstacles)
        strong, parts = _chosen(masks[1], parts)
        _restore_candidates(codes, *weak, *strong, restored)
        image.write_codes(row, codes)
    return {FREE: int(restored[FREE]), UNKNOWN: int(restored[UNKNOWN])}


def _chosen(mask: Uint8s, chosen: Bools) -> tuple[tuple[Uint32s, Bools], Bools]:
    """Label a chunk; return labels with whether each is chosen, and the choices of later chunks."""
    labels, count = label_components(mask, diagonally=True)
    return (labels, np.concatenate([[False], chosen[:count]])), chosen[count:]


def _read_chunks(
    source: GreySource, image: StateImage, rule: EvidenceRule, tile_pass: TilePass
) -> Iterator[tuple[int, Uint8s, Uint8s]]:
    """Yield the first row of each chunk, its codes and its evidence, with one more row above and below."""
    at_once = max(_CHUNK_PIXELS // image.cols // BLOCK, 1) * BLOCK
    border = np.zeros((1, image.cols), np.uint8)
    above, here, top = border, border[:0], 0
    for row, below in chain(_read_evidence(source, image, rule, tile_pass), [(-1, border)]):
        strip = np.concatenate([above, here, below[:1]])
        for first in range(0, len(here), at_once):
            part = strip[first : first + min(at_once, len(here) - first) + 2]
            yield top + first, image.read_codes(top + first - 1, len(part)), part
        above, here, top = strip[-2:-1], below, row


def _read_evidence(
    source: GreySource, image: StateImage, rule: EvidenceRule, tile_pass: TilePass
) -> Iterator[tuple[int, Uint8s]]:
    """Yield the first row of each strip and the evidence of its pixels; 0 in tiles without candidates."""
    strips = [list(strip) for _, strip in groupby(tile_pass.windows, key=lambda window: window.row)]
    trinary = rule.min_cells == 1  # evidence is the same everywhere
    needed = [] if trinary else [tile for strip in strips for tile in _tiles_with_candidates(image, strip)]
    results = zip(needed, tile_pass.run(partial(_evidence_of_tile, source, rule), needed), strict=True)
    waiting = next(results, None)
    for strip in strips:
        top, rows = strip[0].row, whole_blocks(strip[0].rows)
        evidence = np.full((rows, image.cols), trinary, np.uint8)
        while waiting is not None and waiting[0].row == top:
            tile, part = waiting
            evidence[: part.shape[0], tile.col : tile.col + part.shape[1]] = part
            waiting = next(results, None)
        yield top, evidence


def _tiles_with_candidates(image: StateImage, strip: Sequence[Window]) -> list[Window]:
    """List the tiles of a strip that hold or touch pixels occupied by their value alone."""
    columns = np.zeros(image.cols, np.uint8)
    _find_columns(image.read_codes(strip[0].row - 1, strip[0].rows + 2), columns)
    return [tile for tile in strip if columns[max(tile.col - 1, 0) : tile.col + tile.cols + 1].any()]


def _evidence_of_tile(source: GreySource, rule: EvidenceRule, window: Window) -> Uint8s:
    """Return the evidence of a tile's pixels; 0 where they are invalid, as their grey is."""
    return rule.codes[source.read(window, 0).grey]


@inlined
def by_value_alone(code):  # type: ignore[no-untyped-def]
    """Test whether the value of a pixel is occupied, and its state is not."""
    return code == np.uint8(13) or code == np.uint8(14)


@kernel("void(u1[:,::1], u1[::1])")
def _find_columns(codes, columns):  # type: ignore[no-untyped-def]
    for r in range(codes.shape[0]):
        for c in range(codes.shape[1]):
            columns[c] |= by_value_alone(codes[r, c])


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _mark_candidates(codes, evidence, weak, strong, attached, strongly):  # type: ignore[no-untyped-def]
    # `codes` and `evidence` have one more row above and below.
    rows, cols = weak.shape
    for r in range(rows):
        for c in range(cols):
            if evidence[r + 1, c] == 0 or not by_value_alone(codes[r + 1, c]):
                continue
            weak[r, c] = 1
            strong[r, c] = evidence[r + 1, c] >> np.uint8(7)
            for i in range(r, r + 3):
                for k in range(max(c - 1, 0), min(c + 2, cols)):
                    if codes[i, k] == np.uint8(_KEPT):
                        attached[r, c] = 1
                        strongly[r, c] |= evidence[i, k] >> np.uint8(7)
            state = codes[r + 1, c] & np.uint8(3)
            codes[r + 1, c] = state << np.uint8(_STRONG_SHIFT) if strong[r, c] else state


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _find_candidates(codes, weak, strong):  # type: ignore[no-untyped-def]
    for r in range(codes.shape[0]):
        for c in range(codes.shape[1]):
            code = codes[r, c]
            strong[r, c] = code == np.uint8(4) or code == np.uint8(8)
            weak[r, c] = strong[r, c] | (code == np.uint8(1)) | (code == np.uint8(2))


@kernel("void(u1[:,::1], u4[:,::1], b1[::1], u4[:,::1], b1[::1], i8[::1])")
def _restore_candidates(codes, weak, chosen_weak, strong, chosen_strong, restored):  # type: ignore[no-untyped-def]
    for r in range(codes.shape[0]):
        for c in range(codes.shape[1]):
            if weak[r, c] == 0:
                continue
            code = codes[r, c]
            state = code >> np.uint8(_STRONG_SHIFT) if strong[r, c] else code
            if chosen_weak[weak[r, c]] or chosen_strong[strong[r, c]]:
                codes[r, c] = np.uint8(_KEPT)
                restored[state] += 1
            else:
                codes[r, c] = state | np.uint8(12)


@dataclass
class ThinComponents:
    """Streaming labelling of the 8-connected components of a mask of `cols` columns, chunk by chunk.

    Chunks of whole rows are labelled one after the other by union-find; components that run into the next
    chunk are united there. Only a few sums for each component are kept.
    """

    cols: int
    _count: int = 0
    _above: Integers = field(init=False)  # components of the row above the next chunk, from 1
    _sums: list[Integers] = field(default_factory=list)
    _pairs: list[Integers] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._above = np.zeros(self.cols, np.int64)

    def add(self, mask: Uint8s, evidence: Uint8s, attached: Uint8s) -> tuple[Uint32s, int]:
        """Add a chunk; return its labels, and the number of components in chunks before.

        The arrays are (M, N), with N a multiple of 8: 1 where a cell belongs to a component; its evidence; 1
        where it touches an occupied cell.
        """
        labels, count = label_components(mask, diagonally=True)
        sums = np.zeros((3, count), np.int64)
        if count:
            _sum_components(labels, mask.view(np.uint64), evidence, attached, sums)
        self._sums.append(sums)
        self._unite(self._ids(labels[0]))
        self._above = self._ids(labels[-1])
        before = self._count
        self._count += count
        return labels, before

    def totals(self) -> tuple[Integers, Integers]:
        """Return the structure that each chunk's component belongs to, and the sums of all structures.

        A structure is named by its first component, (n,). The sums, (3, n), are cells, evidence of strong
        cells, and cells beside occupied ones, at these components; 0 elsewhere.
        """
        pairs = np.concatenate([np.empty((0, 2), np.int64), *self._pairs])
        roots = union_roots(pairs, self._count)
        parts = np.concatenate([np.zeros((3, 0), np.int64), *self._sums], axis=1)
        sums = np.zeros_like(parts)
        for total, part in zip(sums, parts, strict=True):
            np.add.at(total, roots, part)
        return roots, sums

    def _ids(self, labels: Uint32s) -> Integers:
        """Number the components of a row of the next chunk from 1 through all chunks."""
        return np.where(labels > 0, labels + np.int64(self._count), 0)

    def _unite(self, first: Integers) -> None:
        """Unite the components of a chunk's first row with those that touch them from above."""
        beside = (first[1:], self._above[:-1]), (first[:-1], self._above[1:])
        for here, above in ((first, self._above), *beside):
            touching = (here > 0) & (above > 0)
            if touching.any():
                pairs = np.stack([here[touching], above[touching]], axis=1) - 1
                self._pairs.append(np.unique(pairs, axis=0))


@kernel("void(u4[:,::1], u8[:,::1], u1[:,::1], u1[:,::1], i8[:,::1])")
def _sum_components(labels, words, evidence, attached, sums):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for word in range(words.shape[1]):
            if words[r, word] == 0:
                continue
            for c in range(word * WORD, word * WORD + WORD):
                if labels[r, c] == 0:
                    continue
                k = np.int64(labels[r, c]) - 1
                sums[0, k] += 1
                if evidence[r, c] & 128:
                    part = np.int64(evidence[r, c] & 127) - 1
                    sums[1, k] += part if part < 126 else _CERTAIN
                sums[2, k] += attached[r, c]
