"""Sieve filter: small thin pieces and holes of a class image take the class of what is around them."""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Uint8s
from uavseg.units import MAX_PIXEL_CLASSES

MIN_PIECE = 12  # pixels: smaller thin pieces and thin holes are removed
_UNKNOWN = np.uint8(255)  # label of a pixel around which no component was searched
_NO_DATA = np.uint8(128)  # not valid, or outside the image; a bit that no class has


def drop_specks(inside: Uint8s, valid: Uint8s, active: Uint8s) -> None:
    """Change the class of components of fewer than 12 pixels that touch another class, all at once, in place.

    They get the class that most neighbours of their pixels have, of several the smallest: with one class,
    they change side. Components inside are 4-connected, as regions are; those outside (0) are 8-connected, as
    holes are. A square of 3 x 3 pixels of one class is kept.

    `inside` and `valid` are (M, N), the former of classes 0..`MAX_PIXEL_CLASSES`; `active`, (M / 8, N / 8),
    is not 0 for cells whose pixels may change.
    """
    sides = np.empty((inside.shape[0] + 2, inside.shape[1] + 2), np.uint8)
    _pad_sides(inside, valid, sides)
    lines = np.ones((10, sides.shape[1]), np.uint8)
    stack, seen = np.empty((MIN_PIECE, 2), np.int64), np.empty(2 * MIN_PIECE + 1, np.uint32)
    _drop_specks(sides, active, lines, stack, seen, np.zeros(MAX_PIXEL_CLASSES + 1, np.uint8), inside)


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _pad_sides(inside, valid, sides):  # type: ignore[no-untyped-def]
    sides[0] = _NO_DATA
    sides[-1] = _NO_DATA
    for r in range(inside.shape[0]):
        sides[r + 1, 0] = _NO_DATA
        sides[r + 1, -1] = _NO_DATA
        for c in range(np.uintp(inside.shape[1])):
            sides[r + 1, c + np.uintp(1)] = inside[r, c] if valid[r, c] else _NO_DATA


@inlined
def changes_across(line, result):  # type: ignore[no-untyped-def]
    """Mark pixels that have no data or differ from their left or right neighbour (not 0)."""
    for c in range(np.uintp(result.shape[0] - 2)):
        here = line[c + np.uintp(1)]
        result[c + np.uintp(1)] = (line[c] ^ here) | (here ^ line[c + np.uintp(2)]) | (here & _NO_DATA)


@inlined
def changes_around(above, line, below, across_above, across, across_below, result):  # type: ignore[no-untyped-def]
    """Mark pixels around which the 3 x 3 pixels are not all of one class."""
    for c in range(np.uintp(1), np.uintp(result.shape[0] - 1)):
        result[c] = across_above[c] | across[c] | across_below[c]
    for c in range(np.uintp(1), np.uintp(result.shape[0] - 1)):
        result[c] = np.uint8((result[c] | (above[c] ^ line[c]) | (line[c] ^ below[c])) != 0)


@inlined
def mark_thin(above, line, below, narrow, result):  # type: ignore[no-untyped-def]
    """Mark pixels that belong to no 3 x 3 square of one class (their piece is thin here)."""
    for c in range(np.uintp(narrow.shape[0])):
        narrow[c] = above[c] & line[c] & below[c]
    for c in range(np.uintp(narrow.shape[0] - 2)):
        result[c + np.uintp(1)] = narrow[c] & narrow[c + np.uintp(1)] & narrow[c + np.uintp(2)]


@inlined
def label_around(sides, r, c, stack, seen, contacts):  # type: ignore[no-untyped-def]
    """Return the class around a pixel's component if that is smaller than MIN_PIECE, else the pixel's."""
    # Flood fill, which stops at MIN_PIECE pixels.
    one = np.uint32(1)
    here = sides[r, c]
    seen[:] = 0
    seen[MIN_PIECE] = one << np.uint32(MIN_PIECE)  # a bit for each visited pixel
    stack[0, 0], stack[0, 1] = r, c
    count = 1
    minimum = _NO_DATA  # of the classes around
    maximum = np.uint8(0)
    k = 0
    while k < count:
        row, col = stack[k, 0], stack[k, 1]
        for y in range(row - 1, row + 2):
            for x in range(col - 1, col + 2):
                bit = one << np.uint32(x - c + MIN_PIECE)
                other = sides[y, x]
                if other != here:
                    if other != _NO_DATA:
                        minimum = min(minimum, other)
                        maximum = max(maximum, other)
                elif (here == 0 or y == row or x == col) and not seen[y - r + MIN_PIECE] & bit:
                    if count == MIN_PIECE - 1:
                        return here
                    seen[y - r + MIN_PIECE] |= bit
                    stack[count, 0], stack[count, 1] = y, x
                    count += 1
        k += 1
    if minimum == _NO_DATA:
        return here
    if minimum == maximum:
        return minimum
    return most_contacts(sides, here, stack, count, contacts, minimum, maximum)


@inlined
def most_contacts(sides, here, stack, count, contacts, minimum, maximum):  # type: ignore[no-untyped-def]
    """Return the class that most neighbours of a component's pixels have, of several the smallest."""
    contacts[:] = 0
    for k in range(count):
        for y in range(stack[k, 0] - 1, stack[k, 0] + 2):
            for x in range(stack[k, 1] - 1, stack[k, 1] + 2):
                if sides[y, x] != here and sides[y, x] != _NO_DATA:
                    contacts[sides[y, x]] += np.uint8(1)
    best = minimum
    for label in range(minimum, np.int64(maximum) + 1):
        if contacts[label] > contacts[best]:
            best = np.uint8(label)
    return best


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], i8[:,::1], u4[::1], u1[::1], u1[:,::1])")
def _drop_specks(sides, active, lines, stack, seen, contacts, inside):  # type: ignore[no-untyped-def]
    # `sides` has a border of no data. Rolling lines behind each other: across, around, thin. Pixels of one
    # component that follow each other in a row or a column share the label that was found first.
    rows = inside.shape[0]
    across, around, narrow, result, known = lines[:3], lines[3:6], lines[6], lines[7], lines[8:]
    for step in range(rows + 4):
        if step < rows + 2:
            changes_across(sides[step], across[step % 3])
        row = step - 1
        if row > rows:
            around[row % 3] = 1
        elif row > 0:
            above, here, below = across[(row - 1) % 3], across[row % 3], across[(row + 1) % 3]
            changes_around(sides[row - 1], sides[row], sides[row + 1], above, here, below, around[row % 3])
        row = step - 2
        if row < 1 or row > rows:
            continue
        mark_thin(around[(row - 1) % 3], around[row % 3], around[(row + 1) % 3], narrow, result)
        before, labels = known[(row - 1) % 2], known[row % 2]
        labels[:] = _UNKNOWN
        for cell in range(active.shape[1]):
            if active[(row - 1) // 8, cell]:
                for c in range(8 * cell + 1, 8 * cell + 9):
                    here = sides[row, c]
                    if result[c] and here != _NO_DATA:
                        if here == sides[row, c - 1] and labels[c - 1] != _UNKNOWN:
                            labels[c] = labels[c - 1]  # of the same component
                        elif here == sides[row - 1, c] and before[c] != _UNKNOWN:
                            labels[c] = before[c]
                        else:
                            labels[c] = label_around(sides, row, c, stack, seen, contacts)
                        inside[row - 1, c - 1] = labels[c]
