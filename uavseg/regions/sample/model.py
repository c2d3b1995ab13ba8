"""Texture model of a sample: symbol histograms, spread of the scores of its windows, intensity, and
log-likelihood-ratio weights against the raster as background.
"""

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Floats, Integers, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import SampleError
from uavseg.execution.executors import Map
from uavseg.raster.grid.ground import pixel_on_ground
from uavseg.regions.sample.place import SampleMask
from uavseg.segmentation.blocks.lbp import COARSE_HALO, UNCOUNTED, coarse_symbols, lbp_symbols
from uavseg.segmentation.sample import g_scores
from uavseg.segmentation.sample.pixel_decision import SampleWeights, SymbolPair
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import CELL, GREY_MAX

_OWN_QUANTILE = (19, 20)  # of the scores of windows in the sample: they are similar up to it
_GREY_STEP = 257  # one step of 8 bits: the smallest deviation of a sample
USUAL_WINDOWS = (32, 24, 16)  # pixels
_WINDOWS_IN_SAMPLE = 3  # minimum area of a sample, in windows: a disc with the side as radius


@dataclass(frozen=True)
class Sample:
    """Texture model and intensity of a sample: mean and deviation of the grey levels of its counted pixels.

    `own` is the score that nineteen of twenty of its windows do not exceed, each compared with the rest of
    the sample; at least the expected score under the null hypothesis.
    """

    model: g_scores.TextureModel
    own: int
    mean: float
    deviation: float

    def limit(self, similarity: float) -> int:
        """Return the largest score at which a window has at least this similarity."""
        excess = math.floor(-2 * g_scores.SCORE_UNITS * math.log(similarity))
        return min(self.own + excess, g_scores.MAX_SCORE - 1)

    def similarity(self, score: Floats) -> Floats:
        """Return the similarity to the sample from 0 to 1, for mean scores of windows or regions.

        Half of G is a log-likelihood ratio. So this is the likelihood ratio per pixel of one texture for both
        against two textures, relative to that of windows in the sample.
        """
        excess = np.maximum(score - self.own, 0) / g_scores.SCORE_UNITS
        return np.exp(-excess / 2)

    def bounds(self, deviations: float) -> g_scores.GreyBounds:
        """Return bounds of mean grey, a number of standard deviations around the mean."""
        return bounds_around(self.mean, self.deviation, deviations)


def bounds_around(mean: float, deviation: float, deviations: float) -> g_scores.GreyBounds:
    """Return bounds of mean grey around a mean in grey levels, at least one step of 8 bits from it.

    `deviations` is their distance from it in multiples of the deviation; may be infinite.
    """
    if math.isinf(deviations):
        return g_scores.GreyBounds()
    half = min(max(deviations * deviation, _GREY_STEP), GREY_MAX)
    return g_scores.GreyBounds(max(math.floor(mean - half), 0), min(math.ceil(mean + half), GREY_MAX))


def fit_sample(
    source: GreySource, bin_edges: NDArray[np.int32], place: SampleMask, side: int, map: Map
) -> Sample:
    """Fit the texture model of a sample, with windows of `side` cells.

    `bin_edges` are of the histogram of contrast over the whole raster. SampleError is raised if the sample
    has too few pixels with a texture.
    """
    [(model, scores, moments)] = map(partial(_measure_sample, source, bin_edges, side), [place])
    window = CELL * side
    if model.count == 0:
        raise SampleError("the sample has no valid pixel with valid neighbours; it probably lies on nodata")
    if model.count < 2 * window**2 or len(scores) == 0:
        raise SampleError(
            f"the sample has {model.count:,} pixels with a texture; expected at least {2 * window**2:,}, "
            f"with a window of {window} x {window} among them, as a disc with a radius of "
            f"{_radius(source, window)} has; give a larger sample or a smaller --window, or compare colors "
            "(--by color)"
        )
    count, total, squares = (int(moment) for moment in moments)
    rank = -(-len(scores) * _OWN_QUANTILE[0] // _OWN_QUANTILE[1])
    return Sample(
        model=model,
        own=max(int(np.sort(scores)[rank - 1]), g_scores.NULL_SCORE),
        mean=total / count,
        deviation=math.sqrt((squares * count - total * total) / count**2),
    )


def fit_weights(
    source: GreySource, bin_edges: NDArray[np.int32], place: SampleMask, whole: Integers, side: int, map: Map
) -> SampleWeights:
    """Fit log-likelihood-ratio weights of symbols, sample against background (the whole raster).

    `whole`, (2, 2048), counts each symbol in the raster, at both scales; the others are those of
    `fit_sample`.
    """
    [weights] = map(partial(_fit_sample_weights, source, bin_edges, whole, side), [place])
    return weights


def symbol_pair(tile: GreyTile, bin_edges: NDArray[np.int32]) -> SymbolPair:
    """Return LBP symbols of a tile at both scales, without its halo of COARSE_HALO pixels."""
    inner = np.s_[COARSE_HALO - 1 : 1 - COARSE_HALO, COARSE_HALO - 1 : 1 - COARSE_HALO]
    known = tile.mask
    near = None if known is None else np.ascontiguousarray(known[inner])
    fine = lbp_symbols(np.ascontiguousarray(tile.grey[inner]), near, bin_edges)
    return fine, coarse_symbols(tile.grey, known, bin_edges)


def _fit_sample_weights(
    source: GreySource, bin_edges: NDArray[np.int32], whole: Integers, side: int, place: SampleMask
) -> SampleWeights:
    tile = source.read(place.window, COARSE_HALO)
    return SampleWeights.of(_sample_symbols(tile, bin_edges, place), whole, side)


def _sample_symbols(tile: GreyTile, bin_edges: NDArray[np.int32], place: SampleMask) -> SymbolPair:
    """Return the symbols of the pixels of a sample; UNCOUNTED for the other pixels of its blocks."""
    names = symbol_pair(tile, bin_edges)
    mask = np.zeros(names[0].shape, bool)
    mask[: place.window.rows, : place.window.cols] = place.mask
    for each in names:
        each[~mask] = UNCOUNTED
    return names


def _radius(source: GreySource, pixels: int) -> str:
    """Format a length in pixels, with metres where they are known."""
    box = source.dataset.geobox
    if box.crs is None:
        return f"{pixels} pixels"
    per_col, per_row, _ = pixel_on_ground(box, *(np.array([length / 2]) for length in box.shape))
    metres = pixels * max(float(per_col[0]), float(per_row[0]))
    return f"{pixels} pixels ({metres:.3g} m)" if math.isfinite(metres) else f"{pixels} pixels"


def _measure_sample(
    source: GreySource, bin_edges: NDArray[np.int32], side: int, place: SampleMask
) -> tuple[g_scores.TextureModel, Uint16s, NDArray[np.uint64]]:
    """Measure a sample: texture model, scores of its windows, and count, sum and sum of squares of grey."""
    tile = source.read(place.window, COARSE_HALO)
    names, coarse = _sample_symbols(tile, bin_edges, place)
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    cells = np.ones((names.shape[0] // CELL, names.shape[1] // CELL), np.uint8)
    model = g_scores.texture_model(names, grey, cells, coarse=coarse)
    scores = g_scores.window_scores(names, grey, model, side, leave_one_out=True)
    counted = grey[names != UNCOUNTED].astype(np.uint64)
    moments = np.array([len(counted), counted.sum(), (counted * counted).sum()], np.uint64)
    return model, scores[scores != g_scores.NO_SCORE], moments


def fitting_window(place: SampleMask) -> int | None:
    """Return the side in pixels of the largest usual window that fits into a sample; None where none does."""
    counts = place.cell_counts()
    for side in USUAL_WINDOWS:
        cells = side // CELL
        if counts.sum() >= _WINDOWS_IN_SAMPLE * side**2 and min(counts.shape) >= cells:
            windows = np.lib.stride_tricks.sliding_window_view(counts, (cells, cells))
            if windows.sum((2, 3)).max() >= g_scores.min_count(cells):  # one is covered well enough
                return side
    return None
