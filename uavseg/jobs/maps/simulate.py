"""Simulation job: the map that a laser range finder makes of a scene."""

from dataclasses import replace

from uavseg.dataclass import dataclass
from uavseg.errors import SceneError
from uavseg.execution.executors import decided, phase
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.simulation.paper_scenes import BUILT_IN_SCENES
from uavseg.occupancy.simulation.scene_file import load_scene
from uavseg.occupancy.simulation.simulate import Simulation


@dataclass(frozen=True, slots=True)
class SimulateRequest:
    """Seed of the noise, and changes to the sensor of the scene."""

    seed: int = 0  # of the noise: the same seed gives the same map
    poses: int | None = None  # number of poses to scan from, the first of the scene; by default all
    # Of the sensor: standard deviation of ranges, reach, field of view and angle between beams.
    sigma_m: float | None = None
    max_range_m: float | None = None
    fov_deg: float | None = None
    step_deg: float | None = None

    @property
    def sensor(self) -> dict[str, float]:
        """Return the requested changes to the sensor."""
        names = ("sigma_m", "max_range_m", "fov_deg", "step_deg")
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}


@dataclass(frozen=True)
class Simulated:
    """The map that a simulation made."""

    simulation: Simulation  # scene, sensor and poses; has the ground truth
    grid: OccupancyGrid


def simulate(scene: str, request: SimulateRequest = SimulateRequest()) -> Simulated:
    """Simulate the map that a laser range finder makes of a scene: "lens", "circles" or a JSON file."""
    whole = BUILT_IN_SCENES[scene]() if scene in BUILT_IN_SCENES else load_scene(scene)
    count = request.poses or len(whole.poses)
    if count > len(whole.poses):
        raise SceneError(f"{scene} has {len(whole.poses)} poses, and {count} are asked for")
    simulation = replace(whole, sensor=replace(whole.sensor, **request.sensor), poses=whole.poses[:count])
    beams = len(simulation.sensor.angles)
    decided("%d poses of %d beams, the noise of seed %d", count, beams, request.seed)
    with phase("scans"):
        grid = simulation.run(request.seed)
    return Simulated(simulation, grid)
