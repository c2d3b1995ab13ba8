"""Discs on a label image: where all pixels of a disc have one kind, and which pixels such discs cover.

An ellipse of pixels stands for a disc on the ground, since pixels need not be square. Maxima over it are
built up from runs of a row: each row of the disc is a chord.

Not `skimage.morphology.dilation`: the same values in 300 times the time (disc of 17, 2048 x 2048: 0.9 s).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class PixelDisc:
    """The pixels whose centres lie within an ellipse that is `rows` high and `cols` wide.

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
    def pixels(self) -> NDArray[np.bool_]:
        """The disc as a mask, (rows, cols)."""
        row = 2 * np.arange(self.rows, dtype=np.int64)[:, None] - (self.rows - 1)
        col = 2 * np.arange(self.cols, dtype=np.int64) - (self.cols - 1)
        squares = row**2 * self.cols**2 + col**2 * self.rows**2
        middle = (abs(row) <= 1) | (abs(col) <= 1)  # as wide as its sides also where one of them is small
        return np.asarray(middle | (squares < (self.rows * self.cols) ** 2))


@dataclass(frozen=True, slots=True)
class _Chords:
    """The rows of a disc: first column and index of the length of each, and how lengths are built up.

    Length k + 1 of `shifts` is the maximum of length k and of the same one shifted by `shifts[k]`.
    """

    rows: NDArray[np.int64]
    shifts: NDArray[np.int64]


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


def disc_maximum(image: Image, disc: PixelDisc) -> Image:
    """Largest value in each disc that lies within an image.

    Parameters
    ----------
    image : (M, N) uint8 array
        At least as large as the disc.
    disc : PixelDisc

    Returns
    -------
    maxima : (M - rows + 1, N - cols + 1) uint8 array
        At (r, c) that of the disc whose bounding box begins there.
    """
    chords = _chords(disc)
    found = np.empty((image.shape[0] - disc.rows + 1, image.shape[1] - disc.cols + 1), np.uint8)
    lines = np.zeros((disc.rows, len(chords.shifts) + 1, image.shape[1]), np.uint8)
    _disc_maximum(image, chords.rows, chords.shifts, lines, found)
    return found


def covered_by_own_discs(kinds: Image, valid: Image, disc: PixelDisc) -> Image:
    """Where a pixel lies in a disc whose valid pixels have all its kind: the opening of each kind.

    The centre of such a disc, or a pixel beside it, is valid. Pixels that are not valid, and those outside
    the image, fit every kind.

    Parameters
    ----------
    kinds : (M, N) uint8 array
    valid : (M, N) uint8 array
    disc : PixelDisc

    Returns
    -------
    covered : (M, N) uint8 array
        1 where it is so; 0 where not valid.
    """
    above, left = disc.rows - 1, disc.cols - 1
    known = np.pad(valid > 0, ((above, above), (left, left)))
    padded = np.pad(kinds, ((above, above), (left, left)))
    smallest = 255 - disc_maximum(np.where(known, 255 - padded, 0).astype(np.uint8), disc)
    uniform = disc_maximum(np.where(known, padded, 0).astype(np.uint8), disc) == smallest
    rows, cols = uniform.shape
    centre = np.zeros_like(uniform)
    for row in {above // 2, (above + 1) // 2}:
        for col in {left // 2, (left + 1) // 2}:
            centre |= known[row : row + rows, col : col + cols]
    covered = disc_maximum((uniform & centre).view(np.uint8), disc)
    return covered & (valid > 0).view(np.uint8)


@inlined
def larger_of(first, shift, result):  # type: ignore[no-untyped-def]
    """The larger of each value and the one `shift` columns on."""
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
def _disc_maximum(image, chords, shifts, lines, found):  # type: ignore[no-untyped-def]
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
        larger_of(lines[first % height, chords[0, 1]][chords[0, 0] :], 0, found[first])
        for j in range(1, height):
            raise_to(lines[(first + j) % height, chords[j, 1]], chords[j, 0], found[first])
