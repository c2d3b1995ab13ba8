"""Sweep lines: parallel lines clipped to a polygon, and the angle that needs the fewest."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError, ParameterError
from uavseg.flight.items import MAX_ITEMS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MIN_GAP = 1 / 20  # of the spacing: shorter gaps are flown through, shorter pieces are dropped
WIDTH_SLACK = 0.01  # spacings by which a polygon may be wider before it needs another line


@dataclass(frozen=True, slots=True)
class SweepLines:
    """Pieces of parallel lines inside a polygon, line by line, along each line in its direction.

    Parameters
    ----------
    angle_deg : float
        Azimuth of the lines, clockwise from north, in [0, 180).
    count : int
        Number of parallel lines, exactly one spacing apart.
    line : (N,) int array
        The line that each piece lies on.
    start, end : (N,) float arrays
        Position of the ends of each piece along its line, in metres.
    offset : (N,) float array
        Position of its line across the lines, in metres.
    """

    angle_deg: float
    count: int
    line: Ints
    start: Floats
    end: Floats
    offset: Floats

    def xy(self, along: Floats, offset: Floats) -> Floats:
        """Positions (N, 2) in metres east and north from positions along and across the lines."""
        return np.column_stack((along, offset)) @ _axes(self.angle_deg).T

    @property
    def segments(self) -> Floats:
        """The pieces as (N, 2, 2): start and end, each x, y."""
        return np.stack((self.xy(self.start, self.offset), self.xy(self.end, self.offset)), axis=1)


def sweep(region: Any, spacing_m: float, angle_deg: float) -> SweepLines:
    """Clip parallel lines to a polygon.

    The lines are centred over the polygon: the outermost ones lie at most half a spacing (and half a
    hundredth of it) inside its edge, and a polygon narrower than the spacing gets one line through its
    middle. Gaps and pieces shorter than a twentieth of the spacing are dropped.

    Parameters
    ----------
    region : shapely Polygon
        In metres; may be concave and have holes.
    spacing_m : float
        Distance between neighbouring lines.
    angle_deg : float
        Azimuth of the lines, clockwise from north: 0 runs north-south, 90 east-west.

    Raises
    ------
    ParameterError
        If the spacing is not a positive number.
    MissionError
        If the polygon would need more lines than a mission can hold.

    Examples
    --------
    >>> lines = sweep(shapely.box(0, 0, 30, 100), 10, 0)
    >>> lines.count, lines.segments[:, :, 0].round(6).tolist()
    (3, [[5.0, 5.0], [15.0, 15.0], [25.0, 25.0]])
    """
    if not (math.isfinite(spacing_m) and spacing_m > 0):
        raise ParameterError(f"the spacing of survey lines is a positive number of metres, not {spacing_m}")
    angle_deg = normal_azimuth(angle_deg)
    start, end = _edges(region, angle_deg)
    low, high = start[:, 1].min(), start[:, 1].max()
    count = _line_count(high - low, spacing_m)
    first = (low + high) / 2 - (count - 1) / 2 * spacing_m
    line, along = _crossings(start, end, first, spacing_m, count)
    pieces = _merge_pieces(line[::2], along[::2], along[1::2], spacing_m * MIN_GAP)
    return SweepLines(angle_deg, count, *pieces, first + pieces[0] * spacing_m)


def best_angle(region: Any, spacing_m: float) -> float:
    """Azimuth of the edge of the convex hull along which the lines have the fewest pieces.

    A convex shape is narrowest across one of its edges, so no other direction needs fewer lines. Ties go to
    fewer lines, then to the narrower extent, then to the smaller azimuth.
    """
    hull = shapely.get_coordinates(shapely.convex_hull(region))
    steps = np.diff(hull, axis=0)
    steps = steps[np.hypot(*steps.T) > 1e-6]
    azimuths = np.unique(np.round(np.degrees(np.arctan2(steps[:, 0], steps[:, 1])), 7) % 180)
    widths = np.array([np.ptp(hull @ _axes(azimuth)[:, 1]) for azimuth in azimuths])
    if not widths.size:
        return 0.0
    ranked: list[tuple[int, int, float, float]] = []
    for width, azimuth in sorted(zip(widths.tolist(), azimuths.tolist(), strict=True)):
        if ranked and _line_count(width, spacing_m) > min(ranked)[0]:
            break  # every line has at least one piece
        lines = sweep(region, spacing_m, azimuth)
        ranked.append((lines.line.size, lines.count, round(width, 6), azimuth))
    return min(ranked)[-1]


def normal_azimuth(angle_deg: float) -> float:
    """The direction of a line as an azimuth in [0, 180)."""
    if not math.isfinite(angle_deg):
        raise ParameterError(f"the azimuth of survey lines is a number of degrees or auto, not {angle_deg}")
    return float(angle_deg % 180) % 180


def _axes(angle_deg: float) -> Floats:
    """Columns: the unit vectors along the lines and across them, to the right."""
    azimuth = math.radians(angle_deg)
    sine, cosine = math.sin(azimuth), math.cos(azimuth)
    return np.array([[sine, cosine], [cosine, -sine]])


def _line_count(width_m: float, spacing_m: float) -> int:
    count = max(math.ceil(width_m / spacing_m - WIDTH_SLACK), 1)
    if 2 * count > MAX_ITEMS:
        raise MissionError(
            f"{width_m:.0f} m at a spacing of {spacing_m:g} m make {count} lines, more than a mission holds; "
            "use a wider spacing"
        )
    return count


def _edges(region: Any, angle_deg: float) -> tuple[Floats, Floats]:
    """Starts and ends (N, 2) of all edges of all rings, as positions along and across the lines."""
    rings = shapely.get_rings(region)
    coordinates, ring = shapely.get_coordinates(rings, return_index=True)
    along_across = coordinates @ _axes(angle_deg)
    same_ring = ring[1:] == ring[:-1]
    return along_across[:-1][same_ring], along_across[1:][same_ring]


def _crossings(start: Floats, end: Floats, first: float, spacing_m: float, count: int) -> tuple[Ints, Floats]:
    """Crossings of lines with edges: the line and the position along it, sorted; an even number for each.

    An edge includes its lower end and not its upper one, so a line through a vertex crosses a ring the right
    number of times: never, once or twice.
    """
    lower, upper = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    begin = np.clip(np.ceil((lower - first) / spacing_m), 0, count).astype(np.int64)
    stop = np.clip(np.ceil((upper - first) / spacing_m), 0, count).astype(np.int64)
    crossed = stop - begin
    edge = np.repeat(np.arange(len(crossed)), crossed)
    line = np.arange(len(edge)) - np.repeat(np.cumsum(crossed) - crossed, crossed) + begin[edge]
    part = (first + line * spacing_m - start[edge, 1]) / (end[edge, 1] - start[edge, 1])
    along = start[edge, 0] + np.clip(part, 0, 1) * (end[edge, 0] - start[edge, 0])
    order = np.lexsort((along, line))
    return line[order], along[order]


def _merge_pieces(line: Ints, start: Floats, end: Floats, shortest_m: float) -> tuple[Ints, Floats, Floats]:
    """Merge pieces across short gaps and drop short pieces; the longest always stays."""
    if line.size == 0:
        return line, start, end
    is_gap = (line[1:] != line[:-1]) | (start[1:] - end[:-1] >= shortest_m)
    first, last = np.r_[True, is_gap], np.r_[is_gap, True]
    line, start, end = line[first], start[first], end[last]
    long = end - start >= shortest_m
    long[np.argmax(end - start)] = True
    return line[long], start[long], end[long]
