"""Which means the leaves of a block map have, and how many pixels each of them stands for."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.block_map import BlockMap, strips_of_means
from uavseg.units import GREY_MAX


def histogram_of_means(blocks: BlockMap, threshold: float, intensity_step: float) -> NDArray[np.int64]:
    """How many valid pixels lie in leaves of each mean grey.

    Parameters
    ----------
    blocks : BlockMap
    threshold, intensity_step : float
        X and tau of the division, see `blockmap.leaves`.

    Returns
    -------
    histogram : (65536,) int64 array
        By the grey that is nearest to the mean; those of parts of a raster merge by adding.
    """
    found = np.zeros(GREY_MAX + 1, np.int64)
    for rows, mean in strips_of_means(blocks, threshold, intensity_step):
        greys = np.floor(np.maximum(mean, 0.0) * GREY_MAX + 0.5).astype(np.int64)
        counts = np.bincount(greys.reshape(-1), blocks.counts[rows].reshape(-1), GREY_MAX + 1)
        found += counts.astype(np.int64)
    return found


def means_among(
    blocks: BlockMap, values: Sequence[float], threshold: float, intensity_step: float
) -> set[float]:
    """Those of some values that are exactly the mean of a leaf.

    Parameters
    ----------
    blocks : BlockMap
    values : sequence of float
        Of v.
    threshold, intensity_step : float
        As of `histogram_of_means`.
    """
    found: set[float] = set()
    for _, mean in strips_of_means(blocks, threshold, intensity_step):
        found.update(value for value in values if value not in found and (mean == value).any())
    return found
