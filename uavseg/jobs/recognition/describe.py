"""Description job: measures of the regions of a file, or of the occupied objects of a map."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RegionError
from uavseg.execution.executors import phase
from uavseg.jobs.info_regions import names_regions
from uavseg.jobs.maps.classify import ClassifyRequest, classify
from uavseg.jobs.source.open_source import open_probability_map, open_raster
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.jobs.source.work import Work
from uavseg.options.recognition import DescribeOptions
from uavseg.raster.geodesy.globe import define_crs, is_in_metres, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.polygon_mask import pixels_inside
from uavseg.raster.grid.tiling import Window
from uavseg.regions.edit.small import as_area
from uavseg.regions.formats import read
from uavseg.regions.recognise.fit import (
    FREE,
    SURFACE,
    Evidence,
    evidence_of_cells,
    smooth_contour,
    solid_cells,
)
from uavseg.regions.recognise.measures import Objects, local_metres, objects, pixel_measures, shape_measures
from uavseg.regions.sample.place import to_pixels
from uavseg.regions.table import Regions
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

_MAX_CELLS = 1 << 22  # of the surroundings of an object that is fitted
_SUMMED = ("area_m2", "perimeter_m", "pixels", "holes")  # columns of the parts of one object


@dataclass(frozen=True)
class Description:
    """Regions with their measures, and what is known of their outlines."""

    regions: Regions
    outlines: tuple[
        Any, ...
    ]  # polygons in metres, y to the north; solid for objects that were seen all round
    # Of objects of a map, None for one that is too large; None where all outlines are known as a whole.
    evidence: tuple[Evidence | None, ...] | None
    warnings: tuple[str, ...]

    def frame(self) -> "GeoDataFrame":
        """Return the regions and their measures as a GeoDataFrame."""
        return self.regions.frame()


def described(options: DescribeOptions, work: Work) -> Description:
    """Measure regions by themselves and by a raster, or the occupied objects of a map."""
    source: Any = options.source
    work = work.begun()
    if isinstance(source, bytes) or names_regions(source) or hasattr(source, "geometry"):
        return work.finished(_of_regions(source, options, work))
    opened = open_probability_map(source, options.read)
    if not isinstance(opened, ProbabilityMap):
        raise ParameterError(f"{opened.path} is a block map; its objects are described on the map itself")
    if options.raster is not None or options.layer is not None:
        raise ParameterError("a map is described by its own cells; --raster and --layer are for regions")
    return _of_map(opened, options, work)


def _of_regions(source: Any, options: DescribeOptions, work: Work) -> Description:
    if options.gap or options.min_area is not None:
        raise ParameterError("--gap and --min-area are for objects of a map; regions are taken as they are")
    is_frame = hasattr(source, "geometry")
    regions = (
        read.regions_of_frame(source, True) if is_frame else read.read_regions(source, options.layer, True)
    )
    outlines = local_metres(regions)
    warnings: tuple[str, ...] = ()
    rows = [shape_measures(outline) for outline in outlines]
    if options.raster is not None:
        raster = open_raster(options.raster, options.read)
        grey, geobox, warnings = raster.grey(work.over(raster, False)), raster.geobox, raster.warnings
        with phase("texture"):
            pixels = [pixel_measures(one, grey, _up_deg(one, geobox)) for one in _on_grid(regions, geobox)]
        if beside := sum(not one["texture"] for one in pixels):
            warnings += (
                f"{beside:,} regions have no texture in {raster.name}: they are too small or beside it",
            )
        rows = [row | one for row, one in zip(rows, pixels, strict=True)]
    wkt = None if regions.wkt is None else define_crs(regions.wkt).wkt2
    measured = replace(_measured(regions, rows), wkt=wkt)
    return Description(measured, tuple(outlines), None, warnings)


def _of_map(source: ProbabilityMap, options: DescribeOptions, work: Work) -> Description:
    request = ClassifyRequest(min_area=as_area(options.min_area), allow_lost_obstacles=True)
    found = classify(source, request, work)
    assert found.objects is not None, "as requested"
    grey, geobox, regions = (
        GreySource(source.dataset, found.source.stretch),
        found.geobox,
        found.objects.regions,
    )
    if not is_in_metres(geobox.wkt):
        raise ParameterError(f"{source.name} is not in metres; objects are described in a map that is")
    if not options.gap >= 0:
        raise ParameterError(f"a gap is 0 m or more, not {options.gap:g}")
    if options.gap:
        regions = _joined(regions, options.gap)
    views = [_view(polygon, grey) for polygon in to_pixels(objects(regions.polygons), geobox)]
    solid = [
        shapely.transform(outline, lambda xy: np.column_stack(geobox.xy_from_pixel(xy[:, 1], xy[:, 0])))
        for _, _, outline in views
    ]
    outlines = local_metres(replace(regions, polygons=objects(solid)))
    rows = [
        shape_measures(one) | {"seen_outline": seen}
        for one, (_, seen, _) in zip(outlines, views, strict=True)
    ]
    return Description(
        regions=_measured(regions, rows),
        outlines=tuple(outlines),
        evidence=tuple(evidence for evidence, _, _ in views),
        warnings=found.warnings,
    )


def _measured(regions: Regions, rows: list[dict[str, Any]]) -> Regions:
    """Add measures of each region as columns."""
    columns = {
        name: np.array([row[name] for row in rows], object if isinstance(first, str) else np.float64)
        for name, first in (rows[0] if rows else {}).items()
    }
    return replace(regions, columns={**regions.columns, **columns})


def _on_grid(regions: Regions, geobox: GeoBox) -> Objects:
    """Return polygons of regions, in WGS 84 or local, in the pixels of a raster as (col, row)."""
    polygons = objects(regions.polygons)
    if (regions.wkt is None) != (geobox.wkt is None):
        which = "the regions have" if regions.wkt is None else "the raster has"
        raise RegionError(f"{which} no CRS, so the position of the regions in the raster is unknown")
    if regions.wkt is not None:
        project = transform_between(regions.wkt, geobox.wkt)
        polygons = shapely.transform(polygons, lambda x, y: project(x, y), interleaved=False)
    return to_pixels(polygons, geobox)


def _up_deg(polygon: Any, geobox: GeoBox) -> float:
    """Return the direction of decreasing rows at a polygon in pixels, clockwise from true north."""
    col, row = polygon.centroid.coords[0]
    x, y = geobox.xy_from_pixel([row, row - 1], [col, col])
    if geobox.crs is not None:
        x, y = geobox.lonlat_from_xy(x, y)
        x = ((x - x[0] + 180) % 360 - 180) * math.cos(math.radians(y[0]))
    return math.degrees(math.atan2(x[1] - x[0], y[1] - y[0]))


def _joined(regions: Regions, gap_m: float) -> Regions:
    """Join objects nearer to each other than a gap."""
    polygons = objects(regions.polygons)
    groups = shapely.get_parts(shapely.union_all(shapely.buffer(polygons, gap_m / 2)))
    number, group = shapely.STRtree(groups).query(polygons, "intersects")
    _, first, group = np.unique(
        group[np.argsort(number, kind="stable")], return_index=True, return_inverse=True
    )
    columns = {name: column[first] for name, column in regions.columns.items()}
    for name in columns:
        how = np.add if name in _SUMMED else {"n": np.minimum, "x": np.maximum}.get(name[3:][-1:])
        if how is not None and (name in _SUMMED or name in ("x_min", "y_min", "x_max", "y_max")):
            columns[name] = np.array(
                [how.reduce(regions.columns[name][group == k]) for k in range(len(first))]
            )
    merged = objects([shapely.union_all(polygons[group == k]) for k in range(len(first))])
    order = np.argsort(first, kind="stable")
    return replace(regions, columns=columns, polygons=merged).select(order)


def _view(polygon: Any, grey: GreySource) -> tuple[Evidence | None, float, Any]:
    """Return what cells say of an object, which share of its border is free, and its solid outline in pixels.

    That is the outline of all that is not free and connected with the object, its hidden inside too, where
    free space surrounds it; else the polygon itself.
    """
    from scipy.ndimage import binary_dilation

    bounds, (rows, cols) = np.array(polygon.bounds), grey.shape
    margin = float(np.ptp(bounds.reshape(2, 2), axis=0).max()) / 2 + 8
    left, top = np.maximum(bounds[:2] - margin, 0).astype(int).tolist()
    right, bottom = np.minimum(np.ceil(bounds[2:] + margin), [cols, rows]).astype(int).tolist()
    window = Window(top, left, bottom - top, right - left)
    if window.rows * window.cols > _MAX_CELLS:
        return None, math.nan, polygon
    tile = grey.read(window, 0)
    values = np.where(tile.valid > 0, tile.grey / GREY_MAX, 0.5)[: window.rows, : window.cols]
    block = np.ones((3, 3), bool)
    surface = binary_dilation(pixels_inside(objects([polygon]), window), block, 2)
    solid = solid_cells(values, surface & (values > SURFACE))
    ring = smooth_contour(solid)
    if ring is not None:
        polygon = shapely.Polygon(ring + np.array([window.col, window.row]))
    filled = [shapely.Polygon(part.exterior) for part in shapely.get_parts(polygon)]
    inside = binary_dilation(pixels_inside(objects(filled), window), block)
    around = values[binary_dilation(inside, block) & ~inside]
    free, unknown = int((around < FREE).sum()), int(((around >= FREE) & (around <= SURFACE)).sum())
    cell = math.sqrt(abs(grey.dataset.geobox.transform.determinant))
    return evidence_of_cells(values, surface, cell), free / max(free + unknown, 1), polygon
