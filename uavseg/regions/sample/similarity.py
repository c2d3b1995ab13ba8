"""Similarity to a sample by colour: the posterior probability of each pixel, read like an intensity."""

import threading
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import SampleError
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.sample.place import SampleMask
from uavseg.segmentation.sample.similarity_table import BLUR_HALO, SimilarityTable, blurred
from uavseg.segmentation.source import GreySource, GreyTile

MIN_PIXELS = 64  # of a sample
_WINDOWS = 32  # along each side of the raster, in which its colours are sampled
_WINDOW = 12  # pixels, at most
_STEP = 4  # pixels between those that are sampled


@dataclass(frozen=True)
class SimilaritySource(GreySource):
    """Similarity to a sample in place of grey, 65535 for certain; valid where all bands are."""

    bands: "BlurredBands"
    table: SimilarityTable

    @property
    def is_intensity(self) -> bool:
        """False: where colors overlap, similarity is bimodal, and small structures are noise."""
        return False

    def read(self, window: Window, margin: int, excess: bool = False) -> GreyTile:
        """Read a window; parameters as of `GreySource.read`."""
        planes, valid = self.bands.read(window, margin)
        grey = self.table.apply(planes)
        all_valid = bool(valid.all())
        if not all_valid:
            grey[valid == 0] = 0
        return GreyTile(grey, valid, all_valid)


class BlurredBands:
    """Blurred bands of a raster, which several similarities share; each thread caches its last window."""

    def __init__(self, bands: Sequence[GreySource]) -> None:
        self.bands = tuple(bands)
        self._last = threading.local()

    def __reduce__(self) -> tuple[type["BlurredBands"], tuple[tuple[GreySource, ...]]]:
        return BlurredBands, (self.bands,)

    def fingerprint(self) -> tuple[GreySource, ...]:
        """Return the bands: no result depends on the cache."""
        return self.bands

    def read(self, window: Window, margin: int) -> tuple[list[NDArray[np.uint16]], NDArray[np.uint8]]:
        """Read blurred bands of a window, and where all are valid; do not change the arrays."""
        if getattr(self._last, "place", None) != (window, margin):
            self._last.tile = _read_blurred(self.bands, window, margin)
            self._last.place = window, margin
        tile: tuple[list[NDArray[np.uint16]], NDArray[np.uint8]] = self._last.tile
        return tile


@dataclass(frozen=True)
class SampledColors:
    """Blurred colours, each (n, bands): `points` all over a raster, a sample, and samples of other areas."""

    points: NDArray[np.uint16]
    sample: NDArray[np.uint16]
    unlike: NDArray[np.uint16] | None

    def table(self) -> SimilarityTable:
        """Fit the model of the samples, against the whole raster as background."""
        return SimilarityTable.fit(self.points, self.sample, self.unlike)


def sample_colors(
    bands: Sequence[GreySource],
    places: Sequence[SampleMask],
    tile_pass: TilePass,
    unlike: Sequence[SampleMask] = (),
    name: str = "the sample",
    spread: NDArray[np.uint16] | None = None,
) -> SampledColors:
    """Collect colours of samples, and of pixels all over the raster.

    The bands are of one raster; `places` are samples of the target, called `name` in errors, `unlike` those
    of other areas. `spread`, (n, bands), is from `spread_colors`, where several samples are compared. The
    result depends neither on the executor of the pass nor on its tiles. A SampleError says that either have
    fewer than 64 valid pixels, or that some have pixels in common.
    """
    if any(place.meets(other) for place in places for other in unlike):
        raise SampleError(
            "a sample of what is wanted and one of what is not have pixels in common; draw them apart"
        )
    run = tile_pass.silent
    sample = _colors_of(run, bands, places, name)
    others = _colors_of(run, bands, unlike, "the sample of what is unlike") if unlike else None
    if spread is None:
        spread = spread_colors(bands, tile_pass)
    return SampledColors(np.concatenate([spread, sample[:1]]), sample, others)


def spread_colors(bands: Sequence[GreySource], tile_pass: TilePass) -> NDArray[np.uint16]:
    """Return colours of pixels in small windows that are spread evenly over a raster: (n, bands) uint16."""
    windows = _spread_windows(bands[0].shape)
    return np.concatenate(list(tile_pass.silent.run(partial(_colors, bands), windows)))


def fit_similarity(
    bands: BlurredBands,
    places: Sequence[SampleMask],
    tile_pass: TilePass,
    unlike: Sequence[SampleMask] = (),
    name: str = "the sample",
    spread: NDArray[np.uint16] | None = None,
) -> SimilaritySource:
    """Fit the similarity to the colours of samples, against the whole raster as background.

    Parameters and errors are those of `sample_colors`.
    """
    table = sample_colors(bands.bands, places, tile_pass, unlike, name, spread).table()
    first = bands.bands[0]
    return SimilaritySource(first.dataset, first.stretch, bands, table)


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


def _spread_windows(shape: tuple[int, int]) -> list[Window]:
    starts = []
    for length in shape:
        count = min(_WINDOWS, -(-length // _WINDOW))
        side = min(_WINDOW, length)
        starts.append([(2 * k + 1) * length // (2 * count) - side // 2 for k in range(count)])
    sides = min(_WINDOW, shape[0]), min(_WINDOW, shape[1])
    return [Window(max(row, 0), max(col, 0), *sides).clipped(shape) for row in starts[0] for col in starts[1]]


def _colors(bands: Sequence[GreySource], window: Window) -> NDArray[np.uint16]:
    """Return blurred colours of every fourth pixel of a window in every fourth row: (n, bands)."""
    if bands[0].dataset.is_empty(window):
        return np.empty((0, len(bands)), np.uint16)
    planes, valid = _read_blurred(bands, window, 0)
    chosen = np.zeros(valid.shape, bool)
    chosen[_STEP // 2 : window.rows : _STEP, _STEP // 2 : window.cols : _STEP] = True
    return np.stack([plane[chosen & (valid != 0)] for plane in planes], 1)


def _sample_colors(bands: Sequence[GreySource], place: SampleMask) -> NDArray[np.uint16]:
    """Return blurred colours of the pixels of a sample: (m, bands)."""
    planes, valid = _read_blurred(bands, place.window, 0)
    chosen = valid != 0
    rows, cols = place.window.rows, place.window.cols
    chosen[:rows, :cols] &= place.mask
    chosen[rows:], chosen[:, cols:] = False, False
    return np.stack([plane[chosen] for plane in planes], 1)


def _read_blurred(
    bands: Sequence[GreySource], window: Window, margin: int
) -> tuple[list[NDArray[np.uint16]], NDArray[np.uint8]]:
    """Read blurred bands of a window with a margin, and where all of them are valid."""
    inner = np.s_[BLUR_HALO:-BLUR_HALO, BLUR_HALO:-BLUR_HALO]
    tiles = [band.read(window, margin + BLUR_HALO) for band in bands]
    valid = np.bitwise_and.reduce([tile.valid[inner] for tile in tiles])
    return [blurred(tile.grey, tile.valid) for tile in tiles], np.ascontiguousarray(valid)
