"""The wanted scale: structures, necks and gaps narrower than a disc vanish from a label image.

A sequential filter of partitions, from small discs to the wanted one: what no disc of its own kind covers
takes the kind of the nearest pixel that one covers. In the end each kind is opened by the wanted disc.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.refine.discs import PixelDisc, covered_by_own_discs
from uavseg.units import BLOCK

MAX_DETAIL = 128  # pixels
_FAR = np.uint8(255)  # no covered pixel in this direction

Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Detail:
    """The smallest structure that remains.

    Parameters
    ----------
    rows, cols : int
        Its size along a column and along a row, 1..128 pixels.
    cover : bool
        What is narrow takes the kind of something near or keeps its own, and nothing is left out: for kinds
        that cover a raster, as levels do.
    """

    rows: int
    cols: int
    cover: bool = False

    @property
    def discs(self) -> Iterator[PixelDisc]:
        """Discs of growing size, each about twice as large as the one before; the last is the wanted one."""
        count = max(self.rows, self.cols).bit_length() - 1
        for k in range(count - 1, -1, -1):
            yield PixelDisc(max(self.rows >> k, 1), max(self.cols >> k, 1))

    @property
    def halo(self) -> int:
        """How far the result at a pixel may depend on others, in whole blocks.

        A disc of n pixels reaches n - 1, and the nearest covered pixel is looked for within n: less than 2 n
        for each disc, 4 n for all of them, and n for the opening.
        """
        return -(-(5 * max(self.rows, self.cols) + 1) // BLOCK) * BLOCK


def apply_detail(kinds: Image, valid: Image, detail: Detail) -> Image:
    """Drop structures and cut necks that are narrower than a detail, and close gaps that are.

    Discs grow to the wanted size. At each size, pixels that lie in no disc of their own kind (see
    `covered_by_own_discs`) take the kind of the nearest pixel that does, if it is no farther than the disc is
    wide; of several the own kind, then the smallest number. Small discs come first, so that specks neither
    break large structures nor join small ones. In the end, what lies in no disc of its kind becomes 0, so
    that the opening of each kind by the disc changes nothing; with `detail.cover` it keeps its kind instead.

    Parameters
    ----------
    kinds : (M, N) uint8 array
        0 for none, which counts as a kind while discs grow.
    valid : (M, N) uint8 array
        Pixels that are not valid stay 0 and fit every kind.
    detail : Detail

    Returns
    -------
    kinds : (M, N) uint8 array
    """
    own = kinds[valid > 0]
    if len(own) == 0 or own.min() == own.max():
        return kinds
    for disc in detail.discs:
        kinds = _take_nearest(kinds, covered_by_own_discs(kinds, valid, disc), valid, disc)
    if not detail.cover:
        kinds = kinds * covered_by_own_discs(kinds, valid, PixelDisc(detail.rows, detail.cols))
    return kinds


def _take_nearest(kinds: Image, covered: Image, valid: Image, disc: PixelDisc) -> Image:
    """The kind of the nearest covered pixel within the disc's width; the own one where there is none."""
    up, down = np.empty_like(kinds), np.empty_like(kinds)
    found = kinds.copy()
    _measure_columns(covered, np.int64(disc.rows), up, down)
    _take(kinds, covered, valid, up, down, np.array([disc.rows, disc.cols], np.int64), found)
    return found


@kernel("void(u1[:,::1], i8, u1[:,::1], u1[:,::1])")
def _measure_columns(covered, limit, up, down):  # type: ignore[no-untyped-def]
    # Rows to the nearest covered pixel above and below, up to a limit.
    rows = covered.shape[0]
    for row in range(rows):
        for col in range(covered.shape[1]):
            if covered[row, col]:
                up[row, col] = 0
            elif row == 0 or up[row - 1, col] >= limit:
                up[row, col] = _FAR
            else:
                up[row, col] = up[row - 1, col] + 1
    for row in range(rows - 1, -1, -1):
        for col in range(covered.shape[1]):
            if covered[row, col]:
                down[row, col] = 0
            elif row == rows - 1 or down[row + 1, col] >= limit:
                down[row, col] = _FAR
            else:
                down[row, col] = down[row + 1, col] + 1


@inlined
def is_preferred(kind, found, own):  # type: ignore[no-untyped-def]
    """Whether a kind is preferred to another at the same distance."""
    return found != own and (kind == own or kind < found)


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], i8[::1], u1[:,::1])")
def _take(kinds, covered, valid, up, down, sides, found):  # type: ignore[no-untyped-def]
    # Squared distances are in units in which the disc's width is rows * cols along both axes.
    along_col, along_row = sides[1] * sides[1], sides[0] * sides[0]
    limit = along_col * along_row
    for row in range(kinds.shape[0]):
        for col in range(kinds.shape[1]):
            if covered[row, col] or not valid[row, col]:
                continue
            own = kinds[row, col]
            nearest = own
            best = limit + 1
            for step in range(sides[1] + 1):
                aside = step * step * along_row
                if aside > best:
                    break
                for side in range(2):
                    other = col - step if side == 0 else col + step
                    if other < 0 or other >= kinds.shape[1]:
                        continue
                    for direction in range(2):
                        rows = np.int64(up[row, other] if direction == 0 else down[row, other])
                        if rows == 255:
                            continue
                        kind = kinds[row - rows if direction == 0 else row + rows, other]
                        distance = aside + rows * rows * along_col
                        if distance < best or (distance == best and is_preferred(kind, nearest, own)):
                            best = distance
                            nearest = kind
            found[row, col] = nearest
