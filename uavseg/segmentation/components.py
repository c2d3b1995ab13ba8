"""Connected components: pixels of a region that share edges (4-connectivity; a corner does not connect)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

WORD = 8  # pixels of an image of bytes that are looked at together


def components(inside: NDArray[np.uint8], margin: int = 0) -> tuple[NDArray[np.uint32], int]:
    """Number the components of an image in raster order of their first pixels.

    Parameters
    ----------
    inside : (M + 2 m, N + 2 m) uint8 array
        1 where a pixel belongs to a component.
    margin : int
        m, pixels on every side that are left out.

    Returns
    -------
    labels : (M, N) uint32 array
        0 nothing, 1..n.
    n : int

    Examples
    --------
    >>> components(np.array([[1, 0, 1], [1, 1, 0]], np.uint8))[0]
    array([[1, 0, 2],
           [1, 1, 0]], dtype=uint32)
    """
    labels = np.zeros((inside.shape[0] - 2 * margin, inside.shape[1] - 2 * margin), np.uint32)
    parents = np.empty(labels.size // 2 + 2, np.uint32)
    words = words_of(inside) if margin % WORD == 0 else np.empty((0, 0), np.uint64)
    return labels, _label_u1(inside, words, margin, labels, parents)


def equal_components(image: NDArray[Any], margin: int = 0) -> tuple[NDArray[np.uint32], int]:
    """Number the connected pixels of equal value, 0 left out, in raster order of their first pixels.

    Parameters
    ----------
    image : (M + 2 m, N + 2 m) uint8 or uint32 array
    margin : int
        m, pixels on every side that are left out.

    Returns
    -------
    labels : (M, N) uint32 array
        0 where the image is, 1..n.
    n : int

    Examples
    --------
    >>> equal_components(np.array([[5, 0, 5], [5, 7, 7]], np.uint32))[0]
    array([[1, 0, 2],
           [1, 3, 3]], dtype=uint32)
    """
    labels = np.zeros((image.shape[0] - 2 * margin, image.shape[1] - 2 * margin), np.uint32)
    parents = np.empty(labels.size + 1, np.uint32)
    if image.dtype != np.uint8:
        return labels, _label_u4(image, np.empty((0, 0), np.uint64), margin, labels, parents)
    words = words_of(image) if margin % WORD == 0 else np.empty((0, 0), np.uint64)
    return labels, _label_u1(image, words, margin, labels, parents)


def values_of(image: NDArray[np.uint32], labels: NDArray[np.uint32], count: int) -> NDArray[np.int64]:
    """The value of each component 1..count of an image, (count,) int64.

    Parameters
    ----------
    image, labels : (M, N) uint32 arrays
        As given to `equal_components`, and what it gave.
    count : int
    """
    values = np.empty(count, np.int64)
    _name(image, labels, values)
    return values


def words_of(image: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Eight pixels of a row in one number, so that they are compared at once; empty where they do not fit."""
    if image.shape[1] % WORD or not image.flags.c_contiguous or image.ctypes.data % WORD:
        return np.empty((0, 0), np.uint64)
    return image.view(np.uint64)


@dataclass(frozen=True, slots=True)
class Sums:
    """What adds up over the pixels of each component; tiles of a component merge by adding.

    Parameters
    ----------
    counts : (n,) int64 array
        Number of pixels.
    greys : (n,) uint64 array
        Sum of g.
    squares : (n,) uint64 array
        Sum of g * g; holds up to 4e9 pixels.
    firsts : (n, 2) int64 array
        Row and column of the first pixel in raster order.
    """

    counts: NDArray[np.int64]
    greys: NDArray[np.uint64]
    squares: NDArray[np.uint64]
    firsts: NDArray[np.int64]


def component_sums(labels: NDArray[np.uint32], count: int, grey: NDArray[np.uint16], margin: int = 0) -> Sums:
    """Sums over the components 1..count of a label image.

    Parameters
    ----------
    labels : (M, N) uint32 array
    count : int
    grey : (M + 2 m, N + 2 m) uint16 array
    margin : int
    """
    counts = np.zeros(count, np.int64)
    greys = np.zeros(count, np.uint64)
    squares = np.zeros(count, np.uint64)
    firsts = np.full((count, 2), -1, np.int64)
    _sum_up(labels, grey, margin, counts, greys, squares, firsts)
    return Sums(counts, greys, squares, firsts)


def cell_totals(
    sums: NDArray[np.uint32], counts: NDArray[np.uint8], labels: NDArray[np.uint32], count: int
) -> tuple[NDArray[np.int64], NDArray[np.uint64], NDArray[np.int64]]:
    """Totals over the components 1..count of an image of cells.

    Parameters
    ----------
    sums : (m, n) uint32 array
        Sum of the grey of each cell.
    counts : (m, n) uint8 array
        Its valid pixels.
    labels : (m, n) uint32 array
    count : int

    Returns
    -------
    counts : (count,) int64 array
        Valid pixels.
    greys : (count,) uint64 array
    firsts : (count, 2) int64 array
        Row and column of the first cell in raster order.
    """
    totals, greys, firsts = (
        np.zeros(count, np.int64),
        np.zeros(count, np.uint64),
        np.zeros((count, 2), np.int64),
    )
    arrays = (np.ascontiguousarray(array) for array in (sums, counts, labels))
    _total(*arrays, np.zeros(count, np.uint8), totals, greys, firsts)
    return totals, greys, firsts


def united(pairs: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """The smallest of all items that pairs connect each item with.

    Parameters
    ----------
    pairs : (k, 2) int64 array
        Items that belong together.
    count : int
        Items are 0..count - 1.

    Returns
    -------
    roots : (count,) int64 array

    Examples
    --------
    >>> united(np.array([[3, 1], [3, 4]]), 5)
    array([0, 1, 2, 1, 1])
    """
    parents = np.arange(count)
    _unite(np.ascontiguousarray(pairs), parents)
    return parents


@inlined
def root_of(parents, item):  # type: ignore[no-untyped-def]
    """The root of an item; halves the path on the way."""
    while parents[item] != item:
        parents[item] = parents[parents[item]]
        item = parents[item]
    return item


@inlined
def end_of_run(image, words, margin, r, c, value):  # type: ignore[no-untyped-def]
    """Where the pixels of a value that begin at column c of a row end; columns count from the margin."""
    cols = image.shape[1] - 2 * margin
    full = np.uint64(value) * np.uint64(0x0101010101010101)
    while c < cols and image[r + margin, c + margin] == value:
        c += 1
        if words.shape[0] > 0 and c % WORD == 0:
            while c < cols and words[r + margin, (c + margin) // WORD] == full:
                c += WORD
    return c


def _label(image, words, margin, labels, parents):  # type: ignore[no-untyped-def]
    # Runs of pixels get provisional numbers, and which of them meet is noted; the smaller one is the root, so
    # roots are in raster order.
    rows, cols = labels.shape
    used = np.uint32(0)
    parents[0] = 0
    for r in range(rows):
        c = 0
        while c < cols:
            value = image[r + margin, c + margin]
            end = end_of_run(image, words, margin, r, c, value)
            if value != 0:
                label = np.uint32(0)
                before = np.uint32(0)
                for k in range(c, end if r > 0 else c):
                    above = labels[r - 1, k]
                    if above != before:
                        before = above
                        if above != 0 and image[r + margin - 1, k + margin] == value:
                            root = root_of(parents, above)
                            if label != 0:
                                label = root_of(parents, label)
                                parents[max(label, root)] = min(label, root)
                                root = min(label, root)
                            label = root
                if label == 0:
                    used += np.uint32(1)
                    parents[used] = used
                    label = used
                for k in range(c, end):
                    labels[r, k] = label
            c = end
    found = np.uint32(0)
    for k in range(1, used + 1):
        if parents[k] == k:
            found += np.uint32(1)
            parents[k] = found
        else:
            parents[k] = parents[parents[k]]
    for r in range(rows):
        c = 0
        while c < cols:
            if words.shape[0] > 0 and c % WORD == 0 and words[r + margin, (c + margin) // WORD] == 0:
                c += WORD
                continue
            labels[r, c] = parents[labels[r, c]]
            c += 1
    return found


_label_u1 = kernel("i8(u1[:,::1], u8[:,::1], i8, u4[:,::1], u4[::1])")(_label)
_label_u4 = kernel("i8(u4[:,::1], u8[:,::1], i8, u4[:,::1], u4[::1])")(_label)


@kernel("void(u4[:,::1], u4[:,::1], i8[::1])")
def _name(image, labels, values):  # type: ignore[no-untyped-def]
    named = 0  # components are numbered in the order in which they are met
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if labels[r, c] > named:
                values[named] = image[r, c]
                named += 1


@kernel("void(u4[:,::1], u2[:,::1], i8, i8[::1], u8[::1], u8[::1], i8[:,::1])")
def _sum_up(labels, grey, margin, counts, greys, squares, firsts):  # type: ignore[no-untyped-def]
    rows, cols = labels.shape
    for r in range(rows):
        c = 0
        while c < cols:
            label = labels[r, c]
            start = c
            while c < cols and labels[r, c] == label:
                c += 1
            if label == 0:
                continue
            total = np.uint64(0)
            square = np.uint64(0)
            for k in range(start, c):
                g = np.uint64(grey[r + margin, k + margin])
                total += g
                square += g * g
            if counts[label - 1] == 0:
                firsts[label - 1, 0] = r
                firsts[label - 1, 1] = start
            counts[label - 1] += c - start
            greys[label - 1] += total
            squares[label - 1] += square


@kernel("void(u4[:,::1], u1[:,::1], u4[:,::1], u1[::1], i8[::1], u8[::1], i8[:,::1])")
def _total(sums, counts, labels, seen, totals, greys, firsts):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if labels[r, c] == 0:
                continue
            k = labels[r, c] - 1
            totals[k] += np.int64(counts[r, c])
            greys[k] += np.uint64(sums[r, c])
            if not seen[k]:
                seen[k] = 1
                firsts[k, 0] = r
                firsts[k, 1] = c


@kernel("void(i8[:,::1], i8[::1])")
def _unite(pairs, parents):  # type: ignore[no-untyped-def]
    for k in range(pairs.shape[0]):
        first = root_of(parents, pairs[k, 0])
        second = root_of(parents, pairs[k, 1])
        parents[max(first, second)] = min(first, second)
    for k in range(parents.shape[0]):
        parents[k] = parents[parents[k]]
