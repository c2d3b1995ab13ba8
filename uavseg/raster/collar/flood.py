"""Flood fill: of an image, 8-connected, and streamed of a raster from its edges, tile by tile.

A pixel is passable if it is nodata or of the constant value, and so are its eight neighbours: a morphological
opening, which ends the flood at gaps of one or two pixels. The tiles are worked through in waves: those at
the edge first, then those whose neighbours brought something new to their border. The result does not depend
on the tiles or on the order.
"""

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import partial

import numpy as np

from uavseg._jit import kernel
from uavseg.arrays import Bools, Uint8s
from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import PixelMask, TilePass, Window, tile_side, tiles
from uavseg.raster.read.dataset import Dataset

TILE_PIXELS = 1 << 20

Lines = tuple[Bools, Bools, Bools, Bools]
UNREACHED = 255


@dataclass(frozen=True, slots=True)
class Flooded:
    """What is flooded of a tile."""

    mask: PixelMask
    # of its first and last row, its first and last column: what is flooded, and what could be but is not
    borders: Lines = field(repr=False)
    open_borders: Lines = field(repr=False)


def flood_from_edges(dataset: Dataset, value: int | None, tile_pass: TilePass) -> PixelMask:
    """Return pixels that are connected to the edge of the raster over nodata or a constant value.

    Nodata is what is invalid or has this value in all bands; None for the first alone. The executor of
    `tile_pass` runs the tiles, whose size is that of `flood_tiles`. Of what is connected, the result has the
    pixels whose neighbours are passable too; with these, it is the opening.
    """
    grid = _Grid(dataset.geobox.shape, flood_tiles(dataset))
    strips = [_border_strip(grid, place) for place in grid.at_edge]
    shown = tile_pass.silent.run(partial(_shows_tile, dataset, value), strips)
    wave = [place for place, shows in zip(grid.at_edge, shown, strict=True) if shows]
    known: dict[tuple[int, int], Flooded] = {}
    while wave:
        items = [(grid.windows[place], grid.shore(place, known)) for place in wave]
        found = tile_pass.silent.run(partial(_flood_tile, dataset, value), items)
        known.update(zip(wave, found, strict=True))
        around = {other for place in wave for other in grid.neighbours(place)}
        wave = [place for place in sorted(around) if grid.goes_on(place, known)]
    return PixelMask.joined(grid.shape, ((grid.windows[place], one.mask) for place, one in known.items()))


def flood_tiles(dataset: Dataset) -> tuple[int, int]:
    """Return rows and columns of a tile of the flood, which suits the files."""
    return tile_side(dataset.geobox.shape, dataset.file_block, TILE_PIXELS)


def is_passable(dataset: Dataset, value: int | None, window: Window) -> Bools:
    """Return where pixels are nodata or of a value in all bands, for a window inside the raster."""
    if dataset.is_empty(window):
        return np.ones((window.rows, window.cols), bool)
    values, valid = dataset.read(window)
    passable = np.zeros(values.shape[1:], bool) if valid is None else ~valid
    if value is not None:
        passable |= (values == value).all(axis=0)
    return passable


def _opened(dataset: Dataset, value: int | None, window: Window) -> Bools:
    """Return where a pixel and its eight neighbours are passable; what lies beyond the raster is."""
    whole = with_border(partial(is_passable, dataset, value), window, dataset.geobox.shape, True)
    rows = whole[:-2] & whole[1:-1] & whole[2:]
    return rows[:, :-2] & rows[:, 1:-1] & rows[:, 2:]


def with_border(
    read: Callable[[Window], Bools], window: Window, shape: tuple[int, int], beyond: bool
) -> Bools:
    """Read a window with one more pixel on each side, of one value beyond the raster."""
    wider = window.grown(1)
    part = wider.clipped(shape)
    whole = np.full((wider.rows, wider.cols), beyond)
    whole[part.relative_to(wider).slices] = read(part)
    return whole


def _shows_tile(dataset: Dataset, value: int | None, strips: tuple[Window, ...]) -> bool:
    """Return whether a pixel at the edge of the raster is passable with its neighbours."""
    return any(_opened(dataset, value, strip).any() for strip in strips)


def _flood_tile(dataset: Dataset, value: int | None, item: tuple[Window, Lines]) -> Flooded:
    """Flood a tile from what is flooded around it, see `_Grid.shore`."""
    window, around = item
    opened = _opened(dataset, value, window)
    if opened.all() and any(line.any() for line in around):
        return Flooded(PixelMask.of(opened), _border_lines(opened), _border_lines(~opened))
    passable = np.pad(opened, 1)
    sources = np.zeros(passable.shape, bool)
    sources[0], sources[-1], sources[1:-1, 0], sources[1:-1, -1] = around
    inside = flood(sources, passable)[1:-1, 1:-1]
    return Flooded(PixelMask.of(inside), _border_lines(inside), _border_lines(opened & ~inside))


def _border_lines(image: Bools) -> Lines:
    return image[0].copy(), image[-1].copy(), image[:, 0].copy(), image[:, -1].copy()


def _border_strip(grid: "_Grid", place: tuple[int, int]) -> tuple[Window, ...]:
    """Return the pixels of a tile at the edge of the raster."""
    strips = [side.common(grid.windows[place]) for side in sides(grid.shape)]
    return tuple(strip for strip in strips if strip.rows and strip.cols)


def sides(shape: tuple[int, int]) -> tuple[Window, ...]:
    """Return the first and the last row and column of a raster."""
    rows, cols = shape
    return (
        Window(0, 0, 1, cols),
        Window(rows - 1, 0, 1, cols),
        Window(0, 0, rows, 1),
        Window(0, cols - 1, rows, 1),
    )


class _Grid:
    """The tiles of a raster by their row and column in the grid of tiles."""

    def __init__(self, shape: tuple[int, int], side: tuple[int, int]) -> None:
        self.shape = shape
        self.windows = {(w.row // side[0], w.col // side[1]): w for w in tiles(shape, side)}
        self._last = max(self.windows)

    @property
    def at_edge(self) -> Sequence[tuple[int, int]]:
        """The tiles at the edge of the raster."""
        rows, cols = self._last
        return [(i, j) for i, j in self.windows if i in (0, rows) or j in (0, cols)]

    def shore(self, place: tuple[int, int], known: dict[tuple[int, int], Flooded]) -> Lines:
        """Return the flooded pixels around a tile; all that lies beyond the raster is flooded.

        They are the rows above and below with their corners, (cols + 2,), and the columns left and right.
        """
        (i, j), rows, cols = place, self.windows[place].rows, self.windows[place].cols

        def line(of: tuple[int, int], side: int, length: int) -> Bools:
            if of not in self.windows:
                return np.ones(length, bool)
            return known[of].borders[side] if of in known else np.zeros(length, bool)

        ends = [
            (line((k, j - 1), side, 1)[-1:], line((k, j + 1), side, 1)[:1])
            for k, side in ((i - 1, 1), (i + 1, 0))
        ]
        above = np.concatenate([ends[0][0], line((i - 1, j), 1, cols), ends[0][1]])
        below = np.concatenate([ends[1][0], line((i + 1, j), 0, cols), ends[1][1]])
        return above, below, line((i, j - 1), 3, rows), line((i, j + 1), 2, rows)

    def neighbours(self, place: tuple[int, int]) -> list[tuple[int, int]]:
        """Return the tiles beside a tile and at its corners."""
        around = [(place[0] + i, place[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
        return [other for other in around if other in self.windows]

    def goes_on(self, place: tuple[int, int], known: dict[tuple[int, int], Flooded]) -> bool:
        """Return whether the flood may go on into a tile from those around it."""
        around = self.shore(place, known)
        if place not in known:
            outside = self.shore(place, {})
            return any((line & ~beyond).any() for line, beyond in zip(around, outside, strict=True))
        above, below, left, right = around
        lines = (
            above,
            below,
            np.concatenate([above[:1], left, below[:1]]),
            np.concatenate([above[-1:], right, below[-1:]]),
        )
        return any(
            ((line[:-2] | line[1:-1] | line[2:]) & ends).any()
            for line, ends in zip(lines, known[place].open_borders, strict=True)
        )


def flood(sources: Bools, passable: Bools) -> Bools:
    """Return passable pixels that are connected to a source, and the sources.

    Examples
    --------
    >>> row = np.array([[1, 1, 0, 1]], bool)
    >>> flood(np.array([[1, 0, 0, 0]], bool), row)
    array([[ True,  True, False, False]])
    """
    reached: Bools = distances(sources, passable, 1, 0) != UNREACHED
    return reached


def distances(sources: Bools, passable: Bools, reach: int, step: int = 1) -> Uint8s:
    """Return number of steps over passable pixels from the nearest source, up to `reach`; 255 beyond.

    With a `step` of 0, those at any distance have 0.

    Examples
    --------
    >>> distances(np.array([[1, 0, 0, 0]], bool), np.ones((1, 4), bool), 2)
    array([[  0,   1,   2, 255]], dtype=uint8)
    """
    steps = np.where(sources, np.uint8(0), np.uint8(UNREACHED))
    _spread(np.ascontiguousarray(passable).view(np.uint8), steps, reach, step, np.empty(steps.size, np.int64))
    return steps


@kernel("void(u1[:,::1], u1[:,::1], i8, i8, i8[::1])")
def _spread(passable, steps, reach, step, queue):  # type: ignore[no-untyped-def]
    rows, cols = steps.shape
    end = 0
    for r in range(rows):
        for c in range(cols):
            if steps[r, c] == 0:
                others = 0
                for i in range(max(r - 1, 0), min(r + 2, rows)):
                    for j in range(max(c - 1, 0), min(c + 2, cols)):
                        others += steps[i, j] != 0
                if others > 0:  # a source among others spreads nowhere
                    queue[end] = r * cols + c
                    end += 1
    first = 0
    while first < end:
        r = queue[first] // cols
        c = queue[first] - r * cols
        first += 1
        if steps[r, c] >= reach:
            continue
        following = np.uint8(steps[r, c] + step)
        for i in range(max(r - 1, 0), min(r + 2, rows)):
            for j in range(max(c - 1, 0), min(c + 2, cols)):
                if steps[i, j] == 255 and passable[i, j] != 0:
                    steps[i, j] = following
                    queue[end] = i * cols + j
                    end += 1
