"""Candidate ranges: multi-level Otsu thresholds of the histogram of leaf means, rounded to few digits."""

import math
from collections.abc import Sequence
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.raster.intensity.otsu import are_separated, multi_otsu, select_classes
from uavseg.units import GREY_MAX

MAX_CLASSES = 8  # that a caller may request
_MAX_PROPOSED = 6  # classes, where the caller gives no number
_BINS = 256
_BINS_NEAR = 4  # bins: maximum distance of an edge from the requested grey

_DECIMALS = range(2, 7)
_MIN_DECIMALS = 5  # see `edge_beside_means`


@dataclass(frozen=True, slots=True)
class RangeCandidates:
    """Thresholds that split a histogram of means into ranges: decimal numbers of few digits, increasing.

    `clear` tells whether valleys of the histogram separate all classes.
    """

    edges: tuple[float, ...]
    clear: bool


def propose_ranges(histogram: NDArray[np.int64], n_classes: int | None = None) -> RangeCandidates:
    """Split a histogram into the classes with the smallest variance within (multi-level Otsu).

    The histogram, (65536,), is of valid pixels by the mean grey of their leaf, not all 0. There are fewer
    than `n_classes` if it has fewer different means. By default there are the largest number from 2 to 6 for
    which valleys separate the classes.
    """
    first, last = np.flatnonzero(histogram)[[0, -1]]
    width = -(-(int(last) - int(first) + 1) // _BINS)
    occupied = histogram[first : last + 1]
    bins = np.add.reduceat(occupied, np.arange(0, occupied.size, width))
    splits = multi_otsu(bins, n_classes or _MAX_PROPOSED)
    classes = select_classes(bins, splits) if n_classes is None else splits[-1]
    pairs = zip(classes.ends, classes.starts, strict=True)
    gaps = [
        (int(first) + low, int(first) + high)
        for low, high in (_gap(occupied, width, *pair) for pair in pairs)
    ]
    return RangeCandidates(_edges(histogram, gaps, width), are_separated(bins, classes))


def edge_near(histogram: NDArray[np.int64], grey: float, low: float = 0.0, high: float = 1.0) -> float | None:
    """Return a number of few digits near a grey that splits the range between two edges, or 0 and 1.

    There are means of the histogram, as of `propose_ranges`, between it and both edges; None where a
    threshold at the grey has none on one side.
    """
    below = np.concatenate([[0], np.cumsum(histogram)])
    first = math.floor(low * GREY_MAX) + 1 if low > 0 else 0
    last = math.floor(high * GREY_MAX)
    greys = first + np.flatnonzero(histogram[first : last + 1])
    darker = int(np.searchsorted(greys, grey))
    if darker in (0, len(greys)):
        return None
    reach = _BINS_NEAR * -(-int(greys[-1] - greys[0] + 1) // _BINS)
    gap = (max(int(greys[darker - 1]), round(grey) - reach), min(int(greys[darker]), round(grey) + reach))
    return _edge(below, below[first], gap, last, reach)


def explained_variance(histogram: NDArray[np.int64], edges: Sequence[float]) -> float:
    """Compute the share of the variance of a histogram that lies between the ranges of some edges.

    Examples
    --------
    >>> histogram = np.zeros(65536, np.int64)
    >>> histogram[[1000, 3000, 60000]] = 1
    >>> round(explained_variance(histogram, [0.5]), 4), explained_variance(histogram, [])
    (0.9991, 0.0)
    """
    greys = np.flatnonzero(histogram)
    classes = np.searchsorted(np.floor(np.array(edges) * GREY_MAX), greys)
    weights = histogram[greys].astype(np.float64)
    total = weights.sum()
    if len(greys) < 2 or not len(edges):
        return float(len(greys) < 2)
    offsets = greys - (weights * greys).sum() / total
    number = np.bincount(classes, weights)
    sums = np.bincount(classes, weights * offsets)
    return float((sums**2 / np.maximum(number, 1)).sum() / (weights * offsets**2).sum())


def _gap(occupied: NDArray[np.int64], width: int, end: int, start: int) -> tuple[int, int]:
    """Return the last nonzero element of one bin, and the first nonzero element of a later bin."""
    return (
        end * width + int(np.flatnonzero(occupied[end * width : (end + 1) * width])[-1]),
        start * width + int(np.flatnonzero(occupied[start * width : (start + 1) * width])[0]),
    )


def edge_beside_means(edge: float) -> float:
    """Return a decimal number just above an edge that cannot be the mean of a leaf.

    A mean is sum / (65535 n) with n of at most 4096 valid pixels. A number of m decimals that ends with 1 is
    p / 10^m in lowest terms, and to be a mean 2^m 5^(m-1) must divide n: with five decimals or more it
    cannot.

    Examples
    --------
    >>> edge_beside_means(0.4), edge_beside_means(0.412345)
    (0.40001, 0.4123451)
    """
    exact = Decimal(repr(edge))
    decimals = max(-int(exact.as_tuple().exponent) + 1, _MIN_DECIMALS)
    return float(exact + Decimal(1).scaleb(-decimals))


def _edges(histogram: NDArray[np.int64], gaps: Sequence[tuple[int, int]], width: int) -> tuple[float, ...]:
    """Choose a number of few digits in each gap between two greys, such that no range is empty."""
    below = np.concatenate([[0], np.cumsum(histogram)])
    ends = [gap[0] for gap in gaps[1:]] + [GREY_MAX] * bool(gaps)
    edges: list[float] = []
    for gap, end in zip(gaps, ends, strict=True):
        under = below[math.floor(edges[-1] * GREY_MAX) + 1] if edges else 0
        edges.append(_edge(below, under, gap, end, width))
    return tuple(edges)


def _edge(below: NDArray[np.int64], under: int, gap: tuple[int, int], end: int, width: int) -> float:
    """Return the number with the fewest digits that lies in a gap, or within half a bin of its middle.

    There are pixels on both sides of it: more than `under` pixels below, and others up to the grey `end`.
    """
    middle = sum(gap) / 2 / GREY_MAX
    for decimals in _DECIMALS:
        edge = round(middle, decimals)
        here = below[math.floor(edge * GREY_MAX) + 1]
        inside = gap[0] + 0.5 <= edge * GREY_MAX <= gap[1] - 0.5
        near = inside or 10**-decimals * GREY_MAX <= width
        if near and 0 < edge < 1 and under < here < below[end + 1]:
            break  # six decimals, a fifteenth of a grey, always do
    return edge
