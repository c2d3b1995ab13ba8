"""Simulation of range scans: a scene, a sensor and poses to an occupancy grid, with its ground truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.beams import REACH_SIGMAS
from uavseg.occupancy.mapping.grey_map import Mask
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.range_finder import RangeFinder
from uavseg.occupancy.simulation.scene import Scene
from uavseg.raster.grid.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, UNKNOWN


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a scene for each cell.

    Parameters
    ----------
    states : (rows, cols) uint8 array
        1 free and 3 occupied where the cell is visible to the sensor, 2 (unknown) elsewhere.
    solid : (rows, cols) bool array
        Whether the centre of the cell lies inside a polygon or circle.
    visible : (rows, cols) bool array
        Whether from some pose the centre of the cell lies within the field of view and the maximum range, and
        nothing hides it. A solid cell is visible up to the depth at which a beam still updates cells behind
        its return, 3 σ.
    """

    states: NDArray[np.uint8]
    solid: Mask
    visible: Mask


@dataclass(frozen=True)
class Simulation:
    """A range finder that scans a scene from several poses.

    Parameters
    ----------
    scene : Scene
    sensor : RangeFinder
    poses : sequence of Pose
        At least one; none lies inside a polygon or circle.
    geobox : GeoBox
        The cells of the map.

    Raises
    ------
    SceneError
        If there is no pose, or one lies inside a polygon or circle.
    """

    scene: Scene
    sensor: RangeFinder
    poses: Sequence[Pose]
    geobox: GeoBox

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
        """The true state of each cell, and whether the sensor could observe it."""
        row, col = np.indices(self.geobox.shape)
        x, y = self.geobox.xy_from_pixel(row + 0.5, col + 0.5)
        solid = self.scene.contains(x, y)
        visible = np.zeros(self.geobox.shape, bool)
        for pose in self.poses:
            visible |= self._visible_from(pose, x, y, solid)
        states = np.where(visible, np.where(solid, OCCUPIED, FREE), UNKNOWN).astype(np.uint8)
        return Truth(states, solid, visible)

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
