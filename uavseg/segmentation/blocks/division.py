"""How uniform a block's texture is: G between its four children, R of the block.

G is Sokal and Rohlf's log-likelihood ratio between two histograms, R = G_max / G_min over the pairs of
children (Abou Merhy, Payeur and Petriu 2008, equations 1 and 2). R of a block depends on nothing but its
texture, so it is computed once and any threshold is applied afterwards.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.g_statistic import _N_LN_N, SMALLEST_G
from uavseg.segmentation.blocks.lbp import (
    BINS,
    SYMBOLS,
    UNCOUNTED,
    contrast,
    contrast_bin,
    counted,
    given,
    lbp_code,
)
from uavseg.units import BLOCK

RATIOS = 21  # of one block: side 64, then four of side 32, then sixteen of side 16, each row by row
EVERY = np.uint32((1 << RATIOS) - 1)  # all of them are wanted


def block_ratios(
    grey: NDArray[np.uint16],
    valid: NDArray[np.uint8] | None,
    cuts: NDArray[np.int32],
    corners: NDArray[np.int64],
) -> NDArray[np.float64]:
    """R of blocks of 64 x 64 pixels, and of the blocks of 32 and 16 within them.

    Parameters
    ----------
    grey : (M + 2, N + 2) uint16 array
        Image with a border of one pixel.
    valid : (M + 2, N + 2) uint8 array or None
        1 where a pixel is valid; None where all are.
    cuts : (7,) int32 array
        Of the contrast, from `texture.contrast_cuts`.
    corners : (B, 2) int64 array
        Row and column of each block's first pixel, 0 to M - 64 and N - 64 (the border not counted).

    Returns
    -------
    ratios : (B, 21) float64 array
        Side 64, then the four of side 32, then the sixteen of side 16, row by row. 0 where every G is 0 or
        fewer than two children have counted pixels (never divided); infinite where only the smallest G is 0.
    """
    ratios = np.empty((len(corners), RATIOS))
    scratch = np.zeros((6, SYMBOLS), np.uint64)
    texture = np.empty(BLOCK * BLOCK, np.uint16)
    _ratios(grey, given(valid), valid is None, cuts, corners, _N_LN_N, scratch, texture, ratios)
    return ratios


def wanted_ratios(
    grey: NDArray[np.uint16],
    valid: NDArray[np.uint8] | None,
    cuts: NDArray[np.int32],
    corners: NDArray[np.int64],
    wanted: NDArray[np.uint32],
    threshold: float,
) -> NDArray[np.float64]:
    """R of some of the blocks within blocks of 64 x 64 pixels: those that a question depends on.

    Parameters
    ----------
    grey, valid, cuts, corners
        As of `block_ratios`.
    wanted : (B,) uint32 array
        Bit k is set where ratio k of a block is wanted.
    threshold : float
        X. Where a wanted block is not divided, what lies within it is not looked at.

    Returns
    -------
    ratios : (B, 21) float64 array
        Exactly as of `block_ratios` where they were computed, 0 where they were not.
    """
    ratios = np.zeros((len(corners), RATIOS))
    table, listed = np.zeros(SYMBOLS, np.uint64), np.zeros(SYMBOLS, np.uint64)
    texture = np.empty(BLOCK * BLOCK, np.uint16)
    every = valid is None
    _wanted_ratios(
        grey, given(valid), every, cuts, corners, wanted, threshold, _N_LN_N, table, listed, texture, ratios
    )
    return ratios


@inlined
def pack_sums(packed, width):  # type: ignore[no-untyped-def]
    """Sum of the four counts packed into one word, each `width` bits wide."""
    mask = (np.uint64(1) << width) - np.uint64(1)
    return (
        (packed & mask)
        + ((packed >> width) & mask)
        + ((packed >> (np.uint64(2) * width)) & mask)
        + (packed >> (np.uint64(3) * width))
    )


@inlined
def ratio_of_children(packed, listed, many, width, n_ln_n):  # type: ignore[no-untyped-def]
    """R from the four histograms packed in a table, over the `many` symbols that are listed.

    G of a pair is 2 (J(N_s, N_m) - sum of J(f_s, f_m)) with J(a, b) = (a + b) ln (a + b) - a ln a - b ln b,
    which is equation 1 put in order. A symbol that only one of the two has adds nothing, so no branch is
    needed.
    """
    mask = (np.uint64(1) << width) - np.uint64(1)
    n0 = n1 = n2 = n3 = np.uint64(0)
    j01 = j02 = j03 = j12 = j13 = j23 = 0.0
    for k in range(many):
        word = packed[listed[k]]
        a = word & mask
        b = (word >> width) & mask
        c = (word >> (np.uint64(2) * width)) & mask
        d = word >> (np.uint64(3) * width)
        n0 += a
        n1 += b
        n2 += c
        n3 += d
        la = n_ln_n[a]
        lb = n_ln_n[b]
        lc = n_ln_n[c]
        ld = n_ln_n[d]
        j01 += n_ln_n[a + b] - la - lb
        j02 += n_ln_n[a + c] - la - lc
        j03 += n_ln_n[a + d] - la - ld
        j12 += n_ln_n[b + c] - lb - lc
        j13 += n_ln_n[b + d] - lb - ld
        j23 += n_ln_n[c + d] - lc - ld
    smallest = np.inf
    largest = -1.0
    for first, second, shared in (
        (n0, n1, j01),
        (n0, n2, j02),
        (n0, n3, j03),
        (n1, n2, j12),
        (n1, n3, j13),
        (n2, n3, j23),
    ):
        if first and second:
            g = 2.0 * (n_ln_n[first + second] - n_ln_n[first] - n_ln_n[second] - shared)
            if g < SMALLEST_G * (first + second):
                g = 0.0
            smallest = min(smallest, g)
            largest = max(largest, g)
    if largest <= 0.0:
        return 0.0
    if smallest == 0.0:
        return np.inf
    return largest / smallest


@inlined
def ratios_of_block(texture, n_ln_n, scratch, ratios, b):  # type: ignore[no-untyped-def]
    """Fill ratios[b] from the 4096 symbols of a block, from the smallest blocks up.

    Three tables hold four packed counts a symbol (8 bits each for the cells of a block of 16, 16 bits for
    its parents); `listed` names the symbols that a table holds, so that only those are looked at.
    """
    cells, cells_listed, sixteens, sixteens_listed, halves, halves_listed = 0, 1, 2, 3, 4, 5
    eight = np.uint64(8)
    sixteen = np.uint64(16)
    many_halves = 0
    for half in range(4):
        many_sixteens = 0
        for quarter in range(4):
            row = (half // 2) * 32 + (quarter // 2) * 16
            col = (half % 2) * 32 + (quarter % 2) * 16
            many = 0
            for r in range(16):
                for c in range(16):
                    name = texture[(row + r) * BLOCK + col + c]
                    if name != UNCOUNTED:
                        if scratch[cells, name] == 0:
                            scratch[cells_listed, many] = name
                            many += 1
                        scratch[cells, name] += np.uint64(1) << np.uint64(8 * (2 * (r // 8) + c // 8))
            place = 5 + (row // 16) * 4 + col // 16
            ratios[b, place] = ratio_of_children(scratch[cells], scratch[cells_listed], many, eight, n_ln_n)
            for k in range(many):
                name = scratch[cells_listed, k]
                if scratch[sixteens, name] == 0:
                    scratch[sixteens_listed, many_sixteens] = name
                    many_sixteens += 1
                scratch[sixteens, name] += pack_sums(scratch[cells, name], eight) << np.uint64(16 * quarter)
                scratch[cells, name] = 0
        ratios[b, 1 + half] = ratio_of_children(
            scratch[sixteens], scratch[sixteens_listed], many_sixteens, sixteen, n_ln_n
        )
        for k in range(many_sixteens):
            name = scratch[sixteens_listed, k]
            if scratch[halves, name] == 0:
                scratch[halves_listed, many_halves] = name
                many_halves += 1
            scratch[halves, name] += pack_sums(scratch[sixteens, name], sixteen) << np.uint64(16 * half)
            scratch[sixteens, name] = 0
    ratios[b, 0] = ratio_of_children(scratch[halves], scratch[halves_listed], many_halves, sixteen, n_ln_n)
    for k in range(many_halves):
        scratch[halves, scratch[halves_listed, k]] = 0


@kernel("void(u2[:,::1], u1[:,::1], b1, i4[::1], i8[:,::1], f8[::1], u8[:,::1], u2[::1], f8[:,::1])")
def _ratios(grey, valid, every, cuts, corners, n_ln_n, scratch, texture, ratios):  # type: ignore[no-untyped-def]
    seven = (cuts[0], cuts[1], cuts[2], cuts[3], cuts[4], cuts[5], cuts[6])
    for b in range(corners.shape[0]):
        fill_texture(grey, valid, every, seven, corners[b, 0] + 1, corners[b, 1] + 1, texture)
        ratios_of_block(texture, n_ln_n, scratch, ratios, b)


@inlined
def ratio_of_block(texture, row, col, side, n_ln_n, table, listed):  # type: ignore[no-untyped-def]
    """R of one block within the 4096 symbols of a block of 64; leaves the table as it found it, empty."""
    # Sixteens in the order of `ratios_of_block`, so that sums are rounded alike and R is the same to the bit.
    half = side // 2
    many = 0
    for k in range(side // 16 * (side // 16)):
        top = k // 8 * 32 + k // 2 % 2 * 16
        left = k // 4 % 2 * 32 + k % 2 * 16
        for r in range(top, top + 16):
            for c in range(left, left + 16):
                name = texture[(row + r) * BLOCK + col + c]
                if name != UNCOUNTED:
                    if table[name] == 0:
                        listed[many] = name
                        many += 1
                    table[name] += np.uint64(1) << np.uint64(16 * (2 * (r // half) + c // half))
    ratio = ratio_of_children(table, listed, many, np.uint64(16), n_ln_n)
    for k in range(many):
        table[listed[k]] = 0
    return ratio


@inlined
def fill_texture(grey, valid, every, cuts, top, left, texture):  # type: ignore[no-untyped-def]
    """The symbols of a block of 64 whose first pixel is grey[top, left]."""
    top, left = max(top, 1), max(left, 1)  # they are; the compiler does not know, and counts from the end
    for r in range(BLOCK):
        row = top + r
        for c in range(BLOCK):
            level = contrast_bin(contrast(grey, row, left + c), cuts)
            texture[r * BLOCK + c] = lbp_code(grey, row, left + c) * BINS + level
        if not every:
            for c in range(BLOCK):
                if not counted(valid, row, left + c):
                    texture[r * BLOCK + c] = UNCOUNTED


_WANTED = (
    "void(u2[:,::1], u1[:,::1], b1, i4[::1], i8[:,::1], u4[::1], f8, f8[::1], u8[::1], u8[::1], u2[::1], "
    "f8[:,::1])"
)


@kernel(_WANTED)
def _wanted_ratios(  # type: ignore[no-untyped-def]
    grey, valid, every, cuts, corners, wanted, threshold, n_ln_n, table, listed, texture, ratios
):
    seven = (cuts[0], cuts[1], cuts[2], cuts[3], cuts[4], cuts[5], cuts[6])
    for b in range(corners.shape[0]):
        bits = wanted[b]
        if bits == 0:
            continue
        fill_texture(grey, valid, every, seven, corners[b, 0] + 1, corners[b, 1] + 1, texture)
        if bits & np.uint32(1):
            ratios[b, 0] = ratio_of_block(texture, 0, 0, 64, n_ln_n, table, listed)
            if ratios[b, 0] <= threshold:
                continue
        for half in range(4):
            row = half // 2 * 32
            col = half % 2 * 32
            if bits >> np.uint32(1 + half) & np.uint32(1):
                ratios[b, 1 + half] = ratio_of_block(texture, row, col, 32, n_ln_n, table, listed)
                if ratios[b, 1 + half] <= threshold:
                    continue
            for quarter in range(4):
                r = row + quarter // 2 * 16
                c = col + quarter % 2 * 16
                k = 5 + r // 16 * 4 + c // 16
                if bits >> np.uint32(k) & np.uint32(1):
                    ratios[b, k] = ratio_of_block(texture, r, c, 16, n_ln_n, table, listed)
