"""Simplify outlines as a coverage (Visvalingam and Whyatt): neighbours keep sharing their borders."""

from dataclasses import replace

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.ground import ground_resolution
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.sorted_keys import sorted_unique
from uavseg.regions.table import Regions

Integers = NDArray[np.int64]


def simplify(regions: Regions, metres: float, geobox: GeoBox) -> Regions:
    """Remove vertices of little effect; no region vanishes, overlaps another or becomes invalid.

    All outlines are simplified together (Visvalingam and Whyatt, coverage simplification of GEOS): a border
    between two regions stays one line. Attributes stay those of the pixels.

    Parameters
    ----------
    regions : Regions
        Polygons whose vertices are pixel corners of `geobox`, a finer grid for smoothed outlines.
    metres : float
        Tolerance: removing a vertex may move an area of about this length squared from one side of an outline
        to the other. Units of the transform where there is no CRS.
    geobox : GeoBox

    Returns
    -------
    Regions
        Vertices are pixel corners of `geobox`.

    Raises
    ------
    ParameterError
        If `metres` is negative or not finite.
    """
    if not 0 <= metres < np.inf:
        raise ParameterError(f"expected a simplification tolerance of 0 or more metres, got {metres:g}")
    if not len(regions) or metres == 0:
        return regions
    # The tolerance is an area, so pixels serve as units whatever their shape; and with integer coordinates it
    # is exact on which side of an edge a vertex lies.
    flat = RaggedPolygons.from_geometries(np.asarray(regions.polygons))
    corners, rings = _add_nodes(_corners(flat.vertices, geobox.transform), flat.rings)
    coverage = RaggedPolygons(corners.astype(np.float64), rings, flat.polygons, flat.regions).to_geometries()
    simpler = shapely.coverage_simplify(coverage, metres / np.sqrt(np.prod(ground_resolution(geobox))))
    row, col = shapely.get_coordinates(simpler).T
    polygons = shapely.set_coordinates(simpler, np.stack(geobox.xy_from_pixel(row, col), axis=1))
    return replace(regions, polygons=polygons)


def _corners(xy: NDArray[np.float64], transform: Affine) -> Integers:
    """The (row, col) pixel corners at map coordinates."""
    back = ~transform
    rows, cols = (
        back.d * xy[:, 0] + back.e * xy[:, 1] + back.f,
        back.a * xy[:, 0] + back.b * xy[:, 1] + back.c,
    )
    corners: Integers = np.rint(np.stack([rows, cols], axis=1)).astype(np.int64)
    return corners


def _add_nodes(corners: Integers, starts: Integers) -> tuple[Integers, Integers]:
    """Add a vertex wherever a corner of another ring lies on an edge (noding)."""
    for axis in (0, 1):
        corners, starts = _add_nodes_along(corners, starts, axis)
    return corners, starts


def _add_nodes_along(corners: Integers, starts: Integers, axis: int) -> tuple[Integers, Integers]:
    """Add nodes on the edges that run along one axis."""
    along, across = corners[:, axis], corners[:, 1 - axis]
    keys = across * (along.max() + 1) + along  # corners of one line are adjacent in order
    known = sorted_unique(keys)
    lower, upper = np.minimum(keys[:-1], keys[1:]), np.maximum(keys[:-1], keys[1:])
    first, last = np.searchsorted(known, lower, "right"), np.searchsorted(known, upper)
    counts = np.append(np.maximum(last - first, 0), 0)
    counts[:-1][across[:-1] != across[1:]] = 0
    counts[starts[1:] - 1] = 0
    edge = np.repeat(np.arange(len(corners)), counts)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    found = np.where(keys[edge + 1] > keys[edge], first[edge] + step, last[edge] - 1 - step)
    positions = np.cumsum(counts + 1) - counts - 1
    noded = np.empty((len(corners) + len(edge), 2), np.int64)
    noded[positions] = corners
    noded[positions[edge] + 1 + step, axis] = known[found] % (along.max() + 1)
    noded[positions[edge] + 1 + step, 1 - axis] = across[edge]
    return noded, np.append(positions, len(noded))[starts]
