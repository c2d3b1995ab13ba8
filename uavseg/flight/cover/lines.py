"""Order of survey lines: the space to fly in, short orders of cells and their lines, legs between lines."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing, without_small_holes
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.order.tour import Stops, short_tour

LEEWAY = 0.6
"""Spacings by which lines, and legs between them, may leave the region."""
COARSE = 0.3  # spacings by which an outline of many corners is simplified
SLACK = 0.04  # spacings by which outlines are simplified
MAX_VERTICES = 40  # outlines with more are simplified


def flight_space(
    region: Any, spacing_m: float, lead_m: float = 0.0, obstacles: Sequence[Any] = ()
) -> tuple[Any, FreeSpace]:
    """Return a region with fewer vertices, which contains it but for corners, and the space to fly in.

    The region is in metres. Straight legs of `lead_m` lead out of it, and no leg may cross `obstacles`.
    """
    slack = SLACK * spacing_m
    simple = region = _of_few_corners(region, spacing_m)
    if shapely.get_num_coordinates(region) > MAX_VERTICES:
        fewer = shapely.simplify(region, slack / 2)
        grown = shapely.buffer(fewer, slack / 2, join_style="mitre", mitre_limit=1.5)
        simple = grown if grown.geom_type == "Polygon" else region
    reach = LEEWAY * spacing_m + lead_m - 1.8 * slack
    allowed = shapely.simplify(shapely.buffer(simple, reach, quad_segs=16), slack / 2)
    return simple, FreeSpace(allowed, obstacles)


def _of_few_corners(region: Any, spacing_m: float) -> Any:
    """Simplify a region of many corners, and fill holes that lie between two lines."""
    if shapely.get_num_coordinates(region) <= MANY_CORNERS:
        return region
    around = enclosing(without_small_holes(region, spacing_m**2), COARSE * spacing_m)
    return without_small_holes(around, spacing_m**2)


ROUNDS = 300  # of the search for the order of many cells
HALVINGS = 4  # of a straight leg past the end of a line, until it is free


@dataclass(frozen=True, slots=True, eq=False)
class SurveyLines:
    """Straight lines in cells; those of a cell are flown one after another, to and fro."""

    angle_deg: float  # azimuth
    cells: tuple[Floats, ...]  # for each cell (n, 2, 2): both ends of its lines, in metres
    lead_m: float = 0.0  # length of the straight legs before and after each line

    def estimate_m(self, turn_m: float) -> float:
        """Estimate the cost of flying them in metres: their length, the legs between them, and the turns."""
        within = between = 0.0
        for cell in self.cells:
            ends = np.stack([cell[:-1, 1] - cell[1:, 1], cell[:-1, 0] - cell[1:, 0]], axis=1)
            within += float(np.hypot(*(cell[:, 1] - cell[:, 0]).T).sum())
            within += float(np.hypot(ends[..., 0], ends[..., 1]).mean(axis=1).sum())
        middles = np.array([cell.mean(axis=(0, 1)) for cell in self.cells])
        steps = np.hypot(*(middles[:, None] - middles).T)
        np.fill_diagonal(steps, np.inf)
        if len(middles) > 1:
            between = float(steps.min(axis=0).sum())
        lines = sum(len(cell) for cell in self.cells)
        return within + between + 2 * turn_m * (lines + len(self.cells))


def fly_lines(lines: SurveyLines, space: FreeSpace) -> Iterator[tuple[Floats, Floats, tuple[Floats, ...]]]:
    """Yield orders of lines: one for many cells, two for one cell, which are not each other reversed.

    Each is the lines in the order and direction of flight, the same with the straight legs before and after
    them, and the n - 1 legs from one to the next. A MissionError says that there is no path between lines.
    """
    flat = np.concatenate(lines.cells)
    outer = _extended(flat, lines.lead_m, space)
    stops = np.cumsum([len(cell) for cell in lines.cells])
    candidates = [
        to_and_fro(range(stop - len(cell), stop)) for cell, stop in zip(lines.cells, stops, strict=True)
    ]
    one = len(candidates) == 1
    for order in candidates[0][:2] if one else [join_cells(candidates, outer.reshape(-1, 2), space)]:
        placed = _in_order(outer, order)
        yield _in_order(flat, order), placed, tuple(space.each_path(placed[:-1, 1], placed[1:, 0]))


def to_and_fro(cell: Sequence[int]) -> list[Integers]:
    """Return the four orders of the lines of a cell: 2 k is line k and 2 k + 1 is line k reversed."""
    index = np.array(cell, np.int64)
    odd = np.arange(len(index)) % 2
    forward = [2 * index + (odd ^ turn) for turn in (0, 1)]
    return forward + [(one ^ 1)[::-1] for one in forward]


def join_cells(candidates: list[list[Integers]], ends: Floats, space: FreeSpace) -> Integers:
    """Return one order of the lines of all cells, with a short tour over the cells.

    `candidates` are for each cell its orders, as of `to_and_fro`; rows 2 k and 2 k + 1 of `ends` (m, 2) are
    the ends of line k.
    """
    entries = np.array([[(order[0], order[-1] ^ 1) for order in orders] for orders in candidates])
    points, index = np.unique(entries.ravel(), return_inverse=True)
    lengths = space.paths(ends[points]).lengths
    tour = short_tour(Stops.of(list(index.reshape(entries.shape))), lengths, rounds=ROUNDS)
    return np.concatenate([candidates[cell][order] for cell, order in tour])


def path_length(path: Floats) -> float:
    """Return the length of a path (k, 2) in metres."""
    return math.fsum(np.hypot(*np.diff(path, axis=0).T).tolist())


def _in_order(lines: Floats, order: Integers) -> Floats:
    flown = lines[order // 2]
    turned = order % 2 == 1
    flown[turned] = flown[turned, ::-1]
    return flown


def _extended(lines: Floats, lead_m: float, space: FreeSpace) -> Floats:
    """Lengthen lines at both ends, by less where the straight leg is not free."""
    if not lead_m:
        return lines
    step = lines[:, 1] - lines[:, 0]
    length = np.hypot(*step.T)[:, None]
    unit = np.divide(step, length, out=np.zeros_like(step), where=length > 0)
    outer = lines.copy()
    for side, sign in ((0, -1), (1, 1)):
        todo = np.ones(len(lines), bool)
        for halving in range(HALVINGS):
            place = lines[:, side] + sign * unit * lead_m / 2**halving
            free = todo & space.sees(lines[:, side], place)
            outer[free, side] = place[free]
            todo &= ~free
    return outer
