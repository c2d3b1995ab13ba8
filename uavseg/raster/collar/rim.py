"""The rim of a collar: what lies beyond it, and near-constant pixels along it, by streamed histograms.

Lossy compression and resampling smear the edge between a collar and the picture: pixels along it are nearly
of the constant value. They are concentrated there, which tells them from dark or bright ground.
"""

from dataclasses import field
from functools import partial, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.raster.collar.flood import UNREACHED, distances, flood_tiles
from uavseg.raster.grid.pixel_mask import PixelMask
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.read.dataset import Dataset

SMEAR = 16  # pixels: the side of the block in which JPEG mixes colours
BEYOND = 2 * SMEAR  # pixels: up to here is compared with the rim
BLEND = 2  # pixels beyond near-constant ones that are a mixture too
MIN_CONTRAST = 8  # levels
MAX_CONSTANT = 0.5  # share of one value beyond the rim; of a drawn mask it is nearly 1
NEAR = 0.25  # share of the contrast within which a pixel is nearly constant
MAX_NEAR = 1 / 8  # share of nearly constant pixels in a picture, and least share at a smeared rim
MAX_SPECKLE = 1 / 50  # share of pixels of exactly the constant value in a picture
FADING = (0.05, 0.28)  # shares of the rim within two levels; measured on clipped and on drawn rasters

Pixels = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class RimCounts:
    """Histograms of how far valid pixels are from the constant value; those of tiles merge by adding."""

    # pixels beside the collar, and 17 to 32 pixels from it, by the largest difference of a band, (n,)
    rim: NDArray[np.int64] = field(repr=False)
    beyond: NDArray[np.int64] = field(repr=False)
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


def _share(histogram: NDArray[np.int64], end: int) -> float:
    """Return share of the first bins of a histogram; 0 if it is empty."""
    return int(histogram[:end].sum()) / max(int(histogram.sum()), 1)


def count_rim(dataset: Dataset, flooded: PixelMask, value: int, tile_pass: TilePass) -> RimCounts:
    """Return the histograms along the rim of a flood, as of `flood_from_edges`, of unsigned integers."""
    windows = [window for window in _tiles(dataset) if _touched(dataset, flooded, window)]
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
    windows = [window for window in _tiles(dataset) if _touched(dataset, flooded, window)]
    parts = tile_pass.silent.run(partial(_grow_tile, dataset, flooded, value, limit), windows)
    masks, added = [], 0
    for window, (mask, count) in zip(windows, parts, strict=True):
        masks.append((window, mask))
        added += count
    return PixelMask.joined(dataset.geobox.shape, masks), added


def _tiles(dataset: Dataset) -> list[Window]:
    return tiles(dataset.geobox.shape, flood_tiles(dataset))


def _touched(dataset: Dataset, flooded: PixelMask, window: Window) -> bool:
    return flooded.touches(window.grown(BEYOND).clipped(dataset.geobox.shape))


def _count_tile(dataset: Dataset, flooded: PixelMask, value: int, window: Window) -> RimCounts:
    size = 1 << 8 * dataset.dtype.itemsize
    around = window.grown(BEYOND).clipped(dataset.geobox.shape)
    if flooded.covers(around):
        nothing = np.zeros(size, np.int64)
        return RimCounts(nothing, nothing, _count_valid(dataset, window))
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


def _core(flooded: PixelMask, window: Window, shape: tuple[int, int]) -> Pixels:
    """Return the flood with its neighbours in a window."""
    wider = window.grown(1)
    part = wider.clipped(shape)
    flood = np.zeros((wider.rows, wider.cols), bool)
    inner = Window(part.row - wider.row, part.col - wider.col, part.rows, part.cols)
    flood[inner.slices] = flooded.read(part)
    rows = flood[:-2] | flood[1:-1] | flood[2:]
    return rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]


def _read(
    dataset: Dataset, flooded: PixelMask, value: int, window: Window
) -> tuple[Pixels, NDArray[np.unsignedinteger[Any]], Pixels, tuple[slice, slice]]:
    """Read the flood with its neighbours, differences, validity around a tile; and where that lies."""
    around = window.grown(BEYOND).clipped(dataset.geobox.shape)
    values, valid = dataset.read(around)
    constant = values.dtype.type(value)
    difference = (values - constant if value == 0 else constant - values).max(axis=0)
    known = np.ones(difference.shape, bool) if valid is None else valid
    own = Window(window.row - around.row, window.col - around.col, window.rows, window.cols).slices
    return _core(flooded, around, dataset.geobox.shape), difference, known, own


def _count_valid(dataset: Dataset, window: Window) -> int:
    if dataset.is_empty(window):
        return 0
    _, valid = dataset.read(window)
    return window.rows * window.cols if valid is None else int(valid.sum())
