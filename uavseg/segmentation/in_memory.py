"""In-memory segmentation: all phases on one array, without files and tiles."""

import numpy as np

from uavseg.arguments import checked
from uavseg.arrays import Bools, Uint8s, Uint16s, Uint32s
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.blocks.division import block_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.blocks.leaves import cells_in_range, cells_to_pixels, pixels_in_range
from uavseg.segmentation.components import label_components, number_by_size
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.refine.range_scans import refine_by_local_mean, refine_by_scans
from uavseg.segmentation.refine.total_variation import refine_by_tv
from uavseg.units import BLOCK


@checked
def block_map_of_array(grey: Uint16s, valid: Bools | None = None) -> BlockMap:
    """Measure the block map of an (M, N) image, v = grey / 65535; all pixels are valid without `valid`.

    Examples
    --------
    >>> halves = np.zeros((64, 64), np.uint16)
    >>> halves[:, 32:] = 65535
    >>> float(block_map_of_array(halves).ratios[0, 0, 0])  # only texture along the middle differs
    inf
    """
    image, mask = pad_to_blocks(grey, valid)
    sums, counts = cell_sums(image, mask, margin=1)
    blocks = BlockMap(grey.shape, sums, counts, BlockMap.empty(grey.shape).ratios)
    bin_edges = contrast_bin_edges(contrast_histogram(image, mask))
    rows, cols = np.indices(blocks.blocks).reshape(2, -1) * BLOCK
    ratios = block_ratios(image, mask, bin_edges, np.stack([rows, cols], axis=1))
    blocks.ratios[:] = ratios.reshape(blocks.ratios.shape)
    return blocks


@checked
def label_regions(
    grey: Uint16s, interval: IntensityRange, valid: Bools | None = None, params: SegmentParams | None = None
) -> Uint32s:
    """Label the regions of an (M, N) image whose mean lies in a range; all pixels are valid without `valid`.

    The labels are 1..n, most pixels first; 0 outside all regions.
    """
    params = params or SegmentParams()
    image, mask = pad_to_blocks(grey, valid, 0)
    in_range = pixels_in_range(image, mask, *interval.greys)
    if params.decides_pixels:
        inside = in_range
        if params.refine == "tv":
            refine_by_tv(inside, mask, image, interval.greys)
    else:
        cells = cells_in_range(block_map_of_array(grey, valid), interval, params.division)
        inside = cells_to_pixels(cells, mask)
        if params.refine == "scan":
            refine_by_scans(inside, mask, in_range)
        elif params.refine == "smooth":
            inside = refine_by_local_mean(inside, mask, image, interval.low, interval.high)
    labels, count = label_components(inside)
    return number_by_size(labels, count, image)[labels[: grey.shape[0], : grey.shape[1]]]


def pad_to_blocks(grey: Uint16s, valid: Bools | None, border: int = 1) -> tuple[Uint16s, Uint8s]:
    """Pad an (M, N) image to whole blocks with a border on every side; return it with a mask of valid pixels.

    Both are (64 B + 2 border, 64 C + 2 border); the mask is 1 where a pixel is valid.
    """
    rows, cols = (-(-length // BLOCK) * BLOCK + 2 * border for length in grey.shape)
    image, mask = np.zeros((rows, cols), np.uint16), np.zeros((rows, cols), np.uint8)
    inner = (slice(border, grey.shape[0] + border), slice(border, grey.shape[1] + border))
    mask[inner] = 1 if valid is None else valid
    image[inner] = grey * mask[inner]
    return image, mask
