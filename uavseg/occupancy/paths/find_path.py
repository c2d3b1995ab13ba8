"""Path planning: the shortest path between two positions in one region of a map, in metres."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, PathError
from uavseg.execution.executors import Map, serial
from uavseg.occupancy.paths.any_angle import pull_string
from uavseg.occupancy.paths.astar import shortest_path
from uavseg.occupancy.paths.clearance import clearance, is_at_least
from uavseg.occupancy.paths.closed_way import largest_clearance, narrowest_gap
from uavseg.occupancy.paths.free_cells import FreeCells, MapPosition
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps, line_length
from uavseg.units import GREY_MAX

Cell = tuple[int, int]

_SQUARE_TOLERANCE = 0.01  # relative difference of the sides of a cell that counts as square


@dataclass(frozen=True, slots=True)
class PathParams:
    """Parameters of a path, besides its ends.

    Parameters
    ----------
    clearance_m : float
        Distance that the centres of the path's cells keep from every impassable cell; 0 for none.
    smooth : bool
        Whether the path is shortened by string pulling, at any angle.

    Raises
    ------
    ParameterError
        If the clearance is negative or not finite.
    """

    clearance_m: float = 0.0
    smooth: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.clearance_m) and self.clearance_m >= 0):
            raise ParameterError(
                f"a clearance in metres is finite and not negative, not {self.clearance_m:g}"
            )


@dataclass(frozen=True)
class PlannedPath:
    """A path on the map.

    Parameters
    ----------
    corners : (n, 2) int64 array
        Row and column of the cells where it begins, turns and ends; it is straight between their centres.
    geobox : GeoBox
        Of the map.
    length_m : float
        On the ground; in units of the map if it has no CRS.
    cells : int
        Number of cells of the path before string pulling.
    expanded : int
        Number of cells that the search expanded.
    clearance_m : float
        The requested clearance.
    region : int
        The region's label.
    walls : int
        Number of cells of the region that are impassable because of their own value.
    warnings : tuple of str
    """

    corners: NDArray[np.int64]
    geobox: GeoBox
    length_m: float
    cells: int
    expanded: int
    clearance_m: float
    region: int
    walls: int
    warnings: tuple[str, ...]

    @property
    def xy(self) -> NDArray[np.float64]:
        """The corners in map coordinates, an (n, 2) array."""
        return np.stack(self.geobox.xy_from_pixel(*(self.corners.T + 0.5)), axis=1)


def find_path(
    free: FreeCells,
    start: tuple[float, float],
    goal: tuple[float, float],
    params: PathParams = PathParams(),
    map: Map = serial,
) -> PlannedPath:
    """The shortest path between two positions in one region, over cells whose own value is in range.

    Parameters
    ----------
    free : FreeCells
    start, goal : (float, float)
        x and y on the map.
    params : PathParams
    map : Map
        Executor that reads the region's cells.

    Raises
    ------
    PathError
        If a position lies outside of the map or in no region, the two lie in different regions, or no path
        leads from one to the other.
    """
    first, last = free.place("start", start), free.place("goal", goal)
    if not (first.is_free and last.is_free):
        raise PathError(_explain_apart(free, first, last, map))
    window, mask, walls = free.of_regions({first.region, last.region}, map)
    offset = np.array([window.row, window.col])
    row, col = window.row + window.rows / 2, window.col + window.cols / 2
    width, height = ground_steps(free.geobox, row, col)
    start_cell, goal_cell = (_relative(place.cell, offset) for place in (first, last))
    kept = mask
    if params.clearance_m > 0:
        kept = _with_clearance(
            mask, params.clearance_m, (width, height), {"start": start_cell, "goal": goal_cell}
        )
    try:
        path = shortest_path(kept, start_cell, goal_cell)
    except PathError:
        reason = _what_closes(free, (first, last), mask, offset, (width, height), params)
        raise PathError(f"no path leads from the start to the goal: {reason}") from None
    corners = offset + (pull_string(kept, path.cells) if params.smooth else _turning_cells(path.cells))
    return PlannedPath(
        corners,
        free.geobox,
        line_length(free.geobox, *(corners + 0.5).T),
        len(path.cells),
        path.expanded,
        params.clearance_m,
        first.region,
        walls,
        (*free.warnings, *_warnings(width, height)),
    )


def _relative(cell: Cell, offset: NDArray[np.int64]) -> Cell:
    return cell[0] - int(offset[0]), cell[1] - int(offset[1])


def _explain_apart(free: FreeCells, start: MapPosition, goal: MapPosition, map: Map) -> str:
    """Message for two positions that no path can connect, with the free cells nearest to them."""
    positions = f"the start lies in {start.where} and the goal in {goal.where}"
    nearest = []
    for place, other in ((start, goal), (goal, start)):
        if place.is_free and (place is start or not other.is_free):
            continue
        region = other.region if other.is_free else None
        near = free.nearest(place, region, map)
        if near is None:
            return f"{positions}; no cell of the map is free"
        nearest.append(
            f"the nearest free cell{'' if region is None else f' of region {region}'} is {near.metres:.4g} m "
            f"from the {place.name}, at {near.x:.12g},{near.y:.12g}"
            + (f" in region {near.region}" if region is None else "")
        )
    return "; ".join([positions, *nearest])


def _with_clearance(
    mask: NDArray[np.bool_], metres: float, side: tuple[float, float], ends: dict[str, Cell]
) -> NDArray[np.bool_]:
    """The cells that keep a clearance; start and goal must be among them."""
    distance = clearance(mask, *side)
    for name, cell in ends.items():
        if not is_at_least(distance[cell], metres):
            raise PathError(
                f"a clearance of {metres:g} m leaves no room at the {name}, which is {distance[cell]:.4g} m "
                f"from the nearest impassable cell (the largest clearance in its region is "
                f"{distance.max():.4g} m)"
            )
    return np.asarray(is_at_least(distance, metres) & mask)


def _turning_cells(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cells where a path turns, and its ends."""
    steps = np.diff(cells, axis=0)
    turning = (steps[1:] != steps[:-1]).any(axis=1)
    return cells[np.concatenate([[True], turning, [True]])] if len(cells) > 1 else cells


def _warnings(width: float, height: float) -> Iterator[str]:
    if abs(width - height) > _SQUARE_TOLERANCE * max(width, height):
        yield (
            f"cells are {width:.4g} m wide and {height:.4g} m high: the path is the shortest in cells, "
            "which need not be the shortest in metres; reproject the map to square cells"
        )


def _what_closes(
    free: FreeCells,
    ends: tuple[MapPosition, MapPosition],
    mask: NDArray[np.bool_],
    offset: NDArray[np.int64],
    sides: tuple[float, float],
    params: PathParams,
) -> str:
    """Why no path connects two free cells, where, and which option would open a way."""
    start, goal = (_relative(place.cell, offset) for place in ends)
    if params.clearance_m > 0:
        largest = largest_clearance(clearance(mask, *sides), start, goal)
        if largest > 0:
            return (
                f"every passage is too narrow for a clearance of {params.clearance_m:g} m; a path with at "
                f"most {_floored(largest):g} m exists (--clearance)"
            )
    gap = narrowest_gap(mask, start, goal, *sides)
    x, y = free.geobox.xy_from_pixel(*(offset + (np.add(gap.here, gap.there) + 1) / 2))
    where = "both lie in region {0}" if ends[0].region == ends[1].region else "{1} and {2}"
    where = where.format(ends[0].region, *(f"the {place.name} lies in {place.where}" for place in ends))
    spans = [span for way in gap.ways if (span := free.grey_span(way + offset)) is not None]
    nearest = f"{where}, which come nearest to each other at {x:.12g},{y:.12g}"
    if not spans:
        return f"{nearest}, where the map has no values"
    low, high = min(spans, key=lambda span: span[1] - span[0])
    lowest, highest = free.interval.greys
    if lowest <= low and high <= highest:
        return f"{nearest}, where cells in the range belong to no region; --refine pixels joins the two there"
    ends_of_range = min(_down(low), free.interval.low), max(_up(high), free.interval.high)
    values = f"{low / GREY_MAX:.3f}" + ("" if low == high else f" to {high / GREY_MAX:.3f}")
    return (
        f"{nearest}, where v is {values}; --range {ends_of_range[0]:g},{ends_of_range[1]:g} joins them there"
    )


def _down(grey: int) -> float:
    """v in thousandths, not more than that of a grey."""
    return math.floor(grey * 1000 / GREY_MAX) / 1000


def _up(grey: int) -> float:
    """v in thousandths, not less than that of a grey."""
    return math.ceil(grey * 1000 / GREY_MAX) / 1000


def _floored(metres: float) -> float:
    """A length with four significant digits, not more than it is."""
    unit = 10.0 ** (math.floor(math.log10(metres)) - 3)
    return float(f"{math.floor(metres / unit) * unit:.4g}")
