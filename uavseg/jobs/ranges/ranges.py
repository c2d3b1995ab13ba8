"""Ranges as requests hold them, of v or of values, and as the phases take them."""

from collections.abc import Sequence
from dataclasses import replace

from uavseg.errors import ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.source.source import Blocks, Pixels, Raster
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.value_range import (
    DetectedRange,
    ValueRange,
    axis_of,
    decided_at,
    fit_values,
    range_on_axis,
)
from uavseg.raster.spectral.bands import ValueAxis, values_text
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.source import GreySource

AnyRange = IntensityRange | ValueRange


_FLAT = (
    "without slow light v no longer stands for values of the raster, so values and percentiles of it do not "
    "fit; give a range of v (uavseg suggest with the same --flatten proposes some), or leave --flatten out"
)
EACH_PIXEL = "--refine pixels takes every pixel by its own value"
UNKNOWN_ENDS = (float("nan"), float("nan"))


def is_flat(source: Pixels | Blocks | GreySource) -> bool:
    """Return whether slow light is taken away from v, or was when a block map was made."""
    if isinstance(source, GreySource):
        return source.is_flat
    if isinstance(source, Blocks):
        return source.saved.illumination is not None
    return isinstance(source, Raster) and source.options.flat_field is not None


def where_to_look(source: Pixels | Blocks | GreySource) -> str:
    """Return what shows which v there are, for messages."""
    if is_flat(source):
        return "uavseg suggest with the same --flatten shows which v there are"
    return "uavseg info shows which v there are"


def grey_for(source: Pixels, requested: AnyRange, tile_pass: TilePass) -> tuple[GreySource, DetectedRange]:
    """Return the pixels of a source through a stretch that suits a range, and the range in v of that stretch.

    A range of v leaves the ends of the stretch as they are. A ParameterError says that the range lies outside
    of a stretch that the user chose, or that slow light is taken away and the range is of values.
    """
    if isinstance(requested, ValueRange):
        if is_flat(source):
            raise ParameterError(_FLAT)
        dataset = source.cleaned(tile_pass)
        with phase("stretch"):
            stretch, found = fit_values(dataset, source.stretch, requested, tile_pass)
        decided("%s, stretch %s", dataset.band_names, stretch.name)
        decided("the range %s is v in %.7g..%.7g", requested, found.interval.low, found.interval.high)
        return GreySource(dataset, stretch), found
    grey = decided_grey(source.grey(tile_pass), requested.edges, (requested.low, requested.high))
    axis = None if grey.is_flat else axis_of(source.dataset, grey.stretch)
    return grey, DetectedRange(requested, ends_of(axis, requested))


def decided_grey(grey: GreySource, edges: Sequence[float], bounds: Sequence[float]) -> GreySource:
    """Return the same pixels, on that side of edges of v on which their intensities lie; see `decided_at`."""
    if grey.is_flat:
        return grey
    return replace(grey, stretch=decided_at(grey.dataset, grey.stretch, edges, bounds))


def range_of_blocks(source: Blocks, requested: AnyRange) -> DetectedRange:
    """Return a range in v of the stretch that a block map was made with.

    A ParameterError says that it is of percentiles, or reaches beyond that stretch, or that slow light was
    taken away.
    """
    axis = source.saved.axis
    if not isinstance(requested, ValueRange):
        return DetectedRange(requested, ends_of(axis, requested))
    if is_flat(source):
        raise ParameterError(_FLAT)
    return range_on_axis(requested, axis, source.name)


def ends_of(axis: ValueAxis | None, interval: IntensityRange) -> tuple[float, float]:
    """Return the ends of a range of v in values; NaN where it is open, or values are not known."""
    if axis is None:
        return UNKNOWN_ENDS
    low, high = axis.ends(interval.low, interval.high)
    return float(low), float(high)


def range_text(requested: AnyRange, axis: ValueAxis | None) -> str:
    """Return what was asked for, for messages: "v in 0.5..1", "value in 20 to 40 degC"."""
    if not isinstance(requested, ValueRange):
        return f"v in {requested.low:g}..{requested.high:g}"
    if requested.by_rank:
        return f"value in the percentiles {requested}"
    return f"value in {values_text(requested.ends, '' if axis is None else axis.unit)}"


def missed_text(pixels: int, valid: int, ways: Sequence[str], them: str = "it") -> str:
    """Return how many pixels lie in ranges without a region, and what finds them, for messages."""
    number = f"{pixels:,} of {valid:,} pixels ({100 * pixels / valid:.3g} %) lie in {them}"
    return f"although {number}; {', and '.join(ways)}"
