"""LBP/C, the original algorithm, in full: the baseline for comparison.

Ojala and Pietikäinen, "Unsupervised texture segmentation using feature distributions", Pattern Recognition 32
(1999) 477-486: hierarchical division by texture, agglomerative merging of the most similar adjacent regions
until the next pair is much less similar than all before, then pixelwise classification of the boundaries by
the texture around each pixel. The whole image is held in memory.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.errors import ParameterError, RasterError
from uavseg.segmentation.baseline.merging import merge_regions
from uavseg.segmentation.blocks.block_map import find_leaves
from uavseg.segmentation.blocks.g_statistic import g_of_region, n_ln_n_table
from uavseg.segmentation.blocks.lbp import UNCOUNTED, contrast_bin_edges, contrast_histogram, lbp_symbols
from uavseg.segmentation.components import component_sums
from uavseg.segmentation.in_memory import block_map_of_array, pad_to_blocks
from uavseg.segmentation.params.segment import DivisionParams
from uavseg.units import CELL

Labels = NDArray[np.uint32]

MAX_PIXELS = 4096 * 4096
MIN_LEAF = 16  # pixels: side of the smallest leaf


@dataclass(frozen=True, slots=True)
class LbpcParams:
    """Parameters of LBP/C; the defaults are the usual values of the literature.

    Parameters
    ----------
    threshold : float
        X, at least 0: a block is divided where R = G_max / G_min is larger.
    stop : float
        Y, at least 1: merging stops where MI / (largest MI so far) is larger.
    untested : float
        Share of all possible merges, 0 to 1, during which the stop is not tested.
    radius : int
        Radius of the disc around a pixel, 1 to 128 pixels.
    sweeps : int
        Largest number of sweeps over the boundary pixels; 0 keeps the merged blocks.

    Raises
    ------
    ParameterError
        If a parameter is out of bounds.
    """

    threshold: float = 1.2
    stop: float = 2.0
    untested: float = 0.1
    radius: int = 11
    sweeps: int = 32

    def __post_init__(self) -> None:
        if not self.threshold >= 0:
            raise ParameterError(f"the threshold X of the division is at least 0, not {self.threshold:g}")
        if not self.stop >= 1:
            raise ParameterError(f"the stop Y of merging is at least 1, not {self.stop:g}")
        if not 0 <= self.untested <= 1:
            raise ParameterError(f"the share of untested merges lies in 0..1, not {self.untested:g}")
        if not 1 <= self.radius <= 128:
            raise ParameterError(f"the radius of the disc is 1 to 128 pixels, not {self.radius}")
        if not self.sweeps >= 0:
            raise ParameterError(f"the number of sweeps is at least 0, not {self.sweeps}")


def check_lbpc_size(shape: tuple[int, int]) -> None:
    """Check that an image is small enough to be held in memory.

    Raises
    ------
    RasterError
        If it has more than 4096 x 4096 pixels.
    """
    rows, cols = shape
    if rows * cols > MAX_PIXELS:
        raise RasterError(
            f"the original algorithm holds the whole image, at most {MAX_PIXELS:,} pixels, and this one has "
            f"{rows:,} x {cols:,}: cut a part out (gdal_translate -srcwin) or make it coarser (-outsize)"
        )


def segment_lbpc(
    grey: NDArray[np.uint16],
    valid: NDArray[np.bool_] | None = None,
    params: LbpcParams = LbpcParams(),
) -> Labels:
    """Labels of the segments of an image by LBP/C.

    Parameters
    ----------
    grey : (M, N) uint16 array
    valid : (M, N) bool array, optional
        Valid pixels; all, if left out.
    params : LbpcParams

    Returns
    -------
    labels : (M, N) uint32 array
        1..n, most pixels first, ties in raster order of the first pixel; 0 where invalid.

    Raises
    ------
    RasterError
        If the image has more than 4096 x 4096 pixels.

    Examples
    --------
    >>> segment_lbpc(np.tile(np.array([[0, 9]], np.uint16), (32, 32)))[:2, :3]
    array([[1, 1, 1],
           [1, 1, 1]], dtype=uint32)
    """
    check_lbpc_size(grey.shape)
    mask = np.ones(grey.shape, np.bool_) if valid is None else valid
    image, padded_mask = pad_to_blocks(grey, mask)
    symbols = lbp_symbols(image, padded_mask, contrast_bin_edges(contrast_histogram(image, padded_mask)))
    symbols = np.ascontiguousarray(symbols[: grey.shape[0], : grey.shape[1]])
    labels, models = merge_regions(
        _leaf_labels(grey, mask, params.threshold), symbols, params.stop, params.untested
    )
    _classify_boundaries(labels, symbols, models, params)
    return _relabel_by_size(labels, len(models) - 1, grey)


def _leaf_labels(grey: NDArray[np.uint16], mask: NDArray[np.bool_], threshold: float) -> Labels:
    """The leaf of each valid pixel, 1..n in raster order of the leaves' corners; 0 where invalid."""
    sides, _ = find_leaves(block_map_of_array(grey, mask), DivisionParams(threshold, np.inf))
    side = np.maximum(sides, MIN_LEAF).astype(np.int64)
    rows, cols = np.indices(side.shape) * CELL
    corners = 1 + rows // side * side * grey.shape[1] + cols // side * side
    on_pixels = corners.repeat(CELL, 0).repeat(CELL, 1)[: grey.shape[0], : grey.shape[1]] * mask
    leaf_ids, labels = np.unique(on_pixels, return_inverse=True)
    return (labels.reshape(grey.shape) + int(leaf_ids.size > 0 and leaf_ids[0] > 0)).astype(np.uint32)


def _classify_boundaries(
    labels: Labels, symbols: NDArray[np.uint16], models: NDArray[np.uint32], params: LbpcParams
) -> None:
    """Assign each boundary pixel to the adjacent region with the most similar model, in place.

    Models stay as merging left them, and a sweep reads the labels of the sweep before, so the result does not
    depend on the order of pixels. After the first sweep, only pixels near a change are active.
    """
    offsets = np.arange(-params.radius, params.radius + 1)
    half_widths = np.sqrt(params.radius**2 - offsets**2).astype(np.int64)  # of the rows of the disc
    totals = models.sum(axis=1, dtype=np.int64)
    table = n_ln_n_table(int(totals.max(initial=0)) + len(offsets) ** 2)
    counts, present = np.zeros((2, models.shape[1]), np.int64)
    active = np.ones(labels.shape, np.uint8)
    for _ in range(params.sweeps):
        before, active_before = labels.copy(), active.copy()
        active[:] = 0
        if not _sweep(
            before,
            symbols,
            models,
            totals,
            half_widths,
            table,
            counts,
            present,
            active_before,
            labels,
            active,
        ):
            break


def _relabel_by_size(labels: Labels, count: int, grey: NDArray[np.uint16]) -> Labels:
    """Renumber labels by size, largest first; ties in raster order of the first pixel."""
    sums = component_sums(labels, count, np.ascontiguousarray(grey))
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -sums.counts))
    number = np.zeros(count + 1, np.uint32)
    number[order + 1] = np.arange(1, count + 1)
    return np.asarray(number[labels])


@inlined
def disc_histogram(symbols, half_widths, row, col, counts, present):  # type: ignore[no-untyped-def]
    """Histogram of the symbols in a disc, and the list of those present; their number."""
    rows, cols = symbols.shape
    radius = half_widths.shape[0] // 2
    n_present = 0
    for k in range(half_widths.shape[0]):
        r = row + k - radius
        if r < 0 or r >= rows:
            continue
        for c in range(max(col - half_widths[k], 0), min(col + half_widths[k] + 1, cols)):
            symbol = symbols[r, c]
            if symbol != UNCOUNTED:
                if counts[symbol] == 0:
                    present[n_present] = symbol
                    n_present += 1
                counts[symbol] += 1
    return n_present


@kernel(
    "i8(u4[:,::1], u2[:,::1], u4[:,::1], i8[::1], i8[::1], f8[::1], i8[::1], i8[::1], u1[:,::1],"
    " u4[:,::1], u1[:,::1])"
)
def _sweep(  # type: ignore[no-untyped-def]
    before, symbols, models, totals, half_widths, table, counts, present, active_before, labels, active
):
    # Returns the number of changed pixels; `active` is set at them and at their neighbours.
    rows, cols = before.shape
    changes = 0
    for row in range(rows):
        for col in range(cols):
            own = before[row, col]
            if own == 0 or not active_before[row, col]:
                continue
            north = before[row - 1, col] if row > 0 else own
            south = before[row + 1, col] if row + 1 < rows else own
            west = before[row, col - 1] if col > 0 else own
            east = before[row, col + 1] if col + 1 < cols else own
            around = (north, south, west, east)
            if max(around) == own and min(around) == own:
                continue
            n_present = disc_histogram(symbols, half_widths, row, col, counts, present)
            found = own
            smallest_g = g_of_region(models, totals, own, counts, present, n_present, table)
            for label in around:
                if n_present and label != 0 and label != own:
                    g = g_of_region(models, totals, label, counts, present, n_present, table)
                    if g < smallest_g or (g == smallest_g and found != own and label < found):
                        smallest_g = g
                        found = label
            for k in range(n_present):
                counts[present[k]] = 0
            if found != own:
                changes += 1
                labels[row, col] = found
                active[row, col] = 1
                active[max(row - 1, 0), col] = 1
                active[min(row + 1, rows - 1), col] = 1
                active[row, max(col - 1, 0)] = 1
                active[row, min(col + 1, cols - 1)] = 1
    return changes
