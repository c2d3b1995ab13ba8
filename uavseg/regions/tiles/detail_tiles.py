"""The wanted scale of a refined tile: narrow structures vanish, and the halo that decides is cropped."""

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.refine.detail import Detail, apply_detail
from uavseg.segmentation.source import GreyTile


def with_detail(
    kinds: NDArray[np.uint8], tile: GreyTile, detail: Detail
) -> tuple[NDArray[np.uint8], GreyTile]:
    """Apply a detail to a refined tile, and crop both by `detail.halo`, whose pixels decided with it.

    Parameters
    ----------
    kinds : (M + 2 m, N + 2 m) uint8 array
        The kind of each pixel, exact on the tile grown by `detail.halo` and one pixel more.
    tile : GreyTile
        Of the same pixels.
    detail : Detail
    """
    halo = detail.halo
    inner = np.s_[halo : kinds.shape[0] - halo, halo : kinds.shape[1] - halo]
    return np.ascontiguousarray(apply_detail(kinds, tile.valid, detail)[inner]), tile.cropped(halo)
