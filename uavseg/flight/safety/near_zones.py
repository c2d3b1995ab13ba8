"""Keep-out zones that a flight can meet: those that its shortest ways may touch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely


def near_zones(zones: Sequence[Any], places: Sequence[Any], reach_m: float) -> list[Any]:
    """Zones that the shortest ways between places may meet.

    A shortest way among obstacles stays within the convex hull of its ends and of the obstacles that it
    touches, so a zone beyond the hull of all places, and of the zones that are near to that, changes nothing.

    Parameters
    ----------
    zones : sequence of shapely Polygon or MultiPolygon
        In metres.
    places : sequence of shapely geometries
        All that is flown over, with home.
    reach_m : float
        How far a flight may lead beyond these places, and the margin of zones.

    Returns
    -------
    list of shapely Polygon or MultiPolygon
        In the order of `zones`.

    Examples
    --------
    >>> boxes = [shapely.box(x, -5, x + 10, 5) for x in (20, 500)]
    >>> [zone.bounds for zone in near_zones(boxes, shapely.points([[0, 0], [100, 0]]), 50)]
    [(20.0, -5.0, 30.0, 5.0)]
    """
    if not len(zones):
        return []
    parts = shapely.make_valid(np.array(zones, object))
    hull = shapely.convex_hull(shapely.union_all(shapely.convex_hull(np.array(places, object))))
    near = np.zeros(len(parts), bool)
    while True:
        found = shapely.dwithin(parts, hull, reach_m)
        if (found == near).all():
            return [zone for zone, is_near in zip(zones, near.tolist(), strict=True) if is_near]
        near = found
        hull = shapely.convex_hull(shapely.union_all([hull, *shapely.convex_hull(parts[near])]))
