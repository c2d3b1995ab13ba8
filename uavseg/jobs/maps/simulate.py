"""Simulation of a laser range finder: the map that it makes of a scene."""

from dataclasses import dataclass, replace

from uavseg.errors import SceneError
from uavseg.execution.phases import decided, phase
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.simulation.paper_scenes import BUILT_IN_SCENES
from uavseg.occupancy.simulation.scene_file import load_scene
from uavseg.occupancy.simulation.simulate import Simulation


@dataclass(frozen=True, slots=True)
class SimulateRequest:
    """Which noise, and what differs from the scene's own sensor.

    Parameters
    ----------
    seed : int
        Of the noise: the same seed gives the same map.
    poses : int, optional
        Scan from the first so many poses only.
    sigma_m, max_range_m, fov_deg, step_deg : float, optional
        Of the sensor: standard deviation of ranges, reach, field of view and angle between beams.
    """

    seed: int = 0
    poses: int | None = None
    sigma_m: float | None = None
    max_range_m: float | None = None
    fov_deg: float | None = None
    step_deg: float | None = None

    @property
    def sensor(self) -> dict[str, float]:
        """What is given of the sensor."""
        named = {
            "sigma_m": self.sigma_m,
            "max_range_m": self.max_range_m,
            "fov_deg": self.fov_deg,
            "step_deg": self.step_deg,
        }
        return {name: value for name, value in named.items() if value is not None}


@dataclass(frozen=True)
class Simulated:
    """The map that a simulation made.

    Parameters
    ----------
    simulation : Simulation
        Scene, sensor and poses; knows the truth.
    grid : OccupancyGrid
    """

    simulation: Simulation
    grid: OccupancyGrid


def simulate(scene: str, request: SimulateRequest = SimulateRequest()) -> Simulated:
    """The map that a laser range finder makes of a scene.

    Parameters
    ----------
    scene : str
        "lens", "circles", or the path of a scene's JSON file.
    request : SimulateRequest

    Raises
    ------
    SceneError
        If the scene cannot be read or has not so many poses.
    """
    found = BUILT_IN_SCENES[scene]() if scene in BUILT_IN_SCENES else load_scene(scene)
    wanted = request.poses or len(found.poses)
    if wanted > len(found.poses):
        raise SceneError(f"{scene} has {len(found.poses)} poses, and {wanted} are asked for")
    simulation = replace(found, sensor=replace(found.sensor, **request.sensor), poses=found.poses[:wanted])
    beams = len(simulation.sensor.angles)
    decided("%d poses of %d beams, the noise of seed %d", wanted, beams, request.seed)
    with phase("scans"):
        grid = simulation.run(request.seed)
    return Simulated(simulation, grid)
