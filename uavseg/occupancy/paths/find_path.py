"""A way over a map: from two places in one region of it to a path in metres."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, PathError
from uavseg.execution.executors import Map, serial
from uavseg.occupancy.paths.any_angle import tightened
from uavseg.occupancy.paths.astar import Path, shortest_path
from uavseg.occupancy.paths.clearance import clearance, reaches
from uavseg.occupancy.paths.free_cells import FreeCells, Place
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.ground import ground_steps, line_length

Cell = tuple[int, int]

_SQUARE = 0.01  # sides of a cell that differ by less are of one length


@dataclass(frozen=True, slots=True)
class WayParams:
    """Which way is wanted, beyond where it begins and ends.

    Parameters
    ----------
    clearance_m : float
        How far the centres of cells are at least from every impassable cell; 0 for any distance.
    smooth : bool
        Whether the path is pulled tight.

    Raises
    ------
    ParameterError
        If the clearance is negative or no number.
    """

    clearance_m: float = 0.0
    smooth: bool = False

    def __post_init__(self) -> None:
        if not (isfinite(self.clearance_m) and self.clearance_m >= 0):
            raise ParameterError(f"a clearance is metres that are not negative, not {self.clearance_m:g}")


@dataclass(frozen=True)
class Way:
    """A path on the map.

    Parameters
    ----------
    corners : (n, 2) int64 array
        Row and column of the cells where it begins, turns and ends; it is straight between their centres.
    geobox : GeoBox
        Of the map.
    length_m : float
        On the ground; in units of the map where it has no CRS.
    cells : int
        That the path over cells has, before it is pulled tight.
    expanded : int
        Cells from which the search went on.
    clearance_m : float
        As it was asked for.
    region : int
        The region's label.
    walls : int
        Cells of the region that were kept out of because of their own value.
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
        """The corners on the map, (n, 2)."""
        return np.stack(self.geobox.xy_from_pixel(*(self.corners.T + 0.5)), axis=1)


def find_way(
    free: FreeCells,
    start: tuple[float, float],
    goal: tuple[float, float],
    params: WayParams = WayParams(),
    map: Map = serial,
) -> Way:
    """The shortest way between two places of one region, over cells whose own value is in range.

    Parameters
    ----------
    free : FreeCells
    start, goal : (float, float)
        x and y on the map.
    params : WayParams
    map : Map
        Who reads the region's cells.

    Raises
    ------
    PathError
        If a place lies outside of the map or in no region, the two lie in different regions, or no path
        leads from one to the other.
    """
    first, last = free.place("start", start), free.place("goal", goal)
    if not (first.is_free and last.is_free and first.region == last.region):
        raise PathError(_apart(free, first, last, map))
    window, mask, walls = free.of_region(first.region, map)
    offset = np.array([window.row, window.col])
    row, col = window.row + window.rows / 2, window.col + window.cols / 2
    width, height = ground_steps(free.geobox, row, col)
    begin, end = (_within(place.cell, offset) for place in (first, last))
    if params.clearance_m > 0:
        mask = _kept_clear(mask, params.clearance_m, (width, height), {"start": begin, "goal": end})
    path = _searched(mask, begin, end, first.region, params)
    corners = offset + (tightened(mask, path.cells) if params.smooth else _turns(path.cells))
    return Way(
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


def _within(cell: Cell, offset: NDArray[np.int64]) -> Cell:
    return cell[0] - int(offset[0]), cell[1] - int(offset[1])


def _apart(free: FreeCells, start: Place, goal: Place, map: Map) -> str:
    """Where two places lie that no path can join, and what is nearest to them that one could."""
    said = f"the start lies in {start.where} and the goal in {goal.where}"
    told = []
    for place, other in ((start, goal), (goal, start)):
        if place.is_free and (place is start or not other.is_free):
            continue
        region = other.region if other.is_free else None
        near = free.nearest(place, region, map)
        if near is None:
            return f"{said}; no cell of the map is free"
        told.append(
            f"the nearest free cell{'' if region is None else f' of region {region}'} is {near.metres:.4g} m "
            f"from the {place.name}, at {near.x:.12g},{near.y:.12g}"
            + (f" in region {near.region}" if region is None else "")
        )
    return "; ".join([said, *told])


def _kept_clear(
    mask: NDArray[np.bool_], metres: float, side: tuple[float, float], ends: dict[str, Cell]
) -> NDArray[np.bool_]:
    """The cells that are far enough from what is impassable, if start and goal are among them."""
    distance = clearance(mask, *side)
    for name, cell in ends.items():
        if not reaches(distance[cell], metres):
            raise PathError(
                f"a clearance of {metres:g} m leaves no room at the {name}, which is {distance[cell]:.4g} m "
                f"from the nearest impassable cell (the most in its region is {distance.max():.4g} m)"
            )
    return np.asarray(reaches(distance, metres) & mask)


def _turns(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cells at which a path turns, and its ends."""
    steps = np.diff(cells, axis=0)
    turning = (steps[1:] != steps[:-1]).any(axis=1)
    return cells[np.concatenate([[True], turning, [True]])] if len(cells) > 1 else cells


def _warnings(width: float, height: float) -> Iterator[str]:
    if abs(width - height) > _SQUARE * max(width, height):
        yield (
            f"cells are {width:.4g} m wide and {height:.4g} m high: the path is the shortest in cells, "
            "which need not be the shortest in metres; reproject the map to square cells"
        )


def _searched(mask: NDArray[np.bool_], start: Cell, goal: Cell, region: int, params: WayParams) -> Path:
    try:
        return shortest_path(mask, start, goal)
    except PathError:
        why = "cells whose own value is outside of the range part them, or corners that would have to be cut"
        if params.clearance_m:
            why = f"on the way it is too narrow for a clearance of {params.clearance_m:g} m"
        raise PathError(
            f"no path leads from the start to the goal: both lie in region {region}, but {why}"
        ) from None
