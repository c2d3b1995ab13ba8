"""Survey of one region: sweep lines, flown cell by cell with little between them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight import route
from uavseg.flight.legs import between, lengths_m, outside_m
from uavseg.flight.sweep import Lines, best_angle, sweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAME_STROKE = 1  # spacings: wider gaps in a line part it into strokes
STRAYING = 2  # spacings: steps that leave the region for longer part a cell
STEPPING = 4  # spacings: and so do longer steps
AS_GOOD = 1.05  # times what is flown between the pieces of the best way
MANY_POINTS = 120  # beyond so many, legs between cells are only measured, not checked against the region


@dataclass(frozen=True, slots=True)
class Survey:
    """Sweep lines over one region, in the order and direction in which they are flown.

    Parameters
    ----------
    angle_deg : float
        Azimuth of the lines, clockwise from north, in [0, 180).
    lines : int
        How many parallel lines there are; concave places and holes cut them into more pieces.
    cells : int
        Parts of the region that are flown one after another, each from line to line.
    paths : tuple of (N, 2, 2) float arrays
        Ways to fly the survey, equally good by themselves: start and end of each piece, as x, y in metres.
        Each may also be flown backwards.
    """

    angle_deg: float
    lines: int
    cells: int
    paths: tuple[Floats, ...]


def survey(region: Any, spacing_m: float, angle_deg: float | None = None) -> Survey:
    """Cover a region with parallel lines and order them.

    Lines are cut to the region and put together to cells: parts that are flown line by line, to and fro
    (boustrophedon). Cells begin and end where lines split or merge around concave places and holes, and
    where the step to the next line would stray out of the region. Their order and directions are chosen
    so that little is flown between them, metres outside of the region counting twice.

    Parameters
    ----------
    region : shapely Polygon
        In metres; may be concave and have holes.
    spacing_m : float
        Distance between neighbouring lines.
    angle_deg : float, optional
        Azimuth of the lines, clockwise from north; by default the one that needs the fewest pieces.

    Raises
    ------
    ParameterError
        If the spacing or the angle is not a number, or the spacing not positive.
    MissionError
        If there would be more lines than a mission holds.

    Examples
    --------
    >>> import shapely
    >>> flown = survey(shapely.box(0, 0, 20, 100), 10)
    >>> flown.angle_deg, flown.lines, flown.cells
    (0.0, 2, 1)
    >>> flown.paths[0].round(6).tolist()
    [[[5.0, 0.0], [5.0, 100.0]], [[15.0, 100.0], [15.0, 0.0]]]
    """
    lines = sweep(region, spacing_m, best_angle(region, spacing_m) if angle_deg is None else angle_deg)
    strokes = _strokes(lines, spacing_m * SAME_STROKE)
    cells = _cells(strokes, lines, region, spacing_m)
    ways = [_ways(cell, strokes, lines) for cell in cells]
    paths = _in_order(ways, region) if len(ways) > 1 else _best(ways[0][:2], region)
    return Survey(lines.angle_deg, lines.count, len(cells), tuple(paths))


@dataclass(frozen=True, slots=True)
class _Strokes:
    """Runs of pieces along one line with small gaps: the pieces [first, stop) and the ends of the run."""

    first: Ints
    stop: Ints
    line: Ints
    start: Floats
    end: Floats


def _strokes(lines: Lines, gap_m: float) -> _Strokes:
    parted = (lines.line[1:] != lines.line[:-1]) | (lines.start[1:] - lines.end[:-1] > gap_m)
    first = np.flatnonzero(np.r_[True, parted])
    stop = np.r_[first[1:], lines.line.size]
    return _Strokes(first, stop, lines.line[first], lines.start[first], lines.end[stop - 1])


def _cells(strokes: _Strokes, lines: Lines, region: Any, spacing_m: float) -> list[list[int]]:
    """Strokes that follow each other line by line without splitting, merging or straying."""
    links = _links(strokes)
    onward, backward = np.bincount(links[:, 0], minlength=1), np.bincount(links[:, 1], minlength=1)
    single = links[(onward[links[:, 0]] == 1) & (backward[links[:, 1]] == 1)]
    kept = single[~_strays(single, strokes, lines, region, spacing_m)]
    following = dict(kept.tolist())
    cells = []
    for stroke in sorted(set(range(len(strokes.line))) - set(following.values())):
        cells.append([stroke])
        while cells[-1][-1] in following:
            cells[-1].append(following[cells[-1][-1]])
    return cells


def _links(strokes: _Strokes) -> Ints:
    """Pairs (N, 2) of strokes on neighbouring lines that lie side by side for some length."""
    links = []
    begins = np.searchsorted(strokes.line, np.arange(strokes.line[-1] + 3))
    for stroke, line in enumerate(strokes.line):
        beside = slice(begins[line + 1], begins[line + 2])
        begin = np.searchsorted(strokes.end[beside], strokes.start[stroke], "right")
        stop = np.searchsorted(strokes.start[beside], strokes.end[stroke], "left")
        links += [(stroke, int(begins[line + 1]) + other) for other in range(begin, stop)]
    return np.array(links, np.int64).reshape(-1, 2)


def _strays(links: Ints, strokes: _Strokes, lines: Lines, region: Any, spacing_m: float) -> NDArray[np.bool_]:
    """Which links have a step, at either end, that is too long or out of the region for too long."""
    offset = lines.offset[strokes.first]
    strays = np.zeros(len(links), bool)
    for along in (strokes.start, strokes.end):
        steps = lines.xy(along[links].ravel(), offset[links].ravel()).reshape(-1, 2, 2)
        strays |= outside_m(region, steps) > STRAYING * spacing_m
        strays |= lengths_m(steps) > STEPPING * spacing_m
    return strays


def _ways(cell: Sequence[int], strokes: _Strokes, lines: Lines) -> list[Floats]:
    """The four ways to fly a cell: from its first line, starting at either end, and both backwards."""
    ways = []
    for turn in (0, 1):
        runs = []
        for n, stroke in enumerate(cell):
            run = lines.segments[strokes.first[stroke] : strokes.stop[stroke]]
            runs.append(run if n % 2 == turn else backwards(run))
        ways.append(np.concatenate(runs))
    return ways + [backwards(way) for way in ways]


def backwards(path: Floats) -> Floats:
    """Pieces (N, 2, 2) flown the other way."""
    return path[::-1, ::-1]


def _best(paths: Sequence[Floats], region: Any) -> list[Floats]:
    """Those of the paths with about the least to fly between their pieces."""
    legs = [between(path) for path in paths]
    costs = [float((lengths_m(some) + outside_m(region, some)).sum()) for some in legs]
    return [path for path, cost in zip(paths, costs, strict=True) if cost <= AS_GOOD * min(costs)]


def _in_order(ways: list[list[Floats]], region: Any) -> list[Floats]:
    """All cells one after another."""
    ends = np.array([[(way[0, 0], way[-1, 1]) for way in cell] for cell in ways])
    points, index = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    cost = route.distances(points)
    if len(points) <= MANY_POINTS:
        cost = _strict(points, region)
    tour = route.order(list(index.reshape(ends.shape[:3])), cost)
    return [np.concatenate([ways[cell][way] for cell, way in tour])]


def _strict(points: Floats, region: Any) -> route.Cost:
    """Straight distance between points, metres outside of the region counting twice."""
    here, there = np.triu_indices(len(points), 1)
    legs = np.stack((points[here], points[there]), axis=1)
    matrix = np.zeros((len(points), len(points)))
    matrix[here, there] = lengths_m(legs) + outside_m(region, legs)
    matrix += matrix.T
    return lambda here, there: matrix[here, there]
