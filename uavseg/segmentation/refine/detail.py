"""Width of structures: a minimum one (alternating sequential filter with growing discs), or thin lines added.

From small discs to one of the target size, pixels that no disc of their class covers take the class of the
nearest pixel that one covers; structures, necks and gaps narrower than the disc vanish. In the end each class
is opened by the target disc. An ellipse of pixels stands for a disc on the ground, since pixels need not be
square. Maxima over it are built up from runs of a row: each row of the disc is a chord.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.refine.noise import NOISE_SIDE, medians_around
from uavseg.units import BLOCK

MAX_DETAIL = 128  # pixels
_FAR = np.uint8(255)  # no covered pixel in this direction

LENGTH = 15  # pixels along a line
_DIRECTIONS = 16
_SIDES = (3, 4)  # pixels from the middle of a line to what it is compared with
_STRONG, _WEAK = 4.5, 2.5  # standard deviations of the difference
_REACH = 8  # pixels that weak evidence continues strong evidence
_MIN_NOISE = 74.0  # grey: standard deviation of rounding to 8 bits
_MEASURED = range(0, 16, 4)  # directions in which noise is measured
_INVALID = 1 << 24  # grey of invalid pixels, more than any sum of valid ones
MARGIN = 48  # pixels around a window that count: two squares, a line and a side


@dataclass(frozen=True, slots=True)
class PixelDisc:
    """Pixels whose centres lie within an ellipse that is `rows` high and `cols` wide.

    Its centre is a pixel's, or lies between pixels where a side is even, so a disc is exactly that wide. The
    rows and columns at the centre belong to it.

    Examples
    --------
    >>> PixelDisc(4, 4).pixels.astype(int)
    array([[0, 1, 1, 0],
           [1, 1, 1, 1],
           [1, 1, 1, 1],
           [0, 1, 1, 0]])
    """

    rows: int
    cols: int

    @property
    def pixels(self) -> Bools:
        """Mask of the disc, (rows, cols)."""
        row = 2 * np.arange(self.rows, dtype=np.int64)[:, None] - (self.rows - 1)
        col = 2 * np.arange(self.cols, dtype=np.int64) - (self.cols - 1)
        squares = row**2 * self.cols**2 + col**2 * self.rows**2
        middle = (abs(row) <= 1) | (abs(col) <= 1)  # as wide as its sides also where one of them is small
        return np.asarray(middle | (squares < (self.rows * self.cols) ** 2))


@dataclass(frozen=True, slots=True)
class _Chords:
    """Rows of a disc: first column and index of the length of each, and how lengths are built up."""

    rows: Integers
    shifts: Integers  # length k + 1 is the maximum of length k and of the same shifted by shifts[k]


@lru_cache(maxsize=64)
def _chords(disc: PixelDisc) -> _Chords:
    lengths = disc.pixels.sum(axis=1)
    built, shifts = [1], []
    for length in np.unique(lengths).tolist():
        while built[-1] < length:
            shifts.append(min(built[-1], length - built[-1]))
            built.append(built[-1] + shifts[-1])
    rows = np.stack([(disc.cols - lengths) // 2, np.searchsorted(built, lengths)], axis=1)
    return _Chords(rows.astype(np.int64), np.array(shifts, np.int64))


@dataclass(frozen=True, slots=True)
class Detail:
    """Smallest structure that remains."""

    rows: int  # size along a column, 1..128 pixels
    cols: int  # along a row
    cover: bool = False  # as levels do: what is narrow takes a class nearby or keeps its own, none is dropped

    @property
    def discs(self) -> Iterator[PixelDisc]:
        """Discs of growing size, each about twice as large as the last; the last one of the target size."""
        count = max(self.rows, self.cols).bit_length() - 1
        for k in range(count - 1, -1, -1):
            yield PixelDisc(max(self.rows >> k, 1), max(self.cols >> k, 1))

    @property
    def halo(self) -> int:
        """Pixels around one that its result depends on, in whole blocks.

        A disc of n pixels reaches n - 1, and the nearest covered pixel is searched within n: less than 2 n
        for each disc, 4 n for all of them, and n for the opening.
        """
        return -(-(5 * max(self.rows, self.cols) + 1) // BLOCK) * BLOCK


def apply_detail(classes: Uint8s, valid: Uint8s, detail: Detail) -> Uint8s:
    """Drop structures and cut necks that are narrower than a detail, and close gaps that are.

    Discs grow to the target size. At each size, pixels that lie in no disc of their class (see
    `opening_mask`) take the class of the nearest pixel that does, if it is no farther than the disc is
    wide; of several at one distance their class, then the smallest number. Small discs come first, so that
    specks neither break large structures nor join small ones. In the end, pixels in no disc of their class
    become 0, so that another opening changes nothing; with `detail.cover` they keep their class instead.

    All arrays are (M, N). Class 0 is for none, which counts as a class while discs grow. Pixels that are not
    valid stay 0 and fit every class.
    """
    present = classes[valid > 0]
    if len(present) == 0 or present.min() == present.max():
        return classes
    for disc in detail.discs:
        classes = _take_nearest(classes, opening_mask(classes, valid, disc), valid, disc)
    if not detail.cover:
        classes = classes * opening_mask(classes, valid, PixelDisc(detail.rows, detail.cols))
    return classes


def _take_nearest(classes: Uint8s, covered: Uint8s, valid: Uint8s, disc: PixelDisc) -> Uint8s:
    """Take the class of the nearest covered pixel within the disc's width; keep the class without one."""
    up, down = np.empty_like(classes), np.empty_like(classes)
    nearest = classes.copy()
    _measure_columns(covered, np.int64(disc.rows), up, down)
    _take(classes, covered, valid, up, down, np.array([disc.rows, disc.cols], np.int64), nearest)
    return nearest


@kernel("void(u1[:,::1], i8, u1[:,::1], u1[:,::1])")
def _measure_columns(covered, limit, up, down):  # type: ignore[no-untyped-def]
    # Rows to the nearest covered pixel above and below, up to a limit.
    rows = covered.shape[0]
    for step in (1, -1):
        distances = up if step > 0 else down
        for k in range(rows):
            row = k if step > 0 else rows - 1 - k
            for col in range(covered.shape[1]):
                if covered[row, col]:
                    distances[row, col] = 0
                elif k == 0 or distances[row - step, col] >= limit:
                    distances[row, col] = _FAR
                else:
                    distances[row, col] = distances[row - step, col] + 1


@inlined
def is_preferred(label, nearest, here):  # type: ignore[no-untyped-def]
    """Test whether a class is preferred to another at the same distance."""
    return nearest != here and (label == here or label < nearest)


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], i8[::1], u1[:,::1])")
def _take(classes, covered, valid, up, down, sides, result):  # type: ignore[no-untyped-def]
    # Squared distances are in units in which the disc's width is rows * cols along both axes.
    along_col, along_row = sides[1] * sides[1], sides[0] * sides[0]
    limit = along_col * along_row
    for row in range(classes.shape[0]):
        for col in range(classes.shape[1]):
            if covered[row, col] or not valid[row, col]:
                continue
            here = classes[row, col]
            nearest = here
            best = limit + 1
            for step in range(sides[1] + 1):
                aside = step * step * along_row
                if aside > best:
                    break
                for side in range(2):
                    other = col - step if side == 0 else col + step
                    if other < 0 or other >= classes.shape[1]:
                        continue
                    for direction in range(2):
                        rows = np.int64(up[row, other] if direction == 0 else down[row, other])
                        if rows == 255:
                            continue
                        label = classes[row - rows if direction == 0 else row + rows, other]
                        distance = aside + rows * rows * along_col
                        if distance < best or (distance == best and is_preferred(label, nearest, here)):
                            best, nearest = distance, label
            result[row, col] = nearest


def _disc_maxima(image: Uint8s, disc: PixelDisc) -> Uint8s:
    """Return the maximum of each disc within an image, at the first pixel of its bounding box."""
    chords = _chords(disc)
    maxima = np.empty((image.shape[0] - disc.rows + 1, image.shape[1] - disc.cols + 1), np.uint8)
    lines = np.zeros((disc.rows, len(chords.shifts) + 1, image.shape[1]), np.uint8)
    _disc_maximum(image, chords.rows, chords.shifts, lines, maxima)
    return maxima


def opening_mask(classes: Uint8s, valid: Uint8s, disc: PixelDisc) -> Uint8s:
    """Open each class by a disc: mark pixels that lie in a disc whose valid pixels are all of their class.

    The centre of such a disc, or a pixel beside it, is valid. Pixels that are not valid, and those outside
    the image, fit every class. The mask, (M, N) as the other arrays, is 0 where a pixel is not valid.
    """
    above, left = disc.rows - 1, disc.cols - 1
    known = np.pad(valid > 0, ((above, above), (left, left)))
    padded = np.pad(classes, ((above, above), (left, left)))
    smallest = 255 - _disc_maxima(np.where(known, 255 - padded, 0).astype(np.uint8), disc)
    uniform = _disc_maxima(np.where(known, padded, 0).astype(np.uint8), disc) == smallest
    rows, cols = uniform.shape
    centre = np.zeros_like(uniform)
    for row in {above // 2, (above + 1) // 2}:
        for col in {left // 2, (left + 1) // 2}:
            centre |= known[row : row + rows, col : col + cols]
    covered = _disc_maxima((uniform & centre).view(np.uint8), disc)
    return covered & (valid > 0).view(np.uint8)


@inlined
def larger_of(first, shift, result):  # type: ignore[no-untyped-def]
    """Store the larger of each value and the one `shift` columns on."""
    for c in range(np.uintp(result.shape[0]) - np.uintp(shift)):
        one = first[c]
        other = first[c + np.uintp(shift)]
        result[c] = one if one > other else other


@inlined
def raise_to(line, shift, result):  # type: ignore[no-untyped-def]
    """Raise a row to the values of another one that begins `shift` columns on."""
    for c in range(np.uintp(result.shape[0])):
        one = result[c]
        other = line[c + np.uintp(shift)]
        result[c] = one if one > other else other


@kernel("void(u1[:,::1], i8[:,::1], i8[::1], u1[:,:,::1], u1[:,::1])")
def _disc_maximum(image, chords, shifts, lines, maxima):  # type: ignore[no-untyped-def]
    # `lines` holds the runs of the last rows, a rolling one for each row of the disc.
    height = chords.shape[0]
    for row in range(image.shape[0]):
        runs = lines[row % height]
        larger_of(image[row], 0, runs[0])
        for k in range(shifts.shape[0]):
            larger_of(runs[k], shifts[k], runs[k + 1])
        first = row - height + 1
        if first < 0:
            continue
        larger_of(lines[first % height, chords[0, 1]][chords[0, 0] :], 0, maxima[first])
        for j in range(1, height):
            raise_to(lines[(first + j) % height, chords[j, 1]], chords[j, 0], maxima[first])


@dataclass(frozen=True, slots=True)
class ThinLines:
    """Addition of thin lines to refined regions; it needs no more pixels around a tile than refinement.

    A matched filter for lines (Chaudhuri et al., IEEE Trans. Med. Imaging 8 (1989) 263-269) as a test: a
    pixel is on a line where, in one of 16 directions, the mean of 15 pixels along it lies in the range, those
    of both sides lie out of it on the same side, and their difference is significant. The spread by
    chance is measured in squares of 16 pixels, so that grain and texture count as noise. Evidence of less
    significance counts where it continues a line within 8 pixels of strong evidence.
    """

    halo: int = 0


def find_thin_lines(grey: Uint16s, valid: Uint8s, greys: tuple[int, int], margin: int) -> Uint8s:
    """Detect the pixels on thin lines in a range of `greys`, whose ends belong to it.

    `grey` and `valid` are (M, N), multiples of 16, as is the position of the first pixel in its raster.
    `margin` is the number of pixels on every side that are context alone, a multiple of 16 and at least 48.
    The result, (M − 2 margin + 96, N − 2 margin + 96), is 1 on lines; exact on the part within the margin and
    a border of one pixel.
    """
    skipped = margin - MARGIN
    inner = slice(skipped, -skipped or None)
    values = grey[inner, inner].astype(np.int32)
    values[valid[inner, inner] == 0] = _INVALID
    evidence, sums = np.zeros(values.shape, np.uint8), np.zeros(values.shape, np.int32)
    spread = _spread(values, sums)
    weak, strong = (np.floor(z * spread).astype(np.int32) for z in (_WEAK, _STRONG))
    for k in range(_DIRECTIONS):
        along, sides = _offsets(math.pi * k / _DIRECTIONS)
        _sum_lines(values, along, sums)
        _add_evidence(sums, sides, greys[0], greys[1], weak, strong, evidence)
    lines: Uint8s = evidence >> np.uint8(1)
    for _ in range(_REACH):
        lines = dilate(lines) & (evidence & np.uint8(1))
    return _joined(lines, values, greys)


def _spread(values: NDArray[np.int32], sums: NDArray[np.int32]) -> Floats:
    """Estimate the standard deviation of twice the sum of a line less that of a side, for each square."""
    # It follows from the median over 3 x 3 squares of the mean |difference|, which few lines do not change.
    shape = values.shape[0] // NOISE_SIDE, values.shape[1] // NOISE_SIDE
    totals, counts = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    for k in _MEASURED:
        along, sides = _offsets(math.pi * k / _DIRECTIONS)
        _sum_lines(values, along, sums)
        _add_differences(sums, sides, totals, counts)
    means = np.where(counts > 0, totals / np.maximum(counts, 1), -1.0)
    spread = math.sqrt(math.pi / 2) * medians_around(means, np.ones(shape, np.uint8))
    return np.maximum(spread, _MIN_NOISE * math.sqrt(4 * LENGTH + 2 * LENGTH))


def _joined(lines: Uint8s, values: NDArray[np.int32], greys: tuple[int, int]) -> Uint8s:
    """Add a pixel at each diagonal step, the nearer to the range, so that the pixels of lines share edges."""
    distance = np.maximum(np.maximum(greys[0] - values, values - greys[1]), 0)
    joined = lines.copy()
    first, last = slice(None, -1), slice(1, None)
    for here, there, one, other in (
        ((first, first), (last, last), (first, last), (last, first)),
        ((first, last), (last, first), (first, first), (last, last)),
    ):
        step = (lines[here] & lines[there] & ~(lines[one] | lines[other])) > 0
        step &= np.minimum(values[one], values[other]) < _INVALID
        by_one = distance[one] <= distance[other]
        joined[one] |= step & by_one
        joined[other] |= step & ~by_one
    return joined


def _offsets(angle: float) -> tuple[Integers, Integers]:
    """Return row and column offsets of the pixels of a line in a direction, and of two on each side of it."""
    down, across = math.sin(angle), math.cos(angle)
    half = range(-(LENGTH // 2), LENGTH // 2 + 1)
    if abs(across) >= abs(down):
        along = [(math.floor(t * down / across + 0.5), t) for t in half]
    else:
        along = [(t, math.floor(t * across / down + 0.5)) for t in half]
    places = [(side * far * across, -side * far * down) for side in (1, -1) for far in _SIDES]
    sides = [(math.floor(row + 0.5), math.floor(col + 0.5)) for row, col in places]
    return np.array(along, np.int64), np.array(sides, np.int64)


@kernel("void(i4[:,::1], i8[:,::1], i4[:,::1])")
def _sum_lines(values, offsets, sums):  # type: ignore[no-untyped-def]
    reach = 8
    for row in range(reach, sums.shape[0] - reach):
        sums[row, :] = 0
        for k in range(offsets.shape[0]):
            r = row + offsets[k, 0]
            shift = offsets[k, 1]
            for col in range(reach, sums.shape[1] - reach):
                sums[row, col] += values[r, col + shift]


@kernel("void(i4[:,::1], i8[:,::1], i8[:,::1], i8[:,::1])")
def _add_differences(sums, sides, totals, counts):  # type: ignore[no-untyped-def]
    reach = 13
    for row in range(reach, sums.shape[0] - reach):
        for square in range(totals.shape[1]):
            total, count = np.int64(0), np.int64(0)
            for col in range(max(16 * square, reach), min(16 * square + 16, sums.shape[1] - reach)):
                line = sums[row, col]
                side = sums[row + sides[0, 0], col + sides[0, 1]] + sums[row + sides[1, 0], col + sides[1, 1]]
                known = line < 16777216 and side < 16777216
                total += abs(2 * line - side) if known else 0
                count += 1 if known else 0
            totals[row // 16, square] += total
            counts[row // 16, square] += count


@kernel("void(i4[:,::1], i8[:,::1], i8, i8, i4[:,::1], i4[:,::1], u1[:,::1])")
def _add_evidence(sums, sides, low, high, weak, strong, evidence):  # type: ignore[no-untyped-def]
    reach = 13
    minimum, maximum = np.int32(15 * low), np.int32(15 * high)
    for row in range(reach, sums.shape[0] - reach):
        for square in range(weak.shape[1]):
            weak_limit, strong_limit = weak[row // 16, square], strong[row // 16, square]
            for col in range(max(16 * square, reach), min(16 * square + 16, sums.shape[1] - reach)):
                line = sums[row, col]
                if minimum <= line <= maximum:
                    one = sums[row + sides[0, 0], col + sides[0, 1]]
                    one += sums[row + sides[1, 0], col + sides[1, 1]]
                    two = sums[row + sides[2, 0], col + sides[2, 1]]
                    two += sums[row + sides[3, 0], col + sides[3, 1]]
                    nearer = min(one, two)
                    farther = max(one, two)
                    if farther < 16777216:
                        contrast = np.int32(-1)
                        if nearer > 2 * maximum:
                            contrast = nearer - 2 * line
                        elif farther < 2 * minimum:
                            contrast = 2 * line - farther
                        if contrast > weak_limit:
                            evidence[row, col] |= np.uint8(3) if contrast > strong_limit else np.uint8(1)
