"""From the histogram of leaf means to ranges of v that one would type."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.intensity.otsu import Classes, are_separated, multi_otsu, select_classes
from uavseg.units import GREY_MAX

MOST_CLASSES = 8  # that may be asked for
MOST_FOUND = 6  # that are proposed where nobody says how many
BINS = 256

_DECIMALS = range(2, 7)
_NO_MEAN = 5  # decimals, see `beside_means`


@dataclass(frozen=True, slots=True)
class Cuts:
    """Where a histogram of means is cut into ranges.

    Parameters
    ----------
    edges : tuple of float
        Between the ranges, increasing; decimal numbers of few digits.
    classes : Classes
        What the cuts make of the histogram of at most 256 bins.
    clear : bool
        Whether all of them are parted by valleys of the histogram.
    """

    edges: tuple[float, ...]
    classes: Classes
    clear: bool


def cuts_of(histogram: NDArray[np.int64], wanted: int | None = None) -> Cuts:
    """Cut a histogram into the classes that leave the least variance within.

    Parameters
    ----------
    histogram : (65536,) int64 array
        Valid pixels by the mean grey of their leaf; not all 0.
    wanted : int, optional
        Number of classes; fewer where there are not as many different means. Where it is left out, the
        most, of 2 to 6, between which the histogram has valleys.
    """
    first, last = np.flatnonzero(histogram)[[0, -1]]
    width = -(-(int(last) - int(first) + 1) // BINS)
    held = histogram[first : last + 1]
    bins = np.add.reduceat(held, np.arange(0, held.size, width))
    found = multi_otsu(bins, wanted or MOST_FOUND)
    classes = select_classes(bins, found) if wanted is None else found[-1]
    pairs = zip(classes.ends, classes.starts, strict=True)
    gaps = [
        (int(first) + low, int(first) + high) for low, high in (_gap(held, width, *pair) for pair in pairs)
    ]
    return Cuts(_edges(histogram, gaps, width), classes, are_separated(bins, classes))


def _gap(held: NDArray[np.int64], width: int, end: int, start: int) -> tuple[int, int]:
    """The last element that holds anything of one bin, and the first of a later one."""
    return (
        end * width + int(np.flatnonzero(held[end * width : (end + 1) * width])[-1]),
        start * width + int(np.flatnonzero(held[start * width : (start + 1) * width])[0]),
    )


def beside_means(edge: float) -> float:
    """The nearest number above an edge, and by decimals near it, that is no leaf's mean.

    A mean is sum / (65535 n) with n of at most 4096 valid pixels. A number of m decimals that ends with 1 is
    p / 10^m in lowest terms, and to be a mean 2^m 5^(m-1) must divide n: with five decimals or more it
    cannot.

    Examples
    --------
    >>> beside_means(0.4), beside_means(0.412345)
    (0.40001, 0.4123451)
    """
    exact = Decimal(repr(edge))
    decimals = max(-int(exact.as_tuple().exponent) + 1, _NO_MEAN)
    return float(exact + Decimal(1).scaleb(-decimals))


def _edges(histogram: NDArray[np.int64], gaps: Sequence[tuple[int, int]], width: int) -> tuple[float, ...]:
    """A number for each gap between two greys: of few digits, and no range is left empty."""
    below = np.concatenate([[0], np.cumsum(histogram)])
    ends = [gap[0] for gap in gaps[1:]] + [GREY_MAX] * bool(gaps)
    edges: list[float] = []
    for gap, end in zip(gaps, ends, strict=True):
        under = below[math.floor(edges[-1] * GREY_MAX) + 1] if edges else 0
        edges.append(_edge(below, under, gap, end, width))
    return tuple(edges)


def _edge(below: NDArray[np.int64], under: int, gap: tuple[int, int], end: int, width: int) -> float:
    """The number of fewest digits that lies in a gap, or no farther from its middle than half a bin.

    Between `under` pixels below and the grey `end`, there are pixels on both sides of it.
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
