"""Several occupancy maps: merging, and changes between two: registration, then cells occupied in one only.

Registration is truncated chamfer matching, both ways (Borgefors, "Hierarchical chamfer matching", PAMI 1988):
an occupied cell costs its squared distance to the nearest one of the other map, three cells at most, so what
changed does not pull. A cell has changed where the other map has no occupied cell within the tolerance: free
ground contradicts it, unknown ground says nothing. A part of what still stands needs more evidence than a
whole, because beams along a side clear some of its cells in one of the maps.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.arrays import Bools, Float32s, Floats, Integers, Uint8s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, RasterError, named_errors
from uavseg.occupancy.map_file import FREE_UP_TO, OCCUPIED_FROM, trinary_states
from uavseg.occupancy.mapping.grid_io import check_cells
from uavseg.occupancy.ros.ros_map import placement, transform_of
from uavseg.raster.grid.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, UNKNOWN

MAX_SHIFT, MAX_ANGLE_DEG = 5.0, 2.0  # cells, where the maps have their centre
TOLERANCE = 2.0  # cells: what is left of a shift, and the noise of a wall
MIN_SHARE = 0.6  # of the occupied cells on ground that both maps know, which have to lie on each other

_TRUNCATED, _STEPS = 3.0, (0.5, 0.25, 0.125, 0.0625, 0.03125)  # cells
_COARSE, _FINE = 4_000, 20_000  # points that a step looks at
_MIN_COMMON = 0.2  # of the occupied cells of the smaller map, to tell anything
_WHOLE, _PART = (3, 0.5), (8, 0.75)  # changed cells, and the share of them that is free
_SQUARE = np.ones((3, 3), bool)

_CHUNK = 1 << 20  # cells that are resampled at once
_ROUNDING = 1e-6  # of a cell: a smaller shift is a rounding error


@dataclass(frozen=True, slots=True, eq=False)
class PlacedMap:
    """The probabilities of a map, and their position."""

    name: str
    probabilities: Float32s  # (rows, cols) float32; exactly 0.5 where unknown
    geobox: GeoBox  # square cells in metres


def common_grid(maps: Sequence[PlacedMap], unrotate: bool, resolution: float | None) -> GeoBox:
    """Extend the grid of the first map to hold all maps.

    With `unrotate` its rows run along the x axis, a yaw of 0. `resolution` is the side of a cell in metres;
    by default that of the first map.
    """
    for other in maps:
        if other.geobox.crs != maps[0].geobox.crs:
            raise MapError(
                f"{other.name} has another coordinate system than {maps[0].name}; warp it first (gdalwarp)"
            )
    side, (x, y, yaw), _ = placement(maps[0].geobox)
    side = side if resolution is None else resolution
    yaw = 0.0 if unrotate else yaw
    along, up = math.cos(yaw), math.sin(yaw)
    corners = np.concatenate([_corners(one.geobox) for one in maps]) - (x, y)
    cells = np.column_stack([corners @ (along, up), corners @ (-up, along)]) / side
    left, bottom = np.floor(cells.min(axis=0) + _ROUNDING).tolist()
    right, top = np.ceil(cells.max(axis=0) - _ROUNDING).tolist()
    shape = int(top - bottom), int(right - left)
    check_cells(shape, "the merged map")
    origin = x + side * (left * along - bottom * up), y + side * (left * up + bottom * along), yaw
    with named_errors("the merged map", RasterError, MapError):
        return GeoBox(shape, transform_of(origin, side, shape[0]), maps[0].geobox.crs)


def merge(maps: Sequence[PlacedMap], geobox: GeoBox) -> tuple[Float32s, int]:
    """Merge maps into the cells of a grid, and count disputed cells; the order of the maps does not matter.

    Each cell takes the value that is farthest from 0.5; the highest where one is occupied (0.65 or more).
    Cells that are free (0.25 or less) in one map and occupied in another are disputed. Maps on the same grid
    are copied as they are. Others are resampled: a cell takes the value of the cell in which its centre lies.
    That may step over an obstacle of one cell, so each occupied cell also marks the cell in which its centre
    lies.
    """
    lowest = np.full(geobox.shape, 0.5, np.float32)
    highest = lowest.copy()
    for one in maps:
        values = _resampled(one, geobox)
        np.minimum(lowest, values, out=lowest)
        np.maximum(highest, values, out=highest)
    occupied = highest >= OCCUPIED_FROM
    disputed = int((occupied & (lowest <= FREE_UP_TO)).sum())
    above = highest - np.float32(0.5) >= np.float32(0.5) - lowest  # the highest is farther from 0.5
    return np.where(occupied | above, highest, lowest), disputed


def cropped(probabilities: Float32s, geobox: GeoBox) -> tuple[Float32s, GeoBox]:
    """Crop a map (rows, cols) to its known cells; refuse one without any."""
    known = probabilities != 0.5
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        raise MapError("every cell of the map is unknown, so nothing is left when it is cropped")
    part = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
    inner = np.ascontiguousarray(probabilities[part])
    moved = geobox.transform * geobox.transform.translation(int(cols[0]), int(rows[0]))
    return inner, GeoBox(inner.shape, moved, geobox.crs)


def _corners(geobox: GeoBox) -> Floats:
    placement(geobox)  # refuses cells that are not square or not in metres
    return np.column_stack(geobox.corners)


def _resampled(one: PlacedMap, geobox: GeoBox) -> Float32s:
    """Resample a map to the cells of a grid, 0.5 outside of the map."""
    resampled = np.full(geobox.shape, 0.5, np.float32)
    for row, rows, cols, inside in _cells_of(geobox, one.geobox):
        part = resampled[row : row + len(inside)]
        part[inside] = one.probabilities[rows, cols]
    for row, rows, cols, inside in _cells_of(one.geobox, geobox):
        values = one.probabilities[row : row + len(inside)][inside]
        occupied = values > 0.5
        np.maximum.at(resampled, (rows[occupied], cols[occupied]), values[occupied])
    return resampled


def _cells_of(inner: GeoBox, outer: GeoBox) -> Iterator[tuple[int, Integers, Integers, Bools]]:
    """Yield first rows of `inner`, rows and columns in `outer` of its centres there, and which these are."""
    transform = ~outer.transform * inner.transform
    count, width = inner.shape
    for row in range(0, count, max(_CHUNK // width, 1)):
        y, x = np.mgrid[row : min(row + max(_CHUNK // width, 1), count), :width] + 0.5
        cols = np.floor(transform.a * x + transform.b * y + transform.c + 1e-9).astype(np.int64)
        rows = np.floor(transform.d * x + transform.e * y + transform.f + 1e-9).astype(np.int64)
        inside = (rows >= 0) & (rows < outer.shape[0]) & (cols >= 0) & (cols < outer.shape[1])
        yield row, rows[inside], cols[inside], inside


@dataclass(frozen=True, slots=True)
class Registration:
    """How the first of two maps lies on the second."""

    motion: Affine  # of x and y in the first map to those in the second
    back: Affine
    shift: tuple[float, float]  # x and y in cells, at the centre of the maps
    angle_deg: float  # counterclockwise
    share: float  # of occupied cells on common ground, those that lie on occupied ones of the other map
    cell_m: float  # side of the larger cells, in which lengths are counted


class Evidence:
    """The states of a map, and distances to its occupied cells; MapError where there are none."""

    def __init__(self, one: PlacedMap) -> None:
        from scipy import ndimage

        self.geobox, self.states = one.geobox, trinary_states(one.probabilities)
        self.cells = np.argwhere(self.states == OCCUPIED)
        if not len(self.cells):
            raise MapError(f"{one.name} has no occupied cell, so it cannot be registered")
        self.points = np.column_stack(one.geobox.xy_from_pixel(*(self.cells + 0.5).T))  # (n, 2) x, y
        self.cell_m = math.hypot(one.geobox.transform.a, one.geobox.transform.d)
        rows, cols = one.geobox.shape
        self.centre = np.ravel(one.geobox.xy_from_pixel(rows / 2, cols / 2))
        far = ndimage.distance_transform_edt(self.states != OCCUPIED, self.cell_m)
        self._distances = np.asarray(far, np.float32)

    def distances(self, points: Floats, largest: float) -> Floats:
        """Return metres to the nearest occupied cell, `largest` at most and outside of the map; (n,)."""
        return np.asarray(np.minimum(self._at(self._distances, points, 1, largest), largest))

    def states_at(self, points: Floats) -> Floats:
        """Return the states of the cells in which points lie, unknown outside of the map; (n,)."""
        return self._at(self.states, points, 0, UNKNOWN)

    def _at(self, image: NDArray[np.generic], points: Floats, order: int, outside: float) -> Floats:
        from scipy import ndimage

        where = moved(~self.geobox.transform, points).T[::-1] - 0.5
        found = ndimage.map_coordinates(image, where, float, order=order, mode="constant", cval=outside)
        return np.asarray(found)


def moved(motion: Affine, points: Floats) -> Floats:
    """Apply an affine transform to points, (n, 2) x and y."""
    x, y = points.T
    return np.column_stack([motion.a * x + motion.b * y + motion.c, motion.d * x + motion.e * y + motion.f])


def register(first: Evidence, second: Evidence) -> Registration:
    """Register two maps within 5 cells and 2 degrees; the other way round gives exactly the reverse.

    A MapError says that no motion within the limits lays 60 % of the occupied cells on each other.
    """
    orders = [(len(one.cells), one.states.tobytes(), tuple(one.geobox.transform)) for one in (first, second)]
    one, other = (second, first) if orders[0] > orders[1] else (first, second)
    cell_m, centre = max(one.cell_m, other.cell_m), (one.centre + other.centre) / 2
    there = _best_motion(one, other, centre, cell_m)
    share = min(_share(one, other, there, cell_m), _share(other, one, ~there, cell_m))
    motion, back = (there, ~there) if one is first else (~there, there)
    dx, dy = ((moved(motion, centre[None])[0] - centre) / cell_m).tolist()
    angle = math.degrees(math.atan2(motion.d, motion.a))
    if share < MIN_SHARE or math.hypot(dx, dy) > MAX_SHIFT or abs(angle) > MAX_ANGLE_DEG:
        raise MapError(
            f"the maps do not register within {MAX_SHIFT:g} cells and {MAX_ANGLE_DEG:g} degrees: at best, at "
            f"{dx:.1f}, {dy:.1f} cells and {angle:.1f} degrees, {100 * share:.0f} % of the occupied cells on "
            f"common ground lie on each other, and {100 * MIN_SHARE:.0f} % are needed (what is no map of "
            "probabilities is compared by a range)"
        )
    return Registration(motion=motion, back=back, shift=(dx, dy), angle_deg=angle, share=share, cell_m=cell_m)


def _best_motion(first: Evidence, second: Evidence, centre: Floats, cell_m: float) -> Affine:
    ones, others = (one.points[:: -(-len(one.points) // _FINE)] for one in (first, second))
    few = first.points[:: -(-len(first.points) // _COARSE)]
    radius = max(float(np.hypot(*(few - centre).T).max()), cell_m)

    def motion(at: Floats) -> Affine:  # x, y and the arc of the outermost cell, in cells
        turn = Affine.rotation(math.degrees(at[2] * cell_m / radius))
        dx, dy = centre + at[:2] * cell_m - moved(turn, centre[None])[0]
        return Affine(turn.a, turn.b, dx, turn.d, turn.e, dy)

    def cost(at: Floats) -> float:
        there = motion(at)
        return _cost(second, moved(there, ones), cell_m) + _cost(first, moved(~there, others), cell_m)

    arcs = np.arange(math.ceil(math.radians(MAX_ANGLE_DEG + 0.5) * radius / cell_m) + 1.0)
    reach = np.arange(-MAX_SHIFT - 1, MAX_SHIFT + 2)  # beyond the limits, to see what lies there
    best, least = np.zeros(3), math.inf
    for arc in np.stack([arcs, -arcs], 1).ravel():
        turned = moved(motion(np.array([0.0, 0.0, arc])), few)
        for shift in np.stack(np.meshgrid(reach, reach), -1).reshape(-1, 2):
            found = _cost(second, turned + shift * cell_m, cell_m)
            if found < least:
                best, least = np.array([*shift, arc]), found
    least = cost(best)
    for step in _STEPS:
        while True:
            near = [best + sign * step * axis for axis in np.eye(3) for sign in (-1, 1)]
            costs = [cost(at) for at in near]
            if min(costs) >= least:
                break
            best, least = near[int(np.argmin(costs))], min(costs)
    return motion(best)


def _cost(other: Evidence, points: Floats, cell_m: float) -> float:
    return float((other.distances(points, _TRUNCATED * cell_m) ** 2).mean())


def _share(one: Evidence, other: Evidence, motion: Affine, cell_m: float) -> float:
    points = moved(motion, one.points)
    near = other.distances(points, 2 * TOLERANCE * cell_m) <= TOLERANCE * cell_m
    common = near | (other.states_at(points) != UNKNOWN)
    return float(near.sum() / max(common.sum(), _MIN_COMMON * min(len(one.cells), len(other.cells))))


def changed_objects(one: Evidence, other: Evidence, motion: Affine, cell_m: float) -> tuple[Uint32s, Uint8s]:
    """Find the objects of one map that another, to which `motion` leads, has not.

    Returns labels of the cells of the first, (rows, cols): objects 1..n in raster order, 0 elsewhere; and the
    kind of each object, (n,): 1 where its cells are free in the other map, 2 where they are unknown.
    """
    from scipy import ndimage

    points = moved(motion, one.points)
    distances = other.distances(points, 2 * TOLERANCE * cell_m)
    far, apart, there = (np.zeros(one.states.shape, kind) for kind in (bool, bool, np.uint8))
    place = tuple(one.cells.T)
    far[place], apart[place] = distances > TOLERANCE * cell_m, distances > cell_m
    there[place] = other.states_at(points)
    reach = round(TOLERANCE * cell_m / one.cell_m)
    apart &= ndimage.binary_dilation(far, _SQUARE, reach)
    groups, count = ndimage.label(ndimage.binary_dilation(apart, _SQUARE, reach), _SQUARE)
    groups[~apart] = 0
    counted = (far, far & (there == FREE), far & (there == UNKNOWN), apart)
    known, free, unknown, size = (np.bincount(groups[mask], minlength=count + 1)[1:] for mask in counted)
    connected, _ = ndimage.label(one.states == OCCUPIED, _SQUARE)
    pairs = np.unique(np.stack([groups[apart], connected[apart]], 1), axis=0)
    sizes = np.bincount(connected.ravel())[pairs[:, 1]]
    is_whole = 2 * size >= np.bincount(pairs[:, 0], sizes, count + 1)[1:]
    cells, share = (np.where(is_whole, *both) for both in zip(_WHOLE, _PART, strict=True))
    is_gone = free >= share * known
    kept = (known >= cells) & (is_gone | (2 * unknown >= known))
    numbers = np.concatenate([[0], np.where(kept, np.cumsum(kept), 0)]).astype(np.uint32)
    return numbers[groups], np.where(is_gone, 1, 2).astype(np.uint8)[kept]
