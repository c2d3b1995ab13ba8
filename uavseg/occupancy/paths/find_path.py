"""Path planning: the shortest path between two positions in one region of a map, or why there is none.

A path cuts no corner, so cells are connected where they share an edge.
"""

import math
from collections.abc import Collection, Iterable, Iterator
from functools import cached_property, partial
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, PathError
from uavseg.execution.executors import Map, serial
from uavseg.occupancy.paths.any_angle import pull_string
from uavseg.occupancy.paths.astar import shortest_path
from uavseg.occupancy.paths.clearance import clearance, is_at_least
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps, line_length
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import Rasteriser, Rings
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

Cell = tuple[int, int]
_STRIPE = 1 << 22  # cells of a stripe, which are read together


@dataclass(frozen=True, slots=True)
class MapPosition:
    """The start or the goal, and what the map holds there."""

    name: str  # "start" or "goal"
    cell: tuple[int, int]  # row and column
    region: int  # 0 outside of all regions
    value: float | None  # v of its cell; None where it is not valid
    is_free: bool

    @property
    def where(self) -> str:
        """Return "region 2", or why the position is not free."""
        value = "no valid value" if self.value is None else f"v = {self.value:.3f}"
        if not self.region:
            return f"no region (its cell has {value})"
        return f"region {self.region}" + ("" if self.is_free else f", on a cell out of the range ({value})")


NearestCell = tuple[float, int, float, float]
"""A free cell: its distance in metres from a position, its region, and its centre (x, y) on the map."""


@dataclass(frozen=True)
class FreeCells:
    """The free cells of a map whose regions are known: in a region, and with their value in range.

    The mean of a block hides walls that are a cell or two thin, so a region alone is not passable throughout.
    """

    source: GreySource  # the map
    rings: Rings  # outlines of its regions
    interval: IntensityRange  # the range of v that is passable
    warnings: tuple[str, ...] = ()

    @property
    def geobox(self) -> GeoBox:
        """Return the position of the cells."""
        return self.source.dataset.geobox

    def place(self, name: str, xy: tuple[float, float]) -> MapPosition:
        """Look up a position in map coordinates, named "start" or "goal"; refuse one outside of the map."""
        if not all(map(isfinite, xy)):
            raise PathError(f"the {name} is two finite numbers, x and y on the map, not {_pair(*xy)}")
        box = self.geobox
        col, row = ~box.transform * xy
        if not (0 <= row < box.shape[0] and 0 <= col < box.shape[1]):
            raise PathError(f"the {name} {_pair(*xy)} lies outside of the map, which has {_extent(box)}")
        here = Window(int(row), int(col), 1, 1)
        tile = self.source.read(here, 0)
        value = tile.grey[0, 0] / GREY_MAX if tile.valid[0, 0] else None
        region = int(self._rasteriser(here)[0, 0])
        low, high = self.interval.greys
        free = region > 0 and value is not None and bool(low <= tile.grey[0, 0] <= high)
        return MapPosition(name=name, cell=(here.row, here.col), region=region, value=value, is_free=free)

    def of_regions(self, regions: Collection[int], map: Map = serial) -> tuple[Window, Bools, int]:
        """Return window and mask (rows, cols) of free cells of regions, and how many are out of range."""
        rings = self.rings.select(np.isin(self.rings.labels, list(regions)))
        top, left = rings.vertices.min(axis=0).tolist()
        bottom, right = rings.vertices.max(axis=0).tolist()
        window = Window(top, left, bottom - top, right - left)
        mask = np.zeros((window.rows, window.cols), np.bool_)
        walls = 0
        for stripe, (labels, free) in self._read_stripes(rings, window, map):
            mask[stripe.row - top : stripe.row - top + stripe.rows] = free
            walls += int((labels > 0).sum() - free.sum())
        return window, mask, walls

    def nearest(self, place: MapPosition, region: int | None = None, map: Map = serial) -> NearestCell | None:
        """Find the free cell nearest to a position, in one region or in any; None if there is none."""
        rings = self.rings if region is None else self.rings.select(self.rings.labels == region)
        row, col = place.cell
        width, height = ground_steps(self.geobox, row + 0.5, col + 0.5)
        best: tuple[float, int, int, int] | None = None
        for stripe, (labels, free) in self._read_stripes(rings, Window(0, 0, *self.geobox.shape), map):
            rows, cols = np.nonzero(free)
            if len(rows):
                away = np.hypot((rows + stripe.row - row) * height, (cols + stripe.col - col) * width)
                k = int(np.argmin(away))
                near = (float(away[k]), int(rows[k]) + stripe.row, int(cols[k]) + stripe.col)
                if best is None or near < best[:3]:
                    best = (*near, int(labels[rows[k], cols[k]]))
        if best is None:
            return None
        x, y = self.geobox.xy_from_pixel(best[1] + 0.5, best[2] + 0.5)
        return best[0], best[3], float(x), float(y)

    def grey_span(self, cells: Integers) -> tuple[int, int] | None:
        """Return the lowest and the highest grey of (n, 2) cells; None if one is invalid."""
        (top, left), (bottom, right) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
        tile = self.source.read(Window(top, left, bottom - top + 1, right - left + 1), 0)
        rows, cols = (cells - (top, left)).T
        if not tile.valid[rows, cols].all():
            return None
        grey = tile.grey[rows, cols]
        return int(grey.min()), int(grey.max())

    @cached_property
    def _rasteriser(self) -> Rasteriser:
        return Rasteriser(self.rings)

    def _read_stripes(
        self, rings: Rings, window: Window, map: Map
    ) -> Iterable[tuple[Window, tuple[Uint32s, Bools]]]:
        """Read a window stripe by stripe: labels of some regions, and the free cells among them."""
        count = max(_STRIPE // max(window.cols, 1), 1)
        stripes = [
            Window(window.row + row, window.col, min(count, window.rows - row), window.cols)
            for row in range(0, window.rows, count)
        ]
        read = map(partial(self._read_window, Rasteriser(rings)), stripes)
        return zip(stripes, read, strict=True)

    def _read_window(self, rasteriser: Rasteriser, window: Window) -> tuple[Uint32s, Bools]:
        labels = rasteriser(window)
        low, high = self.interval.greys
        if not labels.any():
            return labels, np.zeros(labels.shape, np.bool_)
        tile = self.source.read(window, 0)
        here = slice(window.rows), slice(window.cols)
        grey, valid = tile.grey[here], tile.valid[here] > 0
        return labels, np.asarray((labels > 0) & valid & (grey >= low) & (grey <= high))


def _pair(x: float, y: float) -> str:
    return f"{x:.12g},{y:.12g}"


def _extent(box: GeoBox) -> str:
    x, y = box.corners
    return f"x {x.min():.12g}..{x.max():.12g} and y {y.min():.12g}..{y.max():.12g}"


def why_apart(free: FreeCells, start: MapPosition, goal: MapPosition, map: Map) -> str:
    """Explain why no path can connect two positions, and name the free cells nearest to them."""
    positions = f"the start lies in {start.where} and the goal in {goal.where}"
    nearest = []
    for place, other in ((start, goal), (goal, start)):
        if place.is_free and (place is start or not other.is_free):
            continue
        region = other.region if other.is_free else None
        near = free.nearest(place, region, map)
        if near is None:
            return f"{positions}; no cell of the map is free"
        metres, its_region, x, y = near
        nearest.append(
            f"the nearest free cell{'' if region is None else f' of region {region}'} is {metres:.4g} m "
            f"from the {place.name}, at {_pair(x, y)}"
            + (f" in region {its_region}" if region is None else "")
        )
    return "; ".join([positions, *nearest])


def why_closed(
    free: FreeCells,
    ends: tuple[MapPosition, MapPosition],
    window: Window,
    mask: Bools,
    sides: tuple[float, float],
    clearance_m: float,
) -> str:
    """Explain where the path between two free cells is closed, and which option would open it.

    `ends` are start and goal, `sides` width and height of a cell in metres. `mask` (rows, cols) are the free
    cells of the regions of both ends, in `window` of the map.
    """
    offset = np.array([window.row, window.col])
    start, goal = ((end.cell[0] - window.row, end.cell[1] - window.col) for end in ends)
    if clearance_m > 0:
        largest = _largest_clearance(clearance(mask, *sides), start, goal)
        if largest > 0:
            return (
                f"every passage is too narrow for a clearance of {clearance_m:g} m; a path with at "
                f"most {_floored(largest):g} m exists (--clearance)"
            )
    here, there, routes = _narrowest_gap(mask, start, goal, *sides)
    x, y = free.geobox.xy_from_pixel(*(offset + (np.add(here, there) + 1) / 2))
    where = "both lie in region {0}" if ends[0].region == ends[1].region else "{1} and {2}"
    where = where.format(ends[0].region, *(f"the {place.name} lies in {place.where}" for place in ends))
    spans = [span for cells in routes if (span := free.grey_span(cells + offset)) is not None]
    nearest = f"{where}, which come nearest to each other at {x:.12g},{y:.12g}"
    if not spans:
        return f"{nearest}, where the map has no values"
    low, high = min(spans, key=lambda span: span[1] - span[0])
    lowest, highest = free.interval.greys
    if lowest <= low and high <= highest:
        return f"{nearest}, where cells in the range belong to no region; --refine pixels joins the two there"
    # v in thousandths, rounded outwards, so that the new range holds the greys
    below, above = math.floor(low * 1000 / GREY_MAX) / 1000, math.ceil(high * 1000 / GREY_MAX) / 1000
    below, above = min(below, free.interval.low), max(above, free.interval.high)
    values = f"{low / GREY_MAX:.3f}" + ("" if low == high else f" to {high / GREY_MAX:.3f}")
    return f"{nearest}, where v is {values}; --range {below:g},{above:g} joins them there"


def _floored(metres: float) -> float:
    unit = 10.0 ** (math.floor(math.log10(metres)) - 3)
    return float(f"{math.floor(metres / unit) * unit:.4g}")


def _narrowest_gap(
    mask: Bools, start: Cell, goal: Cell, width: float, height: float
) -> tuple[Cell, Cell, list[Integers]]:
    """Find the nearest cells of the components of two cells, and the cells of two L-shaped routes between.

    Examples
    --------
    >>> here, there, routes = _narrowest_gap(np.array([[1, 1, 0, 0, 1]], bool), (0, 0), (0, 4), 1.0, 1.0)
    >>> here, there, routes[0].tolist()
    ((0, 1), (0, 4), [[0, 2], [0, 3]])
    """
    import shapely
    from scipy.ndimage import binary_erosion

    labels = _connected(mask)
    parts = (labels == labels[cell] for cell in (start, goal))
    ours, theirs = (np.argwhere(part & ~binary_erosion(part)) for part in parts)  # cells beside others
    tree = shapely.STRtree(shapely.points(ours * (height, width)))
    (at, nearest), away = tree.query_nearest(
        shapely.points(theirs * (height, width)), return_distance=True, all_matches=False
    )
    k = int(np.argmin(away))
    (row, col), (last_row, last_col) = ours[nearest[k]].tolist(), theirs[at[k]].tolist()
    rows, cols = _steps(row, last_row), _steps(col, last_col)
    down = [*((r, col) for r in rows), *((last_row, c) for c in cols[1:])]
    across = [*((row, c) for c in cols), *((r, last_col) for r in rows[1:])]
    routes = [np.array(route[1:-1], np.int64).reshape(-1, 2) for route in (down, across)]
    return (row, col), (last_row, last_col), routes


def _largest_clearance(distance: Floats, start: Cell, goal: Cell) -> float:
    """Find the largest clearance with which a path connects two cells, by bisection; 0 where none does."""
    known = np.unique(distance[(distance > 0) & (distance <= min(distance[start], distance[goal]))])
    open_, closed = -1, len(known)
    while closed - open_ > 1:
        middle = (open_ + closed) // 2
        labels = _connected(is_at_least(distance, known[middle]))
        if labels[start] == labels[goal]:
            open_ = middle
        else:
            closed = middle
    return 0.0 if open_ < 0 else float(known[open_])


def _connected(mask: Bools) -> NDArray[Any]:
    """Label the 4-connected components, 0 where the mask is false."""
    from scipy.ndimage import label

    return np.asarray(label(mask)[0])


def _steps(first: int, last: int) -> range:
    return range(first, last - 1, -1) if last < first else range(first, last + 1)


_SQUARE_TOLERANCE = 0.01  # relative difference of the sides of a cell that counts as square


@dataclass(frozen=True, slots=True)
class PathParams:
    """Parameters of a path, besides its ends."""

    # Distance that the centres of the path's cells keep from every impassable cell; 0 for none.
    clearance_m: float = 0.0
    smooth: bool = False  # whether the path is shortened by string pulling, at any angle

    def __post_init__(self) -> None:
        if not (math.isfinite(self.clearance_m) and self.clearance_m >= 0):
            raise ParameterError(
                f"a clearance in metres is finite and not negative, not {self.clearance_m:g}"
            )


@dataclass(frozen=True)
class PlannedPath:
    """A path on the map."""

    # (n, 2) int64; row and column of the cells where it begins, turns and ends; it is straight between their
    # centres.
    corners: Integers
    geobox: GeoBox  # of the map
    length_m: float  # on the ground; in units of the map if it has no CRS
    cells: int  # number of cells of the path before string pulling
    expanded: int  # number of cells that the search expanded
    clearance_m: float  # the requested clearance
    region: int = 0  # the region's label
    walls: int = 0  # number of cells of the region that are impassable because of their value
    warnings: tuple[str, ...] = ()

    @property
    def xy(self) -> Floats:
        """Return the corners in map coordinates, an (n, 2) array."""
        return np.stack(self.geobox.xy_from_pixel(*(self.corners.T + 0.5)), axis=1)


def find_path(
    free: FreeCells,
    start: tuple[float, float],
    goal: tuple[float, float],
    params: PathParams = PathParams(),
    map: Map = serial,
) -> PlannedPath:
    """Find the shortest path between two positions (x, y) in one region, over cells with values in range."""
    first, last = free.place("start", start), free.place("goal", goal)
    if not (first.is_free and last.is_free):
        raise PathError(why_apart(free, first, last, map))
    window, mask, walls = free.of_regions({first.region, last.region}, map)
    offset = np.array([window.row, window.col])
    sides = ground_steps(free.geobox, window.row + window.rows / 2, window.col + window.cols / 2)
    start_cell, goal_cell = (
        (place.cell[0] - window.row, place.cell[1] - window.col) for place in (first, last)
    )
    kept = mask
    if params.clearance_m > 0:
        kept = _with_clearance(mask, params.clearance_m, sides, {"start": start_cell, "goal": goal_cell})
    try:
        path = shortest_path(kept, start_cell, goal_cell)
    except PathError:
        reason = why_closed(free, (first, last), window, mask, sides, params.clearance_m)
        raise PathError(f"no path leads from the start to the goal: {reason}") from None
    corners = offset + (pull_string(kept, path.cells) if params.smooth else _turning_cells(path.cells))
    return PlannedPath(
        corners=corners,
        geobox=free.geobox,
        length_m=line_length(free.geobox, *(corners + 0.5).T),
        cells=len(path.cells),
        expanded=path.expanded,
        clearance_m=params.clearance_m,
        region=first.region,
        walls=walls,
        warnings=(*free.warnings, *_warnings(*sides)),
    )


def _with_clearance(mask: Bools, metres: float, sides: tuple[float, float], ends: dict[str, Cell]) -> Bools:
    """Return the cells that keep a clearance; refuse a start or goal without it."""
    distance = clearance(mask, *sides)
    for name, cell in ends.items():
        if not is_at_least(distance[cell], metres):
            raise PathError(
                f"a clearance of {metres:g} m leaves no room at the {name}, which is {distance[cell]:.4g} m "
                f"from the nearest impassable cell (the largest clearance in its region is "
                f"{distance.max():.4g} m)"
            )
    return np.asarray(is_at_least(distance, metres) & mask)


def _turning_cells(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the cells where a path turns, and its ends."""
    steps = np.diff(cells, axis=0)
    turning = (steps[1:] != steps[:-1]).any(axis=1)
    return cells[np.concatenate([[True], turning, [True]])] if len(cells) > 1 else cells


def _warnings(width: float, height: float) -> Iterator[str]:
    if abs(width - height) > _SQUARE_TOLERANCE * max(width, height):
        yield (
            f"cells are {width:.4g} m wide and {height:.4g} m high: the path is the shortest in cells, "
            "which need not be the shortest in metres; reproject the map to square cells"
        )
