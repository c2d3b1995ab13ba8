"""Simplify outlines as a coverage (Visvalingam and Whyatt): neighbours keep sharing their borders."""

from dataclasses import replace

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray

from uavseg.arrays import Integers
from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.table import Regions


def simplify(regions: Regions, metres: float, geobox: GeoBox) -> Regions:
    """Remove vertices of little effect; no region vanishes, overlaps another or becomes invalid.

    All outlines are simplified together (Visvalingam and Whyatt, coverage simplification of GEOS): a border
    between two regions stays one line. Attributes stay those of the pixels. Vertices are pixel corners of
    `geobox`, a finer grid for smoothed outlines. `metres` is the tolerance: removing a vertex may move an
    area of about this length squared from one side of an outline to the other; in units of the transform
    where there is no CRS.
    """
    if not 0 <= metres < np.inf:
        raise ParameterError(f"expected a simplification tolerance of 0 or more metres, got {metres:g}")
    if not len(regions) or metres == 0:
        return regions
    # The tolerance is an area, so pixels serve as units whatever their shape; and with integer coordinates it
    # is exact on which side of an edge a vertex lies.
    flat = RaggedPolygons.from_geometries(np.asarray(regions.polygons))
    corners = _corners(flat.vertices, geobox.transform).astype(np.float64)
    coverage = replace(flat, vertices=corners).to_geometries()
    simpler = shapely.coverage_simplify(coverage, metres / np.sqrt(np.prod(ground_resolution(geobox))))
    row, col = shapely.get_coordinates(simpler).T
    polygons = shapely.set_coordinates(simpler, np.stack(geobox.xy_from_pixel(row, col), axis=1))
    return replace(regions, polygons=polygons)


def _corners(xy: NDArray[np.float64], transform: Affine) -> Integers:
    """Return the (row, col) pixel corners at map coordinates."""
    back = ~transform
    rows = back.d * xy[:, 0] + back.e * xy[:, 1] + back.f
    cols = back.a * xy[:, 0] + back.b * xy[:, 1] + back.c
    return np.asarray(np.rint(np.stack([rows, cols], axis=1)), np.int64)
