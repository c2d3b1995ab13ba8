"""What a sample looks like: its histograms, how unlike each other its own windows are, its intensity, and
what tells it from the raster as a whole.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SampleError
from uavseg.execution.executors import Map
from uavseg.raster.geodesy.ellipsoid import pixel_on_ground
from uavseg.regions.sample.place import Place
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

_OWN = (19, 20)  # the quantile of the scores of the sample's own windows that counts as like
_GREY_STEP = 257  # of 8 bits: no sample is more even than this


@dataclass(frozen=True)
class Sample:
    """What is known of a sample.

    Parameters
    ----------
    model : Model
    own : int
        A score that nineteen of twenty of its windows do not exceed, each against the rest of it; at least
        that of chance.
    mean, deviation : float
        Of the grey of its counted pixels.
    """

    model: TextureModel
    own: int
    mean: float
    deviation: float

    def limit(self, similarity: float) -> int:
        """The largest score of what is like the sample to this degree, see `similarity`."""
        return min(self.own + math.floor(-2 * SCORE_UNITS * math.log(similarity)), MAX_SCORE - 1)

    def similarity(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """How like the sample something of a mean score is, from 0 to 1.

        Half of G is a logarithm of a likelihood ratio. So this is by how much, for each pixel, one texture
        for both explains what is there less well than two, beyond what it does within the sample.
        """
        beyond = np.maximum(score - self.own, 0) / SCORE_UNITS
        like: NDArray[np.float64] = np.exp(-beyond / 2)
        return like

    def bounds(self, deviations: float) -> GreyBounds:
        """Greys within so many deviations of the sample's mean, and always within one step of 8 bits."""
        if math.isinf(deviations):
            return GreyBounds()
        half = max(deviations * self.deviation, _GREY_STEP)
        return GreyBounds(max(math.floor(self.mean - half), 0), min(math.ceil(self.mean + half), GREY_MAX))


def sample_of(source: GreySource, cuts: NDArray[np.int32], place: Place, side: int, map: Map) -> Sample:
    """Look at a sample.

    Parameters
    ----------
    source : GreySource
    cuts : (7,) int32 array
        Of the contrast, over the whole raster.
    place : Place
        Its pixels.
    side : int
        Of a window, in cells.
    map : Map

    Raises
    ------
    SampleError
        If it has too few pixels with a texture.
    """
    [(model, own, moments)] = map(partial(_look, source, cuts, side), [place])
    largest = (CELL * side) ** 2
    if model.count == 0:
        raise SampleError("the sample has no valid pixel with valid neighbours; it lies on nodata, it seems")
    if model.count < 2 * largest or len(own) == 0:
        raise SampleError(_too_small(source, model.count, CELL * side))
    count, total, squares = (int(moment) for moment in moments)
    rank = -(-len(own) * _OWN[0] // _OWN[1])
    variance = (squares * count - total * total) / count**2
    return Sample(model, max(int(np.sort(own)[rank - 1]), NULL_SCORE), total / count, math.sqrt(variance))


def evidence_of(
    source: GreySource, cuts: NDArray[np.int32], place: Place, whole: NDArray[np.int64], side: int, map: Map
) -> SampleWeights:
    """What tells a sample from the raster as a whole.

    Parameters
    ----------
    source, cuts, place, side, map
        As of `sample_of`.
    whole : (2, 2048) int64 array
        How often each symbol occurs in the raster, at both scales.
    """
    [found] = map(partial(_weigh, source, cuts, whole, side), [place])
    return found


def names_of(tile: GreyTile, cuts: NDArray[np.int32]) -> SymbolPair:
    """Symbols of a tile at both scales, without its margin of MARGIN pixels."""
    inner = np.s_[COARSE_HALO - 1 : 1 - COARSE_HALO, COARSE_HALO - 1 : 1 - COARSE_HALO]
    known = tile.mask
    near = None if known is None else np.ascontiguousarray(known[inner])
    fine = lbp_symbols(np.ascontiguousarray(tile.grey[inner]), near, cuts)
    return fine, coarse_symbols(tile.grey, known, cuts)


def _weigh(
    source: GreySource, cuts: NDArray[np.int32], whole: NDArray[np.int64], side: int, place: Place
) -> SampleWeights:
    return SampleWeights.of(_own_names(source.read(place.window, COARSE_HALO), cuts, place), whole, side)


def _own_names(tile: GreyTile, cuts: NDArray[np.int32], place: Place) -> SymbolPair:
    """Symbols of the pixels of a sample, in the whole blocks around it."""
    names = names_of(tile, cuts)
    mask = np.zeros(names[0].shape, bool)
    mask[: place.window.rows, : place.window.cols] = place.mask
    for each in names:
        each[~mask] = UNCOUNTED
    return names


def _too_small(source: GreySource, count: int, window: int) -> str:
    return (
        f"the sample has {count:,} pixels with a texture; it wants at least {2 * window**2:,}, with a window "
        f"of {window} x {window} among them, as a disc with a radius of {_radius(source, window)} has; "
        "give a larger sample or a smaller --window"
    )


def _radius(source: GreySource, pixels: int) -> str:
    """A length in pixels for people, and in metres where those are known."""
    box = source.dataset.geobox
    if box.crs is None:
        return f"{pixels} pixels"
    per_col, per_row, _ = pixel_on_ground(box, *(np.array([length / 2]) for length in box.shape))
    metres = pixels * max(float(per_col[0]), float(per_row[0]))
    return f"{pixels} pixels ({metres:.3g} m)" if math.isfinite(metres) else f"{pixels} pixels"


def _look(
    source: GreySource, cuts: NDArray[np.int32], side: int, place: Place
) -> tuple[TextureModel, NDArray[np.uint16], NDArray[np.uint64]]:
    """Histograms of a sample, the scores of its windows, and number, sum and sum of squares of its greys."""
    tile = source.read(place.window, COARSE_HALO)
    names, coarse = _own_names(tile, cuts, place)
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    cells = np.ones((names.shape[0] // CELL, names.shape[1] // CELL), np.uint8)
    model = texture_model(names, grey, cells, coarse=coarse)
    scores = window_scores(names, grey, model, side, leave_one_out=True)
    counted = grey[names != UNCOUNTED].astype(np.uint64)
    moments = np.array([len(counted), counted.sum(), (counted * counted).sum()], np.uint64)
    return model, scores[scores != NO_SCORE], moments
