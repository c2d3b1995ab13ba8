"""Results of jobs: regions with what is needed to describe them and to rasterise them, and their metadata.

Metadata is the same for the same question on any day and machine: names are those that were given, and there
is no time in it.
"""

import importlib.util
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from uavseg._version import __version__
from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissingLibraryError, ParameterError
from uavseg.jobs.source.source import Blocks, Raster, Source
from uavseg.options.reading import ReadOptions
from uavseg.plain_text import printable
from uavseg.raster.grid.geobox import GeoBox, Length
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.intensity.value_range import DetectedRange, axis_of, scale_of
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.band_names import names_of
from uavseg.raster.spectral.bands import BandScale, ValueAxis
from uavseg.regions.confidence import COLUMN, keep_confident
from uavseg.regions.edit.small import Area, fill_small_holes, simplify
from uavseg.regions.outline.rings import RegionOutlines, Rings
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.table import Regions, make_regions, with_values
from uavseg.regions.tiles.range_tiles import sum_regions
from uavseg.segmentation.blocks.block_file import Origin
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.source import GreySource, Statistics

_SIDE = 1024  # pixels: of the windows in which statistics of bands are taken
_BANDS = re.compile(r"band \d{1,6}|luminance of bands \d{1,6}(,\d{1,6}){2}")  # see `BandChoice.name`
_CHOSEN = ("nodata", "index", "expr", "band_names", "flatten")
# by what they result in
_SAID_OTHERWISE = (
    *("band", "rgb", "index", "expr", "band_names", "stretch"),
    *("skip_bad_tiles", "free_is_white", "collar", "flatten"),
)


def filled(grey: GreySource, outlined: RegionOutlines, area: Area | None, tiles: TilePass) -> RegionOutlines:
    """Fill holes of less than an area, with the sums of all pixels that regions then enclose."""
    if area is None:
        return outlined
    found = fill_small_holes(outlined, grey.dataset.geobox, area)
    return outlined if found is outlined else replace(found, sums=sum_regions(grey, found, tiles))


def outlined_cells(source: Blocks, classes: NDArray[Any], fill_holes: Area | None) -> RegionOutlines:
    """Outline the cells of a block map that have a class, and fill holes of less than an area."""
    from uavseg.regions.tiles.class_tiles import outline_block_map, sum_enclosed_cells

    blocks = source.saved.blocks
    outlined = outline_block_map(blocks, classes)
    if fill_holes is None:
        return outlined
    return sum_enclosed_cells(blocks, fill_small_holes(outlined, source.geobox, fill_holes))


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What a result says of its source."""

    name: str  # of the first file, without folder
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    warnings: tuple[str, ...]
    in_metres: bool  # whether lengths are metres rather than units of the map
    axis: ValueAxis | None = None  # how v maps to values in the raster's own units, where known
    statistics: Statistics = Statistics()

    @classmethod
    def of(cls, source: GreySource | Blocks) -> "SourceInfo":
        """Describe pixels that were read, or a block map."""
        if isinstance(source, Blocks):
            saved = source.saved
            metadata = saved.stretch, saved.band_names, saved.stretch.warnings
            return cls(source.name, saved.geobox, *metadata, saved.geobox.crs is not None, saved.axis)
        dataset, stretch = source.dataset, source.stretch
        metadata = stretch, dataset.band_names, dataset.warnings + stretch.warnings
        axis = None if source.is_flat else axis_of(dataset, stretch)
        return cls(dataset.source, dataset.geobox, *metadata, dataset.in_metres, axis, source.statistics)


@dataclass(frozen=True)
class Extraction(SourceInfo):
    """Regions, and what is needed to describe them and to rasterise them."""

    regions: Regions = field(kw_only=True)
    rings: Rings = field(kw_only=True)  # on pixel edges, neither smoothed nor simplified nor regularized
    detected: DetectedRange | None = None  # the range that was asked for, if it is one
    below_minimum: int | None = None  # regions that were left out because of their confidence
    irregular: int | None = None  # regions on pixel edges where outlines were regularized
    nothing: str = ""  # why no region of the range was found; empty where some were

    @property
    def area_unit(self) -> str:
        """Unit of areas in the table at the end: square metres, pixels or square units of the map."""
        if self.in_metres:
            return "m2"
        return "square pixels" if self.geobox.transform.is_identity else "square units"


_MAX_METRES = 1e8  # more than twice around the Earth


@dataclass(frozen=True, slots=True)
class Drawing:
    """How outlines, not attributes, are drawn; ParameterError if negative, not finite, or in two ways."""

    smooth_m: float | None = None  # from the pixel edges at most, and half a pixel at most; comes first
    simplify_m: float | None = None  # tolerance, see `simplify`
    stats: str | None = None  # "bands": with the statistics of bands in outlines as drawn
    regularize_m: float | None = None  # from the pixel edges at most; in place of smoothing

    def __post_init__(self) -> None:
        if self.stats not in (None, "bands"):
            raise ParameterError(f'stats are "bands" or None, not {self.stats!r}')
        by = {"smoothed": self.smooth_m, "regularized": self.regularize_m, "simplified": self.simplify_m}
        for what, metres in by.items():
            if metres is not None and not 0 <= metres < float("inf"):
                raise ParameterError(f"outlines are {what} by metres that are not negative, not {metres:g}")
            if metres is not None and metres > _MAX_METRES:
                raise ParameterError(f"outlines are {what} by {_MAX_METRES:g} m at most, not {metres:g}")
        if self.smooth_m and self.regularize_m:
            raise ParameterError("outlines are smoothed or regularized, not both; leave one of the two out")

    def drawn(self, regions: Regions, rings: Rings, geobox: GeoBox) -> tuple[Regions, int | None]:
        """Return regions with their rings, on pixel edges, as drawn; and how many were not regularized."""
        irregular = None
        if self.smooth_m:
            from uavseg.regions.smooth.smooth_outlines import smooth_outlines

            rings, geobox = smooth_outlines(rings, self.smooth_m, geobox)
        elif self.regularize_m:
            from uavseg.regions.smooth.regularise import regularise_outlines

            rings, geobox, irregular = regularise_outlines(rings, self.regularize_m, geobox)
        if self.smooth_m or self.regularize_m:
            regions = replace(regions, polygons=LazyPolygons(rings, geobox.transform))
        if self.simplify_m:
            regions = simplify(regions, self.simplify_m, geobox)
        return regions, irregular


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionRequest:
    """How regions are drawn and which are left out, of any job."""

    drawing: Drawing = Drawing()
    min_area: Area | None = None
    detail: Length | None = None  # structures that are narrower are left out
    min_confidence: float | None = None  # regions of less are dropped at last


def measured(
    outlined: RegionOutlines,
    info: SourceInfo,
    interval: tuple[ArrayLike, ArrayLike],
    request: RegionRequest,
    more: Mapping[str, NDArray[Any]] = {},
    confidence: Callable[[], Floats] | None = None,
    refine: str = "",
    detected: DetectedRange | None = None,
) -> Extraction:
    """Return regions with their attributes.

    `interval` is the low and high v of all regions, or of each, (n,), and `detected` the range that was asked
    for, in both units; by default its values follow from the interval. Columns of `more` come after the id,
    then the confidence, if any, (n,), 0 to 1, which is computed unless `refine` is "none": then it is not
    known, NaN. Regions of less than the minimum of the request are left out, and a confidence that is not
    known and has a minimum is refused with a ParameterError.
    """
    below_minimum = None
    if confidence is not None:
        sure = np.full(len(outlined.sums.counts), np.nan) if refine == "none" else confidence()
        outlined, kept = keep_confident(outlined, sure, request.min_confidence)
        more = {name: column[kept] for name, column in more.items()} | {COLUMN: sure[kept]}
        low, high = (end if np.ndim(end) == 0 else np.asarray(end)[kept] for end in interval)
        interval = low, high
        below_minimum = None if request.min_confidence is None else int(np.count_nonzero(~kept))
    rings, sums = outlined.rings, outlined.sums
    pixels = np.bincount(rings.labels, rings.pixel_areas(), len(sums.counts) + 1)[1:].astype(np.int64)
    regions = make_regions(rings, sums, info.geobox, interval, info.name, pixels)
    regions = with_values(regions, sums, info.axis, None if detected is None else detected.ends)
    columns = {"id": regions.columns["id"], **more} | regions.columns
    regions, irregular = request.drawing.drawn(replace(regions, columns=columns), rings, info.geobox)
    about = {one.name: getattr(info, one.name) for one in fields(info)} | {"irregular": irregular}
    return Extraction(**about, regions=regions, rings=rings, detected=detected, below_minimum=below_minimum)


def bands_of(dataset: Dataset) -> dict[str, tuple[Dataset, BandScale]]:
    """Return each band but alpha, by common name or the words of its description, or b1, b2, ...

    All are b1, b2, ... where two would have one name. A MissingLibraryError says that exactextract is not
    installed, a ParameterError that files have different scales or there is a palette, a RasterError that
    numbers are complex.
    """
    if importlib.util.find_spec("exactextract") is None:
        raise MissingLibraryError('--stats needs exactextract: pip install "uavseg[stats]"')
    if dataset.choice.expanded:
        raise ParameterError(f"{dataset.source} has a palette, whose indices have no mean; leave --stats out")
    layout = dataset.mosaic.files[0].layout
    bands = [band for band in names_of(layout) if band.number != layout.alpha]
    words = [re.sub(r"\W+", "_", band.description.casefold())[:40].strip("_") for band in bands]
    names = [band.common or word or f"b{band.number}" for band, word in zip(bands, words, strict=True)]
    if len({*names, "value"}) <= len(names):  # there is a column mean_value
        names = [f"b{band.number}" for band in bands]
    read = [dataset.of_band(band.number) for band in bands]
    return {name: (one, scale_of(one)) for name, one in zip(names, read, strict=True)}


@np.errstate(over="ignore", invalid="ignore")
def with_band_statistics(regions: Regions, dataset: Dataset, drawing: Drawing) -> Regions:
    """Return regions, where it is asked for with mean_, std_, min_ and max_<band> of valid pixels.

    They are (n,) float64 in the band's own values. Each pixel is weighted by the part of it that lies in the
    polygon (exactextract); NaN where there is none. Errors are those of `bands_of`.
    """
    if drawing.stats is None:
        return regions
    bands, t = bands_of(dataset), ~dataset.geobox.transform
    from exactextract import exact_extract, raster

    turn, move = ((t.a, -t.d), (t.b, -t.e)), (t.c, -t.f)  # to (col, -row); edges of pixels are met to the bit
    drawn = np.array(list(regions.polygons), object)
    polygons = shapely.transform(drawn, lambda xy: np.round((xy @ turn + move) * 65536) / 65536)
    tree, (count, mean, squares) = shapely.STRtree(polygons), np.zeros((3, len(bands), len(regions)))
    low, high = np.full((2, len(bands), len(regions)), np.nan)
    for window in tiles(dataset.geobox.shape, _SIDE):
        corners = window.col, -window.row - window.rows, window.col + window.cols, -window.row
        near = tree.query(shapely.box(*corners))
        parts = shapely.clip_by_rect(polygons[near], *corners)  # exactextract's own clipping may crash
        near, parts = near[within := shapely.area(parts) > 0], parts[within]
        if not len(near):
            continue
        found = exact_extract(
            [raster.NumPyRasterSource(_values(*bands[name], window), *corners, name=name) for name in bands],
            [{"geometry": part.__geo_interface__, "properties": {}} for part in parts],
            ["count", "mean", "variance", "min", "max"],
            output="pandas",
        )
        n, m, variance, least, most = found.to_numpy(np.float64).T.reshape(5, len(bands), -1)
        before, total = count[:, near], count[:, near] + n
        share, step = n / np.where(total > 0, total, 1), np.where(n > 0, m, 0) - mean[:, near]
        squares[:, near] += np.where(n > 0, variance, 0) * n + step**2 * before * share  # Chan et al. (1979)
        mean[:, near] += step * share
        count[:, near] = total
        low[:, near], high[:, near] = np.fmin(low[:, near], least), np.fmax(high[:, near], most)
    count[count == 0] = np.nan
    rows = np.concatenate([mean + 0 * count, np.sqrt(squares / count), low, high])
    names = [f"{one}_{name}" for one in ("mean", "std", "min", "max") for name in bands]
    return replace(regions, columns=regions.columns | dict(zip(names, rows, strict=True)))


def _values(band: Dataset, scale: BandScale, window: Window) -> Floats:
    """Return the values of a window, (rows, cols); NaN where a pixel is not valid."""
    stored, valid = band.read(window)
    return np.where(True if valid is None else valid, scale.values(stored[0]), np.nan)


def with_metadata(found: Extraction, source: Source, job: str, how: Mapping[str, Any]) -> Extraction:
    """Return a result whose regions say what they were made from, and `how` (as JSON has it; no None)."""
    stretch, made = found.stretch, {"software": f"uavseg {__version__}", "job": job}
    facts = {**made, "sources": _names(source), "band": found.band_names, **_reading(source)}
    facts |= {"stretch": stretch.name, "stretch_low": stretch.low, "stretch_high": stretch.high, **how}
    facts |= {"not_regularized": found.irregular}
    known = {name: _plain(value) for name, value in facts.items() if value is not None}
    return replace(found, regions=replace(found.regions, metadata=known))


def same_reading(metadata: Mapping[str, Any], raster: Raster) -> ReadOptions | None:
    """Return the options that make of a raster the intensity that regions with some metadata were made from.

    None where the regions are of other files, or their metadata is not what `with_metadata` writes.
    """
    named = metadata.get("sources")
    ours = [Path(name).name for name in _names(raster)]
    if not isinstance(named, list) or [Path(str(name)).name for name in named] != ours:
        return None
    read = str(metadata.get("band"))
    bands = tuple(map(int, re.findall(r"\d+", read))) if _BANDS.fullmatch(read) else ()
    try:
        ends = float(metadata["stretch_low"]), float(metadata["stretch_high"])
        chosen: dict[str, Any] = {name: metadata.get(name) for name in _CHOSEN}
        chosen |= {"band": bands[0] if len(bands) == 1 else None, "rgb": bands if len(bands) == 3 else None}
        return replace(raster.options, stretch=Stretch(*ends, str(metadata.get("stretch"))), **chosen)
    except (KeyError, ValueError, TypeError, ParameterError):
        return None


def range_facts(detected: DetectedRange | None, axis: ValueAxis | None) -> dict[str, Any]:
    """Return a range of v, and of the raster's values with their unit; None at an open end."""
    if detected is None:
        return {}
    values = [None if math.isnan(end) else float(end) for end in detected.ends]
    metadata: dict[str, Any] = {"range": [detected.interval.low, detected.interval.high]}
    if axis is not None:
        metadata |= {"range_values": values, "unit": axis.unit or None}
    return metadata


def segment_facts(segment: SegmentParams) -> dict[str, Any]:
    """Return how blocks were divided and boundaries refined."""
    step = segment.intensity_step if segment.method == "adaptive" else None
    how = {"method": segment.method, "threshold": segment.threshold}
    return {**how, "intensity_step": step, "refine": segment.refine}


def drawing_facts(request: RegionRequest, fill_holes: Area | None = None) -> dict[str, Any]:
    """Return what was done to regions after they were outlined."""
    return {
        "detail": None if request.detail is None else str(request.detail),
        "fill_holes": _area(fill_holes),
        "min_area": _area(request.min_area),
        "smooth_outline_m": request.drawing.smooth_m,
        "regularize_m": request.drawing.regularize_m,
        "simplify_m": request.drawing.simplify_m,
        "stats": request.drawing.stats,
        "min_confidence": request.min_confidence,
    }


def _area(area: Area | None) -> str | None:
    return None if area is None else f"{area.value:.12g} {'pixels' if area.in_pixels else 'm2'}"


def _names(source: Source) -> tuple[str, ...]:
    """Return the files as they were named; of a block map, those that it was made from."""
    if isinstance(source, Blocks):
        return source.saved.origin.rasters
    given = source.given if isinstance(source, Raster) else ()
    return given or (source.name,)


def _reading(source: Source) -> dict[str, Any]:
    """Return what was chosen in place of what the files say, such as another nodata value."""
    if isinstance(source, Blocks):
        return {"nodata": source.saved.origin.nodata, **_of_origin(source.saved.origin)}
    if not isinstance(source, Raster):
        return {}
    names = [field.name for field in fields(source.options) if field.name not in _SAID_OTHERWISE]
    chosen = {name: getattr(source.options, name) for name in names}
    usual = [name for name, value in chosen.items() if isinstance(value, bool | tuple | None) and not value]
    return {name: chosen[name] for name in names if name not in usual} | _of_origin(source.origin)


def _of_origin(origin: Origin) -> dict[str, Any]:
    """Return how intensity was made of bands, and whether there was a collar that counts as nodata."""
    words = origin.words
    collar = "nodata" if origin.collar == "auto" else None
    formula = {"index": words.index, "expr": words.expr, "band_names": words.names}
    return {**formula, "collar": collar, "flatten": origin.flatten, "warp": origin.warp or None}


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: the same for 1 and 1.0, and text for what is not finite."""
    if isinstance(value, tuple | list):
        return list(map(_plain, value))
    if isinstance(value, float):
        if not math.isfinite(value):
            return str(value)
        return int(value) if value.is_integer() and abs(value) < 1e15 else float(value)
    return value if value is None or isinstance(value, bool | int) else printable(str(value))
