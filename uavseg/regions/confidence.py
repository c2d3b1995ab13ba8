"""Confidence of regions: the probability that a region is a real one, by logistic regression.

A region is right where it overlaps one region of the truth with an intersection over union of more than one
half, the usual criterion of detection (Everingham et al., "The PASCAL Visual Object Classes Challenge", IJCV
88, 2010); above one half no two regions can claim the same truth. The weights are fitted by
``python -m benchmarks.confidence``; docs/quality.md says how well they hold on others.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uavseg.arrays import Bools, Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.regions.outline.rings import RegionOutlines, renumber_by_size
from uavseg.segmentation.components import Sums
from uavseg.segmentation.source import Statistics
from uavseg.units import GREY_MAX

COLUMN = "confidence"
DECIMALS = 3  # few enough that logarithms of other platforms make no difference
MAX_DEVIATIONS = 50.0  # larger contrasts are not told apart
MIN_SIMILARITY = 1e-3
MIN_RATIO, MAX_STEPS, MAX_DEVIATION = -4.0, 2.0, 3.0  # logarithms of steps over those of the raster


@dataclass(frozen=True, slots=True)
class Parting:
    """Separation of a sample from the rest of a raster by texture."""

    window: int  # side in pixels of the windows that are compared
    separability: float  # of the scores of all cells, see `two_kinds.separability`
    pixels: int  # of all cells with valid ones, of the whole raster


@dataclass(frozen=True, slots=True)
class Weights:
    """Constants of a logistic regression."""

    intercept: float
    terms: tuple[float, ...]

    def probability(self, terms: Floats) -> Floats:
        """Return the probability of each row of terms (n, k): (n,), in thousandths."""
        with np.errstate(over="ignore"):
            probability = 1 / (1 + np.exp(-(self.intercept + terms @ np.array(self.terms))))
        return np.asarray(np.round(probability, DECIMALS))

    def of(self, terms: Callable[..., Floats], *given: Any) -> Floats:
        """Return the probability of the terms that a function gives, such as `match_terms`."""
        return self.probability(terms(*given))


OF_RANGES = Weights(-15.444, (1.382, -1.979, 9.096, -4.936, 3.737, 13.387))
OF_MATCHES = Weights(-15.401, (0.597, -1.310, -1.353, 0.150, 0.302, 4.138, 4.312, 11.619, 0.650))
OF_CLASSES = Weights(-4.022, (0.684, -1.610, 0, 0, 0.149, 8.695, 2.234, 0, 1.008, 5.505, -1.037))
OF_TEXTURES = Weights(-4.375, (0.729, -0.641, 6.675, 0.487, 1.666))


def confidence_of(outlined: RegionOutlines, raster: Statistics) -> Floats:
    """Compute the probability that each region is right, from its size, shape and border, and the raster.

    The regions are refined to the pixel, with the sums of the intensity of the range; `raster` are those
    of their `GreySource`. The confidence, (n,), is 0 to 1, in thousandths; NaN where the steps across borders
    or the statistics are not known.
    """
    return OF_RANGES.probability(region_terms(outlined, raster))


def region_terms(outlined: RegionOutlines, raster: Statistics) -> Floats:
    """Compute the terms of the confidence of regions of a range, arguments of `confidence_of`: (n, 6).

    In order: logarithm of the number of pixels; logarithm of the squared perimeter over that of a square of
    the same area; share of the steps across the border that are among the largest tenth of the raster;
    logarithms of their mean over the mean step of the raster, and its standard deviation; its Otsu's eta.
    """
    total, edges, large = _steps(outlined.sums).T
    of_steps = _log_ratio(total / edges, raster.mean_step, MAX_STEPS)
    of_deviation = _log_ratio(total / edges, raster.deviation, MAX_DEVIATION)
    terms = *_sizes_and_shapes(outlined), large / edges, of_steps, of_deviation, raster.separability
    return np.stack(np.broadcast_arrays(*terms), 1)


def match_terms(
    outlined: RegionOutlines, similarity: Floats, own: ArrayLike, parting: ArrayLike, raster: Statistics
) -> Floats:
    """Compute the terms of the confidence of matches, whose sums are of similarity: (n, 9) float64.

    In order: the first two of `region_terms`; logarithms of one more than the distance of the mean similarity
    from one half, and than the mean step across the border, in standard deviations of the region; the first
    times that; the logarithm of the `similarity` of each, 0 to 1; `parting`, the difference of the mean
    similarities of the sample and of the raster; `own`, that of the sample, which is small where much else
    looks like it; the logarithm of the mean step over the standard deviation of intensity.
    """
    sums, counts = outlined.sums, np.maximum(outlined.sums.counts, 1)
    total, edges, _ = _steps(sums).T
    deviation = np.sqrt(np.maximum(sums.squares / counts - (sums.greys / counts) ** 2, 0)) + 1  # never 0
    above = np.maximum(sums.greys / counts - GREY_MAX / 2, 0)
    margin, contrast = (np.log1p(np.minimum(x / deviation, MAX_DEVIATIONS)) for x in (above, total / edges))
    size, shape = _sizes_and_shapes(outlined)
    logarithm = np.log(np.maximum(similarity, MIN_SIMILARITY))
    rough = _log_ratio(raster.mean_step, raster.deviation, MAX_DEVIATION)
    terms = size, shape, margin, contrast, size * contrast, logarithm, parting, own, rough
    return np.stack(np.broadcast_arrays(*terms), 1)


def class_terms(outlined: RegionOutlines, own: Floats, parting: Floats, raster: Statistics) -> Floats:
    """Compute the terms of the confidence of regions of classes: (n, 11) float64.

    The outlines are refined to the pixel, with the sums of similarity to the class of each region. Those of
    `match_terms`, then the third and fourth of `region_terms`. `own`, (n,), is the mean similarity of the
    samples of its class to this class, `parting`, (n,), the difference of that and the mean similarity of the
    raster to this class.
    """
    sums = outlined.sums
    assert sums.similarity is not None, "regions of classes have it"
    counts, total, squares, steps, edges = sums.similarity.T
    greys, squared = total.astype(np.uint64), squares.astype(np.uint64)
    across = np.stack([steps, edges, edges], 1)
    of_similarity = replace(sums, counts=counts, greys=greys, squares=squared, steps=across)
    similarity = np.minimum(total / np.maximum(counts, 1) / GREY_MAX / np.maximum(own, 1e-9), 1)
    of_matches = match_terms(replace(outlined, sums=of_similarity), similarity, own, parting, raster)
    return np.column_stack([of_matches, region_terms(outlined, raster)[:, 2:4]])


def texture_terms(outlined: RegionOutlines, parting: Parting, raster: Statistics) -> Floats:
    """Compute the terms of the confidence of regions by texture, refined to the pixel: (n, 5) float64.

    In order: logarithm of the number of pixels over that of a window; the second term of `region_terms`; the
    separability; the share of the raster, which is large where nothing ends a region; the fifth of these.
    """
    size, shape, _, _, of_deviation, _ = region_terms(outlined, raster).T
    share = np.exp(size) / max(parting.pixels, 1)
    terms = size - np.log(parting.window**2), shape, parting.separability, share, of_deviation
    return np.stack(np.broadcast_arrays(*terms), 1)


def keep_confident(
    outlined: RegionOutlines, confidence: Floats, minimum: float | None
) -> tuple[RegionOutlines, Bools]:
    """Keep regions of a minimum confidence, in order, and number them 1..n; return which were kept, too.

    The confidence, (n,), is 0 to 1, NaN where it is not known. ParameterError is raised if it is not, and
    there is a minimum.
    """
    if minimum is None:
        return outlined, np.ones(len(confidence), bool)
    if np.isnan(confidence).any():
        raise ParameterError(
            "the confidence of these regions is not known, because they end at block edges; leave the "
            "minimum confidence out"
        )
    kept = np.asarray(confidence >= minimum)
    rings = outlined.rings
    return renumber_by_size(rings, outlined.sums, kept[rings.labels - 1]), kept


def check_minimum(minimum: float | None, refine: str = "") -> None:
    """Check a minimum confidence before any work; regions that end at block edges have no confidence.

    A ParameterError says that it is not within 0 and 1, or that there will be none to compare it with.
    """
    if minimum is None:
        return
    if not 0 <= minimum <= 1:
        raise ParameterError(f"a minimum confidence is within 0 and 1, not {minimum:g}")
    if refine == "none":
        raise ParameterError(
            "regions that end at block edges have no confidence; refine them, or leave the minimum "
            "confidence out"
        )


def none_confident(count: int, minimum: float | None) -> str:
    """Return the hint where all regions were left out because of their confidence."""
    regions = "the only region has" if count == 1 else f"all {count:,} regions have"
    return f"{regions} a confidence of less than {minimum:g}; a smaller minimum keeps more"


def _steps(sums: Sums) -> Floats:
    """Return the steps of `border_steps`, with at least one edge; NaN where they are not known: (n, 3)."""
    steps = np.full((len(sums.counts), 3), np.nan) if sums.steps is None else sums.steps
    return np.maximum(steps, (0.0, 1.0, 0.0))


def _log_ratio(greys: Floats | float, unit: float, most: float) -> Floats:
    return np.asarray(np.clip(np.log((greys + 1) / (unit + 1)), MIN_RATIO, most))


def _sizes_and_shapes(outlined: RegionOutlines) -> tuple[Floats, Floats]:
    """Return the first two terms of `region_terms`: (n,) each."""
    rings, counts = outlined.rings, np.maximum(outlined.sums.counts, 1)
    perimeters = np.bincount(rings.labels, rings.pixel_perimeters(), len(counts) + 1)[1:]
    return np.log(counts), np.log(np.maximum(perimeters**2 / (16 * counts), 1))
