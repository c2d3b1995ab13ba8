"""Ranges as requests hold them, of v or of values, and as the phases take them."""

from dataclasses import dataclass

from uavseg.execution.phases import decided, phase
from uavseg.jobs.source import Blocks, Pixels
from uavseg.raster.intensity.value_range import FittedRange, ValueRange, axis_of, range_on_axis
from uavseg.raster.intensity.values import fit_values
from uavseg.raster.tiling import TilePass
from uavseg.raster.value_scale import ValueAxis, values_text
from uavseg.segmentation.params import IntensityRange
from uavseg.segmentation.source import GreySource

AnyRange = IntensityRange | ValueRange


@dataclass(frozen=True, slots=True)
class FoundRange:
    """A range in both units.

    Parameters
    ----------
    interval : IntensityRange
        Of v, after the stretch.
    ends : (float, float)
        The same in values; NaN where it is open, or values are not known.
    """

    interval: IntensityRange
    ends: tuple[float, float]


UNKNOWN_ENDS = (float("nan"), float("nan"))


def grey_for(source: Pixels, asked: AnyRange, tile_pass: TilePass) -> tuple[GreySource, FoundRange]:
    """The pixels of a source through a stretch that suits a range, and the range in v of that stretch.

    Parameters
    ----------
    source : Pixels
    asked : IntensityRange or ValueRange
        A range of v leaves the stretch as it is.
    tile_pass : TilePass

    Raises
    ------
    ParameterError
        If the range lies outside of a stretch that the user chose.
    """
    if isinstance(asked, ValueRange):
        with phase("stretch"):
            stretch, [found] = fit_values(source.dataset, source.stretch, [asked], tile_pass)
        decided("%s, stretch %s", source.dataset.band_names, stretch.name)
        decided("the range %s is v in %.7g..%.7g", asked, found.low, found.high)
        return GreySource(source.dataset, stretch), _found(found)
    grey = source.grey(tile_pass)
    return grey, FoundRange(asked, ends_of(axis_of(source.dataset, grey.stretch), asked))


def range_of_blocks(source: Blocks, asked: AnyRange) -> FoundRange:
    """A range in v of the stretch that a block map was made with.

    Raises
    ------
    ParameterError
        If it is of percentiles, or reaches beyond that stretch.
    """
    axis = source.saved.axis
    if not isinstance(asked, ValueRange):
        return FoundRange(asked, ends_of(axis, asked))
    return _found(range_on_axis(asked, axis, source.name))


def ends_of(axis: ValueAxis | None, interval: IntensityRange) -> tuple[float, float]:
    """The ends of a range of v in values; NaN where it is open, or values are not known."""
    if axis is None:
        return UNKNOWN_ENDS
    low, high = axis.ends(interval.low, interval.high)
    return float(low), float(high)


def range_text(asked: AnyRange, axis: ValueAxis | None) -> str:
    """What was asked for, for messages: "v in 0.5..1", "value in 20 to 40 degC"."""
    if not isinstance(asked, ValueRange):
        return f"v in {asked.low:g}..{asked.high:g}"
    if asked.by_rank:
        return f"value in the percentiles {asked}"
    return f"value in {values_text(asked.ends, '' if axis is None else axis.unit)}"


def _found(fitted: FittedRange) -> FoundRange:
    return FoundRange(IntensityRange(fitted.low, fitted.high), fitted.ends)
