"""Histogram of the means of a block map's leaves, weighted by their valid pixels."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.block_map import BlockMap, leaf_means_by_strip
from uavseg.segmentation.params import DivisionParams
from uavseg.units import GREY_LEVELS, GREY_MAX


def histogram_of_means(blocks: BlockMap, division: DivisionParams) -> NDArray[np.int64]:
    """Number of valid pixels by the mean grey of their leaf.

    Parameters
    ----------
    blocks : BlockMap
    division : DivisionParams

    Returns
    -------
    histogram : (65536,) int64 array
        By the grey that is nearest to the mean. Histograms of parts of a raster merge by adding.
    """
    histogram = np.zeros(GREY_LEVELS, np.int64)
    for rows, mean in leaf_means_by_strip(blocks, division):
        greys = np.floor(np.maximum(mean, 0.0) * GREY_MAX + 0.5).astype(np.int64)
        counts = np.bincount(greys.reshape(-1), blocks.counts[rows].reshape(-1), GREY_LEVELS)
        histogram += counts.astype(np.int64)
    return histogram


def means_among(blocks: BlockMap, values: Sequence[float], division: DivisionParams) -> set[float]:
    """The values that are exactly equal to the mean of a leaf.

    Parameters
    ----------
    blocks : BlockMap
    values : sequence of float
        Values of v.
    division : DivisionParams
    """
    found: set[float] = set()
    for _, mean in leaf_means_by_strip(blocks, division):
        found.update(value for value in values if value not in found and (mean == value).any())
    return found
