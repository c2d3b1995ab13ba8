"""Path planning: the shortest path between two positions in one region of a map."""

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
from uavseg.occupancy.paths.diagnosis import why_apart, why_closed
from uavseg.occupancy.paths.free_cells import FreeCells
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps, line_length

Cell = tuple[int, int]

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
    corners: NDArray[np.int64]
    geobox: GeoBox  # of the map
    length_m: float  # on the ground; in units of the map if it has no CRS
    cells: int  # number of cells of the path before string pulling
    expanded: int  # number of cells that the search expanded
    clearance_m: float  # the requested clearance
    region: int  # the region's label
    walls: int  # number of cells of the region that are impassable because of their value
    warnings: tuple[str, ...]

    @property
    def xy(self) -> NDArray[np.float64]:
        """Return the corners in map coordinates, an (n, 2) array."""
        return np.stack(self.geobox.xy_from_pixel(*(self.corners.T + 0.5)), axis=1)


def find_path(
    free: FreeCells,
    start: tuple[float, float],
    goal: tuple[float, float],
    params: PathParams = PathParams(),
    map: Map = serial,
) -> PlannedPath:
    """Find the shortest path between two positions in one region, over cells whose value is in range.

    Parameters
    ----------
    free : FreeCells
    start, goal : (float, float)
        x and y on the map.
    params : PathParams
    map : Map
        Executor that reads the region's cells.
    """
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


def _with_clearance(
    mask: NDArray[np.bool_], metres: float, sides: tuple[float, float], ends: dict[str, Cell]
) -> NDArray[np.bool_]:
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
