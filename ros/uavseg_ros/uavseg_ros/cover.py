"""Coverage of regions of a robot's map: lines, to and fro, and legs between them, as waypoints for Nav2."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.arrays import Bools, Floats
from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError, PathError
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.occupancy.paths.path_text import feature_collection, path_to_waypoints
from uavseg.options import texts
from uavseg.options.option import group, option
from uavseg.options.running import output_option
from uavseg_ros import free_space, programs, sweep
from uavseg_ros.free_space import FreeSpace, MapRegion, cell_of
from uavseg_ros.robot_options import ProgramOptions, RobotOptions
from uavseg_ros.sweep import Sweep

_FORMATS = (".yaml", ".yml", ".csv", ".geojson", ".json")
_COLUMNS = ("x", "y", "heading_deg", "part")


@dataclass(frozen=True, eq=False)
class Coverage:
    """A path that covers regions of a map, and what of them it covers."""

    space: FreeSpace
    regions: tuple[MapRegion, ...]
    sweep: Sweep
    no_way_m2: float  # area over which the robot could drive, if there were a way to it

    @property
    def path(self) -> tuple[Floats, Bools]:
        """Return the waypoints (n, 2), row and column, and whether parts between them are lines: (n - 1,)."""
        xy = self.space.xy(self.sweep.path)
        moves = (np.diff(xy, axis=0) != 0).any(axis=1)
        return self.sweep.path[np.append(True, moves)], self.sweep.is_line[moves]

    @property
    def xy(self) -> Floats:
        """Return the waypoints in map coordinates, (n, 2)."""
        return self.space.xy(self.path[0])

    @property
    def heading_deg(self) -> float:
        """Return the heading of the lines, counterclockwise from the x axis of the map, in [0, 180)."""
        along = _linear(self.space) @ (math.cos(self.sweep.heading_rad), math.sin(self.sweep.heading_rad))
        return round(math.degrees(math.atan2(along[1], along[0])), 6) % 180

    @property
    def headings_deg(self) -> Floats:
        """Return where each waypoint heads: for the next one, the last as the one before; (n,), -180..180."""
        steps = np.diff(self.xy, axis=0)
        headings = np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
        return np.append(headings, headings[-1:] if len(headings) else 0.0)

    def length_m(self, lines: bool) -> float:
        """Return the metres of all lines, or of all legs."""
        lengths = np.hypot(*np.diff(self.sweep.path, axis=0).T) * self.space.side_m
        return float(lengths[self.sweep.is_line == lines].sum())

    def free_m2(self, region: MapRegion | None = None) -> float:
        """Return the free area of a region, or of all, in square metres."""
        return self._area_m2(self.sweep.wanted, region)

    def share(self, region: MapRegion | None = None, legs: bool = False) -> float:
        """Return which part of the free area of a region, or of all, is covered by lines, or by legs too."""
        covered = self.sweep.by_path if legs else self.sweep.by_lines
        return self._area_m2(covered, region) / self.free_m2(region)

    @property
    def out_of_reach_m2(self) -> float:
        """Return the free area that is not covered, and farther than half the width from drivable cells."""
        reached = self.sweep.reachable | self.sweep.by_lines
        return self._area_m2(self.sweep.wanted & ~reached, None)

    def _area_m2(self, cells: free_space.Mask, region: MapRegion | None) -> float:
        within = cells if region is None else region.values(cells)
        return float(within.sum()) * self.space.side_m**2

    def to_text(self, suffix: str) -> str:
        """Return the text of a file: waypoints (.yaml), a table (.csv) or lines and legs (.geojson)."""
        if suffix in (".yaml", ".yml"):
            return path_to_waypoints(self._planned())
        return self._to_csv() if suffix == ".csv" else self._to_geojson()

    def _planned(self) -> PlannedPath:
        """Return the path as `uavseg path` has it, but with corners at any place of a cell."""
        corners: Any = self.path[0] - 0.5
        length_m = self.length_m(True) + self.length_m(False)
        radius_m = self.space.radius_m
        return PlannedPath(corners, self.space.geobox, length_m, cells=0, expanded=0, clearance_m=radius_m)

    def _to_csv(self) -> str:
        parts = [*("line" if line else "leg" for line in self.path[1].tolist()), ""]
        headings = (self.headings_deg.round(6) + 0.0).tolist()
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(_COLUMNS)
        for place, heading, part in zip(self.xy.tolist(), headings, parts, strict=True):
            table.writerow([*place, heading, part])
        return text.getvalue()

    def _to_geojson(self) -> str:
        """Return one feature for each line, and for each leg from one to the next."""
        xy, is_line = self.xy, self.path[1]
        first = np.flatnonzero(np.diff(is_line.astype(np.int8), prepend=-1).astype(bool) | is_line)
        ends = np.append(first[1:], len(is_line)).astype(int)
        features = []
        for number, (begin, end) in enumerate(zip(first.tolist(), ends.tolist(), strict=True), start=1):
            about = {"number": number, "part": "line" if is_line[begin] else "leg"}
            features.append((about, {"type": "LineString", "coordinates": xy[begin : end + 1].tolist()}))
        return feature_collection(features)


def cover(
    space: FreeSpace,
    regions: list[MapRegion],
    width_m: float,
    heading_deg: float | None = None,
    start: tuple[float, float] | None = None,
    part: int | None = None,
) -> Coverage:
    """Cover the free area of regions, from a place of the robot or from the first line on.

    Parameters
    ----------
    width_m : float
        Metres that the robot covers across its way.
    heading_deg : float, optional
        Of the lines, counterclockwise from the x axis of the map; by default that of the least driving.
    start : (float, float), optional
        x and y of the robot on the map.
    part : int, optional
        Part of the drivable cells; by default that of the start, or the one with cells of most regions.

    Raises
    ------
    ParameterError
        If the width is less than two cells, or the heading not finite.
    PathError
        If the robot has no room at the start, or no region has room for it.
    """
    if heading_deg is not None and not math.isfinite(heading_deg):
        raise ParameterError(f"a heading is a finite number of degrees, not {heading_deg:g}")
    here = None if start is None else space.place("start", start)
    if part is None:
        part = part_of(space, regions, start)
    inside = np.zeros(space.free.shape, np.bool_)
    for one in regions:
        inside[one.box] |= one.mask
    wanted = inside & space.free
    if not (wanted & (space.parts == part)).any() or part == 0:
        raise PathError(free_space.why_unreachable(space, regions[0], part))
    heading_rad = None
    if heading_deg is not None:
        along = (math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg)))
        x, y = np.linalg.solve(_linear(space), along)
        heading_rad = math.atan2(y, x)
    swept = sweep.sweep(space, wanted, part, width_m, heading_rad, here)
    elsewhere = wanted & space.drivable & (space.parts != part)
    return Coverage(
        space=space,
        regions=tuple(regions),
        sweep=swept,
        no_way_m2=float(elsewhere.sum()) * space.side_m**2,
    )


def part_of(space: FreeSpace, regions: list[MapRegion], start: tuple[float, float] | None) -> int:
    """Return the part of the drivable cells where the robot is, or the one with cells of most regions."""
    if start is None:
        return free_space.main_part(space, regions)
    return int(space.parts[cell_of(space.place("start", start))])


def _linear(space: FreeSpace) -> Floats:
    """Return the matrix (2, 2) from steps along columns and rows to steps on the map."""
    transform = space.geobox.transform
    return np.array([[transform.a, transform.b], [transform.d, transform.e]])


class CoverOptions(ProgramOptions):
    """Coverage."""

    robot: RobotOptions = group(RobotOptions)
    width: float = option(
        "What the robot covers across its way, such as the width of its tool or sensor.",
        required=True,
        metavar="M",
        basic=True,
    )
    output: str = output_option("The path: Nav2's waypoints .yaml, .csv or .geojson; - is GeoJSON.", "PATH")
    heading: float | None = option(
        "Of the lines, counterclockwise from the map's x axis.  [default: that of the least driving]",
        metavar="DEG",
        basic=True,
    )
    start: tuple[float, float] | None = option(
        "Where the robot is, in the map's coordinates.  [default: at the first line]",
        metavar="X,Y",
        parse=texts.numbers("--start is X,Y in the map's coordinates, such as 12.5,40", 2),
        basic=True,
    )


@job_command("cover", CoverOptions)
def command(options: CoverOptions, reporter: Reporter) -> None:
    """Cover the free area of REGIONS by lines, to and fro, with free legs between them.

    REGIONS are polygons in the coordinates of the map. Lines and legs keep the radius of the robot from
    everything that is not free; lines stay in the regions. A place counts as covered where it is nearer to a
    line than half of the width.
    """
    from uavseg.output.atomic import check_target

    output, overwrite, robot = options.output, options.files.overwrite, options.robot
    suffix = ".geojson" if output == "-" else Path(output).suffix.lower()
    if suffix not in _FORMATS:
        raise OutputError(f"{output}: a path is written to .yaml, .csv or .geojson")
    if output != "-":
        check_target(output, overwrite)
    write.keep_inputs([output], robot.regions, robot.map)
    space, regions, notes = robot.read()
    part = part_of(space, regions, options.start)
    reached, refused = robot.split_reachable(space, regions, part)
    found = cover(space, reached, options.width, options.heading, options.start, part)
    reporter.finish([*space.warnings, *notes, *refused, *_warnings(found)])
    write.write_text(output, found.to_text(suffix), overwrite)
    reporter.table(_rows(found) | {"written": write.shown(output)})


def _warnings(found: Coverage) -> list[str]:
    if not found.no_way_m2:
        return []
    return [f"no path leads to {found.no_way_m2:,.1f} m2 of the regions, over which the robot could drive"]


def _rows(found: Coverage) -> dict[str, str]:
    area = f"of {found.free_m2():,.1f} m2 of free area"
    rows = {
        "lines": f"{found.sweep.lines:,}, {found.length_m(True):,.1f} m, {found.heading_deg:g} degrees",
        "legs": f"{found.length_m(False):,.1f} m",
        "waypoints": f"{len(found.xy):,}",
        "covered": f"{100 * found.share():.1f} % {area}, {100 * found.share(legs=True):.1f} % with the legs",
    }
    for one in found.regions if len(found.regions) > 1 else ():
        name = f" ({one.name})" if one.name else ""
        rows[f"  {one.id}"] = f"{100 * found.share(one):.1f} % of {found.free_m2(one):,.1f} m2{name}"
    if round(found.out_of_reach_m2, 1):
        where = "along walls, and where the robot has no room or no way"
        rows["no reach"] = f"{found.out_of_reach_m2:,.1f} m2 {where}"
    return rows


def main() -> None:
    """Run the command, with the arguments of the process."""
    programs.run(command)


if __name__ == "__main__":
    main()
