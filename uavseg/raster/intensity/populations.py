"""Populations of a histogram of pixels: its modes, and the numbers of few digits that part them."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.intensity.otsu import SMOOTHING, VALLEY, smoothed
from uavseg.units import GREY_MAX

_BINS = 256
_MOST = 6  # populations
_APART = 4.0  # standard deviations within two populations, between their means
_LEAST = 0.001  # of all pixels, in a population
_FLOOR = 0.1  # of the lower of two modes, above the lowest place between them: the floor of a valley
_SATURATED = 1 / 32  # of the extent: a tail that reaches an end of v goes on beyond it

Counts = NDArray[np.int64]


def population_edges(greys: Counts) -> tuple[float, ...]:
    """Return values of v that part the populations of a histogram, increasing; none where it has one.

    An edge lies where the smoothed histogram falls below a third of the modes on both sides of it; their
    means lie more than four times their pooled standard deviation apart. Noise, texture and slow changes of
    light have no such edge; two materials have one, however finely they alternate. Pixels at an end of v that
    the tail of a population reaches are saturated, and no population. `greys` (65536,) are pixels by grey.

    Examples
    --------
    >>> greys = np.zeros(65536, np.int64)
    >>> greys[[15000, 16000, 46000, 47000]] = 5000, 5000, 20, 20
    >>> population_edges(greys)
    (0.49,)
    """
    if np.count_nonzero(greys) < 2:
        return ()
    greys = _unsaturated(greys)
    shares = np.cumsum(greys) / greys.sum()
    first, last = (int(one) for one in np.searchsorted(shares, [_LEAST / 2, 1 - _LEAST / 2]))
    width = -(-(last - first + 1) // _BINS)
    bins = np.add.reduceat(greys[first : last + 1], np.arange(0, last - first + 1, width))
    bins[0] += greys[:first].sum()
    bins[-1] += greys[last + 1 :].sum()
    smooth = smoothed(bins.astype(np.float64), len(bins) * SMOOTHING)
    cuts = _valleys(bins, smooth, 0, len(bins))
    while cuts:
        apart = _separations(bins, cuts)
        nearest = int(np.argmin(apart))
        if apart[nearest] >= _APART and len(cuts) < _MOST:
            break
        del cuts[nearest]
    bounds = [0, *cuts, len(bins)]
    floors = [_floor(smooth, *bounds[k : k + 3]) for k in range(len(cuts))]
    return tuple(_edge(first + begin * width, first + end * width) for begin, end in floors)


def rarest_population(greys: Counts, edges: Sequence[float]) -> tuple[float, float]:
    """Return the range between edges, 0 or 1 that holds the fewest pixels; of equal ones, the brightest."""
    counts = np.add.reduceat(greys, [0, *(math.floor(edge * GREY_MAX) + 1 for edge in edges)])
    rarest = len(edges) - int(np.argmin(counts[::-1]))
    return (0.0, *edges, 1.0)[rarest], (*edges, 1.0)[rarest]


def _unsaturated(greys: Counts) -> Counts:
    """Return the histogram without the pixels at an end of v that others lie beside."""
    result, reach = greys.copy(), int(np.ptp(np.flatnonzero(greys)) * _SATURATED) + 1
    result[0] *= not greys[1 : 1 + reach].any()
    result[GREY_MAX] *= not greys[GREY_MAX - reach : GREY_MAX].any()
    return result


def _valleys(bins: Counts, smooth: NDArray[np.float64], begin: int, end: int) -> list[int]:
    """Return numbers of bins below each valley between bins begin..end - 1, the deepest first cut."""
    if end - begin < 2:
        return []
    least = _LEAST * bins.sum()
    below = np.cumsum(bins[begin:end])
    left = np.maximum.accumulate(smooth[begin:end])
    right = np.maximum.accumulate(smooth[begin:end][::-1])[::-1]
    depth = smooth[begin:end] / np.maximum(np.minimum(left, right), np.finfo(float).tiny)
    depth[(below < least) | (below[-1] - below < least)] = np.inf
    if depth.min() >= VALLEY:
        return []
    lowest = np.flatnonzero(depth <= depth.min() + 1e-12)
    cut = begin + int(lowest[len(lowest) // 2]) + 1
    return [*_valleys(bins, smooth, begin, cut), cut, *_valleys(bins, smooth, cut, end)]


def _separations(bins: Counts, cuts: Sequence[int]) -> NDArray[np.float64]:
    """Return distance of the means on both sides of each cut, in their pooled standard deviations."""
    places = np.arange(len(bins), dtype=np.float64)
    classes = np.searchsorted(cuts, places, side="right")
    number, sums, squares = (np.bincount(classes, bins * places**k, len(cuts) + 1) for k in range(3))
    means = sums / number
    spread = squares - number * means**2
    pooled = (spread[:-1] + spread[1:]) / (number[:-1] + number[1:])
    return np.asarray(np.diff(means) / np.sqrt(np.maximum(pooled, 0) + 1 / 12))


def _floor(smooth: NDArray[np.float64], begin: int, cut: int, end: int) -> tuple[int, int]:
    """Return bins begin..end - 1 that are the floor of the valley at a cut between two populations."""
    lowest = min(smooth[cut - 1], smooth[cut])
    low = smooth <= lowest + _FLOOR * (min(smooth[begin:cut].max(), smooth[cut:end].max()) - lowest)
    low[cut - 1 : cut + 1] = True
    return (
        cut - int(np.argmin(np.append(low[begin:cut][::-1], False))),
        cut + int(np.argmin(np.append(low[cut:end], False))),
    )


def _edge(begin: int, end: int) -> float:
    """Return the number of fewest digits in the middle half of some greys; it is the v of none of them."""
    middle, reach = (begin + end - 1) / 2 / GREY_MAX, (end - begin) / 4 / GREY_MAX
    for decimals in range(2, 7):
        edge = round(middle, decimals)
        place = edge * GREY_MAX
        if abs(edge - middle) <= reach and abs(place - round(place)) > 0.01:
            return edge
    return round((math.floor(middle * GREY_MAX) + 0.5) / GREY_MAX, 7)
