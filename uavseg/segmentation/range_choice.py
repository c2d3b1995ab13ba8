"""Choice and ranking of ranges by the contrast at their borders (figure-ground separation).

histogram of leaf means -> classes: Otsu's, or two of minimum cross entropy where no valleys separate them
histogram of pixels -> classes too small or too dense for leaves: populations that valleys separate
co-occurrence histograms -> darkest and brightest objects: the bound with the largest average contrast
                         -> rank: compact, closed and contrasting classes first, then their parts
"""

import math
from collections.abc import Sequence
from decimal import Decimal
from itertools import pairwise

import numpy as np

from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.raster.intensity.thresholds import are_separated, least_cross_entropy, multi_otsu, select_classes
from uavseg.segmentation.blocks.cell_pairs import BINS, CellPairs, RangeBorder
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.units import GREY_MAX

MIN_CONTRAST = 2.5  # of a border; noise, uneven light and fractal surfaces have at most 2.4 at any bound
_PART_CONTRAST = 4.0  # of the border of a part of a class that steps bound
_FAR = 3  # times the contrast of noise, or of the classes if less: small things that are a class themselves
_MAX_PART = 0.8  # of the cells of its class: a part that holds more is the class itself
_PROMINENCE = 1.25  # of a bound's average contrast, over the minimum between it and a higher one
_MIN_SHARE = 0.25  # of the largest average contrast
_MIN_PAIRS = 12  # across a bound: the border of a few cells
_SAME = 0.15  # of the smaller side: cells between two edges that separate the same
MAX_CLASSES = 8  # that a caller may request
_MAX_PROPOSED = 6  # classes, where the caller gives no number
_BINS = 256
_BINS_NEAR = 4  # bins: maximum distance of an edge from the requested grey

Edges = tuple[float, ...]
Part = tuple[float, float, bool]  # of a class: its ends, and True
Bordered = list[tuple[RangeBorder, Part]]
_DECIMALS = range(2, 7)
_MIN_DECIMALS = 5  # see `edge_beside_means`


@dataclass(frozen=True, slots=True)
class RangeCandidates:
    """Thresholds that split a histogram of means into ranges: decimal numbers of few digits, increasing."""

    edges: tuple[float, ...]
    clear: bool  # valleys of the histogram separate all classes


def propose_ranges(histogram: Integers, n_classes: int | None = None) -> RangeCandidates:
    """Split a histogram into the classes with the smallest variance within (multi-level Otsu).

    The histogram, (65536,), is of valid pixels by the mean grey of their leaf, not all 0. There are fewer
    than `n_classes` if it has fewer different means. By default there are the largest number from 2 to 6 for
    which valleys separate the classes.
    """
    means = np.flatnonzero(histogram)
    first = int(means[0])
    occupied = histogram[first : means[-1] + 1]
    width = -(-occupied.size // _BINS)
    bins = np.add.reduceat(occupied, np.arange(0, occupied.size, width))
    splits = multi_otsu(bins, n_classes or _MAX_PROPOSED)
    classes = select_classes(bins, splits) if n_classes is None else splits[-1]
    darker = means[np.searchsorted(means, first + width * (np.array(classes.ends, np.int64) + 1)) - 1]
    lighter = means[np.searchsorted(means, first + width * np.array(classes.starts, np.int64))]
    gaps = list(zip(darker.tolist(), lighter.tolist(), strict=True))
    return RangeCandidates(_edges(histogram, gaps, width), are_separated(bins, classes))


def edge_near(histogram: Integers, grey: float, low: float = 0.0, high: float = 1.0) -> float | None:
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


def explained_variance(histogram: Integers, edges: Sequence[float]) -> float:
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


def _edges(histogram: Integers, gaps: Sequence[tuple[int, int]], width: int) -> tuple[float, ...]:
    """Choose a number of few digits in each gap between two greys, such that no range is empty."""
    below = np.concatenate([[0], np.cumsum(histogram)])
    ends = [gap[0] for gap in gaps[1:]] + [GREY_MAX] * bool(gaps)
    edges: list[float] = []
    for gap, end in zip(gaps, ends, strict=True):
        under = below[math.floor(edges[-1] * GREY_MAX) + 1] if edges else 0
        edges.append(_edge(below, under, gap, end, width))
    return tuple(edges)


def _edge(below: Integers, under: int, gap: tuple[int, int], end: int, width: int) -> float:
    """Return the number with the fewest digits that lies in a gap, or within half a bin of its middle."""
    # There are pixels on both sides of it: more than `under` pixels below, and others up to the grey `end`.
    middle = sum(gap) / 2 / GREY_MAX
    for decimals in _DECIMALS:
        edge = round(middle, decimals)
        here = below[math.floor(edge * GREY_MAX) + 1]
        inside = gap[0] + 0.5 <= edge * GREY_MAX <= gap[1] - 0.5
        near = inside or 10**-decimals * GREY_MAX <= width
        if near and 0 < edge < 1 and under < here < below[end + 1]:
            break  # six decimals, a fifteenth of a grey, always do
    return edge


@dataclass(frozen=True, slots=True)
class ChosenRange:
    """A range of v, with the shape and contrast of its cells; all classes together are 0..1."""

    low: float  # 0, 1, or a decimal number of few digits
    high: float  # likewise
    is_part: bool  # a part of the darkest or the brightest class; else a class
    border: RangeBorder | None  # None where no cell counts
    pixels: int = 0  # that lie in it by their grey; 0 if they were not counted

    @property
    def score(self) -> float:
        """Figure-ground score of its cells; 0 where no cell counts."""
        return 0.0 if self.border is None else self.border.score


@dataclass(frozen=True, slots=True)
class RangeChoice:
    """Ranges of a raster: the classes, the darkest first, then a part of the darkest and of the brightest."""

    ranges: tuple[ChosenRange, ...]
    explained: float  # share of the variance of the leaf means that lies between the classes
    separated: bool = True  # false where no valley lies between the classes, and their number was not given

    @property
    def edges(self) -> tuple[float, ...]:
        """Edges between the classes."""
        return tuple(one.high for one in self.ranges if not one.is_part and one.high < 1)

    @property
    def bounds(self) -> tuple[float, ...]:
        """Ends of all ranges, 0 and 1 aside."""
        return tuple(sorted({end for one in self.ranges for end in (one.low, one.high)} - {0.0, 1.0}))

    @property
    def ranked(self) -> tuple[int, ...]:
        """Indices of the ranges, the best figure-ground score first, then the rarest.

        A part counts half. It comes after its class, and after two classes.
        """
        classes = [one for one in self.ranges if not one.is_part]
        second = sorted(one.score for one in classes)[-2:][0]
        ends = []
        for one in self.ranges:
            limit = min(second, classes[-(one.high == 1)].score, one.score / 2) if one.is_part else one.score
            ends.append((-limit, one.is_part, -one.score, one.pixels, -one.low * (one.pixels > 0)))
        return tuple(sorted(range(len(self.ranges)), key=lambda k: (ends[k], k)))

    @property
    def contrast(self) -> float:
        """Largest contrast of any range; infinite where no cell counts."""
        return max((one.border.contrast for one in self.ranges if one.border is not None), default=math.inf)


def choose_ranges(
    histogram: Integers,
    pairs: CellPairs | None,
    n_classes: int | None = None,
    refined: bool = True,
    greys: Integers | None = None,
    populations: Sequence[float] = (),
) -> RangeChoice:
    """Choose the ranges of a raster.

    `histogram`, (65536,), is of valid pixels by the mean grey of their leaf, not all 0, and `pairs` are of
    the same block map. `n_classes` is the number of Otsu's classes, without parts of them; by default as many
    as valleys of the histogram separate, and where there are no such valleys, two of minimum cross entropy;
    small things that stand out far are one more. `refined` tells whether regions are refined to the pixel, so
    that a cell may differ from its leaf. `greys`, (65536,), are pixels by grey, and `populations` the edges
    between populations of them, see `population_edges`: these replace edges that separate the same cells, and
    are added otherwise; not with a number of classes.
    """
    candidates = propose_ranges(histogram, n_classes)
    edges, parts = candidates.edges, list[Part]()
    if n_classes is None:
        if not candidates.clear and len(edges) == 1:
            edges = tuple(populations) or _minimum_entropy_edge(histogram, pairs) or edges
        if pairs is not None and edges:
            edges, parts = _figures(pairs.histogram() if refined else histogram, pairs, edges)
        if populations:
            others = {edge for edge in edges if _is_new(edge, populations, pairs)}
            edges = tuple(sorted(others.union(populations)))
            parts = [part for part in parts if _is_new(part[0] or part[1], populations, pairs)]
    chosen = []
    for low, high, is_part in [(*ends, False) for ends in pairwise((0.0, *edges, 1.0))] + parts:
        first, last = IntensityRange(low, high).greys
        pixels = 0 if greys is None else int(greys[first : last + 1].sum())
        chosen.append(ChosenRange(low, high, is_part, _border(pairs, low, high), pixels))
    separated = n_classes is not None or candidates.clear or bool(populations)
    return RangeChoice(tuple(chosen), explained_variance(histogram, edges), separated)


def _is_new(edge: float, populations: Sequence[float], pairs: CellPairs | None) -> bool:
    """Test whether an edge separates cells within one population, with contrast at their border."""
    if pairs is None:
        return False
    place, bounds = pairs.bin_of(edge), [0, *map(pairs.bin_of, populations), BINS]
    for bound in bounds[1:-1]:
        low, high = sorted((place, bound))
        below, between, above = (int(part.sum()) for part in np.split(pairs.cells, [low, high]))
        if between <= _SAME * min(below, above):
            return False
    begin = max(one for one in bounds if one <= place)
    end = min((one for one in bounds if one > place), default=BINS)
    filled = pairs.cells[begin:place].any() and pairs.cells[place:end].any()
    return bool(filled and pairs.within(begin, end).border(begin, place).contrast >= MIN_CONTRAST)


def _minimum_entropy_edge(histogram: Integers, pairs: CellPairs | None) -> tuple[float, ...]:
    if pairs is None or np.count_nonzero(pairs.cells) < 2:
        return ()
    end, start = least_cross_entropy(pairs.cells)
    edge = edge_near(histogram, (pairs.grey_of(end + 1) + pairs.grey_of(start)) / 2)
    return () if edge is None else (edge,)


def _figures(histogram: Integers, pairs: CellPairs, edges: Edges) -> tuple[Edges, list[Part]]:
    """Add the edge of small things that stand out far, and choose parts of the outermost classes."""
    contrasts, crossing = pairs.contrasts()
    steps = np.where(crossing >= _MIN_PAIRS, contrasts, 0.0)
    minimum = max(_MIN_SHARE * steps.max(), np.finfo(float).tiny)
    tops = 1 + np.flatnonzero(steps[1:-1] >= np.maximum(np.maximum(steps[:-2], steps[2:]), minimum))
    bounds: list[int] = []
    for top in tops[np.argsort(-steps[tops], kind="stable")].tolist():
        between = [steps[min(top, one) : max(top, one) + 1].min() for one in bounds]
        if all(_PROMINENCE * lowest <= steps[top] for lowest in between):
            bounds.append(top)
    greys = {pairs.grey_of(bound): _PART_CONTRAST for bound in bounds}
    classes = [one for one in (_border(pairs, *ends) for ends in pairwise((0.0, *edges, 1.0))) if one]
    far = _FAR * min(MIN_CONTRAST, max(one.contrast for one in classes))
    found = _outermost(histogram, pairs, edges, greys)
    for border, (low, high, _) in sorted(found, key=lambda one: -one[0].score)[:1]:
        if border.contrast >= far and border.score > 2 * max(one.score for one in classes):
            edges = tuple(sorted((*edges, low or high)))
    greys = {edge * GREY_MAX: 0.0 for edge in propose_ranges(histogram, 3).edges} | greys
    found = sorted(_outermost(histogram, pairs, edges, greys), key=lambda one: one[0].share)
    return edges, sorted({part[0] > 0: part for _, part in found}.values())


def _outermost(histogram: Integers, pairs: CellPairs, edges: Edges, greys: dict[float, float]) -> Bordered:
    """Return the outer parts of the darkest and brightest class with a contrast, 0: with more than theirs."""
    found: Bordered = []
    for outer, inner in ((0.0, edges[0]), (1.0, edges[-1])):
        whole = _border(pairs, *sorted((outer, inner)))
        for grey, contrast in greys.items():
            if (edge := edge_near(histogram, grey, *sorted((outer, inner)))) is None:
                continue
            part = (min(outer, edge), max(outer, edge), True)
            border = _border(pairs, *part[:2])
            if border and whole and border.contrast >= (contrast or max(MIN_CONTRAST, whole.contrast)):
                found += [(border, part)] * (border.share < _MAX_PART * whole.share)
    return found


def _border(pairs: CellPairs | None, low: float, high: float) -> RangeBorder | None:
    """Measure a range; None where no cell lies in it."""
    if pairs is None:
        return None
    first = 0 if low <= 0 else pairs.bin_of(low)
    last = BINS if high >= 1 else pairs.bin_of(high)
    return pairs.border(first, last) if pairs.cells[first:last].any() else None
