"""The band, index or sum of bands, and its range, that part a sample best from the rest of a raster.

sample and raster -> colors: what is of the sample's kind, as `match` learns it
                  -> features: what bands make, each with its best interval
                  -> ranges: the best of each kind of feature
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from uavseg.arrays import Floats, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import raster_of
from uavseg.jobs.source.source import AUTO, Raster, Source, flattened
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.features import Feature, alike, features_of, weighted_sum
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.raster.intensity.value_range import axis_of, scale_of
from uavseg.raster.read.dataset import stacked
from uavseg.raster.read.raster_file import MOST_UNCHOSEN
from uavseg.raster.spectral.band_names import find_band
from uavseg.raster.spectral.bands import BandScale, ValueAxis, values_text
from uavseg.regions.sample.place import Disc, sample_mask
from uavseg.regions.sample.similarity import SampledColors, sample_colors, spread_stretches
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

_MOST_SUMMED = 8  # bands in a weighted sum, which people read
LEAST_PARTING = 0.15  # of likeness: that of the sample less that of the raster, where color parts them
_LEAST_AGREEMENT = 0.5
_SIMPLER = {"band": 0.02, "index": 0.01, "sum": 0.0}  # agreement that what is simpler to read may lack
_HARDLY = (
    "color hardly parts the sample from the rest of the raster, so no range of it does; texture may "
    "(uavseg match --by texture)"
)
_MIXED = (
    "the best range agrees in {:.0%} only with what has the colors of the sample; uavseg match compares all "
    "bands at once"
)
_BINS = 256
_TAILS = (0.001, 0.999)  # quantiles between which bins lie; values outside belong to the outer ones
_WRONG = 0.1  # share of the sample that may be of another class
_OPEN = 0.005  # agreement that an end may cost to be open


@dataclass(frozen=True, slots=True)
class Interval:
    """Interval, open where an end is infinite, with its expected fit.

    `agreement` is the expected number of pixels that are of the class and in the interval, as a share of
    those that are either; `share` that of the raster's pixels in it; `step` the one between values that were
    compared as ends.
    """

    low: float
    high: float
    agreement: float
    share: float
    step: float


def best_interval(values: Floats, similarity: Floats, sample: Floats) -> Interval | None:
    """Choose the interval with the largest expected intersection over union with a sample's class.

    It is open at an end where that costs almost no agreement; None where all values are one, or none is
    finite. `values`, (n,), are of pixels all over the raster, `similarity`, (n,), the probability that each
    is of the class. An interval that lacks more than a tenth of the values of the `sample`, (m,), counts for
    less.
    """
    finite = np.isfinite(values)
    values, similarity, sample = values[finite], similarity[finite], sample[np.isfinite(sample)]
    if len(values) == 0 or len(sample) == 0:
        return None
    low, high = np.quantile(np.concatenate([values, sample]), _TAILS)
    if not low < high:
        return None
    edges = np.linspace(low, high, _BINS + 1)
    places = np.searchsorted(edges[1:-1], values, side="right")
    of_sample = np.bincount(np.searchsorted(edges[1:-1], sample, side="right"), minlength=_BINS) / len(sample)
    expected = _between(np.bincount(places, similarity, _BINS).astype(np.float64))
    pixels = _between(np.bincount(places, minlength=_BINS).astype(np.float64))
    in_sample = np.minimum(_between(of_sample) / (1 - _WRONG), 1)
    agreement = np.triu(expected / np.maximum(expected[0, -1] + pixels - expected, 1e-9), 1) * in_sample
    agreement[0, -1] = 0  # not the interval of all values
    first, last = (int(place) for place in np.unravel_index(agreement.argmax(), agreement.shape))
    best = float(agreement[first, last])
    if agreement[0, last] >= best - _OPEN:
        first = 0
    if agreement[first, -1] >= best - _OPEN:
        last = _BINS
    return Interval(
        -math.inf if first == 0 else float(edges[first]),
        math.inf if last == _BINS else float(edges[last]),
        float(agreement[first, last]),
        float(pixels[first, last] / len(values)),
        float(edges[1] - edges[0]),
    )


def _between(counts: Floats) -> Floats:
    """Sum counts from each edge of bins to each other one."""
    sums = np.concatenate([[0.0], np.cumsum(counts)])
    between: Floats = sums[None, :] - sums[:, None]
    return between


def linear_weights(colors: Floats, similarity: Floats, digits: int = 2) -> Floats:
    """Return the weights of bands whose sum separates a class best: Fisher's linear discriminant.

    R. A. Fisher, Annals of Eugenics 7 (1936) 179-188, with probabilities in place of two classes.

    `similarity` is the probability that each of the (n, bands) colours is of the class. The weights are
    rounded to `digits` decimals; their absolute values have a sum of about 1.
    """
    of_kind, of_rest = (share / max(float(share.sum()), 1e-9) for share in (similarity, 1 - similarity))
    middle, other = ((share[:, None] * colors).sum(0) for share in (of_kind, of_rest))
    scale = np.maximum(colors.std(0), 1e-12)
    scatter = _scatter((colors - middle) / scale, of_kind) + _scatter((colors - other) / scale, of_rest)
    weights = np.linalg.solve(scatter + 0.01 * np.eye(len(scale)), (middle - other) / scale) / scale
    rounded: Floats = np.round(weights / max(float(abs(weights).sum()), 1e-12), digits)
    return rounded


def _scatter(away: Floats, shares: Floats) -> Floats:
    bands = range(away.shape[1])
    return np.array([[(shares * away[:, a] * away[:, b]).sum() for b in bands] for a in bands])


@dataclass(frozen=True, slots=True)
class SuggestLikeRequest:
    """Samples of what is wanted (none: ParameterError) and of what is not; the bands to use, all if none."""

    like: tuple[Disc | str, ...]
    unlike: tuple[Disc | str, ...] = ()
    bands: tuple[int | str, ...] = ()

    def __post_init__(self) -> None:
        if not self.like:
            raise ParameterError("a sample of what is wanted is needed beside that of what is not; give like")


@dataclass(frozen=True, slots=True)
class SampleRange:
    """A band, an index or an expression, and the range of its values that a sample's kind has.

    Parameters
    ----------
    of : str
        Description: "band 3", "ndvi (nir - red) / (nir + red) of bands 4,1".
    value_low, value_high : float or None
        In the units of the raster; None where it is open.
    unit : str
        Of the values; empty where it is not known.
    agreement : float
        Expected pixels that are of the kind and in the range, as a share of those that are either, 0 to 1.
    share : float
        Of the raster's pixels in the range, estimated from pixels all over it.
    words : dict
        What chooses it, as `uavseg.extract` takes it: "band", "index" or "expr"; what was chosen already is
        not there.
    """

    of: str
    value_low: float | None
    value_high: float | None
    unit: str
    agreement: float
    share: float
    words: dict[str, Any]

    @property
    def values(self) -> tuple[float | None, float | None]:
        """As `uavseg.extract` takes it."""
        return self.value_low, self.value_high

    def __str__(self) -> str:
        """As --values takes it."""
        return ",".join("" if end is None else f"{end:.10g}" for end in self.values)

    @property
    def values_text(self) -> str:
        """The range for people."""
        low, high = (math.nan if end is None else end for end in self.values)
        return values_text((low, high), self.unit)


@dataclass(frozen=True, slots=True)
class SampleRanges:
    """Ranges that part a sample from the rest of a raster, the best first: one of each kind of feature.

    These are a band or the luminance, an index or a ratio, and a weighted sum.
    """

    ranges: tuple[SampleRange, ...]
    source: SourceInfo
    warnings: tuple[str, ...]


def ranges_of_sample(source: Source, request: SuggestLikeRequest, work: Work = SERIAL) -> SampleRanges:
    """Return ranges of bands, indices and sums of bands that part samples best from the rest of a raster.

    Where a band or a formula of it is chosen, that alone is looked at. A SampleError says that a sample is
    not on the raster, too small, or on nodata, a ParameterError that slow light is to be taken away.
    """
    work = work.begun()
    raster = raster_of(source, "a block map holds no colors to be compared; name the raster itself")
    if raster.options.flatten is not None:
        raise ParameterError(
            "a sample is parted by ranges of values, which do not fit without slow light; leave flatten out"
        )
    [tile_pass] = work.over(raster).stages(1)
    places = [sample_mask(one, raster.geobox) for one in request.like]
    others = [sample_mask(one, raster.geobox) for one in request.unlike]
    options = raster.options
    alone = not request.bands and (options.band is not None or options.formula.is_formula)
    bands = [] if alone or raster.dataset.choice.expanded else _bands(raster, request.bands)
    sources = band_sources(raster, bands, tile_pass) if bands else [raster.grey(tile_pass)]
    with phase("colors of the sample"):
        colors = sample_colors(sources, places, tile_pass, others)
        table = colors.table()
    decided("likeness %.3f in the sample, %.3f in the raster", table.sample_mean, table.raster_mean)
    similarity = table.of(colors.points) / GREY_MAX
    with phase("ranges"):
        if bands:
            ranges = _of_bands(raster, sources, bands, colors, similarity)
        else:
            ranges = _as_chosen(raster, sources[0], colors, similarity)
    info = SourceInfo.of(sources[0])
    hints = []
    if table.separation < LEAST_PARTING:
        hints.append(_HARDLY)
    elif not ranges or ranges[0].agreement < _LEAST_AGREEMENT:
        hints.append(_MIXED.format(ranges[0].agreement if ranges else 0))
    return work.finished(SampleRanges(tuple(ranges), info, raster.warnings), *hints)


Greys = Sequence[GreySource]
Ranges = list[SampleRange]


def _bands(raster: Raster, wanted: Sequence[int | str]) -> list[int]:
    """Return numbers of the bands to use."""
    layout = raster.dataset.mosaic.files[0].layout
    if wanted:
        return [find_band(layout, band) if isinstance(band, str) else band for band in wanted]
    if raster.options.rgb is not None:
        return list(raster.dataset.bands)
    return _plain_bands(raster)


def _plain_bands(raster: Raster) -> list[int]:
    """Return the numbers of all bands that are not alpha."""
    roles = raster.dataset.mosaic.files[0].layout.roles
    return [number for number, role in enumerate(roles, start=1) if role != "alpha"]


def _as_chosen(raster: Raster, source: GreySource, colors: SampledColors, similarity: Floats) -> Ranges:
    """Return the range of the one number per pixel that was chosen."""
    axis = axis_of(source.dataset, source.stretch) or ValueAxis(source.stretch.low, source.stretch.high)
    points, own = (axis.values(values[:, 0] / GREY_MAX) for values in (colors.points, colors.sample))
    found = best_interval(points, similarity, own)
    if found is None:
        return []
    options = raster.options
    chosen = {"band": options.band, "index": options.index, "expr": options.expr}
    words = _given(chosen | {"band_names": options.band_names})
    return [_range(source.dataset.band_names, axis.unit, words, found)]


def _of_bands(
    raster: Raster, sources: Greys, bands: Sequence[int], colors: SampledColors, similarity: Floats
) -> Ranges:
    """Return the best range of each kind of feature."""
    options, layout = raster.options, raster.dataset.mosaic.files[0].layout
    scales = {band: scale_of(source.dataset) for band, source in zip(bands, sources, strict=True)}
    points, own = (_stored(sources, bands, values) for values in (colors.points, colors.sample))
    integers = sources[0].dataset.dtype.kind in "iu" and scales[bands[0]] == BandScale()
    features = features_of(layout, bands, options.rgb, options.formula, integers)
    summed = alike(layout, bands)
    values = np.stack([scales[band].values(points[band]) for band in summed], 1)
    digits = 2 if len(summed) <= _MOST_SUMMED else 12
    while len(summed) > _MOST_SUMMED:  # leave out the half that counts least
        parts = np.abs(linear_weights(values, similarity, digits)) * values.std(0)
        kept = np.sort(np.argsort(-parts, kind="stable")[: max(len(parts) // 2, _MOST_SUMMED)])
        summed, values = [summed[k] for k in kept.tolist()], values[:, kept]
    if len(summed) > 1:
        weights = [float(f"{weight:.3g}") for weight in linear_weights(values, similarity, digits).tolist()]
        total = weighted_sum(layout, summed, weights, options.formula)
        features += [] if total is None else [total]
    best: dict[str, tuple[Feature, Interval]] = {}
    for one in features:
        if one.choice.formula is None and len({scales[band] for band in one.choice.bands}) > 1:
            continue  # there are no values of its luminance
        found = best_interval(one.values(points, scales), similarity, one.values(own, scales))
        if found and (one.kind not in best or found.agreement > best[one.kind][1].agreement):
            best[one.kind] = one, found
    order = sorted(best.values(), key=lambda pair: -pair[1].agreement - _SIMPLER[pair[0].kind])
    ranges = []
    for one, found in order:
        words: dict[str, Any] = {"band": one.band, "index": one.words.index, "expr": one.words.expr}
        words |= {"rgb": options.rgb if one.choice.formula is None and one.band is None else None}
        unit = scales[one.choice.bands[0]].unit if one.choice.formula is None else ""
        words |= {"band_names": one.words.names}
        ranges.append(_range(one.choice.name, unit, _given(words), found))
    return ranges


def _stored(sources: Greys, bands: Sequence[int], greys: Uint16s) -> dict[int, Floats]:
    """Stored numbers of pixels of each band, from their greys."""
    result = {}
    for band, source, column in zip(bands, sources, greys.T, strict=True):
        low, high = source.stretch.low, source.stretch.high
        result[band] = low + column / GREY_MAX * (high - low)
    return result


def _given(words: dict[str, Any]) -> dict[str, Any]:
    return {name: word for name, word in words.items() if word is not None}


def _range(of: str, unit: str, words: dict[str, Any], found: Interval) -> SampleRange:
    ends = [None if math.isinf(end) else _rounded(end, found.step) for end in (found.low, found.high)]
    return SampleRange(of, ends[0], ends[1], unit, found.agreement, found.share, words)


def _rounded(value: float, step: float) -> float:
    """With as many decimals as the step between values that were compared has."""
    decimals = max(math.ceil(-math.log10(step)), 0)
    return round(value, decimals) + 0.0


def color_sources(raster: Raster, grey: GreySource, bands: Sequence[int | str], tile_pass: TilePass) -> Greys:
    """Return the chosen bands, or those whose luminance is the intensity, or the intensity itself.

    Where nothing is chosen of more than four bands, all are returned but alpha.
    """
    if raster.all_bands and not bands:
        bands = _plain_bands(raster)
    if bands or (raster.dataset.choice.formula is None and len(raster.dataset.bands) > 1):
        return band_sources(raster, bands or raster.dataset.bands, tile_pass)
    return [grey]


def band_sources(raster: Raster, bands: Sequence[int | str], tile_pass: TilePass) -> list[GreySource]:
    """Return each band as grey, by the stretch of the raster, fitted to it; of many, by quantiles.

    Where slow light is to be taken away, that of each band; a ParameterError refuses that for many.
    """
    dataset, nodata, length = raster.cleaned(tile_pass), raster.options.nodata, raster.options.flat_field
    spec = raster.options.spec or AUTO
    stack = stacked(dataset, bands, nodata) if len(bands) > MOST_UNCHOSEN else None
    if stack is None:
        datasets = [dataset.of_band(band, nodata) for band in bands]
    else:
        if length is not None:
            most = f"slow light is taken away from {MOST_UNCHOSEN} bands at most"
            raise ParameterError(f"{most}; choose some, or leave flatten out")
        choices = [replace(stack.choice, bands=(number,), stacked=False) for number in stack.bands]
        datasets = [replace(stack, choice=choice) for choice in choices]
        if spec == AUTO:
            return list(map(GreySource, datasets, spread_stretches(stack, tile_pass)))
    sources = [GreySource(one, fit_stretch(one, spec, tile_pass)) for one in datasets]
    return sources if length is None else [flattened(one, length, tile_pass) for one in sources]
