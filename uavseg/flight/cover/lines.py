"""Survey lines: laid in parallel strips, and put in a short order with legs between them.

Lines along the middle of strips cover a cell if each line is as long as the cell inside its strip. A line
that is clipped to the cell is too short where an edge is slanted, and misses what ends between two lines.

Cells that are divided into strips one by one need up to one line more each. Strips of one grid need as few
lines as the region is high, but two for an arm that lies across an edge of the grid.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Floats, Integers, Objects
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing, without_small_holes
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.order.tour import Stops, short_tour

LEEWAY = 0.6  # spacings by which lines, and legs between them, may leave the region
COARSE = 0.3  # spacings by which an outline of many corners is simplified
SLACK = 0.04  # spacings by which outlines are simplified
MAX_VERTICES = 40  # outlines with more are simplified
Free = Callable[[Floats, Floats], NDArray[np.bool_]]

TOUCH_M = 1e-6
NEAR_EDGE_M = 1e-3  # of an edge between strips: corners there lie on it
MAX_LINES = 10_000  # of a region; 20 000 waypoints are planned at most, and a line takes two of them
MIN_LINE_M = 5.0  # where the cell is as long: a vehicle looks along its line only when it flies along it
WIDTH_SLACK = 1e-3  # share of its height by which a cell may be higher before it needs another line
FEW_LINES = 150  # are also ordered one by one
HALVINGS = 4  # of a straight leg past the end of a line, until it is free


def grid_lines(
    polygon: Any, spacing_m: float, ends: tuple[float, float], joins: Free, start: float | None = None
) -> list[Floats]:
    """Return the lines along x that cover a polygon, cell by cell.

    For each cell they are (n, 2, 2), from south to north: west and east end of each, as x, y. The polygon
    (shapely) is in metres; `spacing_m` is the largest distance between neighbouring lines, `ends` the reach
    and the length of the shortest line, as of `strip_lines`. `joins` says of starts and ends, (n, 2), whether
    a line may lead over a gap in a strip. The strips are as high as each other, or as the spacing from the
    height `start` on, which is not above the polygon.

    Examples
    --------
    >>> ring = shapely.box(0, 0, 90, 90) - shapely.box(30, 30, 60, 60)
    >>> [len(cell) for cell in grid_lines(ring, 10, (0, 0), lambda starts, ends: np.zeros(len(starts), bool))]
    [3, 3, 3, 3]
    """
    _, south, _, north = shapely.bounds(polygon)
    edges = np.linspace(south, north, _line_count(north - south, spacing_m) + 1)
    if start is not None:
        count = _line_count(north - start, spacing_m, 1e-6)
        edges = np.linspace(start, start + spacing_m * count, count + 1)
    parts, row = shapely.get_parts(_strips_between(polygon, edges), return_index=True)
    is_area = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    west = shapely.bounds(parts)[:, 0]
    order = np.flatnonzero(is_area)[np.lexsort((west[is_area], row[is_area]))]
    parts, row = parts[order], row[order]
    lines = _lines_in_strips(parts, ((edges[:-1] + edges[1:]) / 2)[row], *ends)
    joined = np.zeros(len(parts), bool)  # to the part before
    near = np.flatnonzero(np.diff(row) == 0) + 1
    joined[near] = joins(lines[near - 1, 1], lines[near, 0])
    first = np.flatnonzero(~joined)
    east = np.maximum.reduceat(lines[:, 1, 0], first)
    lines = lines[first]
    lines[:, 1, 0] = east
    return _chains(lines, row[first], *(_touched(parts, edges[row + k], first) for k in (0, 1)))


def _touched(parts: Objects, height: Floats, first: Integers) -> Floats:
    """Return the extents (n, 2) along x of groups of parts where they touch a line along x; NaN where not."""
    xy, owner = shapely.get_coordinates(parts, return_index=True)
    near = np.abs(xy[:, 1] - height[owner]) < NEAR_EDGE_M
    low, high = np.full(len(parts), np.inf), np.full(len(parts), -np.inf)
    np.minimum.at(low, owner[near], xy[near, 0])
    np.maximum.at(high, owner[near], xy[near, 0])
    return np.stack([np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)], axis=1)


def _chains(lines: Floats, row: Integers, below: Floats, above: Floats) -> list[Floats]:
    """Join lines of neighbouring strips to one cell, as long as each has one neighbour only."""
    # `below` and `above` (n, 2) are extents of what each line covers along the edges of its strip.
    after = [np.flatnonzero(row == k) for k in range(int(row[-1]) + 2)]
    cells: list[list[int]] = []
    cell_of: dict[int, list[int]] = {}
    for k in range(len(after) - 1):
        before, here = after[k - 1] if k else after[-1], after[k]
        low, high = below[here], above[before]
        shared = np.minimum(high[:, None, 1], low[:, 1]) - np.maximum(high[:, None, 0], low[:, 0])
        touch = shared > TOUCH_M
        for j, line in enumerate(here.tolist()):
            neighbours = np.flatnonzero(touch[:, j])
            if len(neighbours) == 1 and touch[neighbours[0]].sum() == 1:
                cell = cell_of[int(before[neighbours[0]])]
            else:
                cell = []
                cells.append(cell)
            cell.append(line)
            cell_of[line] = cell
    return [lines[cell] for cell in cells]


def strip_lines(cell: Any, spacing_m: float, reach_m: float = 0.0, min_m: float = MIN_LINE_M) -> Floats:
    """Return the lines along x that cover a cell, from south to north.

    They are (n, 2, 2), west and east end of each as x, y; at least one, evenly spaced. The cell (shapely) is
    in metres; every line along x meets it in one piece, or nearly. `spacing_m` is the largest distance
    between neighbouring lines, `min_m` the length of the shortest. The ground that a line covers ends
    `reach_m` past its end: lines may be so much shorter than the cell in their strip, but do not end inside
    the cell.

    Examples
    --------
    >>> strip_lines(shapely.box(0, 0, 100, 30), 12).tolist()
    [[[0.0, 5.0], [100.0, 5.0]], [[0.0, 15.0], [100.0, 15.0]], [[0.0, 25.0], [100.0, 25.0]]]
    """
    _, south, _, north = shapely.bounds(cell)
    edges = np.linspace(south, north, _line_count(north - south, spacing_m) + 1)
    return _lines_in_strips(_strips_between(cell, edges), (edges[1:] + edges[:-1]) / 2, reach_m, min_m)


def _lines_in_strips(pieces: Objects, y: Floats, reach_m: float, min_m: float = MIN_LINE_M) -> Floats:
    """Return the lines along x at heights that cover pieces of strips: (n, 2, 2), west end and east end."""
    # They are no shorter than `min_m` where the strip is as long, but 5 m where one photograph shows all.
    low, _, high, _ = shapely.bounds(pieces).T
    across = np.stack([low - 1, y, high + 1, y], axis=1).reshape(-1, 2, 2)
    # NaN where a piece is not met
    begin, _, stop, _ = shapely.bounds(shapely.intersection(pieces, shapely.linestrings(across))).T
    start, end = np.fmin(low + reach_m, begin), np.fmax(high - reach_m, stop)
    shown_at_once = high - low <= 2 * reach_m - MIN_LINE_M
    middle = np.where(shown_at_once | (start > end), low + high, start + end) / 2
    half = np.where(shown_at_once, MIN_LINE_M, min_m) / 2
    short = end - start < min_m
    start = np.where(short, np.maximum(low, middle - half), start)
    end = np.where(short, np.minimum(high, middle + half), end)
    return np.stack([start, y, end, y], axis=1).reshape(-1, 2, 2)


def _line_count(width_m: float, spacing_m: float, slack: float = WIDTH_SLACK) -> int:
    """Return the number of lines over a width."""
    # Refuse a spacing that is not positive (ParameterError) and more lines than a mission holds
    # (MissionError).
    if not (math.isfinite(spacing_m) and spacing_m > 0):
        raise ParameterError(f"the spacing of survey lines is a positive number of metres, not {spacing_m}")
    count = max(math.ceil(width_m / spacing_m * (1 - slack)), 1)
    if count > MAX_LINES:
        raise MissionError(
            f"{width_m:.0f} m at a spacing of {spacing_m:g} m make {count} lines, more than a mission holds; "
            "use a wider spacing"
        )
    return count


def _strips_between(cell: Any, edges: Floats) -> Objects:
    """Return the parts of a cell between lines along x."""
    # GEOS clips to rectangles fast, but does not promise that all is well where corners lie on their edges.
    west, south, east, north = shapely.bounds(cell)
    bounds = [south - 1, *edges[1:-1].tolist(), north + 1]
    try:
        clipped = [
            shapely.clip_by_rect(cell, west - 1, low, east + 1, high) for low, high in pairwise(bounds)
        ]
        parts = np.array(clipped, object)
        whole = math.isclose(float(shapely.area(parts).sum()), shapely.area(cell), rel_tol=1e-9)
        if whole and shapely.is_valid(parts).all():
            return parts
    except shapely.GEOSException:  # of parts without area
        pass
    exact: Objects = shapely.intersection(cell, shapely.box(west - 1, bounds[:-1], east + 1, bounds[1:]))
    return exact


def flight_space(
    region: Any, spacing_m: float, lead_m: float = 0.0, obstacles: Sequence[Any] = ()
) -> tuple[Any, FreeSpace]:
    """Return a region with fewer vertices, which contains it but for corners, and the space to fly in.

    The region is in metres. Straight legs of `lead_m` lead out of it, and no leg may cross `obstacles`.
    """
    slack = SLACK * spacing_m
    if shapely.get_num_coordinates(region) > MANY_CORNERS:  # without holes that lie between two lines
        around = enclosing(without_small_holes(region, spacing_m**2), COARSE * spacing_m)
        region = without_small_holes(around, spacing_m**2)
    simple = region
    if shapely.get_num_coordinates(region) > MAX_VERTICES:
        fewer = shapely.simplify(region, slack / 2)
        grown = shapely.buffer(fewer, slack / 2, join_style="mitre", mitre_limit=1.5)
        simple = grown if grown.geom_type == "Polygon" else region
    reach = LEEWAY * spacing_m + lead_m - 1.8 * slack
    allowed = shapely.simplify(shapely.buffer(simple, reach, quad_segs=16), slack / 2)
    return simple, FreeSpace(allowed, obstacles)


@dataclass(frozen=True, slots=True, eq=False)
class SurveyLines:
    """Straight lines in cells; those of a cell are flown one after another, to and fro."""

    angle_deg: float  # azimuth
    cells: tuple[Floats, ...]  # for each cell (n, 2, 2): both ends of its lines, in metres
    lead_m: float = 0.0  # length of the straight legs before and after each line

    @property
    def orders(self) -> list[list[Integers]]:
        """The orders of the lines of each cell, as of `to_and_fro`."""
        stops = np.cumsum([len(cell) for cell in self.cells])
        return [to_and_fro(range(end - len(cell), end)) for cell, end in zip(self.cells, stops, strict=True)]

    def rough_order(self, home: Floats | None) -> Integers:
        """Return an order of all lines: cell by cell, each at the nearest end of its first or last line."""
        candidates = self.orders
        entries = np.array([[(order[0], order[-1] ^ 1) for order in orders] for orders in candidates])
        places = np.concatenate(self.cells).reshape(-1, 2)[entries]
        here, chosen = places[0, 0, 0] if home is None else home, []
        for _ in self.cells:
            away = np.hypot(places[..., 0, 0] - here[0], places[..., 0, 1] - here[1])
            cell, option = divmod(int(np.argmin(away)), 4)
            here = places[cell, option, 1].copy()
            places[cell] = np.inf
            chosen.append(candidates[cell][option])
        return np.concatenate(chosen)


@dataclass(frozen=True, slots=True, eq=False)
class OrderParams:
    """Parameters of the search for the order of lines."""

    home: Floats | None = None  # (2,), where the flight starts and ends, in metres
    costs: Callable[[Floats], Floats] = np.asarray  # of legs, by their lengths in metres
    rounds: int = 300  # of the search
    first: Integers | None = None  # options of the first order of the search


def fly_lines(
    lines: SurveyLines, space: FreeSpace, params: OrderParams
) -> Iterator[tuple[Floats, Floats, tuple[Floats, ...]]]:
    """Yield orders of lines: two for one cell, one for several.

    The lines of one cell are flown to and fro, from either end. Those of several cells are ordered line by
    line where they are few, else cell by cell. Each order is the lines in the order and direction of flight,
    the same with the straight legs before and after them, and the n - 1 legs from one to the next. A
    MissionError says that there is no path between lines.
    """
    flat, cells = np.concatenate(lines.cells), lines.orders
    outer = _extended(flat, lines.lead_m, space)
    ends, orders = outer.reshape(-1, 2), []
    if len(cells) == 1:
        orders = cells[0][:2]
    elif len(flat) <= FEW_LINES:
        each = [to_and_fro([k])[:2] for k in range(len(flat))]
        orders = [join_cells(each, ends, space, replace(params, first=lines.rough_order(params.home)))]
    for order in orders or [join_cells(cells, ends, space, params)]:
        placed = in_order(outer, order)
        yield in_order(flat, order), placed, tuple(space.each_path(placed[:-1, 1], placed[1:, 0]))


def to_and_fro(cell: Sequence[int]) -> list[Integers]:
    """Return the four orders of the lines of a cell: 2 k is line k and 2 k + 1 is line k reversed."""
    index = np.array(cell, np.int64)
    forward = [2 * index + (np.arange(len(index)) % 2 ^ turn) for turn in (0, 1)]
    return forward + [(one ^ 1)[::-1] for one in forward]


def join_cells(
    candidates: list[list[Integers]], ends: Floats, space: FreeSpace, params: OrderParams
) -> Integers:
    """Return one order of the lines of all cells, with a short tour over the cells.

    `candidates` are for each cell its orders, as of `to_and_fro`; rows 2 k and 2 k + 1 of `ends` (m, 2) are
    the ends of line k. The ways from home and back are straight.
    """
    entries = np.array([[(order[0], order[-1] ^ 1) for order in orders] for orders in candidates])
    points, index = np.unique(entries.ravel(), return_inverse=True)
    lengths, start = space.paths(ends[points]).lengths, -1
    if params.home is not None:
        start, away = len(points), np.hypot(*(ends[points] - params.home).T)
        lengths = np.block([[lengths, away[:, None]], [away, np.zeros(1)]])
    stops = Stops.of(list(index.reshape(entries.shape)))
    tour = short_tour(stops, params.costs(lengths), start, start, params.rounds, params.first)
    return np.concatenate([candidates[cell][order] for cell, order in tour])


def path_length(path: Floats) -> float:
    """Return the length of a path (k, 2) in metres."""
    return math.fsum(np.hypot(*np.diff(path, axis=0).T).tolist())


def in_order(lines: Floats, order: Integers) -> Floats:
    """Return lines (n, 2, 2) in an order and direction of flight, as of `to_and_fro`."""
    flown = lines[order // 2]
    turned = order % 2 == 1
    flown[turned] = flown[turned, ::-1]
    return flown


def _extended(lines: Floats, lead_m: float, space: FreeSpace) -> Floats:
    """Lengthen lines at both ends, by less where the straight leg is not free."""
    if not lead_m:
        return lines
    step = lines[:, 1] - lines[:, 0]
    length = np.hypot(*step.T)[:, None]
    unit = np.divide(step, length, out=np.zeros_like(step), where=length > 0)
    outer = lines.copy()
    for side, sign in ((0, -1), (1, 1)):
        todo = np.ones(len(lines), bool)
        for halving in range(HALVINGS):
            place = lines[:, side] + sign * unit * lead_m / 2**halving
            free = todo & space.sees(lines[:, side], place)
            outer[free, side] = place[free]
            todo &= ~free
    return outer
