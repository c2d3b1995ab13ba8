"""Mapping jobs: a map from the scans of a recorded bag at the poses of the robot, or of a simulated scene."""

from dataclasses import replace

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, SceneError
from uavseg.execution.executors import decided, phase
from uavseg.occupancy.bags.merge_bag import BagTopics, BuiltMap, MergeParams, merge_bag
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES, load_scene
from uavseg.occupancy.simulation.simulate import Simulation
from uavseg.options.maps import BuildMapOptions, SimulateOptions, sensor_changes

DEFAULT_ODOM = "/odom"


def topics_of(scan: str, odom: str | None, tf: bool) -> BagTopics:
    """Choose the topics: poses from odometry, by default of /odom, or from the tree of /tf, not from both."""
    if tf and odom is not None:
        raise ParameterError("poses come from --odom or from --tf (odom and tf in Python), not from both")
    return BagTopics(scan, None if tf else odom or DEFAULT_ODOM)


def merge_params(options: BuildMapOptions) -> MergeParams:
    """Return how the scans of a bag are merged."""
    return MergeParams(
        resolution_m=options.resolution,
        sigma_m=options.sigma,
        max_range_m=options.max_range,
        heights=options.heights,
        no_return=options.no_return,
        beam_order=options.beam_order,
    )


def build_map(bag: Path_, topics: BagTopics, params: MergeParams) -> BuiltMap:
    """Merge the scans of a recorded bag into a map; see `merge_bag`."""
    decided("scans of %s, poses of %s, cells of %g m", topics.scan, topics.odom or "/tf", params.resolution_m)
    with phase("scans"):
        built = merge_bag(bag, topics, params)
    decided("%d of %d scans merged in the frame %s", built.scans.merged, built.scans.total, built.frame)
    return built


@dataclass(frozen=True)
class Simulated:
    """The map that a simulation made."""

    simulation: Simulation  # scene, sensor and poses; has the ground truth
    grid: OccupancyGrid


def simulate(options: SimulateOptions) -> Simulated:
    """Simulate the map that a laser range finder makes of a scene: "lens", "circles" or a JSON file."""
    scene = options.scene
    whole = BUILT_IN_SCENES[scene]() if scene in BUILT_IN_SCENES else load_scene(scene)
    count = options.poses or len(whole.poses)
    if count > len(whole.poses):
        raise SceneError(f"{scene} has {len(whole.poses)} poses, and {count} are asked for")
    sensor = replace(whole.sensor, **sensor_changes(options, options.max_range))
    simulation = replace(whole, sensor=sensor, poses=whole.poses[:count])
    beams = len(simulation.sensor.angles)
    decided("%d poses of %d beams, the noise of seed %d", count, beams, options.seed)
    with phase("scans"):
        grid = simulation.run(options.seed)
    return Simulated(simulation, grid)
