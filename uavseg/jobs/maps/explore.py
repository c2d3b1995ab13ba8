"""Jobs of where a robot looks next in a map, and of one that explores a scene until nothing is unknown."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from uavseg.arrays import Bools, Float32s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError, SceneError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.maps.classify import ClassifyRequest, classify
from uavseg.jobs.maps.merge_maps import placed_map, read_map
from uavseg.jobs.source.open_source import map_of
from uavseg.jobs.source.source import Blocks, ProbabilityMap
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.occupancy.explore.drive import Drive, Explorer, knowable_cells
from uavseg.occupancy.explore.frontiers import States, expected_bits
from uavseg.occupancy.explore.next_view import Cell, Tour, ViewPlanner, tour_from
from uavseg.occupancy.map_file import trinary_states
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.paths.any_angle import pull_string
from uavseg.occupancy.paths.astar import shortest_path
from uavseg.occupancy.paths.find_path import PathParams, PlannedPath
from uavseg.occupancy.paths.path_text import feature_collection, line_geometry, point_geometry
from uavseg.occupancy.ros.ros_map import placement
from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES, load_scene
from uavseg.occupancy.simulation.simulate import CellScene, RangeFinder, Scene
from uavseg.options.maps import ExploreOptions, NextViewOptions, sensor_changes
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import line_length
from uavseg.segmentation.params.segment import StateLimits
from uavseg.units import FREE, OCCUPIED, UNKNOWN

_COMPLETE = 0.99  # share of what can be known, below which a drive is not complete
_STATES = {0: "has no value", UNKNOWN: "is unknown", OCCUPIED: "is occupied"}


@dataclass(frozen=True)
class View:
    """A pose of the sensor from which unknown space can be seen."""

    pose: Pose
    way: PlannedPath  # the safe way to it from where the robot is
    bits: float  # entropy of the cells that a scan is expected to reach
    frontier_m: float  # length of the frontiers that it sees
    score: float  # the shortest tour through all views, over that which begins with this one: at most 1

    @property
    def properties(self) -> dict[str, float]:
        """Return what is written of the view."""
        return {
            "heading_deg": round(math.degrees(self.pose.heading_rad) % 360, 3),
            "distance_m": round(self.way.length_m, 6),
            "gain_bits": round(self.bits, 3),
            "frontier_m": round(self.frontier_m, 6),
            "score": round(self.score, 6),
        }


@dataclass(frozen=True)
class NextViews:
    """Views of a map, the best first; none where nothing that can be reached is unknown."""

    views: tuple[View, ...]
    geobox: GeoBox
    warnings: tuple[str, ...]

    def to_geojson(self) -> str:
        """Return the views, points with their rank and values, and the ways to them, as GeoJSON."""
        features: list[tuple[dict[str, Any], dict[str, Any]]] = []
        for rank, view in enumerate(self.views, start=1):
            features.append(({"view": rank, **view.properties}, point_geometry(view.way)))
            features.append(({"way_to": rank, "length_m": view.way.length_m}, line_geometry(view.way)))
        return feature_collection(features)


def pose_of(numbers: Sequence[float], name: str) -> Pose:
    """Return the pose of x, y and perhaps a heading in degrees."""
    if len(numbers) not in (2, 3):
        raise ParameterError(f"--{name} is X,Y or X,Y,HEADING, two or three numbers, not {len(numbers)}")
    x, y, heading = [*map(float, numbers), 0.0][:3]
    return Pose(x, y, heading_rad=math.radians(heading))


def check_view(options: NextViewOptions) -> StateLimits:
    """Return the limits of states; a ParameterError says that the robot or its sensor is impossible."""
    pose_of(options.pose, "pose")
    RangeFinder(max_range_m=options.range, fov_deg=options.fov)
    PathParams(options.clearance)
    if options.count < 1:
        raise ParameterError(f"the number of views is at least 1, not {options.count}")
    return StateLimits(options.free_below, options.occupied_above)


def next_views(source: ProbabilityMap | Blocks, options: NextViewOptions, work: Work = SERIAL) -> NextViews:
    """Find the views of a map from which a sensor would see what is unknown, in the order to go there."""
    limits, work = check_view(options), work.begun()
    source = map_of(source, "views are of single cells, so give the map itself")
    side, _, _ = placement(source.geobox)  # refuses cells that are not square or not in metres
    found = classify(source, ClassifyRequest(limits, objects=False), replace(work, progress=None))
    states = found.states
    at = cell_at(source.geobox, options.pose)
    if states[at] != FREE:
        raise MapError(
            f"the cell at the pose {options.pose[0]:g},{options.pose[1]:g} {_STATES[int(states[at])]}; "
            "a robot stands on a free one"
        )
    probabilities = placed_map(source).probabilities
    planner = ViewPlanner(states.shape, side, options.range, options.fov, options.clearance)
    with phase("views"):
        tour = planner.tour(states, at)
        views: tuple[View, ...] = ()
        if tour is not None:
            views = _ranked(planner, tour, states, probabilities, at, options, source.geobox)
    notes = [*found.warnings]
    if not views:
        notes.append("nothing that a robot could see from where it can go is unknown: there is no next view")
    return work.finished(NextViews(views, source.geobox, tuple(notes)))


def cell_at(geobox: GeoBox, place: Sequence[float]) -> Cell:
    """Return the cell in which a place lies; refuse one outside of the map."""
    col, row = ~geobox.transform * (float(place[0]), float(place[1]))
    if not (0 <= row < geobox.shape[0] and 0 <= col < geobox.shape[1]):
        raise MapError(f"the pose {place[0]:g},{place[1]:g} lies outside of the map")
    return int(row), int(col)


def _ranked(
    planner: ViewPlanner,
    tour: Tour,
    states: States,
    probabilities: Float32s,
    at: Cell,
    options: NextViewOptions,
    geobox: GeoBox,
) -> tuple[View, ...]:
    """Return the views by the length of the tour that begins with each; the first of the shortest leads."""
    lengths = np.array([_length_from(tour, k) for k in range(len(tour.views))])
    order = [0, *(1 + np.argsort(lengths[1:], kind="stable")).tolist()][: options.count]
    passable = planner.passable(states, at)
    views = []
    for k in order:
        view = planner.place(tour, tour.own()) if k == 0 else tour.views[k]
        row, col = tour.candidates.cells[view].tolist()
        angle, seen = planner.heading((row, col), tour.frontiers.cells[tour.candidates.seen_by(view)])
        path = shortest_path(passable, at, (row, col))
        corners = pull_string(passable, path.cells)
        way = PlannedPath(
            corners=corners,
            geobox=geobox,
            length_m=line_length(geobox, *(corners + 0.5).T),
            cells=len(path.cells),
            expanded=path.expanded,
            clearance_m=options.clearance,
        )
        (x, ahead_x), (y, ahead_y) = geobox.xy_from_pixel(
            np.array([row, row + math.sin(angle)]) + 0.5, np.array([col, col + math.cos(angle)]) + 0.5
        )
        reach, fov = options.range / planner.cell_m, math.radians(options.fov)
        views.append(
            View(
                pose=Pose(float(x), float(y), heading_rad=math.atan2(ahead_y - y, ahead_x - x)),
                way=way,
                bits=expected_bits(probabilities, states, (row, col), reach, angle, fov),
                frontier_m=len(seen) * planner.cell_m,
                score=float(min(lengths[0] / lengths[k], 1.0)) if lengths[k] > 0 else 1.0,
            )
        )
    return tuple(views)


def _length_from(tour: Tour, k: int) -> float:
    """Return the length of a short tour through all views that begins with the k-th, in cells."""
    rest = [j for j in range(len(tour.views)) if j != k]
    sequence = [k + 1, *(j + 1 for j in rest)]
    if rest and k > 0:
        order = tour_from(tour.lengths[np.ix_(sequence, sequence)], tour.depths[rest])
        sequence = [k + 1, *(rest[j] + 1 for j in order)]
    legs = tour.lengths[[0, *sequence[:-1]], sequence]
    return float(legs.sum())


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
