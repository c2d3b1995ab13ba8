"""Comparison job: what changed between two rasters or two occupancy maps of one place.

Regions of two rasters are those of `extract`, compared tile by tile on the finer of their grids: a pixel has
the class of the pixel of the other raster in which its centre lies, in whatever coordinate system that is.
Only ground that is valid in both counts, in whole pixels: those gained minus those lost are those in range
after minus those before. Maps are registered first, see `occupancy.several_maps`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from affine import Affine

from uavseg._version import __version__
from uavseg.arrays import GeoDataFrame, Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError, RasterError
from uavseg.execution.executors import phase, split_progress
from uavseg.jobs.maps.merge_maps import placed_map
from uavseg.jobs.requests import RegionJob, region_job
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.source.open_source import open_pixels, open_probability_map, pixels_of
from uavseg.jobs.source.source import ProbabilityMap, Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.occupancy.ros.ros_map import placement
from uavseg.occupancy.several_maps import Evidence, Registration, changed_objects, register
from uavseg.options.reading import ReadOptions
from uavseg.options.regions import CompareOptions, ExtractOptions
from uavseg.plain_text import printable
from uavseg.raster.geodesy.globe import transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.raster.grid.tiling import TilePass, Window, whole_blocks
from uavseg.raster.intensity.value_range import ValueRange
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.edit.small import Area
from uavseg.regions.outline.rings import Rasteriser, RegionOutlines, renumber_by_size
from uavseg.regions.outline.stitch import outline_tile
from uavseg.regions.outline.trace import trace
from uavseg.regions.table import Regions, make_regions
from uavseg.regions.tiles.class_tiles import ClassesByPixel, ClassOutlines, stitch_classes
from uavseg.segmentation.components import component_sums, label_equal_values
from uavseg.segmentation.source import GreyTile
from uavseg.units import CELL

Source = Raster | ProbabilityMap
Kinds = Sequence[tuple[str, str]]  # of changes, each with its colour
Side = tuple[Dataset, Rasteriser, Uint8s]  # a raster, its regions, the class of each by label

MAX_CLASSES = 15  # the changes from one to another are counted in a byte
_GAINED, _LOST, _OTHER, _FADED = "#1a9850", "#d73027", "#e6ab02", "#7f7f7f"
_AWAY = (("gone", _LOST), ("not seen again", _FADED))
_HERE = (("new", _GAINED), ("first seen", _OTHER))
_COLUMNS = ("id", "class", "color", "area_m2", "perimeter_m", "pixels", "holes", "lon", "lat", "source")
_COARSER = 1.5  # ratio of resolutions from which borders are uncertain
_TILE = 1024


@dataclass(frozen=True)
class Comparison:
    """What changed between two rasters or maps."""

    # Changes, the largest first, with the columns `class` (the kind) and `color`; of maps, on the second
    regions: Regions
    # Pixels and area of each kind, small ones too: "gained" and "lost" of a range, "new", "gone", "first
    # seen" and "not seen again" of maps
    changes: Mapping[str, tuple[int, float]]
    grid: str  # whose grid they were counted on: "before", "after" or "both"
    warnings: tuple[str, ...]
    before: Mapping[str, int] = field(default_factory=dict)  # of rasters: pixels in range, or of each class
    after: Mapping[str, int] = field(default_factory=dict)
    common: int = 0  # of rasters: pixels that are valid in both, of which those are
    registration: Registration | None = None  # of maps: how the first lies on the second

    def frame(self) -> "GeoDataFrame":
        """Return the changes as a GeoDataFrame."""
        return self.regions.frame()


def compare_job(options: CompareOptions) -> RegionJob | None:
    """Return the job whose regions are compared; None where neither a range nor classes are given: maps."""
    ranges, classes, refine = options.ranges, options.classes, options.refine
    others = ranges.values, ranges.percentile, classes
    if all(one is None for one in (ranges.range, refine, *others)):
        return None
    if isinstance(ranges.range, list) and any(one is not None for one in others):
        raise ParameterError("several ranges are classes; give them, or values, percentile or classes")
    return region_job(ExtractOptions(ranges=ranges, classes=classes, refine=refine))


def open_both(before: Any, after: Any, job: RegionJob | None, read: ReadOptions) -> tuple[Source, Source]:
    """Return both sources of a comparison, see `compare`; no pixel is read. Errors as of `open_source`."""
    opens = open_probability_map if job is None else open_pixels
    refusal = "a block map has no cells; name the map itself"
    return pixels_of(opens(before, read), refusal), pixels_of(opens(after, read), refusal)


def compare(
    before: Source, after: Source, job: RegionJob | None, least: Area | None = None, work: Work = SERIAL
) -> Comparison:
    """Find what changed: regions of a job over two rasters, or occupied cells of two maps where it is None.

    The other way round gained and lost, new and gone are exchanged, exactly. Changes of less than an area are
    counted, but not outlined.
    """
    if job is not None:
        found = _compare_rasters((before, after), job, work.begun())
    elif work.checkpoint is not None:
        raise ParameterError("maps are compared whole, so there is nothing to resume; leave resume out")
    else:
        found = _compare_maps((before, after))
    kept, columns, warnings = found.regions, found.regions.columns, found.warnings
    kinds, pixels, areas = (columns[name] for name in ("class", "pixels", "area_m2"))
    masks = {name: kinds == name for name in found.changes}
    sums = {name: (int(pixels[mask].sum()), float(areas[mask].sum())) for name, mask in masks.items()}
    if least is not None:
        kept = kept.select((pixels if least.in_pixels else areas) >= least.value)
    if small := len(kinds) - len(kept):
        warnings += (f"{small:,} changes smaller than --min-area are left out; the sums count them",)
    kept.columns["id"] = np.arange(1, len(kept) + 1)
    files = [printable(", ".join(getattr(one, "given", ()) or (one.name,))) for one in (before, after)]
    facts = {"software": f"uavseg {__version__}", "job": "compare", "sources": files, **kept.metadata}
    return replace(found, regions=replace(kept, metadata=facts), changes=sums, warnings=warnings)


def _compare_maps(sources: tuple[Source, Source]) -> Comparison:
    """Find objects that are new or gone, and those on ground that only one map knows."""
    before, after = sources
    if before.geobox.crs != after.geobox.crs:
        raise MapError(f"{after.name} has another coordinate system than {before.name}; warp it (gdalwarp)")
    for source in sources:
        placement(source.geobox)  # refuses cells that are not square or not in metres
    with phase("registration"):
        first, second = (Evidence(placed_map(source)) for source in sources)
        found = register(first, second)
    with phase("changes"):
        away = _objects((first, second, found.motion), found, found.motion, _AWAY, before.name)
        here = _objects((second, first, found.back), found, Affine.identity(), _HERE, after.name)
    columns = {name: np.concatenate([away.columns[name], here.columns[name]]) for name in _COLUMNS}
    polygons = np.array([*away.polygons, *here.polygons, None], object)[:-1]
    facts = {"shift_cells": list(found.shift), "angle_deg": found.angle_deg, "overlap": found.share}
    order = np.argsort(-columns["area_m2"], kind="stable")
    return Comparison(
        regions=Regions(columns, polygons, here.wkt, facts).select(order),
        changes={name: (0, 0.0) for name, _ in (*_HERE, *_AWAY)},
        grid="after",
        warnings=_texts(before.warnings, after.warnings),
        registration=found,
    )


def _objects(
    maps: tuple[Evidence, Evidence, Affine], found: Registration, place: Affine, kinds: Kinds, source: str
) -> Regions:
    """Return the objects of one map that the other has not, with their attributes, moved to a place."""
    labels, classes = changed_objects(*maps, found.cell_m)
    sums = component_sums(labels, len(classes), np.zeros(labels.shape, np.uint16))
    outlined = renumber_by_size(trace(labels), sums)
    numbers = ClassesByPixel.of(sums.firsts, classes).at(outlined.sums.firsts) - 1
    geobox = replace(maps[0].geobox, transform=place * maps[0].geobox.transform)
    return _table(outlined, geobox, numbers, kinds, source)


def _compare_rasters(sources: tuple[Source, Source], job: RegionJob, work: Work) -> Comparison:
    """Find what was gained and lost of a range or of classes."""
    before, after = sources
    if (before.geobox.crs is None) != (after.geobox.crs is None):
        raise RasterError(f"one of {before.name} and {after.name} has no CRS; give it one with gdal_edit.py")
    several = getattr(job.request, "classes", None)
    names = ["", *(one.name for one in several.classes)] if several else ["", "in range"]
    if len(names) > MAX_CLASSES + 1:
        raise ParameterError(f"at most {MAX_CLASSES} classes can be compared, not {len(names) - 1}")
    progress = split_progress(work.progress, 3) if work.progress else [None] * 3
    works = [replace(work, progress=one) for one in progress]
    found = [job.find(*both) for both in zip(sources, works, strict=False)]
    sides = [_side(*both, names) for both in zip(sources, found, strict=True)]
    geobox = max((before.geobox, after.geobox), key=_fineness)
    # Every tile needs the regions of both; the coordinates of its pixels take many times its memory.
    here = replace(works[2], tile=work.tile or _TILE, executor=work.local, checkpoint=None)
    tile_pass = here.over(after if geobox == after.geobox else before)
    counts = np.zeros((len(names) + 1, len(names) + 1), np.int64)
    with phase("changes"):
        tiles = tile_pass.run(partial(_outline_tile, sides, geobox, len(names)))
        outlined, classes = stitch_classes(geobox.shape, tile_pass.windows, _counted(tiles, counts))
    inside = counts[:-1, :-1]
    if not inside.any():
        raise RasterError(f"{before.name} and {after.name} have no valid ground in common")
    grid = "both" if before.geobox == after.geobox else "after" if geobox == after.geobox else "before"
    known, kinds = found[1].regions.metadata, _kinds(names)
    facts = {key: known[key] for key in ("band", "range", "range_values", "classes") if key in known}
    source = f"{before.name}, {after.name}"
    regions = _table(outlined, geobox, classes.at(outlined.sums.firsts), kinds, source)
    return Comparison(
        regions=replace(regions, metadata=facts | {"grid": grid}),
        changes={name: (0, 0.0) for name, _ in kinds if name},
        grid=grid,
        warnings=(*_texts(found[0].warnings, found[1].warnings), *_doubts(sources, found, job)),
        before=dict(zip(names[1:], inside.sum(axis=1)[1:].tolist(), strict=True)),
        after=dict(zip(names[1:], inside.sum(axis=0)[1:].tolist(), strict=True)),
        common=int(inside.sum()),
    )


def _texts(before: Sequence[str], after: Sequence[str]) -> tuple[str, ...]:
    return (*(f"before: {text}" for text in before), *(f"after: {text}" for text in after))


def _table(outlined: RegionOutlines, geobox: GeoBox, kinds: Integers, names: Kinds, source: str) -> Regions:
    """Return changes with their attributes; `kinds`, (n,), are indices into the names."""
    rings = outlined.rings
    pixels = np.bincount(rings.labels, rings.pixel_areas(), len(kinds) + 1)[1:].astype(np.int64)
    regions = make_regions(rings, outlined.sums, geobox, (0.0, 1.0), source, pixels)
    words = [np.array([pair[k] for pair in names], object)[kinds] for k in (0, 1)]
    columns = regions.columns | dict(zip(("class", "color"), words, strict=True))
    return replace(regions, columns={name: columns[name] for name in _COLUMNS})


def _side(source: Source, found: Extraction, names: Sequence[str]) -> Side:
    named = found.regions.columns.get("class", [names[1]] * len(found.regions))
    of_label = [names.index(name) for name in named]
    return source.cleaned(TilePass(())), Rasteriser(found.rings), np.array([0, *of_label], np.uint8)


def _fineness(geobox: GeoBox) -> tuple[Any, ...]:  # a key: the smallest pixels last, ties by place
    return -round(1e6 * math.log(np.prod(ground_resolution(geobox)))), tuple(geobox.transform), geobox.shape


def _kinds(names: Sequence[str]) -> Kinds:
    """Return name and colour of the changes from each class to each: index len(names) * before + after."""
    kinds = [(f"{one} to {other}" if one != other else "", _OTHER) for one, other in product(names, repeat=2)]
    for k, name in list(enumerate(names))[1:]:
        suffix = f" {name}" if len(names) > 2 else ""
        kinds[k], kinds[k * len(names)] = (f"gained{suffix}", _GAINED), (f"lost{suffix}", _LOST)
    return kinds


def _doubts(sources: tuple[Source, Source], found: Sequence[Extraction], job: RegionJob) -> Iterator[str]:
    """Yield what to know before trusting the changes of rasters."""
    first, second = (one.stretch for one in found)
    by_v = not isinstance(getattr(job.request, "interval", None), ValueRange)
    if by_v and (first.low, first.high) != (second.low, second.high):
        yield f"the stretches differ ({first.name}; {second.name}), so v means other values; give --values"
    one, other = (math.sqrt(np.prod(ground_resolution(source.geobox))) for source in sources)
    if max(one, other) > _COARSER * min(one, other):
        yield f"pixels are {one:.3g} and {other:.3g} wide, so borders are uncertain; --min-area drops slivers"


def _outline_tile(
    sides: Sequence[Side], geobox: GeoBox, classes: int, window: Window
) -> tuple[ClassOutlines, Integers]:
    """Return outlines of the changes of a tile, and the pixels of each pair of classes, the last: invalid."""
    shape = whole_blocks(window.rows) + 2 * CELL, whole_blocks(window.cols) + 2 * CELL
    around = window.grown(CELL)
    inner = around.clipped(geobox.shape)
    pair = np.full((2, *shape), classes, np.uint8)
    for k, side in enumerate(sides):
        pair[k][inner.relative_to(around).slices] = _classes_at(side, geobox, inner, classes)
    here = Window(CELL, CELL, window.rows, window.cols).slices
    both = pair[0][here].astype(np.int64) * (classes + 1) + pair[1][here]
    counts = np.bincount(both.ravel(), minlength=(classes + 1) ** 2).reshape(classes + 1, -1)
    is_change = (pair[0] != pair[1]) & (pair < classes).all(axis=0)
    codes = np.where(is_change, pair[0] * np.uint8(classes) + pair[1], 0).astype(np.uint8)
    blank = GreyTile(np.zeros(shape, np.uint16), np.ones(shape, np.uint8), False)
    outlines = outline_tile(codes, *label_equal_values(codes, CELL), blank, window, geobox.shape[1])
    if outlines is None:
        return None, counts
    row, col = (outlines.sums.firsts - (window.row, window.col) + CELL).T
    return (outlines, codes[row, col]), counts


def _counted(tiles: Iterator[tuple[ClassOutlines, Integers]], counts: Integers) -> Iterator[ClassOutlines]:
    """Yield the outlines of tiles, and add up their pixels."""
    for outlines, of_tile in tiles:
        counts += of_tile
        yield outlines


def _classes_at(side: Side, geobox: GeoBox, window: Window, invalid: int) -> Uint8s:
    """Return the class of a raster at the centres of the pixels of a window of the grid of comparison."""
    dataset, labels, of_label = side
    (rows, cols), shape = _places(geobox, dataset.geobox, window), dataset.geobox.shape
    in_rows, in_cols = (rows >= 0) & (rows < shape[0]), (cols >= 0) & (cols < shape[1])
    inside = in_rows & in_cols
    if not inside.any():
        return np.full(inside.shape, invalid, np.uint8)
    rows, cols = np.where(in_rows, rows, rows[in_rows].min()), np.where(in_cols, cols, cols[in_cols].min())
    row, col = int(rows.min()), int(cols.min())
    needed = Window(row, col, int(rows.max()) - row + 1, int(cols.max()) - col + 1)
    classes, (_, mask) = of_label[labels(needed)], dataset.read(needed)
    if mask is not None:
        classes[mask == 0] = invalid
    return np.where(inside, classes[rows - row, cols - col], np.uint8(invalid))


def _places(geobox: GeoBox, other: GeoBox, window: Window) -> list[Integers]:
    """Return row and column of another raster at each pixel's centre, to be broadcast; -1 outside of it."""
    row = np.arange(window.row, window.row + window.rows)[:, None]
    col = np.arange(window.col, window.col + window.cols)[None]
    if geobox == other:
        return [row, col]
    x, y, t = col + 0.5, row + 0.5, ~other.transform
    if geobox.crs == other.crs:
        t = t * geobox.transform
    else:
        x, y = geobox.xy_from_pixel(*np.broadcast_arrays(y, x))
        x, y = transform_between(geobox.wkt, other.wkt)(x, y)
    at = (t.e * y + t.f + (t.d * x if t.d else 0.0), t.a * x + t.c + (t.b * y if t.b else 0.0))
    return [np.where(np.abs(one) < 1e15, np.floor(one + 1e-9), -1).astype(np.int64) for one in at]
