"""Block map: cell sums and texture ratios, from which the leaves of the division follow for any threshold.

It holds the sum and the number of the valid pixels of each cell of 8 x 8, and the ratio R of each block of
64, 32 and 16. Neither depends on a threshold or a range of intensity.
"""

import base64
import io
import os
from collections.abc import Iterator, Sequence
from types import ModuleType

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.segmentation.blocks.division import RATIOS
from uavseg.segmentation.params.segment import DivisionParams
from uavseg.units import CELL, CELLS, GREY_MAX

resource: ModuleType | None
try:
    import resource
except ImportError:  # Windows
    resource = None


_MAX_SIDE = 360  # pixels of a thumbnail
_STRIP_BLOCKS = 64  # rows of blocks in a strip of `leaf_means_by_strip`


@dataclass(frozen=True, slots=True)
class BlockMap:
    """Cell sums, cell counts and block ratios over a grid of B x C blocks of 64 x 64 pixels."""

    shape: tuple[int, int]  # of the image in pixels; blocks extend past its right and bottom edge
    sums: Uint32s  # (8 B, 8 C): sum of the grey of valid pixels of each cell
    counts: Uint8s  # (8 B, 8 C): valid pixels of each cell, 0 to 64
    ratios: Floats  # (B, C, 21): R of each block, as `division.block_ratios` orders them

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> "BlockMap":
        """Allocate the block map of an image without valid pixels; see `check_memory`."""
        check_memory(shape)
        rows, cols = (-(-length // (8 * CELLS)) for length in shape)
        cells, ratios = (rows * CELLS, cols * CELLS), np.zeros((rows, cols, RATIOS))
        return cls(shape, np.zeros(cells, np.uint32), np.zeros(cells, np.uint8), ratios)

    @property
    def blocks(self) -> tuple[int, int]:
        """Rows and columns of blocks."""
        return self.ratios.shape[0], self.ratios.shape[1]

    def _repr_html_(self) -> str:
        rows, cols = self.shape
        valid = int(self.counts.sum(dtype=np.int64))
        share = 100 * valid / max(rows * cols, 1)
        down, across = self.blocks
        size = f"block map of {rows:,} x {cols:,} pixels: {down:,} x {across:,} blocks of 64 x 64"
        cells = (slice(-(-rows // CELL)), slice(-(-cols // CELL)))
        if not valid:
            return f"<div><p>{size}, no valid pixel</p></div>"
        picture = _thumbnail(self.sums[cells], self.counts[cells], GREY_MAX)
        return f'<div><p>{size}, {share:.1f} % valid</p><img alt="means of the cells" src="{picture}"></div>'


def find_leaves(
    blocks: BlockMap, division: DivisionParams, rows: slice = slice(None)
) -> tuple[Uint8s, Floats]:
    """Divide blocks hierarchically: return the side and the mean v of the leaf that each cell belongs to.

    Both are (8 b, 8 C) arrays: the side uint8, of 64, 32, 16 or 8 pixels, the mean float64, of the leaf's
    valid pixels; -1 where it has none. `rows` are rows of blocks, so that a large map can be divided in
    strips.
    """
    ratios = blocks.ratios[rows]
    cells = slice(*(index * CELLS for index in rows.indices(blocks.blocks[0])[:2]))
    side = np.empty((ratios.shape[0] * CELLS, ratios.shape[1] * CELLS), np.uint8)
    mean = np.empty(side.shape)
    _leaves(blocks.sums[cells], blocks.counts[cells], ratios, division.threshold, division.step, side, mean)
    return side, mean


def leaf_means_by_strip(blocks: BlockMap, division: DivisionParams) -> Iterator[tuple[slice, Floats]]:
    """Yield the means of `find_leaves` strip by strip: rows of cells, and their (m, 8 C) float64 array."""
    for top in range(0, blocks.blocks[0], _STRIP_BLOCKS):
        _, mean = find_leaves(blocks, division, slice(top, top + _STRIP_BLOCKS))
        yield slice(CELLS * top, CELLS * top + len(mean)), mean


def cell_sums(grey: Uint16s, valid: Uint8s, margin: int = 0) -> tuple[Uint32s, Uint8s]:
    """Sum and count the valid pixels of each cell of 8 x 8 pixels: (m, n) uint32 and uint8 arrays.

    `grey` and `valid` are (M, N) arrays, `grey` 0 where a pixel is not valid. `margin` is the width of the
    border that belongs to no cell, in pixels; M and N less the margins are multiples of 8.
    """
    cells = ((grey.shape[0] - 2 * margin) // 8, (grey.shape[1] - 2 * margin) // 8)
    sums = np.zeros(cells, np.uint32)
    counts = np.zeros(cells, np.uint8)
    _cell_sums(grey, valid, margin, sums, counts)
    return sums, counts


def required_ratios(sums: Uint32s, counts: Uint8s, edges: Sequence[float], step: float) -> Uint32s:
    """Return bit masks of the ratios R that decide in which interval the mean of every leaf lies.

    Where the means of all cells of a block lie in one interval, so does the mean of any leaf made of them,
    whatever its R. R is not required either where intensity alone divides the block. Sums and counts are
    those of `BlockMap`; edges between the intervals increase, and a mean on an edge lies in the interval
    below it. `step` is tau, infinite for no intensity test. Bit k of the masks, (B, C), is set where ratio k
    of a block is required, unless a larger block around it is not divided.
    """
    required = np.zeros((sums.shape[0] // CELLS, sums.shape[1] // CELLS), np.uint32)
    _required_ratios(sums, counts, np.array(edges, np.float64), step, required)
    return required


@kernel("void(u2[:,::1], u1[:,::1], i8, u4[:,::1], u1[:,::1])")
def _cell_sums(grey, valid, margin, sums, counts):  # type: ignore[no-untyped-def]
    for row in range(sums.shape[0]):
        for r in range(margin + 8 * row, margin + 8 * row + 8):
            for col in range(sums.shape[1]):
                total = np.uint32(0)
                number = np.uint8(0)
                for c in range(margin + 8 * col, margin + 8 * col + 8):
                    total += np.uint32(grey[r, c])
                    number += valid[r, c]
                sums[row, col] += total
                counts[row, col] += number


@inlined
def mean_v(sums, counts, row, col, size):  # type: ignore[no-untyped-def]
    """Compute the mean v over size x size cells; -1 where no pixel is valid."""
    total, number = np.int64(0), np.int64(0)
    for r in range(row, row + size):
        for c in range(col, col + size):
            total += np.int64(sums[r, c])
            number += np.int64(counts[r, c])
    return -1.0 if number == 0 else total / (65535.0 * number)


@inlined
def range_of_child_means(sums, counts, row, col, size):  # type: ignore[no-untyped-def]
    """Compute the range of the means of the four children of size x size cells; 0 with fewer than two."""
    low, high = 2.0, -1.0
    half = size // 2
    for child in range(4):
        mean = mean_v(sums, counts, row + child // 2 * half, col + child % 2 * half, half)
        if mean >= 0.0:
            low = min(low, mean)
            high = max(high, mean)
    return max(high - low, 0.0)


@inlined
def write_leaf(side, mean, row, col, size, value):  # type: ignore[no-untyped-def]
    """Write side and mean of a leaf of size x size cells into its cells."""
    for r in range(row, row + size):
        for c in range(col, col + size):
            side[r, c] = 8 * size
            mean[r, c] = value


@inlined
def leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean):  # type: ignore[no-untyped-def]
    """Write the leaves of one block of 64 into its cells."""
    r64, c64 = 8 * row, 8 * col
    if not (ratios[row, col, 0] > threshold or range_of_child_means(sums, counts, r64, c64, 8) > step):
        write_leaf(side, mean, r64, c64, 8, mean_v(sums, counts, r64, c64, 8))
        return
    for half in range(4):
        r32 = r64 + half // 2 * 4
        c32 = c64 + half % 2 * 4
        texture = ratios[row, col, 1 + half]
        if not (texture > threshold or range_of_child_means(sums, counts, r32, c32, 4) > step):
            write_leaf(side, mean, r32, c32, 4, mean_v(sums, counts, r32, c32, 4))
            continue
        for quarter in range(4):
            r16 = r32 + quarter // 2 * 2
            c16 = c32 + quarter % 2 * 2
            texture = ratios[row, col, 5 + (r16 - r64) // 2 * 4 + (c16 - c64) // 2]
            if not (texture > threshold or range_of_child_means(sums, counts, r16, c16, 2) > step):
                write_leaf(side, mean, r16, c16, 2, mean_v(sums, counts, r16, c16, 2))
                continue
            for cell in range(4):
                r8 = r16 + cell // 2
                c8 = c16 + cell % 2
                write_leaf(side, mean, r8, c8, 1, mean_v(sums, counts, r8, c8, 1))


@kernel("void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, u1[:,::1], f8[:,::1])")
def _leaves(sums, counts, ratios, threshold, step, side, mean):  # type: ignore[no-untyped-def]
    for row in range(ratios.shape[0]):
        for col in range(ratios.shape[1]):
            leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)


@inlined
def straddles_edge(sums, counts, row, col, size, edges):  # type: ignore[no-untyped-def]
    """Test whether the means of size x size cells lie in more than one interval."""
    low, high = 2.0, -1.0
    for r in range(row, row + size):
        for c in range(col, col + size):
            mean = mean_v(sums, counts, r, c, 1)
            if mean >= 0.0:
                low = min(low, mean)
                high = max(high, mean)
    first = 0  # binary search: the first edge that is not below the lowest mean
    end = edges.shape[0]
    while first < end:
        middle = (first + end) // 2
        if edges[middle] < low:
            first = middle + 1
        else:
            end = middle
    return first < edges.shape[0] and edges[first] < high


@inlined
def required_ratios_of_block(sums, counts, row, col, edges, step):  # type: ignore[no-untyped-def]
    """Compute the bit mask of `required_ratios` for one block of 64."""
    bits = np.uint32(0)
    bit = 0  # index of a ratio: side 64, then four of 32, then sixteen of 16
    size = 8
    while size >= 2:
        mixed = 0
        for r in range(8 * row, 8 * row + 8, size):
            for c in range(8 * col, 8 * col + 8, size):
                if straddles_edge(sums, counts, r, c, size, edges):
                    mixed += 1
                    if range_of_child_means(sums, counts, r, c, size) <= step:
                        bits |= np.uint32(1) << np.uint32(bit)
                bit += 1
        if mixed == 0:
            break
        size //= 2
    return bits


@kernel("void(u4[:,::1], u1[:,::1], f8[::1], f8, u4[:,::1])")
def _required_ratios(sums, counts, edges, step, required):  # type: ignore[no-untyped-def]
    for row in range(required.shape[0]):
        for col in range(required.shape[1]):
            required[row, col] = required_ratios_of_block(sums, counts, row, col, edges, step)


def check_memory(shape: tuple[int, int]) -> None:
    """Refuse an image whose block map is larger than the memory of this machine, with RasterError."""
    rows, cols = shape
    blocks = -(-rows // (8 * CELLS)) * -(-cols // (8 * CELLS))
    size, memory = blocks * (CELLS * CELLS * 5 + RATIOS * 8), _physical_memory()
    if memory is not None and size > memory:
        raise RasterError(
            f"a raster of {cols:,} x {rows:,} pixels has a block map of {size / 1e9:,.0f} GB, and this "
            f"machine has {memory / 1e9:,.0f} GB of memory; read the part that holds data (--bounds, "
            "--aoi), or take a coarser copy (gdal_translate -outsize)"
        )


def _physical_memory() -> int | None:
    """Return the bytes of memory that a process may have; None where the system does not report it."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
    if resource is None:
        return memory
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return memory if limit == resource.RLIM_INFINITY else min(memory, limit)


def _thumbnail(sums: Uint32s, counts: Uint8s, maximum: float) -> str:
    """Encode the means of cells as a PNG, a `data:` URL; `maximum` is white, empty cells are transparent."""
    from PIL import Image

    step = max(1, -(-max(sums.shape) // _MAX_SIDE))
    rows, cols = (np.arange(0, length, step) for length in sums.shape)
    total, number = (
        np.add.reduceat(np.add.reduceat(band.astype(float), rows, 0), cols, 1) for band in (sums, counts)
    )
    means = np.divide(total, number, out=np.zeros(total.shape), where=number > 0)
    grey = np.rint(np.clip(means / maximum, 0, 1) * 255).astype(np.uint8)
    alpha = np.where(number > 0, 255, 0).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(np.dstack([grey, alpha])).save(stream, "PNG")
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
