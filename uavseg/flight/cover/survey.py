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
from uavseg.flight.avoid.free_space import FreeSpace, ShortestPaths
from uavseg.flight.cover.cells import merge_flat_cells, monotone_cells
from uavseg.flight.cover.strips import strip_lines
from uavseg.flight.order.stops import Stops
from uavseg.flight.order.tour import short_tour

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEEWAY = 0.6
"""Spacings by which lines, and legs between them, may leave the region."""
STEP = 2.0  # spacings: cells may be cut at steps of the outline that are longer
SLACK = 0.04  # spacings by which outlines are simplified
LEAST_HEIGHT = 0.5  # spacings: cells that are less high get no lines of their own
TURN_M = 10.0
"""A turn costs the time of so many metres: at 5 m/s, braking and accelerating at 2.5 m/s2."""
MAX_VERTICES = 200  # outlines with more are simplified
STEP_DEG = 15.0  # azimuths that are tried besides those of edges
MAX_AZIMUTHS = 40
ROUNDS = 300  # of the search for the order of many cells
FLOWN_AZIMUTHS = 6  # those that need the fewest lines are planned to the end


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
    turn_m : float
        Metres that take as long as a turn.
    """

    spacing_m: float
    angle_deg: float | None = None
    reach_m: float = 0.0
    turn_m: float = TURN_M


@dataclass(frozen=True, slots=True)
class SurveyCell:
    """A cell of a survey: a polygon in metres, and its lines, from number `first` to before `stop`."""

    polygon: Any
    first: int
    stop: int


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
    legs : tuple of (k, 2) float64 arrays
        From the end of each line to the start of the next, both included: n - 1 paths.
    parts : tuple of SurveyCell
        The cells, in the order in which they are flown.
    """

    angle_deg: float
    cells: int
    lines: Floats
    legs: tuple[Floats, ...]
    parts: tuple[SurveyCell, ...] = ()

    @property
    def length_m(self) -> float:
        """Length of lines and legs in metres."""
        return float(_length(self.lines).sum() + sum(_path_length(leg) for leg in self.legs))

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
    slack = SLACK * params.spacing_m
    simple = shapely.simplify(region, slack / 2) if _is_complex(region) else region
    allowed = shapely.simplify(shapely.buffer(simple, LEEWAY * params.spacing_m - 1.5 * slack), slack)
    space = FreeSpace(allowed, obstacles)
    flown = [
        _fly(simple, azimuth, step_m, params, space)
        for azimuth in _azimuths(simple, params)
        for step_m in (math.inf, STEP * params.spacing_m)
    ]
    return min(flown, key=lambda ways: ways[0].length_m + params.turn_m * ways[0].turns)


def _is_complex(region: Any) -> bool:
    return int(shapely.get_num_coordinates(region)) > MAX_VERTICES


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
    best: list[float] = azimuths[np.argsort(rise, kind="stable")][:FLOWN_AZIMUTHS].tolist()
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


def _fly(region: Any, angle_deg: float, step_m: float, params: CoverParams, space: FreeSpace) -> list[Survey]:
    """The region in lines of one azimuth, cell by cell, in a short order; see `surveys`."""
    least = LEAST_HEIGHT * params.spacing_m
    turned = shapely.transform(region, lambda xy: xy @ axes(angle_deg))
    cells = merge_flat_cells(monotone_cells(turned, step_m, least / 2), least)
    laid = [strip_lines(cell, params.spacing_m, params.reach_m) for cell in cells]
    lines = np.concatenate(laid) @ axes(angle_deg).T
    stops = np.cumsum([len(some) for some in laid])
    candidates = [_candidates(range(stop - len(some), stop)) for some, stop in zip(laid, stops, strict=True)]
    one = len(cells) == 1
    orders = candidates[0][:2] if one else [_join_cells(candidates, lines.reshape(-1, 2), space)]
    flown = [_survey(angle_deg, len(cells), lines, order, space) for order in orders]
    outlines = [shapely.transform(cell, lambda xy: xy @ axes(angle_deg).T) for cell in cells]
    return [
        replace(one, parts=_flown_cells(outlines, stops, order))
        for one, order in zip(flown, orders, strict=True)
    ]


def _flown_cells(cells: Sequence[Any], stops: Ints, order: Ints) -> tuple[SurveyCell, ...]:
    """The cells in the order of their lines."""
    owner = np.searchsorted(stops, order // 2, side="right")
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    ends = [*starts[1:].tolist(), len(owner)]
    return tuple(
        SurveyCell(cells[owner[first]], first, stop)
        for first, stop in zip(starts.tolist(), ends, strict=True)
    )


def _survey(angle_deg: float, cells: int, lines: Floats, order: Ints, space: FreeSpace) -> Survey:
    flown = lines[order // 2]
    turned = order % 2 == 1
    flown[turned] = flown[turned, ::-1]
    return Survey(angle_deg, cells, flown, _legs(flown, space))


def _candidates(cell: Sequence[int]) -> list[Ints]:
    """The four ways over the lines of a cell, each as 2 k for line k and 2 k + 1 for line k backwards."""
    index = np.array(cell, np.int64)
    odd = np.arange(len(index)) % 2
    forward = [2 * index + (odd ^ turn) for turn in (0, 1)]
    return forward + [(one ^ 1)[::-1] for one in forward]


def _join_cells(candidates: list[list[Ints]], ends: Floats, space: FreeSpace) -> Ints:
    """One order over all cells: the lines of each in one of its ways."""
    entries = np.array([[(way[0], way[-1] ^ 1) for way in ways] for ways in candidates])
    points, index = np.unique(entries.ravel(), return_inverse=True)
    lengths = space.paths(ends[points]).lengths
    tour = short_tour(Stops.of(list(index.reshape(entries.shape))), lengths, rounds=ROUNDS)
    return np.concatenate([candidates[cell][way] for cell, way in tour])


def _legs(flown: Floats, space: FreeSpace) -> tuple[Floats, ...]:
    """Shortest paths from the end of each line to the start of the next."""
    starts, ends = flown[:-1, 1], flown[1:, 0]
    if not len(starts):
        return ()
    straight = space.sees(starts, ends)
    found: list[Floats] = []
    for k in range(len(starts)):
        pair = np.stack([starts[k], ends[k]])
        paths: ShortestPaths | None = None if straight[k] else space.paths(pair)
        found.append(pair if paths is None else paths.path(0, 1))
    return tuple(found)


def _length(lines: Floats) -> Floats:
    lengths: Floats = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    return lengths


def _path_length(path: Floats) -> float:
    return math.fsum(np.hypot(*np.diff(path, axis=0).T).tolist())
