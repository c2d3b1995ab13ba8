"""Refinement of states by directional scans: compaction, then resolution of free against occupied.

Abou Merhy, Payeur and Petriu (2008, section II C). A change may propagate along a whole line, so lines are
never split: a scan along rows takes whole rows; a scan along columns takes strips of rows in order and
carries the previous row from strip to strip.

A pixel is one code: its state in bits 0 and 1, the state of its value v in bits 2 and 3; 0 where it is
invalid. States are 1 free, 2 unknown, 3 occupied, so free and occupied differ in bit 1 only. A pixel is
called half where the state of its value is unknown.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Integers, Uint8s

LOOKAHEAD = 2  # rows after a strip that the resolution of free against occupied reads


def encode_states(states: Uint8s, by_value: Uint8s) -> Uint8s:
    """Encode the states of pixels: 0 invalid, 1 free, 2 unknown, 3 occupied.

    `by_value` is the state of each pixel's value; ignored where a pixel is invalid.

    Examples
    --------
    >>> encode_states(np.array([1, 3, 0], np.uint8), np.array([3, 3, 1], np.uint8))
    array([13, 15,  0], dtype=uint8)
    """
    return np.where(states > 0, states | by_value << np.uint8(2), np.uint8(0))


def decode_states(codes: Uint8s) -> Uint8s:
    """Decode the states of pixels: 0 invalid, 1 free, 2 unknown, 3 occupied."""
    return codes & np.uint8(3)


def count_codes(codes: Uint8s) -> Integers:
    """Count the pixels by code, a (16,) int64 array."""
    counts = np.zeros(16, np.int64)
    _count_codes(codes, counts)
    return counts


@inlined
def compact_pixel(code, previous):  # type: ignore[no-untyped-def]
    """Compact a code: unknown where the previous pixel is, and this one is valid and half."""
    return np.uint8(10) if previous == np.uint8(2) and code >> np.uint8(2) == np.uint8(2) else code


@inlined
def resolve_pixel(code, after, second, previous):  # type: ignore[no-untyped-def]
    """Resolve a code from the next two codes and the state of the previous pixel."""
    # The next pixels are as before the scan: those that change together with this one change in their turn,
    # for the same reason.
    two, three = np.uint8(2), np.uint8(3)
    state = code & three
    opposed = (previous ^ state == two) & (previous & np.uint8(1) == np.uint8(1))
    half = code >> two == two
    votes = code >> two == previous
    same = (after & three == state) & half
    votes |= same & (after >> two == previous)
    same &= (second & three == state) & (after >> two == two)
    votes |= same & (second >> two == previous)
    return code ^ two if opposed & votes else code


@kernel("void(u1[:,::1])")
def compact_rows(codes):  # type: ignore[no-untyped-def]
    """Compact along rows, right to left, then left to right, in place.

    Half pixels after an unknown one become unknown.
    """
    rows, cols = codes.shape
    for r in range(rows):
        for step in (-1, 1):
            previous = np.uint8(0)
            for k in range(cols):
                c = k if step > 0 else cols - 1 - k
                if codes[r, c] & np.uint8(3) != previous:  # rarely true
                    codes[r, c] = compact_pixel(codes[r, c], previous)
                    previous = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1])")
def resolve_rows(codes):  # type: ignore[no-untyped-def]
    """Resolve free against occupied along rows, right to left, then left to right, in place.

    Where the previous pixel is A and this one is B, {A, B} = {free, occupied}, the first pixel that is not
    half decides, of this one and at most two more that are B. If the state of its value is A, all pixels from
    this one through it become A.
    """
    rows, cols = codes.shape
    for r in range(rows):
        for step in (-1, 1):
            previous = np.uint8(0)
            for k in range(cols):
                c = k if step > 0 else cols - 1 - k
                if codes[r, c] & np.uint8(3) != previous:
                    after = codes[r, c + step] if k + 1 < cols else np.uint8(0)
                    second = codes[r, c + 2 * step] if k + 2 < cols else np.uint8(0)
                    codes[r, c] = resolve_pixel(codes[r, c], after, second, previous)
                    previous = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1], u1[::1], b1)")
def compact_columns(codes, previous, upwards):  # type: ignore[no-untyped-def]
    """Compact along columns, upwards (from bottom to top) or downwards, in place; see `compact_rows`.

    `previous`, (N,), are the states of the row before the (M, N) strip in scan order, 0 if there is none;
    updated to those of the strip's last row.
    """
    rows, cols = codes.shape
    for k in range(rows):
        r = rows - 1 - k if upwards else k
        for c in range(cols):
            codes[r, c] = compact_pixel(codes[r, c], previous[c])
            previous[c] = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1], u1[::1], b1)")
def resolve_columns(codes, previous, upwards):  # type: ignore[no-untyped-def]
    """Resolve free against occupied along columns, in place; see `resolve_rows` and `compact_columns`.

    The (M + 2, N) strip has the next two rows in scan order, which are not changed; rows of 0 if there are
    none.
    """
    rows, cols = codes.shape
    step = -1 if upwards else 1
    for k in range(rows - 2):
        r = rows - 1 - k if upwards else k
        for c in range(cols):
            codes[r, c] = resolve_pixel(codes[r, c], codes[r + step, c], codes[r + 2 * step, c], previous[c])
            previous[c] = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1], i8[::1])")
def _count_codes(codes, counts):  # type: ignore[no-untyped-def]
    for r in range(codes.shape[0]):
        for c in range(codes.shape[1]):
            counts[codes[r, c] & np.uint8(15)] += 1
