"""States to the pixel: the paper's compaction, then free against occupied, scan by scan.

Abou Merhy, Payeur and Petriu (2008, section II C). A change may run along a whole line, so lines are never
cut: a scan along rows takes whole rows, a scan along columns takes strips of rows one after the other and
carries the row before from strip to strip.

A pixel is one code: its state in bits 0 and 1, the state of its own v in bits 2 and 3; 0 where it is invalid.
States are 1 free, 2 unknown, 3 occupied, so free and occupied differ in bit 1 alone, and a pixel is half
where its own state is 2.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

LOOKAHEAD = 2  # rows beyond a strip that a scan of free against occupied looks at

Codes = NDArray[np.uint8]


def encode_states(states: NDArray[np.uint8], own: NDArray[np.uint8]) -> Codes:
    """Codes of pixels.

    Parameters
    ----------
    states : (M, N) uint8 array
        0 invalid, 1 free, 2 unknown, 3 occupied.
    own : (M, N) uint8 array
        What each pixel's own v is; looked at where a pixel is valid.

    Examples
    --------
    >>> codes_of(np.array([1, 3, 0], np.uint8), np.array([3, 3, 1], np.uint8))
    array([13, 15,  0], dtype=uint8)
    """
    return np.where(states > 0, states | own << np.uint8(2), np.uint8(0))


def decode_states(codes: Codes) -> NDArray[np.uint8]:
    """States of pixels: 0 invalid, 1 free, 2 unknown, 3 occupied."""
    return codes & np.uint8(3)


def compact_rows(codes: Codes) -> None:
    """Right to left, then left to right: half pixels after an unknown one become unknown, in place."""
    _compact_rows(codes)


def resolve_rows(codes: Codes) -> None:
    """Right to left, then left to right: free pixels against occupied ones, in place.

    Where the previous pixel is A and this one is B, {A, B} = {free, occupied}, this pixel and at most two
    more are looked at, as long as they are B; the first that is not half decides. If its own state is A, all
    from this one through it become A.
    """
    _resolve_rows(codes)


def compact_columns(codes: Codes, before: NDArray[np.uint8], upwards: bool) -> None:
    """Compaction along columns, in place.

    Parameters
    ----------
    codes : (M, N) uint8 array
    before : (N,) uint8 array
        States of the row before the strip in the order of the scan, 0 where there is none; in the end, of the
        strip's last row in this order.
    upwards : bool
        Whether the scan runs from bottom to top.
    """
    _compact_columns(codes, before, upwards)


def resolve_columns(codes: Codes, before: NDArray[np.uint8], upwards: bool) -> None:
    """Free against occupied along columns, in place; see `settle_rows`.

    Parameters
    ----------
    codes : (M + 2, N) uint8 array
        A strip with the two rows that come after it in the order of the scan, which stay as they are; rows of
        0 where there are none.
    before, upwards
        As of `compact_columns`.
    """
    _resolve_columns(codes, before, upwards)


def refine_states(codes: Codes) -> NDArray[np.uint8]:
    """All eight scans over a whole image.

    Parameters
    ----------
    codes : (M, N) uint8 array
        Changed in place.

    Returns
    -------
    states : (M, N) uint8 array

    Examples
    --------
    >>> unknown_beside_free = np.array([[2, 1, 1, 1]], np.uint8)
    >>> half_but_for_the_last = np.array([[2, 2, 2, 1]], np.uint8)
    >>> refine_states(codes_of(unknown_beside_free, half_but_for_the_last))
    array([[2, 2, 2, 1]], dtype=uint8)
    """
    rows, cols = codes.shape
    compact_rows(codes)
    for upwards in (True, False):
        compact_columns(codes, np.zeros(cols, np.uint8), upwards)
    resolve_rows(codes)
    padded = np.zeros((rows + 2 * LOOKAHEAD, cols), np.uint8)
    padded[LOOKAHEAD:-LOOKAHEAD] = codes
    resolve_columns(padded[:-LOOKAHEAD], np.zeros(cols, np.uint8), True)
    resolve_columns(padded[LOOKAHEAD:], np.zeros(cols, np.uint8), False)
    codes[:] = padded[LOOKAHEAD:-LOOKAHEAD]
    return decode_states(codes)


def count_codes(codes: Codes) -> NDArray[np.int64]:
    """How many pixels have each code, a (16,) array."""
    counts = np.zeros(16, np.int64)
    _count_codes(codes, counts)
    return counts


@inlined
def compact_pixel(code, before):  # type: ignore[no-untyped-def]
    """A code after compaction: unknown where the pixel before is, and this one is valid and half."""
    return np.uint8(10) if before == np.uint8(2) and code >> np.uint8(2) == np.uint8(2) else code


@inlined
def resolve_pixel(code, after, second, before):  # type: ignore[no-untyped-def]
    """A code after free against occupied, from the two codes after it and the state of the pixel before.

    Pixels after this one are as they were before the scan: what changes together with this one changes when
    its own turn comes, for the same reason.
    """
    two = np.uint8(2)
    three = np.uint8(3)
    state = code & three
    met = (before ^ state == two) & (before & np.uint8(1) == np.uint8(1))
    half = code >> two == two
    votes = code >> two == before
    same = (after & three == state) & half
    votes |= same & (after >> two == before)
    same &= (second & three == state) & (after >> two == two)
    votes |= same & (second >> two == before)
    return code ^ two if met & votes else code


@kernel("void(u1[:,::1])")
def _compact_rows(codes):  # type: ignore[no-untyped-def]
    rows, cols = codes.shape
    for r in range(rows):
        before = np.uint8(0)
        for k in range(cols):
            c = cols - 1 - k
            if codes[r, c] & np.uint8(3) != before:  # mostly not
                codes[r, c] = compact_pixel(codes[r, c], before)
                before = codes[r, c] & np.uint8(3)
        before = np.uint8(0)
        for c in range(cols):
            if codes[r, c] & np.uint8(3) != before:
                codes[r, c] = compact_pixel(codes[r, c], before)
                before = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1])")
def _resolve_rows(codes):  # type: ignore[no-untyped-def]
    rows, cols = codes.shape
    for r in range(rows):
        before = np.uint8(0)
        for k in range(cols):
            c = cols - 1 - k
            if codes[r, c] & np.uint8(3) != before:
                after = codes[r, c - 1] if c > 0 else np.uint8(0)
                second = codes[r, c - 2] if c > 1 else np.uint8(0)
                codes[r, c] = resolve_pixel(codes[r, c], after, second, before)
                before = codes[r, c] & np.uint8(3)
        before = np.uint8(0)
        for c in range(cols):
            if codes[r, c] & np.uint8(3) != before:
                after = codes[r, c + 1] if c + 1 < cols else np.uint8(0)
                second = codes[r, c + 2] if c + 2 < cols else np.uint8(0)
                codes[r, c] = resolve_pixel(codes[r, c], after, second, before)
                before = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1], u1[::1], b1)")
def _compact_columns(codes, before, upwards):  # type: ignore[no-untyped-def]
    rows, cols = codes.shape
    for k in range(rows):
        r = rows - 1 - k if upwards else k
        for c in range(cols):
            codes[r, c] = compact_pixel(codes[r, c], before[c])
            before[c] = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1], u1[::1], b1)")
def _resolve_columns(codes, before, upwards):  # type: ignore[no-untyped-def]
    rows, cols = codes.shape
    step = -1 if upwards else 1
    for k in range(rows - 2):
        r = rows - 1 - k if upwards else k
        for c in range(cols):
            codes[r, c] = resolve_pixel(codes[r, c], codes[r + step, c], codes[r + 2 * step, c], before[c])
            before[c] = codes[r, c] & np.uint8(3)


@kernel("void(u1[:,::1], i8[::1])")
def _count_codes(codes, counts):  # type: ignore[no-untyped-def]
    for r in range(codes.shape[0]):
        for c in range(codes.shape[1]):
            counts[codes[r, c] & np.uint8(15)] += 1
