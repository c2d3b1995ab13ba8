"""Leaf means quantised without loss for ranges whose bounds are steps of a slider."""

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.block_map import BlockMap, leaf_means_by_strip
from uavseg.segmentation.params.segment import DivisionParams

STEPS = 1000
NO_CODE = 65535


def leaf_codes(blocks: BlockMap, division: DivisionParams) -> NDArray[np.uint16]:
    """Where the mean of each cell's leaf lies among the steps k / 1000.

    The mean lies in low / 1000 .. high / 1000, both ends included, exactly where the code lies in
    2 low .. 2 high.

    Parameters
    ----------
    blocks : BlockMap
    division : DivisionParams

    Returns
    -------
    codes : (8 B, 8 C) uint16 array
        2 k where the mean equals k / 1000, 2 k + 1 where it lies between k / 1000 and (k + 1) / 1000, 65535
        where the leaf has no valid pixel.
    """
    steps = np.arange(STEPS + 1) / STEPS  # the doubles that texts such as "0.553" are read as
    codes = np.empty(blocks.counts.shape, np.uint16)
    for rows, mean in leaf_means_by_strip(blocks, division):
        below = np.searchsorted(steps, mean, side="left")
        reached = np.searchsorted(steps, mean, side="right")
        codes[rows] = np.where(mean < 0, NO_CODE, below + reached - 1)
    return codes
