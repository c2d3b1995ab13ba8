"""Where the next sample would help most: the disc whose colors are the least decided.

cells -> a few discs whose cells are undecided, far enough from all samples
      -> the one whose pixels are the least decided
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SampleError
from uavseg.raster.geodesy.globe import is_geographic
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.sample.likeness import MIN_PIXELS, LikenessSource
from uavseg.regions.sample.place import Disc, SampleMask, sample_mask
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.sample.undecided_cells import half_widths, most_undecided
from uavseg.units import CELL, GREY_MAX

_LEAST_SHARE = 0.05  # of the raster that is undecided, below which no sample is asked for
_LEAST_DOUBT = 0.5  # of the pixels of a disc on average
_LEAST_RADIUS, _LARGEST_RADIUS = 8.0, 16.0  # pixels
_GAP = 2  # radii from the samples
_LOOKED_AT = 16  # discs whose pixels are read
_STRETCHED = 4  # a pixel this many times longer than wide is too long for a disc of cells


def next_place(
    likeness: LikenessSource, blocks: BlockMap, samples: Sequence[SampleMask], tile_pass: TilePass
) -> Disc | None:
    """The disc on the map whose pixels are the least decided; None where hardly any are.

    It lies on valid pixels as a whole and outside of all samples, and is about as large as these are, with a
    radius of 8 to 16 pixels; of 8 where no larger one fits.

    Parameters
    ----------
    likeness : LikenessSource
    blocks : BlockMap
        Of the likeness.
    samples : sequence of SampleMask
        All that were given, of what is wanted and of what is not.
    tile_pass : TilePass
        Its executor reads; the result depends neither on it nor on its tiles.
    """
    if likeness.table.undecided < _LEAST_SHARE:
        return None
    geobox = likeness.dataset.geobox
    usual = _radius(samples)
    for radius in dict.fromkeys((usual, _LEAST_RADIUS)):
        reach = radius * math.sqrt(_stretched(geobox))
        if reach > radius * math.sqrt(_STRETCHED):
            return None
        taken = _taken(samples, blocks.counts.shape, _GAP * radius)
        cells = most_undecided(blocks.sums, blocks.counts, taken, reach, _LOOKED_AT, _LEAST_DOUBT)
        discs = [_disc(geobox, row, col, reach) for row, col in cells.tolist()]
        found = _least_decided(likeness, discs, samples, tile_pass)
        if found is not None:
            return found
    return None


def _least_decided(
    likeness: LikenessSource, discs: Sequence[Disc], samples: Sequence[SampleMask], tile_pass: TilePass
) -> Disc | None:
    """Of discs, the one whose pixels are the least decided on average, if they are undecided."""
    masks = [_mask_apart(disc, likeness.dataset.geobox, samples) for disc in discs]
    looked = [(disc, mask) for disc, mask in zip(discs, masks, strict=True) if mask is not None]
    doubts = list(tile_pass.silent.run(partial(_doubt, likeness), [mask for _, mask in looked]))
    best = max(range(len(looked)), key=lambda k: doubts[k], default=None)
    return None if best is None or doubts[best] < _LEAST_DOUBT else looked[best][0]


def _doubt(likeness: LikenessSource, place: SampleMask) -> float:
    """By how much the pixels of a place are undecided on average, 0 to 1; 0 if one of them is not valid."""
    tile, inside = likeness.read(place.window, 0), place.mask
    rows, cols = inside.shape
    if not tile.valid[:rows, :cols][inside].all():
        return 0.0
    grey = tile.grey[:rows, :cols][inside].astype(np.int64)
    return float((GREY_MAX - np.abs(2 * grey - GREY_MAX)).sum()) / (GREY_MAX * len(grey))


def _mask_apart(disc: Disc, geobox: GeoBox, samples: Sequence[SampleMask]) -> SampleMask | None:
    """The pixels of a disc; None where they are too few, or some belong to a sample."""
    try:
        found = sample_mask(disc, geobox)
    except SampleError:
        return None
    if np.count_nonzero(found.mask) < MIN_PIXELS or any(map(found.meets, samples)):
        return None
    return found


def _radius(samples: Sequence[SampleMask]) -> float:
    """Radius in pixels of a disc that is as large as samples are on average, within bounds."""
    pixels = np.mean([np.count_nonzero(place.mask) for place in samples])
    return float(min(max(round(math.sqrt(pixels / math.pi)), _LEAST_RADIUS), _LARGEST_RADIUS))


def _taken(samples: Sequence[SampleMask], shape: tuple[int, ...], gap: float) -> NDArray[np.bool_]:
    """Cells within a gap of samples: (m, n) bool."""
    taken = np.zeros(shape, bool)
    for place in samples:
        near = _grown(_held_cells(place), half_widths(gap))
        reach = (near.shape[0] - _cells_of(place.window.rows)) // 2
        first = Window(place.window.row // CELL - reach, place.window.col // CELL - reach, *near.shape)
        part = first.clipped((shape[0], shape[1]))
        inner = replace(part, row=part.row - first.row, col=part.col - first.col)
        taken[part.slices] |= near[inner.slices]
    return taken


def _cells_of(length: int) -> int:
    return -(-length // CELL)


def _held_cells(place: SampleMask) -> NDArray[np.bool_]:
    """Cells of a sample's bounding box in which it has pixels."""
    mask = place.mask
    rows, cols = map(_cells_of, mask.shape)
    padded = np.pad(mask, ((0, rows * CELL - mask.shape[0]), (0, cols * CELL - mask.shape[1])))
    return np.asarray(padded.reshape(rows, CELL, cols, CELL).any((1, 3)))


def _grown(held: NDArray[np.bool_], widths: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Cells dilated by a disc, with a margin of its reach on all sides."""
    reach = len(widths) // 2
    around = np.pad(held, reach)
    grown = np.zeros_like(around)
    for row, width in enumerate(widths.tolist(), -reach):
        for col in range(-width, width + 1):
            grown |= np.roll(around, (row, col), (0, 1))
    return grown


def _stretched(geobox: GeoBox) -> float:
    """How many times longer than wide a pixel is, at most, on the map or on the ground in degrees."""
    long, wide = _steps(geobox, geobox.shape[0] / 2, geobox.shape[1] / 2)
    return long / wide if wide > 0 and math.isfinite(long) else math.inf


def _steps(geobox: GeoBox, row: float, col: float) -> tuple[float, float]:
    """Longest and shortest extent of a pixel in the unit of a radius."""
    if is_geographic(geobox.wkt):
        steps = ground_steps(geobox, row, col)
        return max(steps), min(steps)
    t = geobox.transform
    values = np.linalg.svd(np.array([[t.a, t.b], [t.d, t.e]]), compute_uv=False)
    return float(values[0]), float(values[1])


def _disc(geobox: GeoBox, row: int, col: int, reach: float) -> Disc:
    """The disc on the map around the middle of a cell, which reaches so many pixels at most."""
    middle = ((row + 0.5) * CELL, (col + 0.5) * CELL)
    x, y = (float(value) for value in geobox.xy_from_pixel(*middle))
    t = geobox.transform
    finest = min(step for step in (math.hypot(t.a, t.d), math.hypot(t.b, t.e)))
    digits = 1 - math.floor(math.log10(finest))  # a tenth of a pixel or less
    _, least = _steps(geobox, *middle)
    return Disc(round(x, digits), round(y, digits), _rounded_down(reach * least))


def _rounded_down(length: float) -> float:
    """A length with three digits, not above it."""
    digits = 2 - math.floor(math.log10(length))
    unit = 10.0**digits
    return round(math.floor(length * unit + 1e-6) / unit, max(digits, 0))
