"""A raster as the probability that each pixel is of a sample's kind, by its colour."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SampleError
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.sample.place import SampleMask
from uavseg.segmentation.sample.likeness_table import BLUR_HALO, LikenessTable, blurred
from uavseg.segmentation.source import GreySource, GreyTile

MIN_PIXELS = 64  # of a sample
_WINDOWS = 32  # along each side of the raster, where its colours are looked at
_WINDOW = 12  # pixels, at most
_STEP = 4  # pixels between those that are looked at


@dataclass(frozen=True)
class LikenessSource(GreySource):
    """Likeness to a sample in place of grey, 65535 for certain; valid where all bands are.

    Parameters
    ----------
    bands : BlurredBands
    table : LikenessTable
    """

    bands: "BlurredBands"
    table: LikenessTable

    @property
    def is_intensity(self) -> bool:
        """False: likeness falls into two groups wherever colors overlap, and what is small there is noise."""
        return False

    def read(self, window: Window, margin: int, beyond: bool = False) -> GreyTile:
        """As of `GreySource`; nothing lies beyond the ends."""
        planes, valid = self.bands.read(window, margin)
        grey = self.table.apply(planes)
        all_valid = bool(valid.all())
        if not all_valid:
            grey[valid == 0] = 0
        return GreyTile(grey, valid, all_valid)


class BlurredBands:
    """Blurred bands of a raster, which several likenesses share; each thread keeps what it read last.

    Parameters
    ----------
    bands : sequence of GreySource
    """

    def __init__(self, bands: Sequence[GreySource]) -> None:
        self.bands = tuple(bands)
        self._last = threading.local()

    def __reduce__(self) -> tuple[type["BlurredBands"], tuple[tuple[GreySource, ...]]]:
        return BlurredBands, (self.bands,)

    def fingerprint(self) -> tuple[GreySource, ...]:
        """The bands: no result depends on what is kept."""
        return self.bands

    def read(self, window: Window, margin: int) -> tuple[list[NDArray[np.uint16]], NDArray[np.uint8]]:
        """Blurred bands of a window with a margin, and where all of them are valid; not to be changed."""
        if getattr(self._last, "place", None) != (window, margin):
            self._last.found = _read_blurred(self.bands, window, margin)
            self._last.place = window, margin
        found: tuple[list[NDArray[np.uint16]], NDArray[np.uint8]] = self._last.found
        return found


@dataclass(frozen=True)
class SampledColors:
    """Blurred colours of pixels.

    Parameters
    ----------
    points : (n, bands) uint16 array
        All over the raster.
    sample : (m, bands) uint16 array
        Of the samples of what is wanted.
    unlike : (k, bands) uint16 array, optional
        Of the samples of what is not.
    """

    points: NDArray[np.uint16]
    sample: NDArray[np.uint16]
    unlike: NDArray[np.uint16] | None

    def table(self) -> LikenessTable:
        """What the colours of the samples are, against those of the whole raster."""
        return LikenessTable.fit(self.points, self.sample, self.unlike)


def sample_colors(
    bands: Sequence[GreySource],
    places: Sequence[SampleMask],
    tile_pass: TilePass,
    unlike: Sequence[SampleMask] = (),
    name: str = "the sample",
    spread: NDArray[np.uint16] | None = None,
) -> SampledColors:
    """Colours of samples, and of pixels all over the raster.

    Parameters
    ----------
    bands : sequence of GreySource
        Of one raster.
    places : sequence of SampleMask
        Samples of what is wanted.
    tile_pass : TilePass
        Its executor reads; the result depends neither on it nor on its tiles.
    unlike : sequence of SampleMask
        Samples of what is not.
    name : str
        What an error calls the samples of what is wanted.
    spread : (n, bands) uint16 array, optional
        What `spread_colors` found, where several samples are compared.

    Raises
    ------
    SampleError
        If either have fewer than 64 valid pixels, or some have pixels in common.
    """
    _check_apart(places, unlike)
    run = tile_pass.silent
    sample = _colors_of(run, bands, places, name)
    others = _colors_of(run, bands, unlike, "the sample of what is unlike") if unlike else None
    if spread is None:
        spread = spread_colors(bands, tile_pass)
    return SampledColors(np.concatenate([spread, sample[:1]]), sample, others)


def spread_colors(bands: Sequence[GreySource], tile_pass: TilePass) -> NDArray[np.uint16]:
    """Colours of pixels in small windows that are spread evenly over a raster: (n, bands)."""
    windows = _spread_windows(bands[0].shape)
    return np.concatenate(list(tile_pass.silent.run(partial(_colors, bands), windows)))


def fit_likeness(
    bands: BlurredBands,
    places: Sequence[SampleMask],
    tile_pass: TilePass,
    unlike: Sequence[SampleMask] = (),
    name: str = "the sample",
    spread: NDArray[np.uint16] | None = None,
) -> LikenessSource:
    """Learn what the colours of samples are, against those of the whole raster.

    Parameters and errors are those of `sample_colors`.
    """
    table = sample_colors(bands.bands, places, tile_pass, unlike, name, spread).table()
    first = bands.bands[0]
    return LikenessSource(first.dataset, first.stretch, bands, table)


def _colors_of(
    tile_pass: TilePass, bands: Sequence[GreySource], places: Sequence[SampleMask], name: str
) -> NDArray[np.uint16]:
    colors = np.concatenate(list(tile_pass.run(partial(_sample_colors, bands), places)))
    if len(colors) == 0:
        raise SampleError(f"{name} has no valid pixel; it probably lies on nodata")
    if len(colors) < MIN_PIXELS:
        pixels = "1 valid pixel" if len(colors) == 1 else f"{len(colors)} valid pixels"
        raise SampleError(
            f"{name} has {pixels}; expected at least {MIN_PIXELS}, as a disc with a radius of 5 pixels "
            "has; give a larger one"
        )
    return colors


def _check_apart(places: Sequence[SampleMask], unlike: Sequence[SampleMask]) -> None:
    for one in places:
        for other in unlike:
            if one.meets(other):
                raise SampleError(
                    "a sample of what is wanted and one of what is not have pixels in common; draw them apart"
                )


def _spread_windows(shape: tuple[int, int]) -> list[Window]:
    """Small windows that are spread evenly over the raster."""
    starts = []
    for length in shape:
        count = min(_WINDOWS, -(-length // _WINDOW))
        side = min(_WINDOW, length)
        starts.append([(2 * k + 1) * length // (2 * count) - side // 2 for k in range(count)])
    sides = min(_WINDOW, shape[0]), min(_WINDOW, shape[1])
    return [Window(max(row, 0), max(col, 0), *sides).clipped(shape) for row in starts[0] for col in starts[1]]


def _colors(bands: Sequence[GreySource], window: Window) -> NDArray[np.uint16]:
    """Blurred colours of every fourth pixel of a window in every fourth row: (n, bands)."""
    if bands[0].dataset.is_empty(window):
        return np.empty((0, len(bands)), np.uint16)
    planes, valid = _read_blurred(bands, window, 0)
    chosen = np.zeros(valid.shape, bool)
    chosen[_STEP // 2 : window.rows : _STEP, _STEP // 2 : window.cols : _STEP] = True
    return np.stack([plane[chosen & (valid != 0)] for plane in planes], 1)


def _sample_colors(bands: Sequence[GreySource], place: SampleMask) -> NDArray[np.uint16]:
    """Blurred colours of the pixels of a sample: (m, bands)."""
    planes, valid = _read_blurred(bands, place.window, 0)
    chosen = valid != 0
    rows, cols = place.window.rows, place.window.cols
    chosen[:rows, :cols] &= place.mask
    chosen[rows:], chosen[:, cols:] = False, False
    return np.stack([plane[chosen] for plane in planes], 1)


def _read_blurred(
    bands: Sequence[GreySource], window: Window, margin: int
) -> tuple[list[NDArray[np.uint16]], NDArray[np.uint8]]:
    """Blurred bands of a window with a margin, and where all of them are valid."""
    inner = np.s_[BLUR_HALO:-BLUR_HALO, BLUR_HALO:-BLUR_HALO]
    tiles = [band.read(window, margin + BLUR_HALO) for band in bands]
    valid = np.bitwise_and.reduce([tile.valid[inner] for tile in tiles])
    return [blurred(tile.grey, tile.valid) for tile in tiles], np.ascontiguousarray(valid)
