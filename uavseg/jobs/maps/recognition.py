"""Jobs that measure regions or the occupied objects of a map, and name them by the examples that fit best."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import GeoDataFrame, Integers, Objects
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RegionError
from uavseg.execution.executors import phase, steps_done
from uavseg.jobs.info import names_regions
from uavseg.jobs.maps.classify import ClassifyRequest, classify
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.source.open_source import open_probability_map, open_raster, pixels_of
from uavseg.jobs.source.work import Work
from uavseg.options.maps import DescribeOptions, RecogniseOptions
from uavseg.raster.access.opening import file_exists
from uavseg.raster.geodesy.globe import define_crs, is_in_metres
from uavseg.raster.grid.geobox import pixels_inside
from uavseg.regions.edit.small import as_area
from uavseg.regions.formats.export import check_region_path, write_regions
from uavseg.regions.formats.read import read_regions, regions_of_frame
from uavseg.regions.recognise import fit
from uavseg.regions.recognise.measures import local_metres, pixel_measures, shape_measures
from uavseg.regions.sample.place import bounding_cells, to_pixels
from uavseg.regions.table import Regions, plain_columns
from uavseg.segmentation.blocks.g_statistic import g_statistic
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

CANNOT_TELL = "cannot tell"
MAX_EXAMPLES = 500
# Log-evidence of an object of no name by independent point of its surface, and the temperature of evidences:
# calibrated on simulated scenes other than those of benchmarks/recognition.py.
_NO_NAME, _TEMPERATURE = -0.35, 1.25
_TEXTURE_SAMPLES = 32.0  # texture counts as so many independent pixels
_COMPLETE = 0.8  # share of the outline of an example that should have been seen
_MAX_CELLS, _MAX_GAP_M = 1 << 22, 1000.0  # around an object that is fitted; between its pieces
_OF_PARTS = dict.fromkeys(("area_m2", "perimeter_m", "pixels", "holes"), "sum")  # columns of joined objects
_OF_PARTS |= {"x_min": "min", "y_min": "min", "x_max": "max", "y_max": "max"}


@dataclass(frozen=True)
class Description:
    """Regions with their measures, and what is known of their outlines."""

    regions: Regions
    outlines: Objects  # polygons in metres, y to the north; solid for objects that were seen all round
    # Of objects of a map, None for one too large or too faint; None where all outlines are known as a whole.
    evidence: Sequence[fit.Evidence | None] | None
    warnings: tuple[str, ...]

    def frame(self) -> "GeoDataFrame":
        """Return the regions and their measures as a GeoDataFrame."""
        return self.regions.frame()


def described(options: DescribeOptions, work: Work) -> Description:
    """Measure regions by themselves and by a raster, or the occupied objects of a map."""
    source: Any = options.source
    work, is_frame = work.begun(), hasattr(source, "geometry")
    if not (is_frame or isinstance(source, bytes) or names_regions(source)):
        return _of_map(options, work)
    if options.gap or options.min_area is not None:
        raise ParameterError("--gap and --min-area are for objects of a map; regions are taken as they are")
    regions = regions_of_frame(source, True) if is_frame else read_regions(source, options.layer, True)
    outlines, warnings = local_metres(regions), tuple[str, ...]()
    columns: dict[str, Any] = {**shape_measures(outlines)}
    if options.raster is not None:
        raster = open_raster(options.raster, options.read)
        if (regions.wkt is None) != (raster.geobox.wkt is None):
            raise RegionError("regions or raster have no CRS, so their relative place is unknown")
        grey = raster.grey(work.over(raster, False))
        pixels = to_pixels(np.asarray(regions.polygons), raster.geobox, regions.wkt)
        with phase("texture"):
            rows = list(work.local(partial(pixel_measures, grey), pixels.tolist()))
        columns |= {name: np.array([row[name] for row in rows]) for name in rows[0]}
        beside = sum(not row["texture"] for row in rows)
        hint = f"{beside:,} regions have no texture: too small, too large, or beside the raster"
        warnings = (*raster.warnings, *[hint] * (beside > 0))
    regions = replace(regions, wkt=regions.wkt and define_crs(regions.wkt).wkt2)
    return work.finished(Description(_with(regions, columns), outlines, None, warnings))


def _of_map(options: DescribeOptions, work: Work) -> Description:
    opened = open_probability_map(options.source, options.read)
    source: Any = pixels_of(opened, "objects are described on the map itself, not on its block map")
    if options.raster is not None or options.layer is not None:
        raise ParameterError("a map is described by its own cells; --raster and --layer are for regions")
    if not is_in_metres(source.geobox.wkt):
        raise ParameterError(f"{source.name} is not in metres; objects are described in a map that is")
    if not 0 <= options.gap <= _MAX_GAP_M:
        raise ParameterError(f"a gap is 0 m or more, and {_MAX_GAP_M:g} m at most, not {options.gap:g}")
    request = ClassifyRequest(min_area=as_area(options.min_area), allow_lost_obstacles=True)
    found: Any = classify(source, request, work)
    grey, geobox = GreySource(source.dataset, found.source.stretch), found.geobox
    regions = found.objects.regions
    if options.gap:
        polygons = np.asarray(regions.polygons)
        groups = shapely.get_parts(shapely.union_all(shapely.buffer(polygons, options.gap / 2)))
        group = shapely.STRtree(groups).query(shapely.point_on_surface(polygons), "within")[1]
        rules = {name: _OF_PARTS.get(name, "first") for name in regions.columns}
        frame = regions.frame().dissolve(group, aggfunc=rules).sort_values("id")
        columns = {name: frame[name].to_numpy() for name in rules}
        regions = replace(regions, columns=columns, polygons=frame.geometry.to_numpy())
    views = [_view(polygon, grey, options.gap) for polygon in to_pixels(np.asarray(regions.polygons), geobox)]
    evidence, seen, solid = zip(*views, strict=True) if views else ((), (), ())
    polygons = np.array(solid, object)
    polygons = shapely.transform(polygons, lambda x, y: geobox.xy_from_pixel(y, x), interleaved=False)
    outlines = local_metres(replace(regions, polygons=polygons))
    columns = shape_measures(outlines) | {"seen_outline": np.array(seen, np.float64)}
    return Description(_with(regions, columns), outlines, evidence, found.warnings)


def _with(regions: Regions, columns: dict[str, Any]) -> Regions:
    return replace(regions, columns=plain_columns(regions.columns | columns))


def _view(polygon: Any, grey: GreySource, gap_m: float) -> tuple[fit.Evidence | None, float, Any]:
    """Return what cells say of an object, which share of its border is free, and its solid outline in pixels.

    That is the outline of all that is not free and connected with the object, its hidden inside too, where
    that is one piece and free space surrounds it; else the polygon itself, with gaps closed.
    """
    from scipy import ndimage

    bounds, block = np.array(polygon.bounds), np.ones((3, 3), bool)
    margin = max(bounds[2:] - bounds[:2]) / 2 + 8
    window = bounding_cells(bounds + np.repeat([-margin, margin], 2), grey.shape)
    cell = math.sqrt(abs(grey.dataset.geobox.transform.determinant))
    gap = gap_m / cell / 2
    closed = polygon.union(polygon.buffer(gap).buffer(-gap)) if gap else polygon  # buffers are not exact
    if window.rows * window.cols > _MAX_CELLS:
        return None, math.nan, closed
    tile = grey.read(window, 0)
    values = np.where(tile.valid > 0, tile.grey / GREY_MAX, 0.5)[: window.rows, : window.cols]
    cells = pixels_inside([polygon], window)
    surface = ndimage.binary_dilation(cells, block, 2)
    solid = fit.solid_cells(values, surface & (values > fit.SURFACE))
    if (ring := fit.smooth_contour(solid)) is not None:
        closed, cells = shapely.Polygon(ring + np.array([window.col, window.row])), solid
    inside = ndimage.binary_dilation(ndimage.binary_fill_holes(cells), block)
    around = values[ndimage.binary_dilation(inside, block) & ~inside]
    seen = (around < fit.FREE).sum() / max((around <= fit.SURFACE).sum(), 1)
    return fit.evidence_of_cells(values, surface, cell), seen, closed


def recognised(options: RecogniseOptions, work: Work) -> Description:
    """Name regions or objects by the examples of a library; or add them to it, and return all of it."""
    path, name = options.library, options.learn
    if name is not None:
        if not name.isprintable() or name.strip() in ("", CANNOT_TELL):
            raise ParameterError(f"an example needs a printable name other than {CANNOT_TELL!r}")
        keep_inputs([path], [options.source, options.raster])
        check_region_path(path, True)
        before = [read_regions(path, local=True)] if file_exists(path) else []
        learned = _learned(described(options, work), before, name, list(dict.fromkeys(options.ids or ())))
        write_regions(learned.regions, path, overwrite=True)
        return learned
    if options.ids is not None:
        raise ParameterError("ids are those of examples to learn; give their name too (--learn)")
    if not 0 <= options.min_probability <= 1:
        raise ParameterError(f"a probability lies in 0..1, not {options.min_probability:g}")
    library = read_regions(path, local=True)
    names = library.columns.get("name", np.full(len(library), "", object))
    named = [isinstance(one, str) and one not in ("", CANNOT_TELL) for one in names]
    library = library.select(np.array(named, bool))
    if not 0 < len(library) <= MAX_EXAMPLES:
        raise RegionError(
            f"the library has {len(library):,} examples with a name (column 'name'), and 1 to {MAX_EXAMPLES} "
            "are expected; recognise --learn NAME --ids N,... adds some"
        )
    return _recognised(described(options, work), library, options.min_probability, work)


def _recognised(found: Description, library: Regions, minimum: float, work: Work) -> Description:
    """Add names; one has the mean evidence of its examples, and no name that of a mediocre fit."""
    from scipy.special import logsumexp, softmax

    outlines = [fit.Outline.of(polygon) for polygon in local_metres(library)]
    evidence = found.evidence
    if evidence is None:
        evidence = [fit.Outline.of(one).as_evidence() for one in found.outlines]

    def fits(one: fit.Evidence | None) -> list[tuple[float, float]]:
        return [(0.0, 0.0) if one is None else fit.log_evidence(outline, one) for outline in outlines]

    table = np.empty((len(evidence), len(outlines), 2))
    with phase("fit"):
        for k, row in enumerate(work.local(fits, evidence)):
            table[k] = row
            steps_done(k + 1, len(evidence))
    known = _textures(library)
    textures = [_log_texture(one, other) for one in _textures(found.regions) for other in known]
    scores = table[..., 0] + np.reshape(textures, table.shape[:2])
    names, of_names = np.unique(library.columns["name"].astype(str), return_inverse=True)
    shares = np.equal.outer(np.arange(len(names)), of_names) / np.bincount(of_names)[:, None]
    samples = np.array([np.nan if one is None else one.surface[:, 2].sum() for one in evidence])
    scores = np.column_stack([logsumexp(scores[:, None], axis=2, b=shares), _NO_NAME * samples])
    lost = np.isnan(samples)
    best = softmax(scores / _TEMPERATURE, axis=1)[:, :-1].max(axis=1)
    probability, nearest = np.where(lost, 0.0, best.round(6)), names[scores[:, :-1].argmax(axis=1)]
    columns = {
        "name": np.where((probability >= minimum) & ~lost, nearest, CANNOT_TELL),
        "probability": probability,
        "nearest": np.where(lost, "", nearest),
        "misfit": (-2 * table[..., 1].max(axis=1) / samples).round(6),
    }
    hint = f"{lost.sum():,} objects are too large or too faint to be fitted: {CANNOT_TELL}"
    warnings = found.warnings + (hint,) * bool(lost.any())
    return replace(found, regions=_with(found.regions, columns), warnings=warnings)


def _log_texture(first: Integers, second: Integers) -> float:
    """Return the log-likelihood ratio of one texture against two, G by pixel less its expectation."""
    if not (first.any() and second.any()):
        return 0.0
    pixels = 1 / (1 / first.sum() + 1 / second.sum())
    excess = g_statistic(first, second) - np.count_nonzero(first + second) + 1
    return -_TEXTURE_SAMPLES * max(float(excess / (2 * pixels)), 0.0)


def _textures(regions: Regions) -> list[Integers]:
    """Return the histograms of the column `texture`; empty where there is none."""
    texts = map(str, regions.columns.get("texture", [""] * len(regions)))
    valid = re.compile(r"[0-9]{1,12}( [0-9]{1,12}){79}")
    return [np.array(text.split() if valid.fullmatch(text) else [], np.int64) for text in texts]


def _learned(found: Description, before: list[Regions], name: str, ids: list[int]) -> Description:
    """Return a library with regions of these ids as further examples: in metres around their centroids."""
    have = found.regions.columns["id"].tolist()
    if not ids or not set(ids) <= set(have):
        unknown = ", ".join(str(k) for k in ids if k not in have) or "none was named (--ids N,...)"
        raise ParameterError(f"examples are regions by their ids, of which there is no such one: {unknown}")
    chosen = np.array([have.index(k) for k in ids])
    added = found.regions.select(chosen)
    added.columns["name"] = np.full(len(added), name, object)
    columns = plain_columns(*(part.columns for part in (*before, added)))
    outlines = np.concatenate([*map(local_metres, before), found.outlines[chosen]])
    centred = [shapely.affinity.translate(one, -one.centroid.x, -one.centroid.y) for one in outlines]
    columns["id"] = np.arange(1, len(centred) + 1)
    library = Regions(columns, polygons := np.array(centred, object), None)
    seen, warnings = added.columns.get("seen_outline", np.ones(len(ids))), found.warnings
    for k in np.array(ids)[seen < _COMPLETE].tolist():
        warnings += (f"part of the outline of region {k} was not seen; it is learned as it is drawn",)
    if any(part.wkt is not None for part in before):
        warnings += ("the library had a CRS: its outlines are now in metres around their centroids",)
    return Description(library, polygons, None, warnings)
