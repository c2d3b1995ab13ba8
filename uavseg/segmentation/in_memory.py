"""The phases on one image that is held in memory, for those who have an array and no file."""

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.blocks.division import block_ratios
from uavseg.segmentation.blocks.lbp import contrast_cuts, contrast_histogram
from uavseg.segmentation.blocks.leaves import in_range, matching, pixels_of
from uavseg.segmentation.blocks.mixed_cells import unsettled
from uavseg.segmentation.intervals import IntensityRange
from uavseg.segmentation.labels.component_sums import component_sums
from uavseg.segmentation.labels.components import components
from uavseg.segmentation.refine.range_scans import scan, smooth
from uavseg.segmentation.refine.tv import denoised
from uavseg.units import BLOCK


def divided(grey: NDArray[np.uint16], valid: NDArray[np.bool_] | None = None) -> BlockMap:
    """The block map of an image.

    Parameters
    ----------
    grey : (M, N) uint16 array
        v = grey / 65535.
    valid : (M, N) bool array, optional
        Which pixels count; all do, if left out.

    Examples
    --------
    >>> halves = np.zeros((64, 64), np.uint16)
    >>> halves[:, 32:] = 65535
    >>> float(divided(halves).ratios[0, 0, 0])  # texture differs along the middle only
    inf
    """
    image, known = padded(grey, valid)
    sums, counts = cell_sums(image, known, margin=1)
    blocks = BlockMap(grey.shape, sums, counts, BlockMap.empty(grey.shape).ratios)
    cuts = contrast_cuts(contrast_histogram(image, known))
    rows, cols = np.indices(blocks.blocks).reshape(2, -1) * BLOCK
    ratios = block_ratios(image, known, cuts, np.stack([rows, cols], axis=1))
    blocks.ratios[:] = ratios.reshape(blocks.ratios.shape)
    return blocks


def regions(
    grey: NDArray[np.uint16],
    interval: IntensityRange,
    valid: NDArray[np.bool_] | None = None,
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    refine: str = "tv",
) -> NDArray[np.uint32]:
    """Labels of the regions of an image whose mean lies in a range.

    Parameters
    ----------
    grey : (M, N) uint16 array
    interval : IntensityRange
    valid : (M, N) bool array, optional
    threshold, intensity_step : float
        X and tau; an infinite tau is the paper's method.
    refine : {"tv", "scan", "none", "smooth"}
        With "none", labels are those of connected pixels.

    Returns
    -------
    labels : (M, N) uint32 array
        1..n, most pixels first; 0 nothing.
    """
    blocks = divided(grey, valid)
    image, known = padded(grey, valid, 0)
    cells = in_range(blocks, interval, threshold, intensity_step)
    inside = pixels_of(cells, known)
    fits = matching(image, known, *interval.greys)
    if refine == "tv":
        open_cells = unsettled(blocks, cells, interval.low, interval.high)
        denoised(inside, open_cells, known, image, fits, interval.greys)
    elif refine == "scan":
        scan(inside, known, fits)
    elif refine == "smooth":
        inside = smooth(inside, known, image, interval.low, interval.high)
    labels, count = components(inside)
    order = np.argsort(-component_sums(labels, count, image).counts, kind="stable")
    number = np.zeros(count + 1, np.uint32)
    number[order + 1] = np.arange(1, count + 1)
    return np.asarray(number[labels[: grey.shape[0], : grey.shape[1]]])


def padded(
    grey: NDArray[np.uint16], valid: NDArray[np.bool_] | None, border: int = 1
) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
    """An image filled up to whole blocks, with a border of some pixels; and 1 where its pixels are valid."""
    rows, cols = (-(-length // BLOCK) * BLOCK + 2 * border for length in grey.shape)
    image, known = np.zeros((rows, cols), np.uint16), np.zeros((rows, cols), np.uint8)
    place = (slice(border, grey.shape[0] + border), slice(border, grey.shape[1] + border))
    known[place] = 1 if valid is None else valid
    image[place] = grey * known[place]
    return image, known
