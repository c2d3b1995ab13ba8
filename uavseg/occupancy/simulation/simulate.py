"""Simulation of range scans: ray casting in a scene, from poses to an occupancy grid, with its truth."""

import math
from collections.abc import Sequence
from dataclasses import field
from math import inf, sqrt
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from uavseg._jit import kernel
from uavseg.arrays import Bools, Floats, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import SceneError
from uavseg.occupancy.mapping.beams import REACH_SIGMAS
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan, check_distance, check_place, check_positive
from uavseg.occupancy.mapping.sensor_messages import MAX_BEAMS
from uavseg.raster.grid.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, UNKNOWN


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
            if len(circle) != 3 or not np.isfinite(circle).all():
                raise SceneError(f"circle {number} needs finite x, y and radius, not {list(circle)}")
            if not circle[2] > 0:
                raise SceneError(f"circle {number} has a radius of {circle[2]:g}; expected more than 0")
            check_place(f"circle {number}", *circle[:2])
            check_distance(f"the radius of circle {number}", circle[2])
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

    def contains(self, x: ArrayLike, y: ArrayLike) -> Bools:
        """Return whether points lie inside a polygon or circle; `x`, `y` and the result have one shape."""
        xs, ys = np.asarray(x, np.float64), np.asarray(y, np.float64)
        shapely.prepare(self._shapes)
        inside: Bools = shapely.contains_xy(self._shapes, xs, ys)
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
            t, s = (ax * ey - ay * ex) / det, (ax * dy - ay * dx) / det
            if 0.0 <= t < nearest and -1e-12 <= s <= 1.0 + 1e-12:  # the tolerance closes the corners
                nearest = t
        for k in range(discs.shape[0]):
            cx, cy = discs[k, 0] - x, discs[k, 1] - y
            along, aside = cx * dx + cy * dy, cx * dy - cy * dx
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

    solid: Bools  # (rows, cols)
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

    def contains(self, x: ArrayLike, y: ArrayLike) -> Bools:
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


@dataclass(frozen=True, slots=True)
class RangeFinder:
    """A laser range finder.

    Examples
    --------
    >>> np.degrees(RangeFinder(0.05, 2.0, fov_deg=2.0, step_deg=0.5).angles).round(9)
    array([-1. , -0.5,  0. ,  0.5,  1. ])
    """

    sigma_m: float = 0.05  # standard deviation of the Gaussian noise on ranges
    max_range_m: float = 2.0
    fov_deg: float = 360.0  # field of view, up to 360
    step_deg: float = 0.5  # between neighbouring beams

    def __post_init__(self) -> None:
        check_distance("a standard deviation of ranges", self.sigma_m)
        check_distance("a maximum range", self.max_range_m)
        check_positive("an angular step", self.step_deg)
        if not 0 < self.fov_deg <= 360:
            raise SceneError(f"a field of view is more than 0 and at most 360 degrees, not {self.fov_deg:g}")
        if self.fov_deg / self.step_deg > MAX_BEAMS:
            raise SceneError(
                f"steps of {self.step_deg:g} degrees make {self.fov_deg / self.step_deg:.0f} beams; "
                f"at most {MAX_BEAMS} are cast at once"
            )

    @property
    def angles(self) -> Floats:
        """Return the angles of the beams in radians from the heading, (n,): evenly spaced."""
        steps = math.floor(self.fov_deg / self.step_deg + 1e-9)
        beams = steps if self.fov_deg == 360 else steps + 1  # a whole turn ends where it began
        return np.asarray(np.radians((np.arange(beams) - (beams - 1) / 2) * self.step_deg))

    def scan(self, scene: Scene | CellScene, pose: Pose, random: np.random.Generator) -> Scan:
        """Simulate one scan.

        A beam returns if a surface lies within the maximum range. The range is its distance with noise added:
        it may exceed the maximum range a little, but is never negative. `random` is the source of the noise.
        """
        angles = self.angles
        distances = scene.cast(pose.x, pose.y, pose.heading_rad + angles)
        noise = random.normal(0.0, self.sigma_m, len(angles))
        measured = np.where(distances <= self.max_range_m, np.maximum(distances + noise, 0.0), np.inf)
        return Scan(
            pose=pose, angles=angles, ranges=measured, max_range_m=self.max_range_m, sigma_m=self.sigma_m
        )


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a scene for each cell."""

    # (rows, cols) uint8; 1 free and 3 occupied where the cell is visible to the sensor, 2 (unknown)
    # elsewhere.
    states: Uint8s
    solid: Bools  # (rows, cols) bool; whether the centre of the cell lies inside a polygon or circle
    # (rows, cols) bool; whether from some pose the centre of the cell lies within the field of view and the
    # maximum range, and nothing hides it. A solid cell is visible up to the depth at which a beam still
    # updates cells behind its return, 3 σ.
    visible: Bools


@dataclass(frozen=True)
class Simulation:
    """A range finder that scans a scene from several poses."""

    scene: Scene
    sensor: RangeFinder
    poses: Sequence[Pose]  # at least one; none lies inside a polygon or circle
    geobox: GeoBox  # the cells of the map

    def __post_init__(self) -> None:
        if not self.poses:
            raise SceneError("a simulation needs at least one pose")
        for number, pose in enumerate(self.poses, start=1):
            if self.scene.contains([pose.x], [pose.y]).any():
                raise SceneError(
                    f"pose {number} at ({pose.x:g}, {pose.y:g}) stands inside something solid; move it out"
                )

    def run(self, seed: int = 0) -> OccupancyGrid:
        """Merge the scans of all poses into a map; the noise of each depends on the seed and its number."""
        grid = OccupancyGrid(self.geobox)
        for number, pose in enumerate(self.poses):
            grid.merge(self.sensor.scan(self.scene, pose, np.random.default_rng([seed, number])))
        return grid

    def truth(self) -> Truth:
        """Compute the true state of each cell, and whether the sensor could observe it."""
        row, col = np.indices(self.geobox.shape)
        x, y = self.geobox.xy_from_pixel(row + 0.5, col + 0.5)
        solid = self.scene.contains(x, y)
        visible = np.zeros(self.geobox.shape, bool)
        for pose in self.poses:
            visible |= self._visible_from(pose, x, y, solid)
        states = np.where(visible, np.where(solid, OCCUPIED, FREE), UNKNOWN).astype(np.uint8)
        return Truth(states=states, solid=solid, visible=visible)

    def _visible_from(self, pose: Pose, x: Floats, y: Floats, solid: Bools) -> Bools:
        sensor = self.sensor
        depth_limit = REACH_SIGMAS * sensor.sigma_m
        distance = np.hypot(x - pose.x, y - pose.y)
        angle = np.arctan2(y - pose.y, x - pose.x)
        bearing = (angle - pose.heading_rad + math.pi) % math.tau - math.pi
        near = (distance <= sensor.max_range_m + depth_limit) & (
            np.abs(bearing) <= np.abs(sensor.angles).max()
        )
        visible = np.zeros(x.shape, bool)
        depth = distance[near] - self.scene.cast(pose.x, pose.y, angle[near])  # behind the first surface
        surface = distance[near] - depth
        within = np.where(solid[near], surface, distance[near]) <= sensor.max_range_m
        visible[near] = within & np.where(solid[near], depth <= depth_limit, depth < 0)
        return visible
