"""Simulation of range scans: a scene, a sensor and poses to an occupancy grid, with its ground truth."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import SceneError
from uavseg.occupancy.mapping.beams import REACH_SIGMAS
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.pending import Mask
from uavseg.occupancy.mapping.scan import Pose, Scan, check_distance, check_positive
from uavseg.occupancy.mapping.sensor_messages import MAX_BEAMS
from uavseg.occupancy.simulation.scene import CellScene, Scene
from uavseg.raster.grid.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, UNKNOWN


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
    states: NDArray[np.uint8]
    solid: Mask  # (rows, cols) bool; whether the centre of the cell lies inside a polygon or circle
    # (rows, cols) bool; whether from some pose the centre of the cell lies within the field of view and the
    # maximum range, and nothing hides it. A solid cell is visible up to the depth at which a beam still
    # updates cells behind its return, 3 σ.
    visible: Mask


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

    def _visible_from(self, pose: Pose, x: NDArray[np.float64], y: NDArray[np.float64], solid: Mask) -> Mask:
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
