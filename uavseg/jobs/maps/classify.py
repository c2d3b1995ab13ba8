"""Classification job: free, unknown and occupied cells of a map of probabilities, and occupied objects."""

from dataclasses import replace

import numpy as np

from uavseg.arrays import Floats, GeoDataFrame, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import LostObstaclesError, MapError, ParameterError
from uavseg.execution.executors import decided, phase, trim_heap
from uavseg.jobs.ranges.ranges import decided_grey
from uavseg.jobs.result import result as results
from uavseg.jobs.result.result import Drawing, Extraction, RegionRequest, SourceInfo
from uavseg.jobs.source.open_source import map_of
from uavseg.jobs.source.source import Blocks, ProbabilityMap
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.options.maps import ClassifyOptions
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.edit.small import Area, as_area, drop_small_regions
from uavseg.regions.outline.rings import Rings
from uavseg.regions.tiles.class_tiles import outline_state
from uavseg.segmentation.blocks.leaves import cell_intervals
from uavseg.segmentation.params.segment import SegmentParams, StateLimits
from uavseg.segmentation.pipeline import measure_block_map_for
from uavseg.segmentation.states.classify_strips import (
    ClassifiedStates,
    StateRefinement,
    classify_states,
    state_strips,
    states_by_value,
)
from uavseg.segmentation.states.state_image import StateImage
from uavseg.units import OCCUPIED


@dataclass(frozen=True, slots=True)
class ClassifyRequest:
    """Limits of the states, and options for occupied objects."""

    limits: StateLimits = StateLimits()
    # Its `refine` is "scan" or "none". With the adaptive method and scans, thin obstacles are restored.
    segment: SegmentParams = SegmentParams(refine="scan")
    objects: bool = True  # whether occupied segments are outlined as objects
    drawing: Drawing = Drawing()  # style of their outlines
    min_area: Area | None = None  # smaller objects are dropped; states do not change
    allow_lost_obstacles: bool = False  # whether obstacles may be left without an occupied cell

    def __post_init__(self) -> None:
        _ = self.refine

    @property
    def refine(self) -> StateRefinement:
        """Return the refinement of states; refuse those that only regions have."""
        refine = self.segment.refine
        if refine == "smooth" or refine == "tv" or refine == "pixels":
            raise ParameterError(
                f"states are refined by scans or not at all: refine is scan or none, not {refine}"
            )
        return refine

    @property
    def restores(self) -> bool:
        """Return whether thin obstacles are restored: not with the paper's method, nor at block edges."""
        return self.segment.method == "adaptive" and self.refine == "scan"


def classify_request(options: ClassifyOptions, with_objects: bool | None = None) -> ClassifyRequest:
    """Return the states of which a map is classified; objects are outlined by default for a file of them."""
    named = options.objects is not None or options.labels is not None
    return ClassifyRequest(
        StateLimits(options.free_below, options.occupied_above),
        options.division.segment_params(options.refine),
        objects=named if with_objects is None else with_objects,
        drawing=Drawing(simplify_m=options.simplify),
        min_area=as_area(options.min_area),
        allow_lost_obstacles=options.allow_lost_obstacles,
    )


@dataclass(frozen=True)
class Classification:
    """The states of a map's cells."""

    image: StateImage  # reads the states window by window
    cells: dict[int, int]  # number of cells of each state
    # Cells classified free whose v lies above the occupied limit. Paths over free cells have to check v as
    # well.
    occupied_in_free: int
    occupied_by_value: int  # all cells whose v lies above the occupied limit
    unknown_in_free: int  # cells classified free whose v is unknown
    restored: int  # cells of thin obstacles that the scans left out and that became occupied
    # 8-connected structures of occupied cells, not explained by noise, without a cell classified occupied.
    lost_obstacles: int
    # Connected components of occupied cells, if requested: 1..n with the largest first.
    objects: Extraction | None
    source: SourceInfo  # the map
    warnings: tuple[str, ...]

    @property
    def states(self) -> Uint8s:
        """Return the state of each cell: 1 free, 2 unknown, 3 occupied, 0 no data; (rows, cols) uint8."""
        return self.image.read()

    def frame(self) -> "GeoDataFrame":
        """Return the objects as a GeoDataFrame; refuse a result without them."""
        if self.objects is None:
            raise ParameterError("no objects were asked for; classify with objects=True")
        return self.objects.regions.frame()

    @property
    def geobox(self) -> GeoBox:
        """Return the position of the cells."""
        return self.source.geobox


def classify(
    source: ProbabilityMap | Blocks, request: ClassifyRequest = ClassifyRequest(), work: Work = SERIAL
) -> Classification:
    """Classify the cells of a map of probabilities as free, unknown or occupied, refined to the cell.

    Beside the block map, this takes half a byte per cell, in a temporary file where the map is large; see
    `segmentation.states.classify_strips`.
    """
    work = work.begun()
    source = map_of(source, "states are refined with the map, so give the map itself")
    tile_pass = work.over(source)
    grey = decided_grey(source.grey(tile_pass.silent), request.limits.edges, request.limits.edges)
    strips = state_strips(grey.shape, grey.dataset.file_block, work.tile)
    tile_pass = replace(tile_pass, windows=[tile for strip in strips for tile in strip])
    dividing, deciding, *outlining = tile_pass.stages(2 + request.objects)
    leaves = None
    with phase("states"):
        states = states_by_value(grey, request.limits, tile_pass.silent) if request.restores else None
    if states is None:
        with phase("division"):
            blocks = measure_block_map_for(grey, request.limits, request.segment, dividing)
        decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
        leaves = cell_intervals(blocks, request.limits.edges, request.segment.division)  # 1 free, 2 unknown
        del blocks
        trim_heap()
        with phase("states"):
            states = classify_states(grey, leaves, request.limits, request.refine, deciding, request.restores)
    elif deciding.progress is not None:
        deciding.progress(1, 1)
    if not states.codes[1:].any():
        raise MapError(f"{source.name} has no valid cell: all of it is nodata or NaN")
    hints = _warnings(source.name, states, request)
    objects, info = None, SourceInfo.of(grey)
    if request.objects:
        leaves = leaves if request.refine == "none" else None
        outlined = outline_state(grey, states.image, OCCUPIED, outlining[0], leaves)
        outlined = drop_small_regions(outlined, source.geobox, request.min_area)
        bounds = _bounds(outlined.rings, source.geobox)
        ends = request.limits.occupied_above, 1.0
        drawn = RegionRequest(drawing=request.drawing, min_area=request.min_area)
        found = results.measured(outlined, info, ends, drawn, bounds)
        how = {"free_below": request.limits.free_below, "occupied_above": request.limits.occupied_above}
        how |= results.segment_facts(request.segment) | {"refine": request.refine}
        how |= results.drawing_facts(drawn)
        objects = results.with_metadata(found, source, "classify", how)
    doubtful = ("occupied_in_free", "occupied_by_value", "unknown_in_free")
    classification = Classification(
        image=states.image,
        cells=states.pixels,
        **{name: getattr(states, name) for name in doubtful},
        restored=sum(states.thin.restored.values()),
        lost_obstacles=states.thin.lost,
        objects=objects,
        source=info,
        warnings=info.warnings,
    )
    return work.finished(classification, *hints)


def _warnings(name: str, states: ClassifiedStates, request: ClassifyRequest) -> list[str]:
    """Warn planners that use the states; refuse lost obstacles unless that is allowed."""
    warnings = []
    lost = states.thin.lost
    if lost:
        text = "1 obstacle of {} has" if lost == 1 else f"{lost:,} obstacles of {{}} have"
        text = f"{text.format(name)} no occupied cell in these states"
        if not request.allow_lost_obstacles:
            raise LostObstaclesError(
                f"{text}; the default method with refine scan restores thin obstacles, or accept the loss "
                "(--allow-lost-obstacles)"
            )
        warnings.append(f"{text}: whatever plans with them does not avoid these")
    if states.trinary and states.unknown_in_free:
        one = states.unknown_in_free == 1
        cells = "1 unknown cell" if one else f"{states.unknown_in_free:,} unknown cells"
        warnings.append(f"{cells} of {name} {'is' if one else 'are'} called free")
    return warnings


def _bounds(rings: Rings, geobox: GeoBox) -> dict[str, Floats]:
    starts = rings.starts[np.flatnonzero(np.diff(rings.labels, prepend=0))]  # of the first ring of each
    xy = np.asarray(geobox.xy_from_pixel(rings.vertices[:, 0], rings.vertices[:, 1]), np.float64)
    return {
        f"{axis}_{end}": extreme.reduceat(values, starts) if len(starts) else np.empty(0)
        for end, extreme in (("min", np.minimum), ("max", np.maximum))
        for axis, values in zip("xy", xy, strict=True)
    }
