"""Survey angles: `auto` against each of 180 fixed angles, by the time of the planned mission.

Flights are compared with simple grids: parallel lines a spacing apart, at the best of 180 angles, flown to
and fro, row by row, with shortest legs within the region. Lines that are clipped to the region are shorter
than its strips where edges are slanted, and leave ground uncovered there: lengths are compared with those,
and with the shortest order of the same lines (OR-tools, where it is installed). Times, from home and back,
are compared with grids whose lines cover their strips.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from benchmarks.flight.fields import Field, degrees, metres
from benchmarks.flight.plans import planned
from benchmarks.table import rows, with_provenance
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.cover.lines import flight_space, path_length
from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.items import WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import ARDUCOPTER

Floats = NDArray[np.float64]
CAMERA, HEIGHT_M, SPEED_M_S, SPACING_M = "DJI Mavic 3 Enterprise", 50.0, 8.0, 20.0
EXACT_LINES = 70  # simple grids of more lines are not solved
RANDOM = 6


def shapes() -> dict[str, Any]:
    """Return regions of about 300 m in metres, north-east of home."""
    comb = [shapely.box(60, 60, 360, 100), *(shapely.box(x, 60, x + 30, 260) for x in range(60, 360, 60))]
    angle = np.linspace(0, 5 * np.pi, 160)
    turns = np.column_stack([np.cos(angle), np.sin(angle)]) * (20 + 8 * angle)[:, None] + 260
    around = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    lobes = np.column_stack([np.cos(around), np.sin(around)]) * (110 + 50 * np.cos(3 * around))[:, None] + 220
    spikes = np.linspace(0, 2 * np.pi, 10, endpoint=False) + 0.1
    star = (
        np.column_stack([np.cos(spikes), np.sin(spikes)]) * np.where(np.arange(10) % 2, 65, 160)[:, None]
        + 220
    )
    east = np.linspace(60, 460, 60)
    river = shapely.LineString(
        np.column_stack([east, 180 + 0.4 * (east - 60) + 45 * np.sin(east / 35)])
    ).buffer(30)
    drawn = {
        "L": shapely.union(shapely.box(60, 60, 360, 150), shapely.box(60, 60, 150, 360)),
        "T": shapely.union(shapely.box(60, 270, 360, 360), shapely.box(165, 60, 255, 360)),
        "comb": shapely.union_all(comb),
        "spiral": shapely.LineString(turns).buffer(11),
        "lobes": shapely.Polygon(lobes),
        "star": shapely.Polygon(star),
        "ring": shapely.Point(210, 210).buffer(150) - shapely.Point(195, 220).buffer(60),
        "river": river,
        "rectangle": shapely.box(60, 60, 360, 210),
        "triangle": shapely.Polygon([(60, 60), (380, 120), (140, 330)]),
    }
    return drawn | {f"random {seed}": random_polygon(seed) for seed in range(RANDOM)}


def random_polygon(seed: int) -> Any:
    """Return a star-shaped polygon of 5 to 14 corners, up to 360 m across."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(5, 15))
    turns = (np.arange(count) + draw.uniform(-0.4, 0.4, count)) * 2 * np.pi / count
    radii = draw.uniform(60, 180, count)
    return shapely.Polygon(np.column_stack([np.cos(turns), np.sin(turns)]) * radii[:, None] + 240)


def duration_s(region: Any, angle: float | str = "auto", camera: str | None = CAMERA) -> float:
    """Return the estimated time of the mission over a region in metres, from home and back."""
    return sum(mission.estimate.duration_s for mission in planned_survey(region, angle, camera))


def planned_survey(region: Any, angle: float | str, camera: str | None) -> Sequence[Mission]:
    """Return the missions over a region in metres; without a camera, lines are a spacing apart."""
    return planned(
        Field("", (degrees(region),)),
        pattern="survey",
        camera=camera,
        height_m=HEIGHT_M,
        speed=SPEED_M_S,
        angle=angle,
        spacing=None if camera else SPACING_M,
    )


@dataclass(frozen=True, slots=True)
class SimpleGrid:
    """Parallel lines over a region, row by row, and shortest legs between any two of their ends."""

    lines: Floats  # (n, 2, 2), in metres
    rows: NDArray[np.int64]  # (n,), number of the row of each line
    lengths: Floats  # (2 n, 2 n), in metres between ends 2 k and 2 k + 1 of each line

    @property
    def lines_m(self) -> float:
        """Return the length of the lines."""
        return float(np.hypot(*(self.lines[:, 1] - self.lines[:, 0]).T).sum())

    def boustrophedon(self, space: FreeSpace) -> Floats:
        """Return the path (n, 2) over the lines, row by row to and fro."""
        order: list[tuple[int, int]] = []
        for number, row in enumerate(np.unique(self.rows).tolist()):
            ends = [(2 * k, 2 * k + 1) for k in np.flatnonzero(self.rows == row).tolist()]
            order += ends if number % 2 == 0 else [(b, a) for a, b in ends[::-1]]
        flown = self.lines.reshape(-1, 2)[np.array(order)]
        legs = space.each_path(flown[:-1, 1], flown[1:, 0])
        return np.concatenate(
            [*(part for pair in zip(flown[:-1], legs, strict=True) for part in pair), flown[-1]]
        )

    @property
    def least_m(self) -> float:
        """Return a lower bound of any order: no leg is shorter than to the nearest end of another line."""
        apart = self.lengths.copy()
        for k in range(len(self.lines)):
            apart[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = np.inf
        if len(self.lines) < 2:
            return self.lines_m
        nearest = np.sort(apart.min(axis=1))
        return self.lines_m + float(nearest[:-2].sum()) / 2


def simple_grid(
    region: Any, angle_deg: float, spacing_m: float, space: FreeSpace, covers: bool = False
) -> SimpleGrid:
    """Return the lines of one angle, evenly spaced over the region and at most a spacing apart.

    They are clipped to the region, or, with `covers`, as long as the region in their strips.
    """
    azimuth = math.radians(angle_deg)
    turn = np.array([[math.sin(azimuth), math.cos(azimuth)], [math.cos(azimuth), -math.sin(azimuth)]])
    turned = shapely.transform(region, lambda xy: xy @ turn)
    west, south, east, north = shapely.bounds(turned)
    count = max(math.ceil((north - south) / spacing_m - 1e-3), 1)
    height = (north - south) / count
    lines: list[Floats] = []
    row: list[int] = []
    for k in range(count):
        y = south + (k + 0.5) * height
        strip = shapely.box(west - 1, y - height / 2, east + 1, y + height / 2)
        met = strip if covers else shapely.LineString([(west - 1, y), (east + 1, y)])
        parts = shapely.get_parts(shapely.intersection(turned, met))
        reach = shapely.bounds(parts[shapely.length(parts) > 1e-6])[:, [0, 2]]
        for begin, end in reach[np.argsort(reach[:, 0])].tolist():
            if covers and row and row[-1] == k and begin <= lines[-1][1, 0]:
                lines[-1][1, 0] = max(end, lines[-1][1, 0])
            else:
                lines.append(np.array([[begin, y], [end, y]]))
                row.append(k)
    placed = np.stack(lines) @ turn.T
    return SimpleGrid(placed, np.array(row), space.paths(placed.reshape(-1, 2)).lengths)


def exact_m(grid: SimpleGrid, best_m: float = math.inf) -> float:
    """Return the length of the shortest order of the lines of a grid; infinite where that is above `best_m`.

    An integer program: every end of a line has one leg to another line, or is one of the two ends of the
    flight; closed tours of some of the lines are excluded when they appear (G. Dantzig, R. Fulkerson and
    S. Johnson, Solution of a large-scale traveling-salesman problem, Operations Research 2, 1954).
    """
    from ortools.linear_solver import pywraplp

    count = 2 * len(grid.lines)
    solver = pywraplp.Solver.CreateSolver("SCIP")
    pairs = [(a, b) for a in range(count) for b in range(a + 1, count) if a // 2 != b // 2]
    legs = {pair: solver.BoolVar("") for pair in pairs}
    stops = [solver.BoolVar("") for _ in range(count)]
    at: list[list[Any]] = [[stop] for stop in stops]
    for (a, b), leg in legs.items():
        at[a].append(leg)
        at[b].append(leg)
    for some in at:
        solver.Add(solver.Sum(some) == 1)
    solver.Add(solver.Sum(stops) == 2)
    solver.Minimize(solver.Sum([float(grid.lengths[pair]) * leg for pair, leg in legs.items()]))
    while True:
        if solver.Solve() != pywraplp.Solver.OPTIMAL:
            return math.inf
        total = grid.lines_m + solver.Objective().Value()
        flown = [pair for pair, leg in legs.items() if leg.solution_value() > 0.5]
        groups = closed_groups(len(grid.lines), [(a // 2, b // 2) for a, b in flown])
        if total >= best_m or len(groups) == 1:
            return total if total < best_m else math.inf
        for group in groups:
            inside = [leg for (a, b), leg in legs.items() if (a // 2 in group) != (b // 2 in group)]
            ends = [stops[2 * line + side] for line in group for side in (0, 1)]
            solver.Add(solver.Sum([*inside, *ends]) >= 2)


def closed_groups(count: int, pairs: Sequence[tuple[int, int]]) -> list[set[int]]:
    """Return the connected components of a graph of nodes 0..count - 1."""
    groups = [{node} for node in range(count)]
    for a, b in pairs:
        one, other = (next(group for group in groups if node in group) for node in (a, b))
        if one is not other:
            groups.remove(other)
            one |= other
    return groups


@dataclass(frozen=True, slots=True)
class AngleRow:
    """Times of a survey with a camera and with a spacing, and lengths over the region with the spacing.

    Parameters
    ----------
    name : str
    auto_s, fixed_s : float
        Estimate of the mission with the camera: by default, and at the best of 180 angles.
    spacing_auto_s, spacing_fixed_s : float
        The same with a spacing.
    length_m : float
        Over the region, between the first and the last waypoint.
    area_m, grid_m, exact_m : float
        Area over spacing; the best grid of clipped lines; its lines in the best order, NaN where that is not
        computed.
    covering : float
        Time of the flight over that of the best grid whose lines cover their strips.
    """

    name: str
    auto_s: float
    fixed_s: float
    spacing_auto_s: float
    spacing_fixed_s: float
    length_m: float
    area_m: float
    grid_m: float
    covering: float
    exact_m: float


def angle_rows(
    some: dict[str, Any],
    report: Callable[[str], None],
    exact: bool = True,
    angles: Sequence[int] = range(180),
) -> Iterator[AngleRow]:
    """Plan a survey over each region at each angle, and compare lengths."""
    for name, region in some.items():
        fixed = {
            camera: min(duration_s(region, angle, camera) for angle in angles) for camera in (CAMERA, None)
        }
        _, space = flight_space(region, SPACING_M)
        grids, covering = (
            [simple_grid(region, float(angle), SPACING_M, space, covers) for angle in range(180)]
            for covers in (False, True)
        )
        own = waypoints(region)
        row = AngleRow(
            name=name,
            auto_s=duration_s(region),
            fixed_s=fixed[CAMERA],
            spacing_auto_s=duration_s(region, camera=None),
            spacing_fixed_s=fixed[None],
            length_m=path_length(own),
            area_m=region.area / SPACING_M,
            grid_m=min(path_length(grid.boustrophedon(space)) for grid in grids),
            covering=flown_s(own) / min(flown_s(grid.boustrophedon(space)) for grid in covering),
            exact_m=shortest_m(grids) if exact else math.nan,
        )
        report(f"angles: {row}")
        yield row


def waypoints(region: Any) -> Floats:
    """Return the waypoints of the planned flight (n, 2), in metres."""
    mission = planned_survey(region, "auto", None)[0]
    places = [(item.lon, item.lat) for item in mission.items if item.command == WAYPOINT]
    xy: Floats = shapely.get_coordinates(metres(shapely.LineString(places)))
    return xy


def flown_s(over: Floats) -> float:
    """Return the time of a level path (n, 2) from home and, after a stop, back; of its faster direction."""
    speeds = np.full(len(over) + 1, SPEED_M_S)
    speeds[-1] = ARDUCOPTER.return_speed_m_s
    stops = np.arange(len(over) + 2) == len(over)
    each = []
    for path in (over, over[::-1]):
        xyz = np.zeros((len(over) + 2, 3))
        xyz[1:-1, :2] = path
        each.append(float(leg_seconds(xyz, speeds, ARDUCOPTER, stops).sum()))
    return min(each)


def shortest_m(grids: Sequence[SimpleGrid]) -> float:
    """Return the length of the shortest order of the best grid; NaN without OR-tools or with many lines."""
    if find_spec("ortools") is None:
        return math.nan
    best = math.inf
    for grid in sorted(grids, key=lambda grid: grid.least_m):
        if grid.least_m >= best:
            break
        if len(grid.lines) > EXACT_LINES:
            continue
        best = min(best, exact_m(grid, best))
    return best if math.isfinite(best) else math.nan


def angles_table(found: Sequence[AngleRow]) -> str:
    """Return `auto` against fixed angles, and lengths against those of simple grids."""
    heads = [
        "region",
        "auto, s",
        "best fixed, s",
        "auto, s (spacing)",
        "best fixed, s (spacing)",
        "length, m",
    ]
    heads += ["over area / spacing", "over clipped lines", "in the best order", "time over covering lines"]
    cells = [
        [
            one.name,
            *(f"{t:.1f}" for t in (one.auto_s, one.fixed_s, one.spacing_auto_s, one.spacing_fixed_s)),
            f"{one.length_m:,.0f}",
            f"{one.length_m / one.area_m:.3f}",
            f"{one.length_m / one.grid_m:.3f}",
            "" if math.isnan(one.exact_m) else f"{one.length_m / one.exact_m:.3f}",
            f"{one.covering:.3f}",
        ]
        for one in found
    ]
    return with_provenance(rows(heads, cells))
