"""Ray casting in a scene of solid polygons and circles."""

from collections.abc import Sequence
from dataclasses import field
from math import inf, sqrt
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from uavseg._jit import kernel
from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import check_distance, check_place
from uavseg.raster.grid.geobox import GeoBox


@dataclass(frozen=True, eq=False)
class Scene:
    """Solid polygons and circles in the plane, in metres.

    Examples
    --------
    >>> scene = Scene(circles=[(5.0, 0.0, 1.0)])
    >>> scene.cast(0.0, 0.0, np.array([0.0, np.pi]))
    array([ 4., inf])
    """

    polygons: Sequence[ArrayLike] = ()  # corners (n, 2) of simple ones; the last is connected to the first
    circles: Sequence[tuple[float, float, float]] = ()  # x, y, radius
    _edges: Floats = field(init=False, repr=False)
    _discs: Floats = field(init=False, repr=False)
    _shapes: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rings = [_checked_ring(ring, number) for number, ring in enumerate(self.polygons, start=1)]
        for number, circle in enumerate(self.circles, start=1):
            _check_circle(circle, number)
        edges = [np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings]
        object.__setattr__(self, "_edges", np.concatenate([np.zeros((0, 4)), *edges]))
        object.__setattr__(self, "_discs", np.array(self.circles, np.float64).reshape(-1, 3))
        object.__setattr__(self, "_shapes", shapely.union_all([shapely.Polygon(ring) for ring in rings]))

    def cast(self, x: float, y: float, angles: ArrayLike) -> Floats:
        """Cast rays from (x, y): the distance to the first surface at each angle, infinite without one.

        `angles` (n,) are radians, counterclockwise from the x axis; distances are metres, without limit and
        noise.
        """
        radians = np.asarray(angles, np.float64)
        distances = np.empty(len(radians))
        rays = np.column_stack([np.cos(radians), np.sin(radians)])
        _cast(x, y, rays, self._edges, self._discs, distances)
        return distances

    def contains(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return whether points lie inside a polygon or circle; `x`, `y` and the result have one shape."""
        xs, ys = np.asarray(x, np.float64), np.asarray(y, np.float64)
        shapely.prepare(self._shapes)
        inside: NDArray[np.bool_] = shapely.contains_xy(self._shapes, xs, ys)
        for cx, cy, radius in self._discs:
            inside = inside | (np.hypot(xs - cx, ys - cy) < radius)
        return inside


def _checked_ring(corners: ArrayLike, number: int) -> Floats:
    ring = np.asarray(corners, np.float64)
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
        raise SceneError(f"polygon {number} needs three or more corners [x, y], not an array of {ring.shape}")
    if not np.isfinite(ring).all():
        raise SceneError(f"polygon {number} has a corner that is not finite")
    check_place(f"polygon {number}", *ring.ravel().tolist())
    shape = shapely.Polygon(ring)
    if not shape.is_valid:
        raise SceneError(
            f"polygon {number} crosses or touches itself ({shapely.is_valid_reason(shape)}); "
            "a solid is bounded by a simple polygon: split it where it crosses"
        )
    if not shape.area > 0:
        raise SceneError(f"polygon {number} has no area")
    return ring


def _check_circle(circle: Sequence[float], number: int) -> None:
    if len(circle) != 3 or not np.isfinite(circle).all():
        raise SceneError(f"circle {number} needs finite x, y and radius, not {list(circle)}")
    if not circle[2] > 0:
        raise SceneError(f"circle {number} has a radius of {circle[2]:g}; expected more than 0")
    check_place(f"circle {number}", *circle[:2])
    check_distance(f"the radius of circle {number}", circle[2])


@kernel("void(f8, f8, f8[:,::1], f8[:,::1], f8[:,::1], f8[::1])")
def _cast(x, y, rays, edges, discs, distances):  # type: ignore[no-untyped-def]
    for i in range(rays.shape[0]):
        dx, dy = rays[i, 0], rays[i, 1]
        nearest = inf
        for k in range(edges.shape[0]):
            ax, ay = edges[k, 0] - x, edges[k, 1] - y
            ex, ey = edges[k, 2] - edges[k, 0], edges[k, 3] - edges[k, 1]
            det = dx * ey - dy * ex
            if det == 0.0:
                continue  # parallel to the edge: the neighbouring edges are hit instead
            t = (ax * ey - ay * ex) / det
            s = (ax * dy - ay * dx) / det
            if 0.0 <= t < nearest and -1e-12 <= s <= 1.0 + 1e-12:  # the tolerance closes the corners
                nearest = t
        for k in range(discs.shape[0]):
            cx, cy = discs[k, 0] - x, discs[k, 1] - y
            along = cx * dx + cy * dy
            aside = cx * dy - cy * dx
            rest = discs[k, 2] * discs[k, 2] - aside * aside
            if rest < 0.0:
                continue
            half = sqrt(rest)
            t = along - half if along >= half else along + half
            if 0.0 <= t < nearest:
                nearest = t
        distances[i] = nearest


@dataclass(frozen=True, eq=False)
class CellScene:
    """Solid cells; nothing is solid outside of the map.

    Examples
    --------
    >>> from uavseg.raster.grid.geobox import local_geobox
    >>> scene = CellScene(np.array([[0, 0, 1]], bool), local_geobox((1, 3), 2.0, (0.0, 0.0)))
    >>> scene.cast(1.0, 1.0, np.array([0.0, np.pi]))
    array([ 3., inf])
    """

    solid: NDArray[np.bool_]  # (rows, cols)
    geobox: GeoBox

    def cast(self, x: float, y: float, angles: ArrayLike) -> Floats:
        """Cast rays from (x, y), as `Scene.cast`: metres to the first solid cell, infinite without one."""
        radians = np.asarray(angles, np.float64)
        a, b, c, d, e, f = tuple(~self.geobox.transform)[:6]
        along_x, along_y = np.cos(radians), np.sin(radians)
        steps = np.column_stack([d * along_x + e * along_y, a * along_x + b * along_y])
        distances = np.empty(len(radians))
        solid = np.ascontiguousarray(self.solid).view(np.uint8)
        _cast_in_cells(solid, d * x + e * y + f, a * x + b * y + c, steps, distances)
        return distances

    def contains(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return whether points lie in a solid cell; `x`, `y` and the result have one shape."""
        a, b, c, d, e, f = tuple(~self.geobox.transform)[:6]
        xs, ys = np.asarray(x, np.float64), np.asarray(y, np.float64)
        row, col = np.floor(d * xs + e * ys + f), np.floor(a * xs + b * ys + c)
        rows, cols = self.solid.shape
        inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        r, k = (np.clip(axis, 0, size - 1).astype(np.int64) for axis, size in ((row, rows), (col, cols)))
        return np.asarray(inside & self.solid[r, k])


@kernel("void(u1[:,::1], f8, f8, f8[:,::1], f8[::1])")
def _cast_in_cells(solid, row, col, steps, distances):  # type: ignore[no-untyped-def]
    # `steps` (n, 2) are rows and columns of a metre along each ray (Amanatides and Woo, 1987).
    rows, cols = solid.shape
    for k in range(steps.shape[0]):
        down, right = steps[k, 0], steps[k, 1]
        r, c = np.int64(np.floor(row)), np.int64(np.floor(col))
        per_row = 1.0 / abs(down) if abs(down) > 1e-12 else inf
        per_col = 1.0 / abs(right) if abs(right) > 1e-12 else inf
        to_row = per_row * (r + 1 - row if down > 0.0 else row - r) if per_row < inf else inf
        to_col = per_col * (c + 1 - col if right > 0.0 else col - c) if per_col < inf else inf
        length = 0.0
        distances[k] = inf
        while 0 <= r < rows and 0 <= c < cols:
            if solid[r, c] != 0:
                distances[k] = length
                break
            if to_row < to_col:
                length, to_row, r = to_row, to_row + per_row, r + (1 if down > 0.0 else -1)
            else:
                length, to_col, c = to_col, to_col + per_col, c + (1 if right > 0.0 else -1)
