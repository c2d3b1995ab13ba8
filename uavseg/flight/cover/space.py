"""Where a vehicle may fly while it covers a region: the region itself, and a leeway around it."""

from collections.abc import Sequence
from typing import Any

import shapely

from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing, without_small_holes
from uavseg.flight.avoid.free_space import FreeSpace

LEEWAY = 0.6
"""Spacings by which lines, and legs between them, may leave the region."""
COARSE = 0.3  # spacings by which an outline of many corners is simplified
SLACK = 0.04  # spacings by which outlines are simplified
MAX_VERTICES = 40  # outlines with more are simplified


def flight_space(
    region: Any, spacing_m: float, lead_m: float = 0.0, obstacles: Sequence[Any] = ()
) -> tuple[Any, FreeSpace]:
    """A region with fewer vertices, which contains it but for corners; and the space around and in it.

    Parameters
    ----------
    region : shapely Polygon
        In metres.
    spacing_m : float
    lead_m : float
        How far straight legs lead out of the region.
    obstacles : sequence of shapely Polygon
        Where no leg may lead.
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
    """A region of many corners with fewer, without holes that lie between two lines."""
    if shapely.get_num_coordinates(region) <= MANY_CORNERS:
        return region
    around = enclosing(without_small_holes(region, spacing_m**2), COARSE * spacing_m)
    return without_small_holes(around, spacing_m**2)
