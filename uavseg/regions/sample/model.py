"""Texture model of a sample: symbol histograms, the spread of its own windows' scores, its intensity, and
log-likelihood-ratio weights against the raster as background.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SampleError
from uavseg.execution.executors import Map
from uavseg.raster.grid.ellipsoid import pixel_on_ground
from uavseg.regions.sample.place import SampleMask
from uavseg.segmentation.blocks.lbp import UNCOUNTED, lbp_symbols
from uavseg.segmentation.sample.coarse_lbp import COARSE_HALO, coarse_symbols
from uavseg.segmentation.sample.g_scores import (
    MAX_SCORE,
    NO_SCORE,
    NULL_SCORE,
    SCORE_UNITS,
    GreyBounds,
    TextureModel,
    texture_model,
    window_scores,
)
from uavseg.segmentation.sample.likelihood_weights import SampleWeights, SymbolPair
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import CELL, GREY_MAX

_OWN_QUANTILE = (19, 20)  # of the scores of the sample's own windows, which counts as similar
_GREY_STEP = 257  # one step of 8 bits: the smallest deviation of a sample


@dataclass(frozen=True)
class Sample:
    """Texture model and intensity of a sample.

    Parameters
    ----------
    model : TextureModel
    own : int
        The score that nineteen of twenty of its windows do not exceed, each compared with the rest of the
        sample; at least the expected score under the null hypothesis.
    mean, deviation : float
        Of the grey levels of its counted pixels.
    """

    model: TextureModel
    own: int
    mean: float
    deviation: float

    def limit(self, similarity: float) -> int:
        """The largest score at which a window has at least this similarity."""
        return min(self.own + math.floor(-2 * SCORE_UNITS * math.log(similarity)), MAX_SCORE - 1)

    def similarity(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """Similarity to the sample from 0 to 1, for mean scores of windows or regions.

        Half of G is a log-likelihood ratio. So this is the likelihood ratio per pixel of one texture for both
        against two textures, relative to that of the sample's own windows.
        """
        excess = np.maximum(score - self.own, 0) / SCORE_UNITS
        similarity: NDArray[np.float64] = np.exp(-excess / 2)
        return similarity

    def bounds(self, deviations: float) -> GreyBounds:
        """Bounds of mean grey: so many deviations around the sample's mean, at least one step of 8 bits."""
        return bounds_around(self.mean, self.deviation, deviations)


def bounds_around(mean: float, deviation: float, deviations: float) -> GreyBounds:
    """Bounds of mean grey: so many times the deviation around a mean, at least one step of 8 bits."""
    if math.isinf(deviations):
        return GreyBounds()
    half = min(max(deviations * deviation, _GREY_STEP), GREY_MAX)
    return GreyBounds(max(math.floor(mean - half), 0), min(math.ceil(mean + half), GREY_MAX))


def fit_sample(
    source: GreySource, bin_edges: NDArray[np.int32], place: SampleMask, side: int, map: Map
) -> Sample:
    """Fit the texture model of a sample.

    Parameters
    ----------
    source : GreySource
    bin_edges : (7,) int32 array
        Of the histogram of contrast, over the whole raster.
    place : SampleMask
    side : int
        Side of a window in cells.
    map : Map

    Raises
    ------
    SampleError
        If the sample has too few pixels with a texture.
    """
    [(model, own, moments)] = map(partial(_measure_sample, source, bin_edges, side), [place])
    largest = (CELL * side) ** 2
    if model.count == 0:
        raise SampleError("the sample has no valid pixel with valid neighbours; it probably lies on nodata")
    if model.count < 2 * largest or len(own) == 0:
        raise SampleError(_too_small(source, model.count, CELL * side))
    count, total, squares = (int(moment) for moment in moments)
    rank = -(-len(own) * _OWN_QUANTILE[0] // _OWN_QUANTILE[1])
    variance = (squares * count - total * total) / count**2
    return Sample(model, max(int(np.sort(own)[rank - 1]), NULL_SCORE), total / count, math.sqrt(variance))


def fit_weights(
    source: GreySource,
    bin_edges: NDArray[np.int32],
    place: SampleMask,
    whole: NDArray[np.int64],
    side: int,
    map: Map,
) -> SampleWeights:
    """Fit log-likelihood-ratio weights of symbols, sample against background (the whole raster).

    Parameters
    ----------
    source, bin_edges, place, side, map
        As of `fit_sample`.
    whole : (2, 2048) int64 array
        Count of each symbol in the raster, at both scales.
    """
    [found] = map(partial(_fit_sample_weights, source, bin_edges, whole, side), [place])
    return found


def symbol_pair(tile: GreyTile, bin_edges: NDArray[np.int32]) -> SymbolPair:
    """LBP symbols of a tile at both scales, without its halo of COARSE_HALO pixels."""
    inner = np.s_[COARSE_HALO - 1 : 1 - COARSE_HALO, COARSE_HALO - 1 : 1 - COARSE_HALO]
    known = tile.mask
    near = None if known is None else np.ascontiguousarray(known[inner])
    fine = lbp_symbols(np.ascontiguousarray(tile.grey[inner]), near, bin_edges)
    return fine, coarse_symbols(tile.grey, known, bin_edges)


def _fit_sample_weights(
    source: GreySource, bin_edges: NDArray[np.int32], whole: NDArray[np.int64], side: int, place: SampleMask
) -> SampleWeights:
    return SampleWeights.of(_own_names(source.read(place.window, COARSE_HALO), bin_edges, place), whole, side)


def _own_names(tile: GreyTile, bin_edges: NDArray[np.int32], place: SampleMask) -> SymbolPair:
    """Symbols of the pixels of a sample; UNCOUNTED for the other pixels of the blocks around it."""
    names = symbol_pair(tile, bin_edges)
    mask = np.zeros(names[0].shape, bool)
    mask[: place.window.rows, : place.window.cols] = place.mask
    for each in names:
        each[~mask] = UNCOUNTED
    return names


def _too_small(source: GreySource, count: int, window: int) -> str:
    return (
        f"the sample has {count:,} pixels with a texture; expected at least {2 * window**2:,}, with a window "
        f"of {window} x {window} among them, as a disc with a radius of {_radius(source, window)} has; "
        "give a larger sample or a smaller --window, or compare colors (--by color)"
    )


def _radius(source: GreySource, pixels: int) -> str:
    """A length in pixels as text, with metres where they are known."""
    box = source.dataset.geobox
    if box.crs is None:
        return f"{pixels} pixels"
    per_col, per_row, _ = pixel_on_ground(box, *(np.array([length / 2]) for length in box.shape))
    metres = pixels * max(float(per_col[0]), float(per_row[0]))
    return f"{pixels} pixels ({metres:.3g} m)" if math.isfinite(metres) else f"{pixels} pixels"


def _measure_sample(
    source: GreySource, bin_edges: NDArray[np.int32], side: int, place: SampleMask
) -> tuple[TextureModel, NDArray[np.uint16], NDArray[np.uint64]]:
    """Texture model of a sample, scores of its windows, and count, sum and sum of squares of its grey."""
    tile = source.read(place.window, COARSE_HALO)
    names, coarse = _own_names(tile, bin_edges, place)
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    cells = np.ones((names.shape[0] // CELL, names.shape[1] // CELL), np.uint8)
    model = texture_model(names, grey, cells, coarse=coarse)
    scores = window_scores(names, grey, model, side, leave_one_out=True)
    counted = grey[names != UNCOUNTED].astype(np.uint64)
    moments = np.array([len(counted), counted.sum(), (counted * counted).sum()], np.uint64)
    return model, scores[scores != NO_SCORE], moments
