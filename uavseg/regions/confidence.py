"""Confidence of regions: the probability that a region is a real one, by logistic regression.

A region is right where it overlaps one region of the truth with an intersection over union of more than one
half, the usual criterion of detection (Everingham et al., "The PASCAL Visual Object Classes Challenge", IJCV
88, 2010); above one half no two regions can claim the same truth. The weights are fitted on drawn scenes by
``python -m benchmarks.confidence``; docs/quality.md says how well they hold on others.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.regions.outline.rings import RegionOutlines, Rings, renumber_by_size
from uavseg.segmentation.components import Sums
from uavseg.units import GREY_MAX

COLUMN = "confidence"
DECIMALS = 3  # few enough that logarithms of other platforms make no difference
MAX_DEVIATIONS = 50.0  # larger contrasts are not told apart
MIN_SIMILARITY = 1e-3
MIN_RATIO, MAX_RATIOS = -4.0, (2.0, 3.0)  # logarithms of steps over the mean step, and the deviation


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


OF_RANGES = Weights(-15.820, (1.319, -1.889, 2.249, -0.988, 8.714, -5.369, 4.029, 13.747))
OF_MATCHES = Weights(-10.379, (1.501, -3.291, -3.4, 0.378, 0.759, 10.398, 10.835))
OF_CLASSES = Weights(-7.326, (1.971, -4.591, -5.918, 1.997, 0.716, 9.848, 9.33))
OF_TEXTURES = Weights(-7.448, (1.305, -0.751, 9.572, -5.778))


def confidence_of(outlined: RegionOutlines, low: ArrayLike, high: ArrayLike, raster: ArrayLike) -> Floats:
    """Compute the probability that each region is right, from its size, shape, margin, border and raster.

    The regions are refined to the pixel, with the sums of the intensity of the range. `low` and `high` are
    the range of v, of all regions or of each; 0 and 1 are no bounds. `raster` is the `scale` of the
    `GreySource` that the regions are measured in, (3,), or of each, (n, 3). The confidence, (n,), is 0 to 1,
    in thousandths; NaN where the sums of squares, the contrast or the scale are not known.
    """
    return OF_RANGES.probability(region_terms(outlined, low, high, raster))


def region_terms(outlined: RegionOutlines, low: ArrayLike, high: ArrayLike, raster: ArrayLike) -> Floats:
    """Compute the terms of the confidence of regions of a range, arguments of `confidence_of`: (n, 8).

    In order: logarithm of the number of pixels; logarithm of the squared perimeter over that of a square of
    the same area; logarithms of one more than the distance of the mean from the nearest bound, and than the
    mean step across the border, both in standard deviations of the region; those of `_border_terms`.
    """
    sums = outlined.sums
    counts = np.maximum(sums.counts, 1).astype(np.float64)
    mean = sums.greys / counts
    unit = np.sqrt(np.maximum(sums.squares / counts - mean * mean, 0)) + 1  # greys; noise is never 0
    size = np.log(counts)
    v, lows, highs = mean / GREY_MAX, np.asarray(low, np.float64), np.asarray(high, np.float64)
    from_low, from_high = np.where(lows > 0, v - lows, np.inf), np.where(highs < 1, highs - v, np.inf)
    margin = _in_deviations(np.maximum(np.minimum(from_low, from_high), 0) * GREY_MAX, unit)
    contrast = _in_deviations(_mean_steps(sums), unit)
    shape = _shapes(outlined.rings, counts)
    return np.column_stack([size, shape, margin, contrast, _border_terms(sums, raster)])


def _mean_steps(sums: Sums) -> Floats:
    """Return the mean absolute step across the border of each region: 0 without one within the raster."""
    if sums.steps is None:
        return np.full(len(sums.counts), np.nan)
    return np.asarray(sums.steps[:, 0] / np.maximum(sums.steps[:, 1], 1))


def _border_terms(sums: Sums, raster: ArrayLike) -> Floats:
    """Compute the terms that compare borders with the raster: (n, 4) float64.

    In order: the share of the steps across the border that are among the largest tenth of the raster; the
    logarithms of their mean over the mean step of the raster, and over its standard deviation; Otsu's eta of
    the raster.
    """
    mean_step, deviation, separability = np.broadcast_to(raster, (len(sums.counts), 3)).T
    steps = _mean_steps(sums) + 1
    large = np.nan if sums.steps is None else sums.steps[:, 2] / np.maximum(sums.steps[:, 1], 1)
    units = zip((mean_step, deviation), MAX_RATIOS, strict=True)
    ratios = [np.clip(np.log(steps / (unit + 1)), MIN_RATIO, most) for unit, most in units]
    return np.column_stack([np.broadcast_to(large, steps.shape), *ratios, separability])


def match_terms(
    outlined: RegionOutlines, similarity: Floats, parting: ArrayLike, raster: ArrayLike
) -> Floats:
    """Compute the terms of the confidence of matches: (n, 10) float64.

    Those of `region_terms` with similarity in place of grey, also in the sums of the outlines, the logarithm
    of the `similarity` of each, 0 to 1, and `parting`, the difference of the mean similarities of the sample
    and of the raster.
    """
    logarithm = np.log(np.maximum(similarity, MIN_SIMILARITY))
    parts = np.broadcast_to(np.asarray(parting, np.float64), logarithm.shape)
    return np.column_stack([region_terms(outlined, 0.5, 1, raster), logarithm, parts])


def class_terms(outlined: RegionOutlines, own: Floats, parting: Floats, raster: ArrayLike) -> Floats:
    """Compute the terms of the confidence of regions of classes: (n, 10) float64, as of `match_terms`.

    The outlines are refined to the pixel, with the sums of similarity to the class of each region. `own`,
    (n,), is the mean similarity of the samples of its class to this class, `parting`, (n,), the difference of
    that and the mean similarity of the raster to this class.
    """
    sums = outlined.sums
    assert sums.similarity is not None, "regions of classes have it"
    counts, total, squares = sums.similarity.T
    of_similarity = replace(
        sums, counts=counts, greys=total.astype(np.uint64), squares=squares.astype(np.uint64)
    )
    similarity = np.minimum(total / np.maximum(counts, 1) / GREY_MAX / np.maximum(own, 1e-9), 1)
    return match_terms(replace(outlined, sums=of_similarity), similarity, parting, raster)


def texture_terms(outlined: RegionOutlines, parting: Parting) -> Floats:
    """Compute the terms of the confidence of regions by texture, refined to the pixel: (n, 4) float64.

    In order: logarithm of the number of pixels over that of a window; the term of shape of `region_terms`;
    the separability; the share of the raster, which is large where nothing ends a region.
    """
    counts = np.maximum(outlined.sums.counts, 1).astype(np.float64)
    size, shape = np.log(counts / parting.window**2), _shapes(outlined.rings, counts)
    separability, share = np.full_like(size, parting.separability), counts / max(parting.pixels, 1)
    return np.column_stack([size, shape, separability, share])


def keep_confident(
    outlined: RegionOutlines, confidence: Floats, minimum: float
) -> tuple[RegionOutlines, NDArray[np.bool_]]:
    """Keep regions of a minimum confidence, in order, and number them 1..n; return which were kept, too."""
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


@dataclass(frozen=True, eq=False)
class Confidence:
    """The confidence of regions, 0 to 1, NaN where it is not known, and the minimum that is asked for."""

    values: Floats
    minimum: float | None = None

    @classmethod
    def of(
        cls, outlined: RegionOutlines, compute: Callable[[], Floats], refine: str, minimum: float | None
    ) -> "Confidence":
        """Compute the confidence of regions, unless they are not refined: then it is not known.

        `compute` calls one of the functions above, such as `confidence_of`.
        """
        if refine == "none":
            return cls(np.full(len(outlined.sums.counts), np.nan), minimum)
        return cls(compute(), minimum)

    def applied(self, outlined: RegionOutlines) -> tuple[RegionOutlines, NDArray[np.bool_]]:
        """Return the regions of at least the minimum, numbered anew, and which were kept.

        ParameterError is raised if their confidence is not known, and there is a minimum.
        """
        if self.minimum is None:
            return outlined, np.ones(len(self.values), bool)
        if np.isnan(self.values).any():
            raise ParameterError(
                "the confidence of these regions is not known, because they end at block edges; leave the "
                "minimum confidence out"
            )
        return keep_confident(outlined, self.values, self.minimum)


def _in_deviations(greys: Floats, unit: Floats) -> Floats:
    return np.asarray(np.log1p(np.minimum(greys / unit, MAX_DEVIATIONS)))


def _shapes(rings: Rings, counts: Floats) -> Floats:
    """Return the logarithm of the squared perimeter over that of a square of the same area."""
    perimeters = np.bincount(rings.labels, rings.pixel_perimeters(), len(counts) + 1)[1:]
    return np.asarray(np.log(np.maximum(perimeters**2 / (16 * counts), 1)))
