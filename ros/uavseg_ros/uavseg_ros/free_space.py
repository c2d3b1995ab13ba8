"""Free space of a robot with a radius: cells of a map over which its centre may drive, and paths over them.

Free are the cells that `uavseg path --range 0,V` may enter: everything else, what is unknown too, counts as
an obstacle. The centre of the robot drives over cells whose own centre keeps its radius and half of a cell's
diagonal from all obstacles. No point of such a cell is nearer to one than the radius (a distance changes by
no more than the way between two points), so straight lines over these cells keep it too, not only corners.

Positions are (row, col) of the map; the outer corner of its first cell is (0, 0), a centre is (0.5, 0.5).
"""

import math
import os
from collections import Counter
from collections.abc import Collection
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import label

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError, PathError, RegionError
from uavseg.jobs.maps.path import PathRequest, free_cells
from uavseg.jobs.source.open_source import map_of, open_probability_map
from uavseg.occupancy.paths.any_angle import pull_string
from uavseg.occupancy.paths.astar import shortest_path
from uavseg.occupancy.paths.clearance import clearance, is_at_least
from uavseg.occupancy.ros.ros_map import placement
from uavseg.raster.grid.geobox import GeoBox, pixels_inside
from uavseg.regions.formats.read import read_local_regions
from uavseg.regions.sample.place import bounding_cells, extent, to_pixels
from uavseg.segmentation.params.segment import IntensityRange

Cell = tuple[int, int]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Free cells of a map, and those over which the centre of a robot may drive."""

    name: str  # of the map
    geobox: GeoBox
    side_m: float  # of a cell
    radius_m: float  # of the robot
    free: Mask  # (rows, cols)
    warnings: tuple[str, ...] = ()

    @cached_property
    def distance_m(self) -> Floats:
        """Metres from the centre of each cell to the nearest obstacle or edge of the map, (rows, cols)."""
        return clearance(self.free, self.side_m, self.side_m)

    @property
    def slack_m(self) -> float:
        """Metres from the centre of a cell to its corners."""
        return self.side_m * math.sqrt(0.5)

    @cached_property
    def drivable(self) -> Mask:
        """Cells over which the centre of the robot may drive, (rows, cols)."""
        return np.asarray(self.free & is_at_least(self.distance_m, self.radius_m + self.slack_m))

    @cached_property
    def parts(self) -> NDArray[np.int32]:
        """Connected components of the drivable cells, (rows, cols), from 1; 0 elsewhere."""
        return np.asarray(label(self.drivable)[0], np.int32)

    def xy(self, positions: Any) -> Floats:
        """Return map coordinates (n, 2) of positions (n, 2), to the nanometre."""
        rows, cols = np.asarray(positions, np.float64).reshape(-1, 2).T
        return np.stack(self.geobox.xy_from_pixel(rows, cols), axis=1).round(9)

    def path(self, start: Cell, goal: Cell) -> NDArray[np.int64]:
        """Plan between two cells of one part, pulled tight: the corners (n, 2), row and column of cells."""
        return pull_string(self.drivable, shortest_path(self.drivable, start, goal).cells)

    def sees(self, start: Floats, end: Floats) -> bool:
        """Return whether a straight line stays on drivable cells."""
        cells, _ = _crossed(start, end)
        if (cells < 0).any() or (cells >= self.drivable.shape).any():
            return False
        return bool(self.drivable[cells[:, 0], cells[:, 1]].all())

    def leg(self, start: Floats, end: Floats) -> Floats:
        """Return the path between two positions on drivable cells of one part, both included: (n, 2)."""
        if self.sees(start, end):
            return np.stack([start, end])
        between = self.path(cell_of(start), cell_of(end)) + 0.5
        first = 1 if len(between) > 1 and self.sees(start, between[1]) else 0
        last = len(between) - 1 if len(between) > first + 1 and self.sees(between[-2], end) else len(between)
        return np.concatenate([start[None], between[first:last], end[None]])

    def place(self, name: str, xy: tuple[float, float]) -> Floats:
        """Return a place on the map, named "start", as a position; refuse one where the robot cannot be.

        Raises
        ------
        PathError
            If it lies outside of the map, or nearer to an obstacle than the robot may be.
        """
        where = f"{xy[0]:g},{xy[1]:g}"
        if not all(map(math.isfinite, xy)):
            raise PathError(f"the {name} is two finite numbers, x and y on the map, not {where}")
        col, row = ~self.geobox.transform * xy
        rows, cols = self.free.shape
        if not (0 <= row < rows and 0 <= col < cols):
            raise PathError(f"the {name} {where} lies outside of {self.name}: {extent(self.geobox)}")
        cell = int(row), int(col)
        if not self.drivable[cell]:
            room = (
                f"at most {_floored(self.distance_m[cell] - self.slack_m)}"
                if self.free[cell]
                else "its cell is not free"
            )
            raise PathError(f"the {name} {where} has no room for a radius of {self.radius_m:g} m ({room})")
        return np.array([row, col])

    def widest(self, starts: Mask, goals: Mask) -> float:
        """Return the largest radius in metres with which a path leads from cells to others; 0 if none."""
        known = np.unique(self.distance_m[self.free])
        open_, closed = -1, len(known)
        while closed - open_ > 1:
            middle = (open_ + closed) // 2
            labels = label(is_at_least(self.distance_m, known[middle]) & self.free)[0]
            if np.intersect1d(labels[starts & (labels > 0)], labels[goals & (labels > 0)]).size:
                open_ = middle
            else:
                closed = middle
        return 0.0 if open_ < 0 else max(float(known[open_]) - self.slack_m, 0.0)


def runs_over(mask: Mask, start: Floats, end: Floats) -> list[Floats]:
    """Return the parts (2, 2) of a straight line over the cells of a mask, start and end of each, in order.

    They begin and end within a cell, a quarter of the way over it.
    """
    cells, times = _crossed(start, end)
    known = ((cells >= 0) & (cells < mask.shape)).all(axis=1)
    inside = np.zeros(len(cells), np.bool_)
    inside[known] = mask[cells[known, 0], cells[known, 1]]
    steps = np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))
    first, last = np.flatnonzero(steps > 0), np.flatnonzero(steps < 0) - 1
    quarter = np.diff(times) / 4
    begin, stop = times[first] + quarter[first], times[last + 1] - quarter[last]
    return list(start + np.stack([begin, stop], axis=1)[:, :, None] * (end - start))


def _crossed(start: Floats, end: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return the cells (n, 2) that a line crosses, in their order, and where, 0..1: (n + 1,).

    A point between two cells is of both, so that one of them is enough.
    """
    times = [np.array([0.0, 1.0])]
    for a, b in zip(start.tolist(), end.tolist(), strict=True):
        low, high = sorted((a, b))
        lines = np.arange(math.floor(low) + 1, math.ceil(high))
        if len(lines):
            times.append((lines - a) / (b - a))
    cuts = np.unique(np.concatenate(times).clip(0, 1))
    if len(cuts) == 1 or np.array_equal(start, end):
        cuts = np.array([0.0, 1.0])
    middles = (cuts[:-1] + cuts[1:])[:, None] / 2
    return np.floor(start + middles * (end - start)).astype(np.int64), cuts


def cell_of(position: Floats) -> Cell:
    """Return row and column of the cell of a position."""
    row, col = np.floor(position).astype(int).tolist()
    return row, col


def read_free_space(path: str | os.PathLike[str], radius_m: float, passable_below: float = 0.45) -> FreeSpace:
    """Read a map without a CRS for a robot.

    Parameters
    ----------
    path : path
        The YAML file of a ROS map, or a raster of probabilities; cells are square, in metres.
    radius_m : float
        Metres that the centre of the robot keeps from all that is not free.
    passable_below : float
        Free are cells up to this probability.

    Raises
    ------
    ParameterError
        If the radius is not finite or below 0, or the probability is not above 0 and up to 1.
    MapError
        If the map has a CRS, no square cells in metres, or no free cell.
    UavsegError
        If it cannot be read.
    """
    if not (math.isfinite(radius_m) and radius_m >= 0):
        raise ParameterError(f"the radius of a robot is metres, not below 0, not {radius_m:g}")
    if not 0 < passable_below <= 1:
        raise ParameterError(f"free are cells up to a probability above 0, at most 1, not {passable_below:g}")
    source = map_of(open_probability_map(path), "name the map that it was made from")
    if source.geobox.crs is not None:
        raise MapError(f"{source.name} has a CRS; the map of a robot is in metres without one")
    side_m, _, _ = placement(source.geobox)
    cells = free_cells(source, PathRequest(IntensityRange(0.0, passable_below), (0.0, 0.0), (0.0, 0.0)))
    free = np.zeros(source.geobox.shape, np.bool_)
    labels = np.unique(cells.rings.labels).tolist()
    if not labels:
        raise MapError(f"{source.name} has no free cell: none of at most {passable_below:g}")
    window, mask, _ = cells.of_regions(labels)
    free[window.row : window.row + window.rows, window.col : window.col + window.cols] = mask
    return FreeSpace(
        name=source.name,
        geobox=source.geobox,
        side_m=side_m,
        radius_m=radius_m,
        free=free,
        warnings=cells.warnings,
    )


@dataclass(frozen=True, eq=False)
class MapRegion:
    """A region of a map: its id, its name if the file has one, and the cells whose centres lie in it."""

    id: int
    name: str | None
    box: tuple[slice, slice]  # rows and columns of the map around the region
    mask: Mask  # the cells of the region in the box

    def values(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return the values (n,) of an array (rows, cols) of the map on the cells of the region."""
        return np.asarray(array[self.box][self.mask])

    def __str__(self) -> str:
        return f"region {self.id}" + (f" ({self.name})" if self.name else "")


def read_map_regions(
    path: str | os.PathLike[str],
    space: FreeSpace,
    layer: str | None = None,
    ids: Collection[int] | None = None,
) -> tuple[list[MapRegion], list[str]]:
    """Read regions in the coordinates of a map, in the order of their ids, and notes on them.

    Parameters
    ----------
    path : path
        A file of polygons; a column `name` of texts names them.
    ids : collection of int, optional
        Which of them; by default all.

    Raises
    ------
    RegionError
        If they cannot be read, have a CRS, two have one id, or one is not there.
    """
    regions = read_local_regions(path, layer)
    if regions.wkt is not None:
        raise RegionError(f"{path} has a CRS, and {space.name} none; give polygons in the map's coordinates")
    known = regions.columns["id"].tolist()
    often, count = Counter(known).most_common(1)[0] if known else (0, 0)
    if count > 1:
        raise RegionError(f"{path} has {count} regions with the id {often}; give each its own")
    missing = sorted(set(ids or ()) - set(known))
    if missing:
        raise RegionError(f"{path} has no region {missing[0]}; it has {_listed(known)}")
    names = regions.columns.get("name", [None] * len(known))
    polygons = to_pixels(np.asarray(regions.polygons), space.geobox)
    chosen = [k for k, one in enumerate(known) if ids is None or one in ids]
    if not chosen:
        raise RegionError(f"{path} has no region")
    found = []
    for k in chosen:
        name = names[k] if isinstance(names[k], str) else None
        box, mask = _inside(polygons[k], space.free.shape)
        found.append(MapRegion(id=known[k], name=name, box=box, mask=mask))
    return found, list(regions.metadata.get("notes", []))


def _listed(ids: list[int]) -> str:
    return ", ".join(map(str, ids[:10])) + (", ..." if len(ids) > 10 else "")


def _inside(polygon: Any, shape: tuple[int, int]) -> tuple[tuple[slice, slice], Mask]:
    """Return the box of a polygon (x, y of columns and rows) on a map, and the mask of its cells there."""
    window = bounding_cells(np.array(shapely.bounds(polygon)), shape)
    if not (window.rows and window.cols):
        return (slice(0), slice(0)), np.zeros((0, 0), np.bool_)
    box = slice(window.row, window.row + window.rows), slice(window.col, window.col + window.cols)
    return box, pixels_inside([polygon], window)


def main_part(space: FreeSpace, regions: list[MapRegion]) -> int:
    """Return the part of the drivable cells with cells of most regions, of equals the largest; 0 if none."""
    sizes = np.bincount(space.parts.ravel())
    served = np.zeros(len(sizes), np.int64)
    for region in regions:
        served[np.unique(region.values(space.parts))] += 1
    served[0] = -1
    return int(np.lexsort((np.arange(len(sizes)), -sizes, -served))[0])


def why_unreachable(space: FreeSpace, region: MapRegion, part: int) -> str:
    """Say why no place of a region lies in a part of the drivable cells."""
    if not region.mask.any():
        return f"{region} has no cell of {space.name}, which is {extent(space.geobox)}"
    if not region.values(space.free).any():
        return f"{region} has no free cell"
    radius = f"a radius of {space.radius_m:g} m"
    starts = np.zeros(space.free.shape, np.bool_)
    starts[region.box] = region.mask & space.drivable[region.box]
    if not starts.any():
        room_m = float(region.values(space.distance_m).max()) - space.slack_m
        return f"{region} has no room for {radius} (at most {_floored(room_m)})"
    widest = space.widest(starts, space.parts == part)
    most = f"at most {_floored(widest)}" if widest > 0 else "with none"
    return f"no path leads to {region} with {radius} ({most})"


def _floored(metres: float) -> str:
    """Return metres, rounded down to a millimetre."""
    return f"{math.floor(max(metres, 0.0) * 1000) / 1000:g} m"
