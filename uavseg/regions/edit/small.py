"""Generalise regions: join them at corners, remove small ones and small holes, simplify as a coverage."""

from dataclasses import replace

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox, parse_size
from uavseg.raster.grid.ground import ground_resolution, ring_areas
from uavseg.regions.outline.rings import (
    RegionOutlines,
    Rings,
    dense_parts,
    merge_sums,
    renumber_by_size,
    reorder_rings,
    select_sums,
)
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.table import Regions
from uavseg.segmentation.components import union_roots


@dataclass(frozen=True, slots=True)
class Area:
    """Area in square metres, or in pixels.

    Examples
    --------
    >>> as_area("64px"), as_area("0.5 ha")
    (Area(value=64.0, in_pixels=True), Area(value=5000.0, in_pixels=False))
    """

    value: float
    in_pixels: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.value < float("inf"):
            raise ParameterError(f"an area is a finite number of at least 0, not {self.value:g}")


def as_area(given: float | str | None) -> Area | None:
    """Parse an area: square metres, or text that ends in m2, ha, km2 or px (pixels); None for None."""
    if given is None:
        return None
    expected = "an area is square metres such as 500, hectares such as 0.5ha, or pixels such as 64px"
    return Area(*parse_size(given, expected, {"km2": 1e6, "m2": 1.0, "ha": 1e4}))


def join_at_corners(outlined: RegionOutlines, classes: Integers) -> tuple[RegionOutlines, Integers]:
    """Join regions of one class that touch at corners of pixels (8-connectivity); return their classes, too.

    No two regions of one class share an edge; `classes`, (n,) int64 from 0, are those of the regions. The
    polygons stay as they are: a joined region has several, which touch at points. Labels are those of
    `renumber_by_size`.
    """
    rings = outlined.rings
    if not len(classes):
        return outlined, classes
    # Where two regions of one class, or two rings of a region, touch, a corner is a vertex twice, never more.
    corners = rings.vertices[:, 0].astype(np.int64) * (int(rings.vertices[:, 1].max()) + 1)
    corners += rings.vertices[:, 1]
    firsts = corners[rings.starts[:-1][rings.exteriors]]  # of each polygon
    corners *= int(classes.max()) + 1
    corners += np.repeat(classes[rings.labels - 1], np.diff(rings.starts))
    keys = np.sort(corners)
    keys = keys[1:][keys[1:] == keys[:-1]]
    shared = np.flatnonzero(np.append(keys, -1)[np.searchsorted(keys, corners)] == corners)
    owners = rings.labels[np.searchsorted(rings.starts, shared, "right") - 1] - 1
    pairs = owners[np.argsort(corners[shared])].reshape(-1, 2)
    if (pairs[:, 0] == pairs[:, 1]).all():
        return outlined, classes
    names, group = np.unique(union_roots(pairs, len(classes)), return_inverse=True)
    sums = merge_sums(outlined.sums, group, len(names))
    pixels = np.bincount(group[rings.labels - 1], rings.pixel_areas())
    largest = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -pixels))
    labels = np.argsort(largest)[group][rings.labels - 1] + 1
    order = np.lexsort((firsts[rings.parts], labels))
    vertices, starts = reorder_rings(rings.vertices, rings.starts, order)
    joined = Rings(
        vertices=vertices, starts=starts, labels=labels[order], parts=dense_parts(rings.parts[order])
    )
    return RegionOutlines(joined, select_sums(sums, largest)), classes[names][largest]


def fill_small_holes(outlined: RegionOutlines, geobox: GeoBox, min_area: Area) -> RegionOutlines:
    """Fill holes below a minimum area; regions inside such a hole become part of the region around it.

    The sums stay those of the original pixels: `extract` measures filled regions again.
    """
    rings = outlined.rings
    small = ~rings.exteriors & (-_areas(rings, geobox, min_area) < min_area.value)
    if not small.any():
        return outlined
    return renumber_by_size(rings, outlined.sums, ~small & ~np.isin(rings.parts, _parts_inside(rings, small)))


def drop_small_regions(outlined: RegionOutlines, geobox: GeoBox, min_area: Area | None) -> RegionOutlines:
    """Drop regions below a minimum area, if there is one, and number the others 1..n in order."""
    if min_area is None:
        return outlined
    rings = outlined.rings
    areas = region_areas(outlined, geobox, min_area)
    return renumber_by_size(rings, outlined.sums, areas[rings.labels - 1] >= min_area.value)


def region_areas(outlined: RegionOutlines, geobox: GeoBox, unit: Area) -> Floats:
    """Return the area of each region, (n,), in the unit of `unit`: square metres or pixels.

    Square metres are refused with a ParameterError where there is no CRS.
    """
    rings = outlined.rings
    areas = np.bincount(rings.labels, _areas(rings, geobox, unit), len(outlined.sums.counts) + 1)
    return np.asarray(areas[1:], np.float64)


def _areas(rings: Rings, geobox: GeoBox, unit: Area) -> Floats:
    """Return the area of each ring, negative for holes, in the unit of `unit`."""
    if unit.in_pixels:
        return rings.pixel_areas().astype(np.float64)
    if geobox.crs is None:
        raise ParameterError(
            "the raster has no CRS, so there are no square metres; give the area in pixels, "
            f"such as {unit.value:g}px"
        )
    return ring_areas(geobox, rings.vertices, rings.starts)


def _parts_inside(rings: Rings, holes: Bools) -> Integers:
    """Return the numbers of the polygons that lie inside some of the holes."""
    corners = rings.vertices[rings.starts[:-1][rings.exteriors]]
    centres = shapely.points(corners[:, ::-1] + 0.5)  # a region's uppermost, then leftmost pixel
    filled = [
        shapely.Polygon(rings.vertices[rings.starts[k] : rings.starts[k + 1], ::-1])
        for k in np.flatnonzero(holes)
    ]
    _, within = shapely.STRtree(centres).query(filled, predicate="contains")
    return np.unique(rings.parts[rings.exteriors][within])


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
    x, y, back = *flat.vertices.T, ~geobox.transform
    rows, cols = back.d * x + back.e * y + back.f, back.a * x + back.b * y + back.c
    corners = np.rint(np.stack([rows, cols], axis=1)) + 0.0  # without negative zeros
    coverage = replace(flat, vertices=corners).to_geometries()
    simpler = shapely.coverage_simplify(coverage, metres / np.sqrt(np.prod(ground_resolution(geobox))))
    row, col = shapely.get_coordinates(simpler).T
    polygons = shapely.set_coordinates(simpler, np.stack(geobox.xy_from_pixel(row, col), axis=1))
    return replace(regions, polygons=polygons)
