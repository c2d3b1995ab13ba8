"""Coverage of free space by a robot: back-and-forth lines, what they miss, and an order with free legs.

Parallel lines are laid as those of surveys from the air, cell by cell of a boustrophedon decomposition (H.
Choset and P. Pignon, Coverage path planning: the boustrophedon cellular decomposition, Field and Service
Robotics, 1998), and cut to the cells over which the robot may drive. What lies beside them, along slanted
walls and in narrow places, is covered by further lines, along and across, each time by the one that covers
most for its length (greedy set cover). Parts of the lines are driven to and fro, the nearest next.

Positions are (row, col), lengths in cells, where nothing else is said.
"""

import heapq
import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from rasterio.features import shapes
from scipy.ndimage import distance_transform_edt

from uavseg.arrays import Bools, Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.cover.lines import grid_lines, path_length, to_and_fro
from uavseg.warning_filters import changing_filters
from uavseg_ros.free_space import FreeSpace, Mask, runs_over

MIN_WIDTH = 2.0  # cells
STEP_DEG = 15.0  # between headings that are tried, besides those of the smallest rectangle around all
TURN = 2.0  # widths of driving that a line costs besides its length
MIN_GAIN, MIN_SHARE = 1 / 8, 0.01  # squares of the width that a line covers alone, or of all, if that is less
SHORTEST = 0.5  # cells: a line at a single place
TOLERANCE = 1e-9  # cells by which a place may be farther than half of the width
Lines = list[Floats]  # each (2, 2): start and end


@dataclass(frozen=True, eq=False)
class Sweep:
    """A path of lines and legs over cells, and what it covers."""

    heading_rad: float  # of the lines, from rising columns towards rising rows
    path: Floats  # (n, 2)
    is_line: Bools  # (n - 1,): whether each of its parts is a line rather than a leg
    wanted: Mask  # (rows, cols): cells to cover
    reachable: Mask  # (rows, cols): those within half of the width of the centre of a drivable one
    by_lines: Mask  # (rows, cols): those within half of the width of a line
    by_path: Mask  # (rows, cols): those within half of the width of a line or a leg

    @property
    def lines(self) -> int:
        """Return the number of lines."""
        return int(self.is_line.sum())


def sweep(
    space: FreeSpace,
    wanted: Mask,
    part: int,
    width_m: float,
    heading_rad: float | None = None,
    start: Floats | None = None,
) -> Sweep:
    """Cover cells by lines over drivable cells among them.

    Parameters
    ----------
    wanted : (rows, cols) bool array
        Free cells to cover.
    part : int
        Part of the drivable cells over which the robot drives, with some of the wanted ones.
    width_m : float
        Metres that a line covers, half of them to each side and at its ends.
    heading_rad : float, optional
        Of the lines, from rising columns towards rising rows; by default that of the least driving.
    start : (2,) array, optional
        Where the robot is, on a cell of the part; the path begins there.

    Raises
    ------
    ParameterError
        If the width is not finite, or less than two cells.
    """
    width = width_m / space.side_m
    if not (math.isfinite(width) and width >= MIN_WIDTH * (1 - TOLERANCE)):
        least = f"{MIN_WIDTH * space.side_m:g} m, two cells of {space.name}"
        raise ParameterError(f"the width is at least {least}, not {width_m:g} m")
    ground = _ground(wanted, wanted & (space.parts == part), width)
    headings = _headings(ground) if heading_rad is None else [heading_rad]
    laid = [_chains(ground, one) for one in headings]
    best = int(np.argmin([round(_cost(ground, chains), 6) for chains in laid]))
    chains, missing = laid[best], ground.missed(_flat(laid[best]))
    extra = _fill(ground, headings[best], missing, ground.min_gain)
    if not (chains or extra):  # of next to nothing
        extra = _fill(ground, headings[best], missing, 1.0)
    items = ground.needed([*chains, *([[line]] for line in extra)])
    path, is_line = _drive(space, items, start)
    parts = list(np.stack([path[:-1], path[1:]], axis=1))
    by_lines = [one for one, line in zip(parts, is_line.tolist(), strict=True) if line]
    return Sweep(
        heading_rad=headings[best],
        path=path,
        is_line=is_line,
        wanted=wanted,
        reachable=ground.reachable,
        by_lines=wanted & ground.swept(by_lines),
        by_path=wanted & ground.swept(parts),
    )


@dataclass(frozen=True, eq=False)
class _Ground:
    """Where the robot may drive while it covers, and what it can cover from there."""

    inside: Mask  # (rows, cols): wanted cells of the part
    reachable: Mask  # (rows, cols): wanted cells within half of the width of these
    fields: tuple[tuple[shapely.Polygon, Floats], ...]  # pieces of `inside`, (x, y) of columns and rows, with
    # the centres (n, 2), also x and y, of the reachable cells nearest to each
    width: float

    @property
    def min_gain(self) -> float:
        """Return the number of cells that a line covers alone, at least."""
        return min(MIN_GAIN * self.width**2, MIN_SHARE * float(self.reachable.sum()))

    def near(self, line: Floats) -> NDArray[np.int64]:
        """Return the flat indices of the cells whose centres lie within half of the width of a line."""
        reach, (rows, cols) = self.width / 2, self.inside.shape
        low, high = line.min(axis=0) - reach, line.max(axis=0) + reach
        top, left = np.maximum(np.floor(low), 0).astype(int).tolist()
        bottom, right = np.minimum(np.ceil(high), (rows, cols)).astype(int).tolist()
        y, x = np.arange(top, bottom)[:, None] + 0.5, np.arange(left, right)[None] + 0.5
        (row, col), step = line[0], line[1] - line[0]
        length = float(step @ step)
        t = ((y - row) * step[0] + (x - col) * step[1]) / length if length else np.zeros_like(y + x)
        t = np.clip(t, 0, 1)
        squares = (y - row - t * step[0]) ** 2 + (x - col - t * step[1]) ** 2
        found_rows, found_cols = np.nonzero(squares <= (reach + TOLERANCE) ** 2)
        return np.asarray((found_rows + top) * cols + found_cols + left)

    def swept(self, lines: Lines) -> Mask:
        """Return the cells (rows, cols) whose centres lie within half of the width of one of some lines."""
        swept = np.zeros(self.inside.size, np.bool_)
        for line in lines:
            swept[self.near(line)] = True
        return swept.reshape(self.inside.shape)

    def missed(self, lines: Lines) -> Mask:
        """Return the reachable cells (rows, cols) that lines do not cover."""
        return self.reachable & ~self.swept(lines)

    def needed(self, items: list[list[Lines]]) -> list[list[Lines]]:
        """Leave out lines that cover next to nothing alone, the shortest first."""
        flat = [line for chain in items for lines in chain for line in lines]
        swept = [self.near(line) for line in flat]
        count = np.zeros(self.inside.size, np.int64)
        for cells in swept:
            count[cells] += 1
        reachable = self.reachable.ravel()
        dropped: set[int] = set()
        for k in np.argsort([path_length(line) for line in flat], kind="stable").tolist():
            alone = (count[swept[k]] == 1) & reachable[swept[k]]
            if alone.sum() < self.min_gain and len(dropped) < len(flat) - 1:
                count[swept[k]] -= 1
                dropped.add(id(flat[k]))
        kept = [[[line for line in lines if id(line) not in dropped] for lines in chain] for chain in items]
        return [chain for chain in ([lines for lines in chain if lines] for chain in kept) if chain]


def _ground(wanted: Mask, inside: Mask, width: float) -> _Ground:
    away, nearest = distance_transform_edt(~inside, return_indices=True)
    reachable = wanted & (away <= width / 2 + TOLERANCE)
    with changing_filters():  # rasterio changes them itself
        outlines = [shape for shape, _ in shapes(inside.astype(np.uint8), inside, connectivity=4)]
    polygons = [shapely.geometry.shape(one) for one in outlines]
    rows, cols = np.nonzero(reachable)
    at = nearest[:, rows, cols] + 0.5
    centres = np.stack([cols, rows], axis=1) + 0.5
    fields = [(one, centres[shapely.contains_xy(one, at[1], at[0])]) for one in polygons]
    return _Ground(inside=inside, reachable=reachable, fields=tuple(fields), width=width)


def _headings(ground: _Ground) -> list[float]:
    """Return headings to try: in steps, and along the sides of the smallest rectangle around all."""
    around = shapely.minimum_rotated_rectangle(shapely.union_all([one for one, _ in ground.fields]))
    x, y = shapely.get_coordinates(around)[:2].T
    side = math.degrees(math.atan2(y[-1] - y[0], x[-1] - x[0]))
    degrees = [*np.arange(0, 180, STEP_DEG).tolist(), *((side + turn) % 180 for turn in (0, 90))]
    return [math.radians(one) for one in dict.fromkeys(round(one, 3) % 180 for one in degrees)]


def _axes(heading_rad: float) -> Floats:
    """Return the unit vectors along lines and across them as columns (2, 2), in x and y."""
    cosine, sine = (round(one, 12) + 0.0 for one in (math.cos(heading_rad), math.sin(heading_rad)))
    return np.array([[cosine, -sine], [sine, cosine]])


def _chains(ground: _Ground, heading_rad: float) -> list[list[Lines]]:
    """Lay lines of one heading: for each chain of neighbouring strips, the parts of the line of each."""
    turn, result = _axes(heading_rad), []
    for polygon, centres in ground.fields:
        turned = shapely.transform(polygon, lambda xy: xy @ turn)
        for cell in _field_lines(turned, centres @ turn[:, 1], ground.width):
            ends = (cell @ turn.T)[:, :, ::-1]  # row, col
            chain = [runs_over(ground.inside, *line) for line in ends]
            if any(chain):
                result.append([lines for lines in chain if lines])
    return result


def _field_lines(polygon: shapely.Polygon, heights: Floats, width: float) -> list[Floats]:
    """Return lines along x over a polygon, cell by cell, that cover heights (n,) beside it too.

    The first line and the last lie half of a strip from the lowest and the highest of them, but within the
    polygon: along its edge, where a wall is farther from it than half of the width.
    """
    _, south, _, north = shapely.bounds(polygon)
    low, high = float(heights.min()) - 0.5, float(heights.max()) + 0.5
    count = max(math.ceil((high - low) / width - TOLERANCE), 1)
    strip = (high - low) / count
    first, last = max(south + 0.5, low + strip / 2), min(north - 0.5, high - strip / 2)
    spacing = (last - first) / (count - 1) if count > 1 else width
    if spacing < 1 or count == 1:
        first, spacing = min(max((low + high) / 2, south), north), max(width, north - south)
    start = min(first - spacing / 2, south)
    return grid_lines(polygon, spacing, (0.0, 0.0), lambda a, b: np.zeros(len(a), np.bool_), start)


def _flat(chains: list[list[Lines]]) -> Lines:
    return [line for chain in chains for lines in chain for line in lines]


def _cost(ground: _Ground, chains: list[list[Lines]]) -> float:
    """Return the driving over lines, turns among it, and over what they do not cover."""
    lines = _flat(chains)
    left = float(ground.missed(lines).sum())
    return sum(map(path_length, lines)) + TURN * ground.width * len(lines) + 2 * left / ground.width


def _fill(ground: _Ground, heading_rad: float, missing: Mask, min_gain: float) -> Lines:
    """Return lines that each cover so many missing cells, along and across (lazy greedy set cover)."""
    turn = _axes(heading_rad)[::-1].T  # rows: along and across, as row and col
    found = [*_candidates(ground, missing, turn), *_candidates(ground, missing, turn[::-1])]
    swept, left = [ground.near(line) for line in found], missing.ravel().copy()

    def worth(k: int) -> float:
        gain = float(left[swept[k]].sum())
        return gain / (path_length(found[k]) + ground.width) if gain >= min_gain else 0.0

    queue = [(-worth(k), k) for k in range(len(found))]
    heapq.heapify(queue)
    chosen: Lines = []
    while queue and queue[0][0] < 0:
        _, k = heapq.heappop(queue)
        now = worth(k)
        if queue and -queue[0][0] > now:
            if now > 0:
                heapq.heappush(queue, (-now, k))
        elif now > 0:
            gained = swept[k][left[swept[k]]]
            line = _trimmed(found[k], np.stack(np.divmod(gained, missing.shape[1]), axis=1) + 0.5)
            left[ground.near(line)] = False
            chosen.append(line)
    return chosen


def _candidates(ground: _Ground, missing: Mask, axes: Floats) -> Iterator[Floats]:
    """Yield lines along the first of two axes, over drivable cells from which missing cells are covered."""
    if not missing.any():
        return
    near = ground.inside & (distance_transform_edt(~missing) <= ground.width / 2 + TOLERANCE)
    centres = np.argwhere(near) + 0.5
    along, across = (centres @ axes.T).T
    lane = np.floor(across + 0.25).astype(np.int64)
    order = np.lexsort((along, lane))
    ends = np.flatnonzero((np.diff(lane[order]) != 0) | (np.diff(along[order]) > ground.width))
    for lot in np.split(order, ends + 1):
        reach = along[lot[[0, -1]], None] + [[-SHORTEST / 2], [SHORTEST / 2]]
        yield from runs_over(ground.inside, *(reach * axes[0] + across[lot[0]] * axes[1]))


def _trimmed(line: Floats, places: Floats) -> Floats:
    """Return the part of a line beside places (n, 2); a short one where they lie past an end."""
    step = line[1] - line[0]
    length = float(np.hypot(*step))
    t = np.clip((places - line[0]) @ step / length**2, 0, 1)
    more = max(SHORTEST / length - np.ptp(t), 0.0) / 2
    ends = np.clip([t.min() - more, t.max() + more], 0, 1)
    return np.asarray(line[0] + ends[:, None] * step)


def _drive(space: FreeSpace, items: list[list[Lines]], start: Floats | None) -> tuple[Floats, Bools]:
    """Drive all chains, each time the one that begins nearest: corners (n, 2), and which parts are lines."""
    orders = [_orders(chain) for chain in items]
    left = dict.fromkeys(range(len(items)))
    path: Lines = [] if start is None else [start[None]]
    is_line: list[bool] = []
    while left:
        if path:
            k, way, leg = _nearest(space, path[-1][-1], {k: orders[k] for k in left})
            path.append(leg[1:])
            is_line += [False] * (len(leg) - 1)
        else:
            k, way = 0, 0
            path.append(orders[0][0][0][:1])
        del left[k]
        lines = orders[k][way]
        for number, line in enumerate(lines):
            if number:
                leg = space.leg(path[-1][-1], line[0])
                path.append(leg[1:])
                is_line += [False] * (len(leg) - 1)
            path.append(line[1:])
            is_line.append(True)
    return np.concatenate(path), np.array(is_line, np.bool_)


def _orders(chain: list[Lines]) -> list[Lines]:
    """Return the orders of the lines of a chain, to and fro from each of its corners, in their directions."""
    orders: list[Lines] = []
    for order in to_and_fro(range(len(chain))):
        lines: Lines = []
        for one in order.tolist():
            parts = chain[one // 2]
            lines += [part[::-1] for part in parts[::-1]] if one % 2 else parts
        orders.append(lines)
    return orders


def _nearest(space: FreeSpace, here: Floats, orders: dict[int, list[Lines]]) -> tuple[int, int, Floats]:
    """Return the chain that begins nearest, which of its orders, and the leg to it; of equals the first."""
    begins = [(k, way, lines[0][0]) for k, some in orders.items() for way, lines in enumerate(some)]
    straight = np.hypot(*(np.array([place for _, _, place in begins]) - here).T)
    best: tuple[float, int, int, Floats] | None = None
    for n in np.argsort(straight.round(9), kind="stable").tolist():
        if best is not None and straight[n] >= best[0]:
            break
        k, way, place = begins[n]
        leg = space.leg(here, place)
        length = path_length(leg)
        if best is None or length < best[0] - TOLERANCE:
            best = length, k, way, leg
    assert best is not None, "there is a chain"
    return best[1:]
