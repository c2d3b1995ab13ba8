"""The two simulated scenes of the paper: an object like a divergent lens, and two circles side by side.

For both the paper gives the size of the map (320 x 320 cells), the number of scans, their noise, a range of 2
m and beams 0.5 degrees apart. It shows scanned triangles with the sensor at a vertex, and cells between beams
that no beam crosses. Beams 0.5 degrees apart are 17 mm apart at 2 m, so cells are 10 mm here. The positions
of the objects and the sensor are chosen to look like the figures.
"""

import math
from collections.abc import Callable

import numpy as np

from uavseg.arrays import Floats
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene, Simulation
from uavseg.raster.grid.geobox import local_geobox

_MAP_SHAPE = (320, 320)
_CELL_M = 0.01
_MIDDLE_M = 1.6


def lens() -> Simulation:
    """Make the scene of a divergent lens, thin in the middle, seen in five views with σ = 5 cm."""
    scene = Scene(polygons=[lens_outline(_MIDDLE_M, _MIDDLE_M, height=1.1, edge=1.0, waist=0.5)])
    return _views_around(scene, views=5, distance_m=1.5, first_deg=90.0, fov_deg=75.0, sigma_m=0.05)


def circles() -> Simulation:
    """Make the scene of two circles side by side, seen in eight views with σ = 3 cm."""
    scene = Scene(circles=[(_MIDDLE_M - 0.4, _MIDDLE_M, 0.35), (_MIDDLE_M + 0.4, _MIDDLE_M, 0.35)])
    return _views_around(scene, views=8, distance_m=1.4, first_deg=22.5, fov_deg=60.0, sigma_m=0.03)


BUILT_IN_SCENES: dict[str, Callable[[], Simulation]] = {"lens": lens, "circles": circles}


def lens_outline(
    x: float, y: float, height: float, edge: float, waist: float, arc_corners: int = 65
) -> Floats:
    """Compute the corners (2 arc_corners, 2) of a lens with two concave sides, counterclockwise.

    The centre and all lengths are in metres; `edge` is the width at the top and bottom, `waist` in the
    middle.
    """
    sag = (edge - waist) / 2
    radius = (sag**2 + (height / 2) ** 2) / (2 * sag)
    half_angle = math.asin(height / 2 / radius)
    turned = np.linspace(-half_angle, half_angle, arc_corners)
    right = np.column_stack([waist / 2 + radius * (1 - np.cos(turned)), radius * np.sin(turned)])
    left = -right  # mirrored in both axes, so the order continues
    return np.asarray(np.vstack([right, left]) + np.array([x, y]))


def _views_around(
    scene: Scene, views: int, distance_m: float, first_deg: float, fov_deg: float, sigma_m: float
) -> Simulation:
    """Place poses on a circle around the middle of the map, facing it."""
    angles = [first_deg + 360.0 * view / views for view in range(views)]
    poses = [
        Pose(
            _MIDDLE_M + distance_m * math.cos(math.radians(angle)),
            _MIDDLE_M + distance_m * math.sin(math.radians(angle)),
            heading_rad=math.radians((angle + 180.0) % 360.0),
        )
        for angle in angles
    ]
    sensor = RangeFinder(sigma_m=sigma_m, max_range_m=2.0, fov_deg=fov_deg, step_deg=0.5)
    geobox = local_geobox(_MAP_SHAPE, _CELL_M, (0.0, 0.0))
    return Simulation(scene=scene, sensor=sensor, poses=poses, geobox=geobox)
