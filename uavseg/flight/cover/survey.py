"""Survey of a region: boustrophedon cellular decomposition, cells in a short order, legs that stay inside.

Strips are joined to cells that are flown line by line, to and fro (H. Choset and P. Pignon, Coverage path
planning: the boustrophedon cellular decomposition, Field and Service Robotics, 1998): a cell ends where
strips split or merge around concave places and holes. Legs between lines are shortest paths in the region
with a small leeway.

A line that sweeps over a polygon splits or merges at the corners that point against the sweep: the corners of
holes and of concave places. Divided along the sweep line through each of them, every line meets every cell in
one piece.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.cover import lines as swaths
from uavseg.flight.cover.lines import MIN_LINE_M, OrderParams, SurveyLines, flight_space, grid_lines

OVERLAP_M = 1e-6  # by which dividing lines are longer than the polygon is wide
STEP = 2.0  # spacings: cells may be cut at steps of the outline that are longer
MIN_HEIGHT = 0.5  # spacings: cells that are less high are merged
GAP = 3.0  # spacings: longest gap over which a line continues
TURN_M = 10.0  # a turn costs the time of so many metres: at 5 m/s, braking and accelerating at 2.5 m/s2
STEP_DEG = 15.0  # azimuths that are tried besides those of edges; whole degrees where many are tried
MIN_TRIES, MANY_TRIES = 3, 12
MAX_WORK = 18_000  # tries times corners of a region and its lines
FINE_DEG = 2.0  # between azimuths of many tries
MAX_RISE, MAX_RISE_OF_SEVERAL = 1.35, 2.0  # their lines, relative to the fewest; of one of several regions
LEG_LENGTHS = 48  # between which the costs of legs are interpolated
QUICK_ROUNDS = 100  # of the search for an order, where azimuths are compared
SPREAD, REFINED = 16, 6  # azimuths at all ranks that are tried too; azimuths beside those of the best are
COST_DECIMALS = 6  # so that rounding errors choose nothing
SIMILAR_DEG = 10.0  # azimuths of less difference are similar where surveys of several regions are chosen
MAX_AZIMUTHS = 40  # of edges
COMPACT = 0.8  # share of the convex hull: a region that fills more, and is one cell, is not divided otherwise
MAX_CRITICAL = 400  # corners at which a region is divided into cells
MAX_SHIFTS = 6  # places of the first line, for one azimuth
WAY, LINE, RETURN = 0, 1, 2  # kinds of legs: between lines and from home; survey lines; home
Costs = Callable[[Floats, Integers, Bools], Floats]
"""Costs of the legs (n - 1,) of a path (n, 2) in metres: the second argument, (n - 1,), is the kind of each,
the third, (n,), whether the vehicle stops there, as at home."""


def monotone_cells(polygon: Any, step_m: float = np.inf, detail_m: float = 0.0) -> list[Any]:
    """Divide a polygon into cells that every line along x meets in one piece at most.

    They come from south to north, then from west to east. The polygon (shapely, in metres) may have holes. It
    is also divided at the inner corner of a step, an edge longer than `step_m` that runs nearly along x: a
    line across it would be too long for the narrow side. Notches less deep than `detail_m` do not divide it;
    lines along x may meet cells in more pieces there.

    Examples
    --------
    >>> ring = shapely.box(0, 0, 9, 9) - shapely.box(3, 3, 6, 6)
    >>> [cell.bounds for cell in monotone_cells(ring)]  # doctest: +NORMALIZE_WHITESPACE
    [(0.0, 0.0, 9.0, 3.0), (0.0, 3.0, 3.0, 6.0), (6.0, 3.0, 9.0, 6.0), (0.0, 6.0, 9.0, 9.0)]
    """
    critical = _all_critical(polygon, step_m, detail_m)
    if not len(critical):
        return [polygon]
    west, _, east, _ = shapely.bounds(polygon)
    dividing = []
    for x, y in critical.tolist():
        across = shapely.LineString([(west - 1, y), (east + 1, y)])
        chords = shapely.get_parts(shapely.line_merge(shapely.intersection(polygon, across)))
        reach = shapely.Point(x, y)
        for chord in chords:
            if chord.geom_type == "LineString" and shapely.distance(chord, reach) < OVERLAP_M:
                low, high = sorted((chord.coords[0][0], chord.coords[-1][0]))
                dividing.append(shapely.LineString([(low - OVERLAP_M, y), (high + OVERLAP_M, y)]))
    lines = shapely.union_all([shapely.boundary(polygon), *dividing])  # noded: they meet at vertices only
    faces = shapely.get_parts(shapely.polygonize(list(shapely.get_parts(lines))))
    places = shapely.get_coordinates(shapely.point_on_surface(faces))
    inner = faces[shapely.contains_xy(polygon, *places.T)]
    return sorted(inner, key=lambda face: (face.bounds[1], face.bounds[0]))


def merge_flat_cells(cells: list[Any], min_m: float) -> list[Any]:
    """Merge cells of one polygon less high than a minimum with the neighbour of the longest common edge.

    Lines along x may meet merged cells in two pieces, near an edge that is `min_m` away at most.
    """
    cells = list(cells)
    grown = list(shapely.buffer(cells, 1e-5))
    while len(cells) > 1:
        bounds = shapely.bounds(cells)
        height = bounds[:, 3] - bounds[:, 1]
        flat = int(np.argmin(height))
        if height[flat] >= min_m:
            break
        cell = cells.pop(flat)
        grown.pop(flat)
        best = int(np.argmax(shapely.length(shapely.intersection(shapely.boundary(cell), grown))))
        merged = shapely.union(shapely.buffer(cells[best], 1e-5, join_style="mitre"), cell)
        if merged.geom_type != "Polygon":
            cells.append(cell)  # it touches none: the polygon was not connected there
            break
        cells[best], grown[best] = merged, shapely.buffer(merged, 1e-5)
    return sorted(cells, key=lambda face: (face.bounds[1], face.bounds[0]))


def _all_critical(polygon: Any, step_m: float, detail_m: float) -> Floats:
    outline = shapely.simplify(polygon, detail_m) if detail_m else polygon
    rings = shapely.get_rings(shapely.orient_polygons(outline))  # the inside to their left
    critical = [_critical(shapely.get_coordinates(ring)[:-1], step_m) for ring in rings]
    return np.unique(np.concatenate(critical), axis=0)


def _critical(ring: Floats, step_m: float) -> Floats:
    """Return the corners that turn right, with both neighbours on one side of the sweep line through them."""
    # An edge along the sweep line counts as one corner.
    into, out = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    turns_right = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0
    first = into[:, 1] != 0  # of each run of equal heights
    corners, turns_right = ring[first], turns_right[first]
    height = corners[:, 1]
    below, above = np.roll(height, 1) < height, np.roll(height, -1) < height
    is_step = (np.abs(out[:, 0]) >= step_m) & (np.abs(out[:, 1]) <= step_m / 4)
    inner = (into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0) & (is_step | np.roll(is_step, 1))
    return np.concatenate([corners[turns_right & (below == above)], ring[inner]])


@dataclass(frozen=True, slots=True)
class CoverParams:
    """Parameters of survey lines over a region."""

    spacing_m: float  # distance between neighbouring lines
    angle_deg: float | None = None  # azimuth, clockwise from north; by default that of the least cost
    reach_m: float = 0.0  # ground that photographs show past the end of a line; negative: lines are longer
    min_m: float = MIN_LINE_M  # length of the shortest line
    costs: Costs | None = None  # of legs, such as their times; by default their lengths, and turns
    lead_m: float = 0.0  # length of the straight legs before and after each line, without photographs
    crosshatch: bool = False  # whether to cover the region once more, at a right angle
    tries: int = MIN_TRIES  # surveys that are planned to the end
    home: tuple[float, float] | None = None  # where the flight starts and ends, if over this region only


@dataclass(frozen=True, slots=True)
class Survey:
    """Lines over one region in the order and direction of flight, and the legs between them."""

    angle_deg: float  # azimuth of the lines, clockwise from north, in [0, 180)
    cells: int  # number of parts that are flown one after another, each line by line
    lines: Floats  # (n, 2, 2), start and end of each line in metres
    outer: Floats  # (n, 2, 2), with the straight legs before and after lines
    legs: tuple[Floats, ...]  # n - 1 of (k, 2), from the end of each outer line to the start of the next

    @property
    def length_m(self) -> float:
        """Length of lines and legs in metres."""
        lines_m = np.hypot(*(self.outer[:, 1] - self.outer[:, 0]).T).sum()
        return float(lines_m + sum(swaths.path_length(leg) for leg in self.legs))

    @property
    def turns(self) -> int:
        """Number of places at which the vehicle changes its direction."""
        return sum(len(leg) for leg in self.legs)

    def path(self) -> tuple[Floats, Bools]:
        """Return the path of flight (k, 2), and whether each of its legs is a line (k - 1,)."""
        after = zip(self.legs, self.outer[1:], strict=True)
        legs = [self.outer[0], *(part for pair in after for part in pair)]
        xy = np.concatenate([leg[1:] if k else leg for k, leg in enumerate(legs)])
        return xy, np.repeat(np.arange(len(legs)) % 2 == 0, [len(leg) - 1 for leg in legs])


def surveys(region: Any, params: CoverParams, obstacles: Sequence[Any] = ()) -> list[Survey]:
    """Cover a region with parallel lines in a short order; return surveys from the cheapest one on.

    Lines of many azimuths are laid in one grid, and ranked by the cost of a rough order. For the best ones
    the grid is also shifted, and the region divided into cells. The `tries` best of all of these are planned
    to the end, cell by cell and line by line; twice as many azimuths are ranked, or 180 and more for 12
    tries. There are fewer tries where the region has many corners. Lines of one azimuth are laid and planned
    in the same way.

    Each survey may be reversed. The region (shapely, in metres) may be concave and have holes; no line or leg
    crosses an obstacle. A ParameterError says that the spacing is not a positive number or the angle not
    finite, a MissionError that there would be more lines than a mission holds, or no path between them.

    Examples
    --------
    >>> flown, *_ = surveys(shapely.box(0, 0, 20, 100), CoverParams(10))
    >>> flown.angle_deg, flown.cells, flown.lines.round(6).tolist()
    (0.0, 1, [[[5.0, 0.0], [5.0, 100.0]], [[15.0, 100.0], [15.0, 0.0]]])
    """
    outside_m = max(-params.reach_m, 0.0)
    simple, space = flight_space(region, params.spacing_m, params.lead_m + outside_m, obstacles)
    near = flight_space(region, params.spacing_m, outside_m, obstacles)[1] if params.lead_m else space
    found = _found(simple, params, near, space)
    if not params.crosshatch:
        return found
    across = replace(params, angle_deg=found[0].angle_deg + 90)
    return [_joined(_same_azimuth(found), _same_azimuth(_found(simple, across, near, space)), space)]


def _same_azimuth(found: list[Survey]) -> list[Survey]:
    """Return the cheapest survey and another one of the same lines."""
    return [one for one in found[:2] if one.angle_deg == found[0].angle_deg]


def _found(region: Any, params: CoverParams, near: FreeSpace, space: FreeSpace) -> list[Survey]:
    """Return surveys from the cheapest on, with lines in one space and legs in another; see `surveys`."""
    home = None if params.home is None else np.array(params.home)
    order = OrderParams(home) if params.costs is None else OrderParams(home, _leg_costs(region, params.costs))
    quick = replace(order, rounds=QUICK_ROUNDS)
    is_compact = region.area > COMPACT * shapely.convex_hull(region).area
    # fewer tries where they take long
    count = region.area / params.spacing_m**2 / max(math.sqrt(region.area) / params.spacing_m, 1.0)
    size = int(shapely.get_num_coordinates(region)) + 2 * count
    tries = min(params.tries, max(int(MAX_WORK / size), MIN_TRIES))
    is_thorough = tries >= MANY_TRIES
    costs: dict[SurveyLines, float] = {}

    def ranked(laid: list[SurveyLines]) -> list[SurveyLines]:
        new = [lines for lines in laid if lines not in costs]
        if not new:
            least = np.empty(0)
        elif is_thorough:
            least = _least_costs([list(_fly(lines, space, quick)) for lines in new], params)
        else:
            orders = [swaths.in_order(np.concatenate(lines.cells), lines.rough_order(home)) for lines in new]
            paths = [(xy.reshape(-1, 2), np.arange(2 * len(xy) - 1) % 2 == 0) for xy in orders]
            least = _path_costs(paths, params)
        costs.update(zip(new, least.tolist(), strict=True))
        return sorted(laid, key=lambda lines: costs[lines])

    def others(grids: list[SurveyLines]) -> list[SurveyLines]:
        """Return further lines of the azimuths of grids: merged cells may leave the region."""
        divided = [grid for grid in grids if not is_compact or len(grid.cells) > 1]
        cells = [lines for grid in divided for lines in _cells(region, grid.angle_deg, params)]
        shifted = [
            lines for grid in grids * is_thorough for lines in _shifted(region, grid.angle_deg, params, near)
        ]
        inside = [near.sees(*np.concatenate(lines.cells).swapaxes(0, 1)).all() for lines in cells]
        return [*shifted, *(lines for lines, is_in in zip(cells, inside, strict=True) if is_in)]

    grids = ranked([_grid(region, azimuth, params, near) for azimuth in _azimuths(region, params, tries)])
    spread = grids[:: max(len(grids) // SPREAD, 1)] if is_thorough else []
    best = list(dict.fromkeys([*grids[: max(tries // 3, MIN_TRIES)], *spread]))
    laid = ranked([*grids, *others(best)])
    if is_thorough and params.angle_deg is None:
        known = {grid.angle_deg for grid in best}
        beside = {(lines.angle_deg + step) % 180 for lines in laid[:REFINED] for step in (-2, -1, 1, 2)}
        closer = [_grid(region, azimuth, params, near) for azimuth in sorted(beside - known)]
        laid = ranked([*laid[:tries], *closer, *others(closer)])
    if home is None:
        turns = np.zeros(len(laid), np.int64)  # the first of each group of similar azimuths comes first
        azimuths = np.array([lines.angle_deg for lines in laid])
        for k in range(1, len(laid)):
            turns[k] = np.sum(np.abs((azimuths[:k] - azimuths[k] + 90) % 180 - 90) < SIMILAR_DEG)
        laid = [laid[k] for k in np.argsort(turns, kind="stable")]
    flown = [list(_fly(lines, space, order)) for lines in laid[: max(tries // 3, MIN_TRIES)]]
    best_first = np.argsort(_least_costs(flown, params), kind="stable").tolist()
    return [survey for k in best_first for survey in flown[k]]


def _least_costs(flown: list[list[Survey]], params: CoverParams) -> Floats:
    """Return the cost of the cheapest of each list of surveys."""
    costs = _path_costs([survey.path() for some in flown for survey in some], params)
    least: Floats = np.minimum.reduceat(costs, np.cumsum([0, *map(len, flown[:-1])]))
    return least


def _leg_costs(region: Any, costs_of: Costs) -> Callable[[Floats], Floats]:
    """Return the function of the cost of straight legs, from rest to rest, by their lengths."""
    west, south, east, north = shapely.bounds(region)
    lengths = np.append(0.0, np.geomspace(1.0, 10 * (east - west + north - south), LEG_LENGTHS))
    ends = np.stack([np.zeros(len(lengths)), lengths], axis=1).ravel()
    path = np.stack([ends, np.zeros(len(ends))], axis=1)
    costs = costs_of(path, np.full(len(path) - 1, WAY), np.ones(len(path), bool))[::2]
    return lambda some: np.interp(some, lengths, costs)


def _path_costs(paths: list[tuple[Floats, Bools]], params: CoverParams) -> Floats:
    """Return the cost of each path, all at once; from home and, after a stop, back, where that is given."""
    # Of both directions that of less cost counts.
    turned = [] if params.home is None else [(xy[::-1], is_line[::-1]) for xy, is_line in paths]
    both = [*paths, *turned]
    home = np.empty((0, 2)) if params.home is None else np.array([params.home])
    ends = len(home)
    xy = np.concatenate([part for path, _ in both for part in (home, path, home)])
    out, back = np.full(ends, WAY), np.full(ends, RETURN)
    kind = np.concatenate([part for _, is_line in both for part in (out, is_line * LINE, back, [WAY])])
    first = np.cumsum([0, *(len(path) + 2 * ends for path, _ in both)])
    stops = np.zeros(len(xy), bool)
    stops[first[:-1]] = stops[first[1:] - 1] = stops[first[1:] - 1 - ends] = True
    if params.costs is None:
        costs = np.append(np.hypot(*np.diff(xy, axis=0).T) + TURN_M * ~stops[1:], 0.0)
    else:
        costs = np.append(params.costs(xy, kind[:-1], stops), 0.0)
    costs[first[1:] - 1] = 0.0  # from one path to the next
    sums: Floats = np.add.reduceat(costs, first[:-1]).reshape(-1, len(paths)).min(axis=0)
    return sums.round(COST_DECIMALS)


def _azimuths(region: Any, params: CoverParams, tries: int) -> list[float]:
    """Return the requested azimuth, or those along edges and in steps that need the fewest lines."""
    # The number of lines is about half of the rise and fall of the outline across them, in spacings.
    if params.angle_deg is not None:
        if not math.isfinite(params.angle_deg):
            raise ParameterError(
                f"the azimuth of survey lines is a number of degrees or auto, not {params.angle_deg}"
            )
        return [float(params.angle_deg % 180) % 180]  # -1e-17 % 180 is 180
    many = tries >= MANY_TRIES
    outlines = [*shapely.get_rings(region), shapely.get_exterior_ring(shapely.convex_hull(region))]
    step = np.concatenate([np.diff(shapely.get_coordinates(ring), axis=0) for ring in outlines])
    longest = step[np.argsort(-np.hypot(*step.T), kind="stable")][:MAX_AZIMUTHS]
    along = np.degrees(np.arctan2(longest[:, 0], longest[:, 1])) % 180
    steps = np.arange(0, 180, FINE_DEG if many else STEP_DEG)
    azimuths = np.unique(np.round(np.concatenate([along, steps]), 3) % 180)
    edges = np.concatenate([np.diff(shapely.get_coordinates(ring), axis=0) for ring in outlines[:-1]])
    rise = [float(np.abs(edges @ axes(azimuth)[:, 1]).sum()) for azimuth in azimuths.tolist()]
    best: list[float] = azimuths[np.argsort(rise, kind="stable")].tolist()
    most = min(rise) * (MAX_RISE_OF_SEVERAL if params.home is None else MAX_RISE)
    return best[: int((np.array(rise) <= most).sum()) if many else 2 * tries]


def axes(angle_deg: float) -> Floats:
    """Return the unit vectors along lines of an azimuth and across them, to the right, as columns (2, 2)."""
    azimuth = math.radians(angle_deg)
    sine, cosine = math.sin(azimuth), math.cos(azimuth)
    return np.array([[sine, cosine], [cosine, -sine]])


def _grid(
    region: Any, angle_deg: float, params: CoverParams, space: FreeSpace, start: float | None = None
) -> SurveyLines:
    """Return the lines of one azimuth, in one grid; `start` is that of `grid_lines`."""
    turn, spacing = axes(angle_deg), params.spacing_m

    def joins(starts: Floats, ends: Floats) -> Bools:
        return (ends[:, 0] - starts[:, 0] <= GAP * spacing) & space.sees(starts @ turn.T, ends @ turn.T)

    cells = grid_lines(_turned(region, turn), spacing, (params.reach_m, params.min_m), joins, start)
    return SurveyLines(angle_deg, tuple(cell @ turn.T for cell in cells), params.lead_m)


def _shifted(region: Any, angle_deg: float, params: CoverParams, space: FreeSpace) -> list[SurveyLines]:
    """Return grids of one azimuth with an edge between strips at a corner where cells are divided."""
    turned = _turned(region, axes(angle_deg))
    _, south, _, north = shapely.bounds(turned)
    corners = _all_critical(turned, STEP * params.spacing_m, MIN_HEIGHT * params.spacing_m / 2)[:, 1]
    phases = (np.concatenate([corners, [south, north]]) - south) % params.spacing_m
    distinct = np.unique(np.round(phases / params.spacing_m, 1) % 1, return_index=True)[1][:MAX_SHIFTS]
    starts = south + phases[distinct] - params.spacing_m * (phases[distinct] > 0)
    return [_grid(region, angle_deg, params, space, start) for start in starts.tolist()]


def _cells(region: Any, angle_deg: float, params: CoverParams) -> list[SurveyLines]:
    """Return the lines of one azimuth in strips cell by cell; divided at steps of the outline or not."""
    # Nothing where there would be too many cells.
    turn, spacing, min_m = axes(angle_deg), params.spacing_m, MIN_HEIGHT * params.spacing_m
    turned = _turned(region, turn)
    divisions = []
    counts = {step: len(_all_critical(turned, step, min_m / 2)) for step in (math.inf, STEP * spacing)}
    for step, count in counts.items():
        if count <= MAX_CRITICAL and (step == math.inf or count > counts[math.inf]):
            cells = merge_flat_cells(monotone_cells(turned, step, min_m / 2), min_m)
            lines = [swaths.strip_lines(one, spacing, params.reach_m, params.min_m) @ turn.T for one in cells]
            divisions.append(SurveyLines(angle_deg, tuple(lines), params.lead_m))
    return divisions


def _turned(region: Any, turn: Floats) -> Any:
    return shapely.transform(region, lambda xy: xy @ turn)


def _fly(lines: SurveyLines, space: FreeSpace, params: OrderParams) -> Iterator[Survey]:
    for flown, outer, legs in swaths.fly_lines(lines, space, params):
        yield Survey(angle_deg=lines.angle_deg, cells=len(lines.cells), lines=flown, outer=outer, legs=legs)


def _joined(first: list[Survey], second: list[Survey], space: FreeSpace) -> Survey:
    """Join two surveys, one after the other, with the shortest leg between any of their candidates."""
    pairs = [
        (one, other)
        for some, others in ((first, second), (second, first))
        for one in [*some, *map(_reversed, some)]
        for other in [*others, *map(_reversed, others)]
    ]
    ends = np.array([[one.outer[-1, 1], other.outer[0, 0]] for one, other in pairs])
    points, index = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    index, paths = index.reshape(-1, 2), space.paths(points)
    best = int(np.argmin(paths.lengths[index[:, 0], index[:, 1]]))
    one, other = pairs[best]
    return Survey(
        angle_deg=first[0].angle_deg,
        cells=one.cells + other.cells,
        lines=np.concatenate([one.lines, other.lines]),
        outer=np.concatenate([one.outer, other.outer]),
        legs=(*one.legs, paths.path(*index[best].tolist()), *other.legs),
    )


def _reversed(flown: Survey) -> Survey:
    legs = tuple(leg[::-1] for leg in flown.legs[::-1])
    return replace(flown, lines=flown.lines[::-1, ::-1], outer=flown.outer[::-1, ::-1], legs=legs)
