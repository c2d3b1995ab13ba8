"""Evidence that constant pixels at the edge of a raster are a collar: their rim, border and the picture."""

from dataclasses import field
from functools import partial, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.raster.collar.flood import UNREACHED, distances, flood, flood_tiles, sides, with_border
from uavseg.raster.grid.tiling import ALL, PixelMask, TilePass, Window, sample_positions, tiles
from uavseg.raster.read.dataset import Dataset
from uavseg.units import BLOCK

MAX_POINTS = 20_000
_ANGLES = np.deg2rad(np.arange(0, 180, 0.5))
SMEAR = 16  # pixels: the side of the block in which JPEG mixes colours
BEYOND = 2 * SMEAR  # pixels: up to here is compared with the rim
BLEND = 2  # pixels beyond near-constant ones that are a mixture too
MIN_CONTRAST = 8  # levels
MAX_CONSTANT = 0.5  # share of one value beyond the rim; of a drawn mask it is nearly 1
NEAR = 0.25  # share of the contrast within which a pixel is nearly constant
MAX_NEAR = 1 / 8  # share of nearly constant pixels in a picture, and least share at a smeared rim
MAX_SPECKLE = 1 / 50  # share of pixels of exactly the constant value in a picture
FADING = (0.05, 0.28)  # shares of the rim within two levels; measured on clipped and on drawn rasters

CORNERS_AROUND = 3  # held by what surrounds a picture
EDGE_AROUND = 0.5  # share of the edge of the raster that it covers
ONE_PIECE = 0.97  # share of the picture in its largest piece
COARSE = 1024  # rows and columns at which pieces are looked at
# Of a straight border: most lines, least share of the border on them, pixels from a line.
SHARP, SMEARED = (8, 0.75, 2.0), (4, 0.9, 4.0)


@dataclass(frozen=True, slots=True)
class RimCounts:
    """Histograms of how far valid pixels are from the constant value; those of tiles merge by adding.

    Lossy compression and resampling smear the edge between a collar and the picture: pixels along it are
    nearly of the constant value. They are concentrated there, which tells them from dark or bright ground.
    """

    # pixels beside the collar, and 17 to 32 pixels from it, by the largest difference of a band, (n,)
    rim: Integers = field(repr=False)
    beyond: Integers = field(repr=False)
    inside: int  # valid pixels in the collar

    def __add__(self, other: "RimCounts") -> "RimCounts":
        return RimCounts(self.rim + other.rim, self.beyond + other.beyond, self.inside + other.inside)

    @property
    def contrast(self) -> int:
        """Median difference between the picture and the constant value; 0 if there is no picture."""
        total = int(self.beyond.sum())
        return int(np.searchsorted(np.cumsum(self.beyond), (total + 1) // 2)) if total else 0

    @property
    def shows_picture(self) -> bool:
        """Whether what lies beyond differs clearly from the constant value, and is not constant itself."""
        constant = int(self.beyond.max()) / max(int(self.beyond.sum()), 1)
        return self.contrast >= MIN_CONTRAST and constant <= MAX_CONSTANT

    @property
    def is_textured(self) -> bool:
        """Whether few pixels beyond are as nearly constant."""
        return self.near[1] <= MAX_NEAR

    @property
    def is_speckled(self) -> bool:
        """Whether pixels beyond are of exactly the constant value, as in ground that is clipped at it."""
        return _share(self.beyond, 1) > MAX_SPECKLE

    @property
    def is_smeared(self) -> bool:
        """Whether nearly constant pixels are concentrated at the rim."""
        rim, beyond = self.near
        return rim >= MAX_NEAR and rim >= 4 * beyond

    @property
    def smear_limit(self) -> int:
        """Largest difference of a smeared pixel; -1 where the rim is not smeared."""
        return int(NEAR * self.contrast) if self.is_smeared else -1

    @property
    def near(self) -> tuple[float, float]:
        """Shares of nearly constant pixels at the rim, and beyond it."""
        end = int(NEAR * self.contrast) + 1
        return _share(self.rim, end), _share(self.beyond, end)

    @property
    def fades(self) -> bool:
        """Whether the rim fades into the constant value, as ground does that is clipped at it.

        Pixels beside a collar have other values at once, or nearly all of a compressed block are within two
        levels of it; of a histogram that goes on beyond its end, a part in between is.
        """
        low, high = FADING
        return low < _share(self.rim, 3) < high


def _share(histogram: Integers, end: int) -> float:
    """Return share of the first bins of a histogram; 0 if it is empty."""
    return int(histogram[:end].sum()) / max(int(histogram.sum()), 1)


def count_rim(dataset: Dataset, flooded: PixelMask, value: int, tile_pass: TilePass) -> RimCounts:
    """Return the histograms along the rim of a flood, as of `flood_from_edges`, of unsigned integers."""
    windows = _tiles(dataset, flooded)
    size = 1 << 8 * dataset.dtype.itemsize
    start = RimCounts(np.zeros(size, np.int64), np.zeros(size, np.int64), 0)
    found = tile_pass.silent.run(partial(_count_tile, dataset, flooded, value), windows)
    return reduce(RimCounts.__add__, found, start)


def grow_over_smear(
    dataset: Dataset, flooded: PixelMask, value: int, limit: int, tile_pass: TilePass
) -> tuple[PixelMask, int]:
    """Return a flood with the smeared pixels along it, and how many valid pixels these are.

    They are connected to it within 16 pixels and differ by at most `limit` in all bands; with them go pixels
    of the mixture, within 2 pixels. With `limit` -1, it is the flood with its neighbours alone.
    """
    windows = _tiles(dataset, flooded)
    parts = tile_pass.silent.run(partial(_grow_tile, dataset, flooded, value, limit), windows)
    masks, added = [], 0
    for window, (mask, count) in zip(windows, parts, strict=True):
        masks.append((window, mask))
        added += count
    return PixelMask.joined(dataset.geobox.shape, masks), added


def _tiles(dataset: Dataset, flooded: PixelMask) -> list[Window]:
    """Return the tiles that lie in a flood or near it."""
    shape = dataset.geobox.shape
    every = tiles(shape, flood_tiles(dataset))
    return [window for window in every if flooded.touches(window.grown(BEYOND).clipped(shape))]


def _count_tile(dataset: Dataset, flooded: PixelMask, value: int, window: Window) -> RimCounts:
    size = 1 << 8 * dataset.dtype.itemsize
    around = window.grown(BEYOND).clipped(dataset.geobox.shape)
    if flooded.covers(around):
        nothing, count = np.zeros(size, np.int64), 0
        if not dataset.is_empty(window):
            _, known = dataset.read(window)
            count = window.rows * window.cols if known is None else int(known.sum())
        return RimCounts(nothing, nothing, count)
    core, difference, valid, own = _read(dataset, flooded, value, window)
    steps = distances(core, np.ones(core.shape, bool), BEYOND)[own]
    seen = valid[own] & (steps > 0)
    rim = np.bincount(difference[own][seen & (steps == 1)], minlength=size)
    beyond = np.bincount(difference[own][seen & (steps > SMEAR) & (steps <= BEYOND)], minlength=size)
    return RimCounts(rim, beyond, int((valid[own] & core[own]).sum()))


def _grow_tile(
    dataset: Dataset, flooded: PixelMask, value: int, limit: int, window: Window
) -> tuple[PixelMask, int]:
    around = window.grown(BEYOND).clipped(dataset.geobox.shape)
    if flooded.covers(around):
        return PixelMask.of(np.ones((window.rows, window.cols), bool)), 0
    if limit < 0:
        return PixelMask.of(_core(flooded, window, dataset.geobox.shape)), 0
    core, difference, valid, own = _read(dataset, flooded, value, window)
    near = distances(core, difference <= limit, SMEAR) != UNREACHED
    grown = distances(near, np.ones(core.shape, bool), BLEND)[own] != UNREACHED
    return PixelMask.of(grown), int((grown & valid[own] & ~core[own]).sum())


def _core(flooded: PixelMask, window: Window, shape: tuple[int, int]) -> Bools:
    """Return the flood with its neighbours in a window."""
    flood = with_border(flooded.read, window, shape, False)
    rows = flood[:-2] | flood[1:-1] | flood[2:]
    return rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]


def _read(
    dataset: Dataset, flooded: PixelMask, value: int, window: Window
) -> tuple[Bools, NDArray[np.unsignedinteger[Any]], Bools, tuple[slice, slice]]:
    """Read the flood with its neighbours, differences, validity around a tile; and where that lies."""
    around = window.grown(BEYOND).clipped(dataset.geobox.shape)
    values, valid = dataset.read(around)
    constant = values.dtype.type(value)
    difference = (values - constant if value == 0 else constant - values).max(axis=0)
    known = np.ones(difference.shape, bool) if valid is None else valid
    own = window.relative_to(around).slices
    return _core(flooded, around, dataset.geobox.shape), difference, known, own


def straight_share(points: Floats, tolerance: float, length: float, max_lines: int = 8) -> float:
    """Return the share of points, (n, 2) rows and columns, that lie on a few straight lines.

    They are at most `tolerance` pixels from a line, and those of a line extend at least over `length`.

    Examples
    --------
    >>> across = np.column_stack([np.arange(100), np.full(100, 7)]).astype(float)
    >>> straight_share(across, 1, 50), straight_share(across, 1, 200)
    (1.0, 0.0)
    """
    left = points
    for _ in range(max_lines):
        if len(left) < 2:
            break
        on_line, extent = _best_line(left, tolerance)
        if extent < length:
            break
        left = left[~on_line]
    return 1 - len(left) / max(len(points), 1)


def outline_points(mask: PixelMask, shape: tuple[int, int]) -> Floats:
    """Return (n, 2) rows and columns of a set's outline, by blocks, evenly thinned to 20 000."""
    whole = np.pad(mask.codes == ALL, 1, mode="edge")
    inner = whole[:-2, 1:-1] & whole[2:, 1:-1] & whole[1:-1, :-2] & whole[1:-1, 2:]
    rows, cols = np.nonzero((mask.codes != 0) & ~inner)  # mixed blocks, and whole ones beside others
    found = [np.zeros((0, 2), np.int64)]
    for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
        block = Window(row * BLOCK, col * BLOCK, BLOCK, BLOCK).clipped(shape)
        around = block.grown(1).clipped(shape)
        inside = mask.read(around)
        wide = np.pad(inside, 1, mode="edge")
        inner = wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]
        own = block.relative_to(around).slices
        found.append(np.argwhere((inside & ~inner)[own]) + np.array([block.row, block.col]))
    points = np.concatenate(found)
    step = -(-len(points) // MAX_POINTS) if len(points) else 1
    return points[::step].astype(np.float64)


def _best_line(points: Floats, tolerance: float) -> tuple[Bools, float]:
    """Return the points on the line with most of them, and how far these extend."""
    center = points.mean(axis=0)
    row, col = (points - center).T
    best, normal, offset = -1, 0.0, 0.0
    for angle in _ANGLES.tolist():
        rho = np.floor((row * np.cos(angle) + col * np.sin(angle)) / tolerance).astype(np.int64)
        least = int(rho.min())
        counts = np.bincount(rho - least)
        peak = int(counts.argmax())
        if counts[peak] > best:
            best, normal, offset = int(counts[peak]), angle, (peak + least + 0.5) * tolerance
    near = np.abs(row * np.cos(normal) + col * np.sin(normal) - offset) <= tolerance
    for _ in range(2):  # the line of total least squares through these points
        along = _direction(points[near])
        across = (points - points[near].mean(axis=0)) @ np.array([-along[1], along[0]])
        near = np.abs(across) <= tolerance
        if not near.any():
            return near, 0.0
    return near, float(np.ptp(points[near] @ _direction(points[near])))


def _direction(points: Floats) -> Floats:
    away = points - points.mean(axis=0)
    return np.linalg.eigh(away.T @ away)[1][:, -1]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a collar."""

    counts: RimCounts
    is_straight: bool  # a few straight lines hold most of the border, see `SHARP`
    is_around: bool  # it holds three corners or more
    is_all_around: bool  # all four, and half of the edge of the raster
    is_one_piece: bool  # 97 % of the picture are connected

    @classmethod
    def of(
        cls, counts: RimCounts, mask: PixelMask, shape: tuple[int, int], corners: int, one_piece: bool
    ) -> "Evidence":
        """Judge by histograms of the rim, the pixels, the raster's shape, corners held, and pieces."""
        most, share, tolerance = SMEARED if counts.is_smeared else SHARP
        length = max(min(shape) / 8, 16 * tolerance)  # of each line of a straight border
        straight = straight_share(outline_points(mask, shape), tolerance, length, most)
        of_edge = sum(int(mask.read(side).sum()) for side in sides(shape)) / (2 * sum(shape))
        along_edge = of_edge >= EDGE_AROUND
        return cls(
            counts=counts,
            is_straight=straight >= share,
            is_around=along_edge and corners >= CORNERS_AROUND,
            is_all_around=along_edge and corners == 4,
            is_one_piece=one_piece,
        )

    @property
    def is_collar(self) -> bool:
        """Whether it is a collar beyond doubt.

        A sharp step to a textured picture leaves the shape to decide. A smeared one has to surround the
        picture, in one piece: a pale sky above a horizon fades like what JPEG smears. Beside a picture that
        is nearly black or white itself, all of it is required.
        """
        if self.counts.fades or self.counts.is_speckled:
            return False
        if not self.counts.is_textured:
            return self.is_straight and self.is_all_around and self.is_one_piece
        if self.counts.is_smeared:
            return self.is_one_piece and self.is_around
        return self.is_straight or (self.is_around and self.is_one_piece)

    @property
    def may_be_collar(self) -> bool:
        """Whether the user should decide."""
        sharp = not (self.counts.fades or self.counts.is_speckled)
        return sharp and self.is_one_piece and (self.is_straight or self.is_around)


def is_one_piece(mask: PixelMask, shape: tuple[int, int]) -> bool:
    """Return whether nearly all that is not in a set is connected, at a coarse scale.

    If so, it is reached from one of the three pixels at the quartiles of it in raster order.
    """
    rows, cols = (sample_positions(0, length, min(length, COARSE)) for length in shape)
    picture = ~mask.sample(rows, cols)
    places = np.flatnonzero(picture)
    for quarter in (1, 2, 3) if len(places) else ():
        source = np.zeros(picture.shape, bool)
        source.flat[places[len(places) * quarter // 4]] = True
        if flood(source, picture).sum() >= ONE_PIECE * len(places):
            return True
    return False
