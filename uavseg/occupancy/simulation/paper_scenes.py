"""The two scenes of the paper: an object like a divergent lens, and two circles side by side.

Of both the paper tells the size of the map (320 x 320 cells), the number of scans, their noise, that they
cover up to 2 m and that beams are 0.5 degrees apart; it shows scanned triangles with the sensor at a vertex,
and cells between beams that no beam crosses. Beams 0.5 degrees apart are 17 mm apart at 2 m, so cells are 10
mm here. Where the objects and the sensor stand is chosen to look like the figures.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.range_finder import RangeFinder
from uavseg.occupancy.simulation.scene import Scene
from uavseg.occupancy.simulation.simulate import Simulation
from uavseg.raster.geobox import local_geobox

CELLS = (320, 320)
CELL_M = 0.01
MIDDLE_M = 1.6


def lens() -> Simulation:
    """A divergent lens, thin in the middle, seen in five views with σ = 5 cm."""
    scene = Scene(polygons=[lens_outline(MIDDLE_M, MIDDLE_M, height=1.1, edge=1.0, waist=0.5)])
    return _around(scene, views=5, distance_m=1.5, first_deg=90.0, fov_deg=75.0, sigma_m=0.05)


def circles() -> Simulation:
    """Two circles side by side, seen in eight views with σ = 3 cm."""
    scene = Scene(circles=[(MIDDLE_M - 0.4, MIDDLE_M, 0.35), (MIDDLE_M + 0.4, MIDDLE_M, 0.35)])
    return _around(scene, views=8, distance_m=1.4, first_deg=22.5, fov_deg=60.0, sigma_m=0.03)


BUILT_IN: dict[str, Callable[[], Simulation]] = {"lens": lens, "circles": circles}


def lens_outline(
    x: float, y: float, height: float, edge: float, waist: float, arc_corners: int = 65
) -> NDArray[np.float64]:
    """Corners of a lens with two hollow sides: `edge` wide above and below, `waist` in the middle.

    Returns
    -------
    corners : (2 arc_corners, 2) array
        Counterclockwise; all lengths in metres.
    """
    sag = (edge - waist) / 2
    radius = (sag**2 + (height / 2) ** 2) / (2 * sag)
    half_angle = math.asin(height / 2 / radius)
    turned = np.linspace(-half_angle, half_angle, arc_corners)
    right = np.column_stack([waist / 2 + radius * (1 - np.cos(turned)), radius * np.sin(turned)])
    left = -right  # upside down as well, hence in order
    corners: NDArray[np.float64] = np.vstack([right, left]) + np.array([x, y])
    return corners


def _around(
    scene: Scene, views: int, distance_m: float, first_deg: float, fov_deg: float, sigma_m: float
) -> Simulation:
    """Views from a circle around the middle of the map, looking at it."""
    angles = [first_deg + 360.0 * view / views for view in range(views)]
    poses = [
        Pose(
            MIDDLE_M + distance_m * math.cos(math.radians(angle)),
            MIDDLE_M + distance_m * math.sin(math.radians(angle)),
            (angle + 180.0) % 360.0,
        )
        for angle in angles
    ]
    sensor = RangeFinder(sigma_m, 2.0, fov_deg, 0.5)
    return Simulation(scene, sensor, poses, local_geobox(CELLS, CELL_M, (0.0, 0.0)))
