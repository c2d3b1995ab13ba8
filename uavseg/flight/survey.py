"""Survey of one region: boustrophedon cell decomposition of parallel sweep lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight import route
from uavseg.flight.legs import legs_between, lengths_m, outside_m
from uavseg.flight.sweep import SweepLines, best_angle, sweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_STROKE_GAP = 1  # spacings: wider gaps split a line into strokes
MAX_OUTSIDE = 2  # spacings: a step that is longer outside of the region ends a cell
MAX_STEP = 4  # spacings: a longer step ends a cell
COST_TOLERANCE = 1.05  # times the cost of the best path: as good
MAX_CHECKED_POINTS = 120  # with more points, legs between cells are not checked against the region


@dataclass(frozen=True, slots=True)
class Survey:
    """Sweep lines over one region, in the order and direction in which they are flown.

    Parameters
    ----------
    angle_deg : float
        Azimuth of the lines, clockwise from north, in [0, 180).
    lines : int
        Number of parallel lines; concave places and holes split them into more pieces.
    cells : int
        Number of parts of the region that are flown one after another, each from line to line.
    paths : tuple of (N, 2, 2) float arrays
        Candidate paths of about equal cost: start and end of each piece, as x, y in metres. Each may also be
        flown in reverse.
    """

    angle_deg: float
    lines: int
    cells: int
    paths: tuple[Floats, ...]


def survey(region: Any, spacing_m: float, angle_deg: float | None = None) -> Survey:
    """Cover a region with parallel lines and order them.

    Lines are clipped to the region and grouped into cells: parts that are flown line by line, to and fro
    (boustrophedon). Cells begin and end where lines split or merge around concave places and holes, and
    where the step to the next line would leave the region. Their order and directions minimise the legs
    between them; metres outside of the region count twice.

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
        If the spacing is not a positive number, or the angle not finite.
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
    strokes = _strokes(lines, spacing_m * MAX_STROKE_GAP)
    cells = _cells(strokes, lines, region, spacing_m)
    candidates = [_candidates(cell, strokes, lines) for cell in cells]
    paths = _join_cells(candidates, region) if len(candidates) > 1 else _cheapest(candidates[0][:2], region)
    return Survey(lines.angle_deg, lines.count, len(cells), tuple(paths))


@dataclass(frozen=True, slots=True)
class _Strokes:
    """Runs of pieces along one line with small gaps: the pieces [first, stop) and the ends of the run."""

    first: Ints
    stop: Ints
    line: Ints
    start: Floats
    end: Floats


def _strokes(lines: SweepLines, gap_m: float) -> _Strokes:
    is_split = (lines.line[1:] != lines.line[:-1]) | (lines.start[1:] - lines.end[:-1] > gap_m)
    first = np.flatnonzero(np.r_[True, is_split])
    stop = np.r_[first[1:], lines.line.size]
    return _Strokes(first, stop, lines.line[first], lines.start[first], lines.end[stop - 1])


def _cells(strokes: _Strokes, lines: SweepLines, region: Any, spacing_m: float) -> list[list[int]]:
    """Chains of strokes from line to line that do not split, merge or leave the region."""
    links = _links(strokes)
    onward, backward = np.bincount(links[:, 0], minlength=1), np.bincount(links[:, 1], minlength=1)
    single = links[(onward[links[:, 0]] == 1) & (backward[links[:, 1]] == 1)]
    kept = single[~_leaves_region(single, strokes, lines, region, spacing_m)]
    following = dict(kept.tolist())
    cells = []
    for stroke in sorted(set(range(len(strokes.line))) - set(following.values())):
        cells.append([stroke])
        while cells[-1][-1] in following:
            cells[-1].append(following[cells[-1][-1]])
    return cells


def _links(strokes: _Strokes) -> Ints:
    """Pairs (N, 2) of strokes on neighbouring lines that overlap along the lines."""
    links = []
    begins = np.searchsorted(strokes.line, np.arange(strokes.line[-1] + 3))
    for stroke, line in enumerate(strokes.line):
        beside = slice(begins[line + 1], begins[line + 2])
        begin = np.searchsorted(strokes.end[beside], strokes.start[stroke], "right")
        stop = np.searchsorted(strokes.start[beside], strokes.end[stroke], "left")
        links += [(stroke, int(begins[line + 1]) + other) for other in range(begin, stop)]
    return np.array(links, np.int64).reshape(-1, 2)


def _leaves_region(
    links: Ints, strokes: _Strokes, lines: SweepLines, region: Any, spacing_m: float
) -> NDArray[np.bool_]:
    """Whether a link has a step, at either end, that is too long, in all or outside of the region."""
    offset = lines.offset[strokes.first]
    is_outside = np.zeros(len(links), bool)
    for along in (strokes.start, strokes.end):
        steps = lines.xy(along[links].ravel(), offset[links].ravel()).reshape(-1, 2, 2)
        is_outside |= outside_m(region, steps) > MAX_OUTSIDE * spacing_m
        is_outside |= lengths_m(steps) > MAX_STEP * spacing_m
    return is_outside


def _candidates(cell: Sequence[int], strokes: _Strokes, lines: SweepLines) -> list[Floats]:
    """The four paths over a cell: from its first line, starting at either end, and both in reverse."""
    candidates = []
    for turn in (0, 1):
        runs = []
        for n, stroke in enumerate(cell):
            run = lines.segments[strokes.first[stroke] : strokes.stop[stroke]]
            runs.append(run if n % 2 == turn else reverse_path(run))
        candidates.append(np.concatenate(runs))
    return candidates + [reverse_path(path) for path in candidates]


def reverse_path(path: Floats) -> Floats:
    """Pieces (N, 2, 2) in reverse order and direction."""
    return path[::-1, ::-1]


def _cheapest(paths: Sequence[Floats], region: Any) -> list[Floats]:
    """The paths whose legs between pieces cost about the least."""
    legs = [legs_between(path) for path in paths]
    costs = [float((lengths_m(some) + outside_m(region, some)).sum()) for some in legs]
    return [path for path, cost in zip(paths, costs, strict=True) if cost <= COST_TOLERANCE * min(costs)]


def _join_cells(candidates: list[list[Floats]], region: Any) -> list[Floats]:
    """One path over all cells."""
    ends = np.array([[(path[0, 0], path[-1, 1]) for path in cell] for cell in candidates])
    points, index = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    cost = route.straight_distance(points)
    if len(points) <= MAX_CHECKED_POINTS:
        cost = _outside_cost(points, region)
    tour = route.order_stops(list(index.reshape(ends.shape[:3])), cost)
    return [np.concatenate([candidates[cell][option] for cell, option in tour])]


def _outside_cost(points: Floats, region: Any) -> route.Cost:
    """Cost function: straight distance between points; metres outside of the region count twice."""
    here, there = np.triu_indices(len(points), 1)
    legs = np.stack((points[here], points[there]), axis=1)
    matrix = np.zeros((len(points), len(points)))
    matrix[here, there] = lengths_m(legs) + outside_m(region, legs)
    matrix += matrix.T
    return lambda here, there: matrix[here, there]
