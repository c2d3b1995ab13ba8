"""Many polygons as flat arrays, and back: coordinates, where each ring starts, where each polygon starts."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Objects = NDArray[np.object_]


def rings_from_polygons(polygons: Objects) -> tuple[Floats, Integers, Integers]:
    """Take polygons apart.

    Parameters
    ----------
    polygons : (n,) object array of shapely Polygon

    Returns
    -------
    coordinates : (v, 2) float64 array
        Vertices of closed rings.
    starts : (r + 1,) int64 array
        Where each ring starts in `coordinates`.
    firsts : (n + 1,) int64 array
        The exterior ring of each polygon, which its holes follow; r at the end.
    """
    rings, owners = shapely.get_rings(polygons, return_index=True)
    starts = np.concatenate([[0], np.cumsum(shapely.get_num_coordinates(rings))])
    return shapely.get_coordinates(polygons), starts, np.searchsorted(owners, np.arange(len(polygons) + 1))


def polygons_from_rings(coordinates: NDArray[Any], starts: Integers, firsts: Integers) -> Objects:
    """The polygons that `rings_from_polygons` took apart; one without rings is empty."""
    built: Objects = shapely.from_ragged_array(shapely.GeometryType.POLYGON, coordinates, (starts, firsts))
    return built
