"""Survey of a region: boustrophedon cellular decomposition, cells in a short order, legs that stay inside.

Strips are joined to cells that are flown line by line, to and fro (H. Choset and P. Pignon, Coverage path
planning: the boustrophedon cellular decomposition, Field and Service Robotics, 1998): a cell ends where
strips split or merge around concave places and holes. Legs between lines are shortest paths in the region
with a small leeway.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.cover.cells import count_cuts, has_steps, merge_flat_cells, monotone_cells
from uavseg.flight.cover.grid import grid_lines
from uavseg.flight.cover.lines import Lines, fly_lines, path_length
from uavseg.flight.cover.space import flight_space
from uavseg.flight.cover.strips import LEAST_LINE_M, strip_lines

Floats = NDArray[np.float64]

STEP = 2.0  # spacings: cells may be cut at steps of the outline that are longer
LEAST_HEIGHT = 0.5  # spacings: cells that are less high get no lines of their own
GAP = 3.0  # spacings: no longer are gaps over which a line leads on
TURN_M = 10.0
"""A turn costs the time of so many metres: at 5 m/s, braking and accelerating at 2.5 m/s2."""
STEP_DEG = 15.0  # azimuths that are tried besides those of edges
MAX_AZIMUTHS = 40
TRIED_AZIMUTHS = 6  # those that need the fewest lines are divided into cells
COMPACT = (
    0.8  # share of the convex hull: what fills more, and is one cell of a grid, is not divided otherwise
)
MAX_CUTS = 400  # into cells
FLOWN = 3  # the best of those are planned to the end


@dataclass(frozen=True, slots=True)
class CoverParams:
    """How a region is covered.

    Parameters
    ----------
    spacing_m : float
        Distance between neighbouring lines.
    angle_deg : float, optional
        Azimuth of the lines, clockwise from north; by default the one that takes the least time.
    reach_m : float
        How far photographs show ground beyond the end of a line.
    least_m : float
        Length of the shortest line.
    turn_m : float
        Metres that take as long as a turn.
    lead_m : float
        Length of the straight legs before and after each line, on which nothing is photographed.
    crosshatch : bool
        Whether the region is covered once more, in lines at a right angle to the first.
    """

    spacing_m: float
    angle_deg: float | None = None
    reach_m: float = 0.0
    least_m: float = LEAST_LINE_M
    turn_m: float = TURN_M
    lead_m: float = 0.0
    crosshatch: bool = False


@dataclass(frozen=True, slots=True)
class Survey:
    """Lines over one region, in the order and direction in which they are flown, and the legs between them.

    Parameters
    ----------
    angle_deg : float
        Azimuth of the lines, clockwise from north, in [0, 180).
    cells : int
        Number of parts of the region that are flown one after another, each from line to line.
    lines : (n, 2, 2) float64 array
        Start and end of each line, as x, y in metres.
    outer : (n, 2, 2) float64 array
        The same with the straight legs before and after lines, on which nothing is photographed.
    legs : tuple of (k, 2) float64 arrays
        From each line, with its straight leg, to the next, both ends included: n - 1 paths.
    """

    angle_deg: float
    cells: int
    lines: Floats
    outer: Floats
    legs: tuple[Floats, ...]

    @property
    def length_m(self) -> float:
        """Length of lines and legs in metres."""
        return float(_length(self.outer).sum() + sum(path_length(leg) for leg in self.legs))

    @property
    def turns(self) -> int:
        """Number of places at which the vehicle changes its direction."""
        return sum(len(leg) for leg in self.legs)


def surveys(region: Any, params: CoverParams, obstacles: Sequence[Any] = ()) -> list[Survey]:
    """Cover a region with parallel lines in a short order.

    Parameters
    ----------
    region : shapely Polygon
        In metres; may be concave and have holes.
    params : CoverParams
    obstacles : sequence of shapely Polygon
        Where no line or leg may lead.

    Returns
    -------
    list of Survey
        The shortest; one cell is also flown from the other end of its lines. Each may be reversed.

    Raises
    ------
    ParameterError
        If the spacing is not a positive number, or the angle not finite.
    MissionError
        If there would be more lines than a mission holds, or there is no way between them.

    Examples
    --------
    >>> flown, _ = surveys(shapely.box(0, 0, 20, 100), CoverParams(10))
    >>> flown.angle_deg, flown.cells, flown.lines.round(6).tolist()
    (0.0, 1, [[[5.0, 0.0], [5.0, 100.0]], [[15.0, 100.0], [15.0, 0.0]]])
    """
    simple, space = flight_space(region, params.spacing_m, params.lead_m, obstacles)
    near = flight_space(region, params.spacing_m, 0.0, obstacles)[1] if params.lead_m else space
    best = _best(simple, params, near, space)
    if not params.crosshatch:
        return best
    across = _best(simple, replace(params, angle_deg=best[0].angle_deg + 90), near, space)
    return [_joined(best, across, space)]


def _best(region: Any, params: CoverParams, near: FreeSpace, space: FreeSpace) -> list[Survey]:
    """The survey that takes the least time, with lines in one space and legs in another; see `surveys`."""

    def estimate(lines: Lines) -> float:
        return lines.estimate_m(params.turn_m)

    grids = sorted(
        (_grid(region, azimuth, params, near) for azimuth in _azimuths(region, params)), key=estimate
    )
    compact = region.area > COMPACT * shapely.convex_hull(region).area
    others = [grid for grid in grids[:FLOWN] if not compact or len(grid.cells) > 1]
    cells = [lines for grid in others for lines in _cells(region, grid.angle_deg, params)]
    free = [lines for lines in cells if _stays_in(lines, near)]  # merged cells are not monotone
    tried = sorted([*grids, *free], key=estimate)
    flown = [_fly(lines, space) for lines in tried[:FLOWN]]
    return min(flown, key=lambda ways: ways[0].length_m + params.turn_m * ways[0].turns)


def _azimuths(region: Any, params: CoverParams) -> list[float]:
    """The azimuth that is given, or those along edges and in steps that need the fewest lines.

    The number of lines is about half of what the outline rises and falls across them, in spacings.
    """
    if params.angle_deg is not None:
        return [normal_azimuth(params.angle_deg)]
    outlines = [*shapely.get_rings(region), shapely.get_exterior_ring(shapely.convex_hull(region))]
    step = np.concatenate([np.diff(shapely.get_coordinates(ring), axis=0) for ring in outlines])
    longest = step[np.argsort(-np.hypot(*step.T), kind="stable")][:MAX_AZIMUTHS]
    along = np.degrees(np.arctan2(longest[:, 0], longest[:, 1])) % 180
    azimuths = np.unique(np.round(np.concatenate([along, np.arange(0, 180, STEP_DEG)]), 3) % 180)
    edges = np.concatenate([np.diff(shapely.get_coordinates(ring), axis=0) for ring in outlines[:-1]])
    rise = [float(np.abs(edges @ axes(azimuth)[:, 1]).sum()) for azimuth in azimuths.tolist()]
    best: list[float] = azimuths[np.argsort(rise, kind="stable")][:TRIED_AZIMUTHS].tolist()
    return best


def normal_azimuth(angle_deg: float) -> float:
    """The direction of a line as an azimuth in [0, 180)."""
    if not math.isfinite(angle_deg):
        raise ParameterError(f"the azimuth of survey lines is a number of degrees or auto, not {angle_deg}")
    return float(angle_deg % 180) % 180


def axes(angle_deg: float) -> Floats:
    """Columns: the unit vectors along lines of an azimuth and across them, to the right."""
    azimuth = math.radians(angle_deg)
    sine, cosine = math.sin(azimuth), math.cos(azimuth)
    return np.array([[sine, cosine], [cosine, -sine]])


def _grid(region: Any, angle_deg: float, params: CoverParams, space: FreeSpace) -> Lines:
    """The lines of one azimuth, in one grid."""
    turn, spacing = axes(angle_deg), params.spacing_m

    def joins(starts: Floats, ends: Floats) -> NDArray[np.bool_]:
        near = _length(np.stack([starts, ends], axis=1)) <= GAP * spacing
        return near & space.sees(starts @ turn.T, ends @ turn.T)

    cells = grid_lines(_turned(region, turn), spacing, (params.reach_m, params.least_m), joins)
    return Lines(angle_deg, tuple(cell @ turn.T for cell in cells), params.lead_m)


def _cells(region: Any, angle_deg: float, params: CoverParams) -> list[Lines]:
    """The lines of one azimuth, in cells of their own height; cut at steps of the outline or not.

    None where there would be too many cells.
    """
    turn, spacing, least = axes(angle_deg), params.spacing_m, LEAST_HEIGHT * params.spacing_m
    turned = _turned(region, turn)
    steps = [math.inf, STEP * spacing] if has_steps(turned, STEP * spacing, least / 2) else [math.inf]
    few = [step for step in steps if count_cuts(turned, step, least / 2) <= MAX_CUTS]
    divisions = [monotone_cells(turned, step, least / 2) for step in few]
    laid = [
        [
            strip_lines(cell, spacing, params.reach_m, params.least_m)
            for cell in merge_flat_cells(cells, least)
        ]
        for cells in divisions
    ]
    return [Lines(angle_deg, tuple(cell @ turn.T for cell in cells), params.lead_m) for cells in laid]


def _stays_in(lines: Lines, space: FreeSpace) -> bool:
    flat = np.concatenate(lines.cells)
    return bool(space.sees(flat[:, 0], flat[:, 1]).all())


def _turned(region: Any, turn: Floats) -> Any:
    return shapely.transform(region, lambda xy: xy @ turn)


def _fly(lines: Lines, space: FreeSpace) -> list[Survey]:
    """Lines in a short order, with the legs between them."""
    return [Survey(lines.angle_deg, len(lines.cells), *one) for one in fly_lines(lines, space)]


def _joined(first: list[Survey], second: list[Survey], space: FreeSpace) -> Survey:
    """Two surveys, one after the other, with the shortest leg between them that their candidates have."""
    pairs = [
        (one, other)
        for some, others in ((first, second), (second, first))
        for one in [*some, *map(_reversed, some)]
        for other in [*others, *map(_reversed, others)]
    ]
    ends = np.array([[one.outer[-1, 1], other.outer[0, 0]] for one, other in pairs])
    points, index = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    index = index.reshape(-1, 2)
    paths = space.paths(points)
    best = int(np.argmin(paths.lengths[index[:, 0], index[:, 1]]))
    one, other = pairs[best]
    return Survey(
        first[0].angle_deg,
        one.cells + other.cells,
        np.concatenate([one.lines, other.lines]),
        np.concatenate([one.outer, other.outer]),
        (*one.legs, paths.path(*index[best].tolist()), *other.legs),
    )


def _reversed(flown: Survey) -> Survey:
    legs = tuple(leg[::-1] for leg in flown.legs[::-1])
    return replace(flown, lines=flown.lines[::-1, ::-1], outer=flown.outer[::-1, ::-1], legs=legs)


def _length(lines: Floats) -> Floats:
    lengths: Floats = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    return lengths
