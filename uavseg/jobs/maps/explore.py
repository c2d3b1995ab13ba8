"""Job of a robot that explores a simulated scene until nothing that it can see is unknown."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from uavseg.arrays import Bools
from uavseg.dataclass import dataclass
from uavseg.errors import SceneError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.maps.merge_maps import read_map
from uavseg.jobs.maps.next_view import cell_at, pose_of
from uavseg.occupancy.explore.drive import Drive, Explorer, knowable_cells
from uavseg.occupancy.map_file import trinary_states
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.paths.find_path import PathParams
from uavseg.occupancy.paths.path_text import feature_collection
from uavseg.occupancy.ros.ros_map import placement
from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES, load_scene
from uavseg.occupancy.simulation.simulate import CellScene, RangeFinder, Scene
from uavseg.options.maps import ExploreOptions, sensor_changes
from uavseg.raster.grid.geobox import GeoBox
from uavseg.segmentation.params.segment import StateLimits
from uavseg.units import FREE, UNKNOWN

_COMPLETE = 0.99  # share of what can be known, below which a drive is not complete


@dataclass(frozen=True)
class Explored:
    """A drive through a scene."""

    drive: Drive
    knowable: Bools  # (rows, cols); cells that some place sees which the robot could reach
    warnings: tuple[str, ...]

    def to_geojson(self) -> str:
        """Return the drive, a line, and the views at which it stopped, as GeoJSON in local coordinates."""
        drive = self.drive
        places = np.round(drive.xy, 6).tolist()
        about = {"length_m": round(drive.metres[-1], 6), "scans": len(places), "known": round(self.share, 6)}
        features: list[tuple[dict[str, Any], dict[str, Any]]] = [
            (about, {"type": "LineString", "coordinates": places if len(places) > 1 else places * 2})
        ]
        for number, scan in enumerate(drive.views, start=1):
            driven = round(drive.metres[scan], 6)
            heading = round(math.degrees(drive.poses[scan].heading_rad) % 360, 3)
            view = {"view": number, "scan": scan, "heading_deg": heading, "driven_m": driven}
            features.append((view, {"type": "Point", "coordinates": places[scan]}))
        return feature_collection(features)

    def table(self) -> str:
        """Return the scans as CSV: place, heading, metres driven and cells that are known."""
        lines = ["scan,x,y,heading_deg,driven_m,known_cells"]
        scans = zip(self.drive.poses, self.drive.metres, self.drive.known, strict=True)
        for k, (pose, metres, known) in enumerate(scans):
            heading = math.degrees(pose.heading_rad) % 360
            lines.append(f"{k},{pose.x:.6f},{pose.y:.6f},{heading:.3f},{metres:.6f},{known}")
        return "\n".join(lines) + "\n"

    @property
    def share(self) -> float:
        """Return the share of what can be known that is known at the end."""
        known = StateLimits().of(self.drive.grid.probabilities) != UNKNOWN
        return float((known & self.knowable).sum() / self.knowable.sum())


def explore(options: ExploreOptions) -> Explored:
    """Let a robot explore a scene: "lens", "circles", a JSON file, or a map whose free cells it may enter."""
    scene, clearance_m, warnings = options.scene, options.clearance, list[str]()
    solids, sensor, geobox, first = _opened(scene, sensor_changes(options, options.range), warnings)
    side, _, _ = placement(geobox)  # refuses cells that are not square or not in metres
    PathParams(clearance_m)
    start = first if options.start is None else pose_of(options.start, "start")
    if start is None:
        raise SceneError(f"{scene} is a map, so nobody knows where the robot begins; give it (--start X,Y)")
    explorer = Explorer(solids, sensor, OccupancyGrid(geobox), clearance_m, options.seed)
    with phase("drive"):
        drive = explorer.run(start)
    decided("%d scans, %d choices", len(drive.poses), len(drive.seconds))
    rows, cols = np.indices(geobox.shape) + 0.5
    solid = solids.contains(*geobox.xy_from_pixel(rows, cols))
    at = cell_at(geobox, (start.x, start.y))
    knowable = knowable_cells(solid, at, side, sensor.max_range_m, clearance_m)
    explored = Explored(drive, knowable, tuple(warnings))
    if explored.share < _COMPLETE:
        known = f"only {100 * explored.share:.1f} % of what could be known is known"
        why = "the rest was looked at in vain (a longer range, or smaller steps of the beams)"
        warnings.append(f"{known}; {why}")
    return replace(explored, warnings=tuple(warnings))


def _opened(
    scene: str, changes: dict[str, float], warnings: list[str]
) -> tuple[Scene | CellScene, RangeFinder, GeoBox, Pose | None]:
    """Return what is solid, the sensor, the cells of the map and the first pose of a scene or a map."""
    if scene not in BUILT_IN_SCENES and not scene.lower().endswith(".json"):
        if "max_range_m" not in changes:
            raise SceneError(f"{scene} is a map, and has no sensor; say how far it sees (--range M)")
        found = read_map(scene, warnings)
        solid = trinary_states(found.probabilities) != FREE
        return CellScene(solid, found.geobox), RangeFinder(**changes), found.geobox, None
    whole = BUILT_IN_SCENES[scene]() if scene in BUILT_IN_SCENES else load_scene(scene)
    return whole.scene, replace(whole.sensor, **changes), whole.geobox, whole.poses[0]
