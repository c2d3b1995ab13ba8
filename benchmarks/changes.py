"""Changes between two maps of one place: recall and false changes on drawn rooms, at shifts of the second.

    python -m benchmarks.changes    # tables: two maps, numbers of live segments, evidence that fades

Ten scenes of two rooms with boxes. Between the runs one box is taken away, one is added, one is moved. The second map
lies in a frame that is shifted and turned. A change is found if a region of its kind overlaps it; a region is false if
it lies on none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.simulation.scene import Scene
from uavseg.occupancy.simulation.simulate import RangeFinder
from uavseg.raster.grid.geobox import local_geobox

CELL_M, SIZE_M, SIGMA_M = 0.05, (9.0, 6.0), 0.03
SHIFTS = {
    "as it is": (0.0, 0.0, 0.0),
    "1 cell": (1.0, 0.0, 0.0),
    "(1.5, -1) cells": (1.5, -1.0, 0.0),
    "(2, 1) cells, 1 degree": (2.0, 1.0, 1.0),
    "(-3, 3) cells, -1.9 degrees": (-3.0, 3.0, -1.9),
}
SENSOR = RangeFinder(SIGMA_M, 8.0, fov_deg=360.0, step_deg=0.5)
Box = tuple[float, float, float, float]  # x, y, half sides


@dataclass(frozen=True, slots=True)
class Pair:
    """Two states of a place: walls, and boxes before and after."""

    walls: tuple[Box, ...]
    before: tuple[Box, ...]
    after: tuple[Box, ...]

    def scene(self, boxes: Sequence[Box]) -> Scene:
        """Return a state of the place as a scene."""
        return Scene(polygons=[_corners(box) for box in (*self.walls, *boxes)])


def _corners(box: Box) -> NDArray[np.float64]:
    x, y, half_x, half_y = box
    return np.array(
        [
            (x - half_x, y - half_y),
            (x + half_x, y - half_y),
            (x + half_x, y + half_y),
            (x - half_x, y + half_y),
        ]
    )


def draw_pair(seed: int) -> Pair:
    """Draw two rooms with a door, six boxes that stay, one that goes, one that comes, one that moves."""
    random = np.random.default_rng([seed, 1])
    width, height = SIZE_M
    door = random.uniform(1.5, 4.5)
    middle, thick = random.uniform(3.8, 5.2), 0.075
    walls = [(width / 2, 0.5, 4.0, thick), (width / 2, height - 0.5, 4.0, thick)]
    walls += [(0.5, height / 2, thick, 2.5), (width - 0.5, height / 2, thick, 2.5)]
    low, high = door - 0.45, door + 0.45
    walls += [
        (middle, (0.5 + low) / 2, thick, (low - 0.5) / 2),
        (middle, (high + height - 0.5) / 2, thick, (height - 0.5 - high) / 2),
    ]
    placed: list[Box] = []
    while len(placed) < 10:
        box = (
            random.uniform(1, width - 1),
            random.uniform(1, height - 1),
            random.uniform(0.12, 0.3),
            random.uniform(0.12, 0.3),
        )
        apart = all(
            max(abs(box[0] - o[0]) - box[2] - o[2], abs(box[1] - o[1]) - box[3] - o[3]) > 0.25
            for o in (*placed, *walls)
        )
        if apart and abs(box[0] - middle) > 0.7:
            placed.append(box)
    stay, gone, new, moved, target = placed[:6], placed[6], placed[7], placed[8], placed[9]
    moved_to = (*target[:2], *moved[2:])
    return Pair(tuple(walls), (*stay, gone, moved), (*stay, new, moved_to))


def run_map(
    scene: Scene, seed: int, motion: tuple[float, float, float] = (0.0, 0.0, 0.0), poses: int = 40
) -> OccupancyGrid:
    """Merge scans from free places into a map, in a frame that is moved by cells x, y and degrees around the middle."""
    random = np.random.default_rng([seed, 2])
    grid = OccupancyGrid(
        local_geobox((round(SIZE_M[1] / CELL_M), round(SIZE_M[0] / CELL_M)), CELL_M, (0.0, 0.0))
    )
    turn = math.radians(motion[2])
    merged = 0
    while merged < poses:
        x, y = random.uniform(0.8, SIZE_M[0] - 0.8), random.uniform(0.8, SIZE_M[1] - 0.8)
        around = np.linspace(0, math.tau, 16)
        if scene.contains(x + 0.2 * np.cos(around), y + 0.2 * np.sin(around)).any():
            continue
        scan = SENSOR.scan(scene, Pose(x, y, heading_rad=random.uniform(0, math.tau)), random)
        px, py = place_of((x, y), motion)
        pose = Pose(px, py, heading_rad=scan.pose.heading_rad + turn)
        grid.merge(Scan(pose=pose, angles=scan.angles, ranges=scan.ranges, max_range_m=8.0, sigma_m=SIGMA_M))
        merged += 1
    return grid


def place_of(xy: tuple[float, float], motion: tuple[float, float, float]) -> tuple[float, float]:
    """Return where a place lies in the frame that is moved by cells and degrees around the middle of the map."""
    turn = math.radians(motion[2])
    u, v = xy[0] - SIZE_M[0] / 2, xy[1] - SIZE_M[1] / 2
    x = SIZE_M[0] / 2 + u * math.cos(turn) - v * math.sin(turn) + motion[0] * CELL_M
    return x, SIZE_M[1] / 2 + u * math.sin(turn) + v * math.cos(turn) + motion[1] * CELL_M
