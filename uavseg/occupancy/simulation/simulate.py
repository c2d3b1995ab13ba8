"""Simulation: a scene, a sensor and where it stands become a map, and the truth beside it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.beams import REACH_SIGMAS
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.range_finder import RangeFinder
from uavseg.occupancy.simulation.scene import Scene
from uavseg.raster.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, UNKNOWN

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Truth:
    """What a scene really is, cell by cell.

    Parameters
    ----------
    states : (rows, cols) uint8 array
        1 free and 3 occupied where the sensor could see the cell, 2 (unknown) where it could not.
    solid : (rows, cols) bool array
        The centre of the cell lies inside something.
    visible : (rows, cols) bool array
        The sensor could see the cell: from some pose its centre lies within the field of view and the maximal
        range, with nothing in between; a solid cell counts as seen as deep as a beam still says something
        about what it has hit, 3 σ.
    """

    states: NDArray[np.uint8]
    solid: Mask
    visible: Mask


@dataclass(frozen=True)
class Simulation:
    """A range finder that looks at a scene from several poses.

    Parameters
    ----------
    scene : Scene
    sensor : RangeFinder
    poses : sequence of Pose
        At least one; none stands inside something solid.
    geobox : GeoBox
        The cells of the map.

    Raises
    ------
    SceneError
        If a pose is inside something, or there is none.
    """

    scene: Scene
    sensor: RangeFinder
    poses: Sequence[Pose]
    geobox: GeoBox

    def __post_init__(self) -> None:
        if not self.poses:
            raise SceneError("a simulation wants at least one pose")
        for number, pose in enumerate(self.poses, start=1):
            if self.scene.contains([pose.x], [pose.y]).any():
                raise SceneError(
                    f"pose {number} at ({pose.x:g}, {pose.y:g}) stands inside something solid; move it out"
                )

    def run(self, seed: int = 0) -> OccupancyGrid:
        """The map that all scans together make; the noise of each pose depends on the seed and its number."""
        grid = OccupancyGrid(self.geobox)
        for number, pose in enumerate(self.poses):
            grid.merge(self.sensor.scan(self.scene, pose, np.random.default_rng([seed, number])))
        return grid

    def truth(self) -> Truth:
        """What is free, what is solid and what the sensor could see."""
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
        skin = REACH_SIGMAS * sensor.sigma_m
        distance = np.hypot(x - pose.x, y - pose.y)
        angle = np.arctan2(y - pose.y, x - pose.x)
        aside = (angle - math.radians(pose.heading_deg) + math.pi) % math.tau - math.pi
        near = (distance <= sensor.max_range_m + skin) & (np.abs(aside) <= np.abs(sensor.angles).max())
        seen = np.zeros(x.shape, bool)
        depth = distance[near] - self.scene.cast(pose.x, pose.y, angle[near])  # behind the first surface
        surface = distance[near] - depth
        within = np.where(solid[near], surface, distance[near]) <= sensor.max_range_m
        seen[near] = within & np.where(solid[near], depth <= skin, depth < 0)
        return seen
