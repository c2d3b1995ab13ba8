"""LBP/C, the original algorithm, whole: the baseline beside which the rest is measured.

Ojala and Pietikäinen, "Unsupervised texture segmentation using feature distributions", Pattern Recognition 32
(1999) 477-486: blocks are divided by texture, adjacent regions that are most alike are merged until what
would be merged next is much less alike than anything before, and then the pixels along the boundaries go to
the region whose texture is most like that around them. Everything is held in memory.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.errors import ParameterError, RasterError
from uavseg.segmentation.baseline.merging import likelihood_ratio, log_table, merged
from uavseg.segmentation.blocks.block_map import leaves
from uavseg.segmentation.blocks.lbp import UNCOUNTED, contrast_cuts, contrast_histogram, symbols
from uavseg.segmentation.in_memory import divided, padded
from uavseg.segmentation.labels.component_sums import component_sums
from uavseg.units import CELL

Labels = NDArray[np.uint32]

MOST_PIXELS = 4096 * 4096
SMALLEST = 16  # pixels: side of the smallest leaf


@dataclass(frozen=True, slots=True)
class OriginalParams:
    """The parameters of LBP/C; the literature's usual values.

    Parameters
    ----------
    threshold : float
        X, at least 0: a block is divided where R = G_max / G_min is larger.
    stop : float
        Y, at least 1: merging stops where MI / (largest MI before) is larger.
    untested : float
        Share of all possible merges, 0 to 1, during which that is not tested.
    radius : int
        Of the disc around a pixel, 1 to 128 pixels.
    sweeps : int
        How often, at most, pixels along boundaries are looked at; 0 leaves the merged blocks.

    Raises
    ------
    ParameterError
        If one of them is not what it may be.
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
            raise ParameterError(f"the number of sweeps is not negative, unlike {self.sweeps}")


def check_size(shape: tuple[int, int]) -> None:
    """Whether an image is small enough for an algorithm that holds all of it.

    Raises
    ------
    RasterError
        If it has more than 4096 x 4096 pixels.
    """
    rows, cols = shape
    if rows * cols > MOST_PIXELS:
        raise RasterError(
            f"the original algorithm holds the whole image, at most {MOST_PIXELS:,} pixels, and this one has "
            f"{rows:,} x {cols:,}: cut a part out (gdal_translate -srcwin) or make it coarser (-outsize)"
        )


def original(
    grey: NDArray[np.uint16],
    valid: NDArray[np.bool_] | None = None,
    params: OriginalParams = OriginalParams(),
) -> Labels:
    """Labels of the segments of an image by LBP/C.

    Parameters
    ----------
    grey : (M, N) uint16 array
    valid : (M, N) bool array, optional
        Which pixels count; all do, if left out.
    params : OriginalParams

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
    >>> original(np.tile(np.array([[0, 9]], np.uint16), (32, 32)))[:2, :3]
    array([[1, 1, 1],
           [1, 1, 1]], dtype=uint32)
    """
    check_size(grey.shape)
    known = np.ones(grey.shape, np.bool_) if valid is None else valid
    image, around = padded(grey, known)
    texels = symbols(image, around, contrast_cuts(contrast_histogram(image, around)))
    texels = np.ascontiguousarray(texels[: grey.shape[0], : grey.shape[1]])
    labels, models = merged(_leaf_labels(grey, known, params.threshold), texels, params.stop, params.untested)
    _classify_boundaries(labels, texels, models, params)
    return _by_size(labels, len(models) - 1, grey)


def _leaf_labels(grey: NDArray[np.uint16], known: NDArray[np.bool_], threshold: float) -> Labels:
    """The leaf of each valid pixel, 1..n in raster order of the leaves' corners; 0 where invalid."""
    sides, _ = leaves(divided(grey, known), threshold, np.inf)
    side = np.maximum(sides, SMALLEST).astype(np.int64)
    rows, cols = np.indices(side.shape) * CELL
    corners = 1 + rows // side * side * grey.shape[1] + cols // side * side
    on_pixels = corners.repeat(CELL, 0).repeat(CELL, 1)[: grey.shape[0], : grey.shape[1]] * known
    names, labels = np.unique(on_pixels, return_inverse=True)
    return (labels.reshape(grey.shape) + int(names.size > 0 and names[0] > 0)).astype(np.uint32)


def _classify_boundaries(
    labels: Labels, texels: NDArray[np.uint16], models: NDArray[np.uint32], params: OriginalParams
) -> None:
    """Give the pixels along boundaries to the region around them whose model is nearest, in place.

    Models stay as merging left them, and a sweep sees the labels of the sweep before: what comes out depends
    on no order. Only where something changed nearby is there something new to decide.
    """
    away = np.arange(-params.radius, params.radius + 1)
    halves = np.sqrt(params.radius**2 - away**2).astype(np.int64)  # of the disc's rows
    totals = models.sum(axis=1, dtype=np.int64)
    table = log_table(int(totals.max(initial=0)) + len(away) ** 2)
    counts, listed = np.zeros((2, models.shape[1]), np.int64)
    active = np.ones(labels.shape, np.uint8)
    for _ in range(params.sweeps):
        before, looked = labels.copy(), active.copy()
        active[:] = 0
        if not _sweep(before, texels, models, totals, halves, table, counts, listed, looked, labels, active):
            break


def _by_size(labels: Labels, count: int, grey: NDArray[np.uint16]) -> Labels:
    """The labels in the order of their pixels, ties in raster order of the first one."""
    sums = component_sums(labels, count, np.ascontiguousarray(grey))
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -sums.counts))
    number = np.zeros(count + 1, np.uint32)
    number[order + 1] = np.arange(1, count + 1)
    return np.asarray(number[labels])


@inlined
def take_disc(texels, halves, row, col, counts, listed):  # type: ignore[no-untyped-def]
    """Count the symbols in a disc, and list which there are; how many of them."""
    rows, cols = texels.shape
    radius = halves.shape[0] // 2
    many = 0
    for k in range(halves.shape[0]):
        r = row + k - radius
        if r < 0 or r >= rows:
            continue
        for c in range(max(col - halves[k], 0), min(col + halves[k] + 1, cols)):
            name = texels[r, c]
            if name != UNCOUNTED:
                if counts[name] == 0:
                    listed[many] = name
                    many += 1
                counts[name] += 1
    return many


@kernel(
    "i8(u4[:,::1], u2[:,::1], u4[:,::1], i8[::1], i8[::1], f8[::1], i8[::1], i8[::1], u1[:,::1],"
    " u4[:,::1], u1[:,::1])"
)
def _sweep(before, texels, models, totals, halves, table, counts, listed, looked, labels, active):  # type: ignore[no-untyped-def]
    # How many pixels changed; `active` is set at them and beside them.
    rows, cols = before.shape
    changes = 0
    for row in range(rows):
        for col in range(cols):
            own = before[row, col]
            if own == 0 or not looked[row, col]:
                continue
            north = before[row - 1, col] if row > 0 else own
            south = before[row + 1, col] if row + 1 < rows else own
            west = before[row, col - 1] if col > 0 else own
            east = before[row, col + 1] if col + 1 < cols else own
            around = (north, south, west, east)
            if max(around) == own and min(around) == own:
                continue
            many = take_disc(texels, halves, row, col, counts, listed)
            found = own
            least = likelihood_ratio(models, totals, own, counts, listed, many, table)
            for label in around:
                if many and label != 0 and label != own:
                    g = likelihood_ratio(models, totals, label, counts, listed, many, table)
                    if g < least or (g == least and found != own and label < found):
                        least = g
                        found = label
            for k in range(many):
                counts[listed[k]] = 0
            if found != own:
                changes += 1
                labels[row, col] = found
                active[row, col] = 1
                active[max(row - 1, 0), col] = 1
                active[min(row + 1, rows - 1), col] = 1
                active[row, max(col - 1, 0)] = 1
                active[row, min(col + 1, cols - 1)] = 1
    return changes
