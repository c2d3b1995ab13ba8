"""Classification of a map of probabilities: free, unknown and occupied cells, and occupied objects."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import LostObstaclesError, MapError, ParameterError
from uavseg.execution.executors import trim_heap
from uavseg.execution.phases import decided, phase
from uavseg.jobs.ranges.ranges import decided_grey
from uavseg.jobs.result.metadata import drawing_facts, segment_facts, with_metadata
from uavseg.jobs.result.result import Drawing, Extraction, SourceInfo, measured
from uavseg.jobs.source.source import Blocks, ProbabilityMap
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.regions.outline.rings import Rings
from uavseg.regions.tiles.segment_tiles import outline_state
from uavseg.segmentation.blocks.leaves import cell_states
from uavseg.segmentation.params.segment import SegmentParams, StateLimits
from uavseg.segmentation.pipeline import measure_block_map_for
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.classified_states import ClassifiedStates
from uavseg.segmentation.states.classify_strips import (
    StateRefinement,
    classify_states,
    own_states,
    state_strips,
)
from uavseg.segmentation.states.state_image import StateImage
from uavseg.units import OCCUPIED

if TYPE_CHECKING:
    from geopandas import GeoDataFrame


@dataclass(frozen=True, slots=True)
class ClassifyRequest:
    """Which states, and what becomes of occupied objects.

    Parameters
    ----------
    limits : StateLimits
    segment : SegmentParams
        Its `refine` is "scan" or "none". With the adaptive method and scans, thin obstacles are restored.
    objects : bool
        Whether occupied segments are outlined as objects.
    drawing : Drawing
        How their outlines are drawn.
    min_area : Area, optional
        Objects of less are dropped; states stay as they are.
    allow_lost_obstacles : bool
        Whether obstacles may be left without an occupied cell.

    Raises
    ------
    ParameterError
        If the refinement is another.
    """

    limits: StateLimits = StateLimits()
    segment: SegmentParams = SegmentParams(refine="scan")
    objects: bool = True
    drawing: Drawing = Drawing()
    min_area: Area | None = None
    allow_lost_obstacles: bool = False

    def __post_init__(self) -> None:
        _ = self.refine

    @property
    def refine(self) -> StateRefinement:
        """How states are refined."""
        refine = self.segment.refine
        if refine == "smooth" or refine == "tv" or refine == "pixels":
            raise ParameterError(
                f"states are refined by scans or not at all: refine is scan or none, not {refine}"
            )
        return refine

    @property
    def restores(self) -> bool:
        """Whether thin obstacles are restored: not with the paper's method, nor at block edges."""
        return self.segment.method == "adaptive" and self.refine == "scan"


@dataclass(frozen=True)
class Classification:
    """The states of a map's cells.

    Parameters
    ----------
    image : StateImage
        Reads the states window by window.
    cells : dict of int to int
        How many cells have each state.
    occupied_in_free : int
        Cells that are called free and whose own v lies above the occupied limit. Paths over free cells have
        to check v as well.
    occupied_by_value : int
        All cells whose own v lies above the occupied limit.
    unknown_in_free : int
        Cells that are called free and whose own v is unknown.
    restored : int
        Cells of thin obstacles that the scans left out and that became occupied.
    lost_obstacles : int
        8-connected structures of occupied cells, not explained by noise, of which no cell is called occupied.
    objects : Extraction or None
        What is occupied, if it was asked for: connected cells, 1..n with the largest first.
    source : SourceInfo
        The map.
    warnings : tuple of str
    """

    image: StateImage
    cells: dict[int, int]
    occupied_in_free: int
    occupied_by_value: int
    unknown_in_free: int
    restored: int
    lost_obstacles: int
    objects: Extraction | None
    source: SourceInfo
    warnings: tuple[str, ...]

    @property
    def states(self) -> NDArray[np.uint8]:
        """The state of each cell: 1 free, 2 unknown, 3 occupied, 0 no data; (rows, cols) uint8."""
        return self.image.read()

    def frame(self) -> "GeoDataFrame":
        """The objects as a GeoDataFrame.

        Raises
        ------
        ParameterError
            If no objects were asked for.
        """
        if self.objects is None:
            raise ParameterError("no objects were asked for; classify with objects=True")
        return self.objects.regions.frame()

    @property
    def geobox(self) -> GeoBox:
        """Where the cells lie."""
        return self.source.geobox


def classify(
    source: ProbabilityMap | Blocks, request: ClassifyRequest = ClassifyRequest(), work: Work = SERIAL
) -> Classification:
    """Free, unknown and occupied cells of a map of probabilities, refined to the cell.

    What is held for each cell, beyond the block map, is half a byte, and that lies in a temporary file where
    the map is large; see `segmentation.states.classify_strips`.

    Parameters
    ----------
    source : ProbabilityMap
    request : ClassifyRequest
    work : Work

    Raises
    ------
    MapError
        If no cell of the map is valid, or it holds something else than probabilities.
    LostObstaclesError
        If obstacles would be lost, which was not allowed.
    ParameterError
        If the source is a block map.
    """
    work = work.begun()
    if isinstance(source, Blocks):
        raise ParameterError(
            f"{source.path} is a block map; states are refined with the map, so give the map itself"
        )
    tile_pass = work.over(source)
    grey = decided_grey(source.grey(tile_pass.silent), request.limits.edges, request.limits.edges)
    strips = state_strips(grey.shape, grey.dataset.file_block, work.tile)
    tile_pass = replace(tile_pass, windows=[tile for strip in strips for tile in strip])
    dividing, deciding, *outlining = tile_pass.stages(2 + request.objects)
    leaves = None
    with phase("states"):
        found = own_states(grey, request.limits, tile_pass.silent) if request.restores else None
    if found is None:
        leaves = _leaf_states(grey, request, dividing)
        with phase("states"):
            found = classify_states(grey, leaves, request.limits, request.refine, deciding, request.restores)
    elif deciding.progress is not None:
        deciding.progress(1, 1)
    if not found.codes[1:].any():
        raise MapError(f"{source.name} has no valid cell: all of it is nodata or NaN")
    hints = _warnings(source.name, found, request)
    if request.refine != "none":
        leaves = None
    objects = _objects(grey, found, leaves, request, outlining[0]) if request.objects else None
    if objects is not None:
        objects = with_metadata(objects, source, "classify", _facts(request))
    hazard = found.occupied_in_free, found.occupied_by_value, found.unknown_in_free
    thin = sum(found.thin.restored.values()), found.thin.lost
    info = SourceInfo.of(grey)
    states = Classification(found.image, found.pixels, *hazard, *thin, objects, info, info.warnings)
    return work.finished(states, *hints)


def _leaf_states(grey: GreySource, request: ClassifyRequest, tile_pass: TilePass) -> NDArray[np.uint8]:
    with phase("division"):
        blocks = measure_block_map_for(grey, request.limits, request.segment, tile_pass)
    decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
    cells = cell_states(blocks, request.limits, request.segment.division)
    del blocks
    trim_heap()
    return cells


def _warnings(name: str, found: ClassifiedStates, request: ClassifyRequest) -> list[str]:
    """What a planner should know of the states; lost obstacles are refused unless that is allowed."""
    said = []
    lost = found.thin.lost
    if lost:
        text = "1 obstacle of {} has" if lost == 1 else f"{lost:,} obstacles of {{}} have"
        text = f"{text.format(name)} no occupied cell in these states"
        if not request.allow_lost_obstacles:
            raise LostObstaclesError(
                f"{text}; the default method with refine scan restores thin obstacles, or accept the loss "
                "(--allow-lost-obstacles)"
            )
        said.append(f"{text}: whatever plans with them does not avoid these")
    if found.trinary and found.unknown_in_free:
        one = found.unknown_in_free == 1
        cells = "1 unknown cell" if one else f"{found.unknown_in_free:,} unknown cells"
        said.append(f"{cells} of {name} {'is' if one else 'are'} called free")
    return said


def _objects(
    grey: GreySource,
    found: ClassifiedStates,
    leaves: NDArray[np.uint8] | None,
    request: ClassifyRequest,
    tile_pass: TilePass,
) -> Extraction:
    outlined = outline_state(grey, found.image, OCCUPIED, tile_pass, leaves)
    geobox = grey.dataset.geobox
    if request.min_area is not None:
        outlined = drop_small_regions(outlined, geobox, request.min_area)
    interval = request.limits.occupied_above, 1.0
    bounds = _bounds(outlined.rings, geobox)
    return measured(outlined, SourceInfo.of(grey), interval, request.drawing, bounds)


def _facts(request: ClassifyRequest) -> dict[str, Any]:
    """The parameters, for the metadata of the objects."""
    limits = {"free_below": request.limits.free_below, "occupied_above": request.limits.occupied_above}
    facts = limits | segment_facts(request.segment) | {"refine": request.refine}
    return facts | drawing_facts(request.drawing, None, request.min_area)


def _bounds(rings: Rings, geobox: GeoBox) -> dict[str, NDArray[np.float64]]:
    """The bounding box of each region, in the coordinates of the map."""
    xy = geobox.xy_from_pixel(rings.vertices[:, 0], rings.vertices[:, 1])
    first_rings = np.flatnonzero(np.diff(rings.labels, prepend=0))
    starts = rings.starts[first_rings]
    named = {}
    for name, coordinates in zip("xy", xy, strict=True):
        whole = np.asarray(coordinates, np.float64)
        named[f"{name}_min"] = np.minimum.reduceat(whole, starts) if len(starts) else np.empty(0)
        named[f"{name}_max"] = np.maximum.reduceat(whole, starts) if len(starts) else np.empty(0)
    return {name: named[name] for name in ("x_min", "y_min", "x_max", "y_max")}
