"""Lines in cells: a short order of the cells and of the lines in them, and the legs between lines."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.order.stops import Stops
from uavseg.flight.order.tour import short_tour

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDS = 300  # of the search for the order of many cells
HALVINGS = 4  # of a straight leg beyond the end of a line, until it is free


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Straight lines in cells; those of a cell are flown one after another, to and fro.

    Parameters
    ----------
    angle_deg : float
        Their azimuth.
    cells : tuple of (n, 2, 2) float64 arrays
        For each cell its lines: both ends, as x, y in metres.
    lead_m : float
        Length of the straight legs before and after each line.
    """

    angle_deg: float
    cells: tuple[Floats, ...]
    lead_m: float = 0.0

    def estimate_m(self, turn_m: float) -> float:
        """About the cost of flying them: their length, the ways between them, and the turns."""
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


def fly_lines(lines: Lines, space: FreeSpace) -> Iterator[tuple[Floats, Floats, tuple[Floats, ...]]]:
    """Lines in the order and direction in which they are flown, with their straight legs, and legs between.

    Yields one way for many cells; for one cell two, of which none is the other reversed: the lines, the same
    with the straight legs before and after them, and the n - 1 legs from one to the next.

    Raises
    ------
    MissionError
        If there is no way between lines.
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
        yield _in_order(flat, order), placed, tuple(shortest_legs(placed[:-1, 1], placed[1:, 0], space))


def to_and_fro(cell: Sequence[int]) -> list[Ints]:
    """The four ways over the lines of a cell, each as 2 k for line k and 2 k + 1 for line k backwards."""
    index = np.array(cell, np.int64)
    odd = np.arange(len(index)) % 2
    forward = [2 * index + (odd ^ turn) for turn in (0, 1)]
    return forward + [(one ^ 1)[::-1] for one in forward]


def join_cells(candidates: list[list[Ints]], ends: Floats, space: FreeSpace) -> Ints:
    """One order over all cells: the lines of each in one of its ways; ends 2 k and 2 k + 1 are of line k."""
    entries = np.array([[(way[0], way[-1] ^ 1) for way in ways] for ways in candidates])
    points, index = np.unique(entries.ravel(), return_inverse=True)
    lengths = space.paths(ends[points]).lengths
    tour = short_tour(Stops.of(list(index.reshape(entries.shape))), lengths, rounds=ROUNDS)
    return np.concatenate([candidates[cell][way] for cell, way in tour])


def path_length(path: Floats) -> float:
    """Length of a path (k, 2) in metres."""
    return math.fsum(np.hypot(*np.diff(path, axis=0).T).tolist())


def shortest_legs(starts: Floats, ends: Floats, space: FreeSpace) -> list[Floats]:
    """Shortest paths from each start to its end, (n, 2) both."""
    if not len(starts):
        return []
    straight = space.sees(starts, ends)
    pairs = np.stack([starts, ends], axis=1)
    return [
        pair if seen else space.paths(pair).path(0, 1) for pair, seen in zip(pairs, straight, strict=True)
    ]


def _in_order(lines: Floats, order: Ints) -> Floats:
    flown = lines[order // 2]
    turned = order % 2 == 1
    flown[turned] = flown[turned, ::-1]
    return flown


def _extended(lines: Floats, lead_m: float, space: FreeSpace) -> Floats:
    """Lines that begin and end so much farther out, or less where the way is not free."""
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
