"""Hierarchical division by texture: the ratio R = G_max / G_min over the pairs of a block's four children.

G is the log-likelihood ratio of two histograms (Sokal and Rohlf, Biometry; Abou Merhy, Payeur and Petriu
2008, equations 1 and 2). With J(a, b) = (a + b) ln (a + b) - a ln a - b ln b, G of histograms f_s and f_m
with totals N_s and N_m is 2 [J(N_s, N_m) - sum of J(f_s, f_m) over the symbols]; it is 0 where they have the
same proportions. A symbol that only one of the two histograms has adds nothing: no branch is needed. R
depends only on the texture of the block, so it is computed once and any threshold is applied afterwards.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers, Uint8s, Uint16s, Uint32s
from uavseg.segmentation.blocks.g_statistic import MIN_G_PER_PIXEL, N_LN_N
from uavseg.segmentation.blocks.lbp import (
    CONTRAST_BINS,
    SYMBOLS,
    UNCOUNTED,
    contrast,
    contrast_bin,
    is_counted,
    lbp_code,
    or_empty,
)
from uavseg.units import BLOCK

RATIOS = 21  # of one block: side 64, then four of side 32, then sixteen of side 16, each row by row
ALL_RATIOS = np.uint32((1 << RATIOS) - 1)  # bit mask


def block_ratios(
    grey: Uint16s, valid: Uint8s | None, bin_edges: NDArray[np.int32], corners: Integers
) -> Floats:
    """Compute R of blocks of 64 x 64 pixels and of the blocks of 32 and 16 within them.

    `grey` and `valid`, 1 where a pixel is valid and None where all are, are (M + 2, N + 2), with a border of
    one pixel. `bin_edges`, (7,), are those of the contrast, from `lbp.contrast_bin_edges`, and `corners`, (B,
    2), row and column of each block's first pixel, 0 to M - 64 and N - 64, without the border. The ratios,
    (B, 21), are those of side 64, then the four of side 32, then the sixteen of side 16, row by row: 0 where
    every G is 0 or fewer than two children have counted pixels (not divided); infinite where only the
    smallest G is 0.
    """
    ratios = np.empty((len(corners), RATIOS))
    scratch = np.zeros((6, SYMBOLS), np.uint64)
    symbols = np.empty(BLOCK * BLOCK, np.uint16)
    _ratios(grey, or_empty(valid), valid is None, bin_edges, corners, N_LN_N, scratch, symbols, ratios)
    return ratios


def selected_ratios(
    grey: Uint16s,
    valid: Uint8s | None,
    bin_edges: NDArray[np.int32],
    corners: Integers,
    selected: Uint32s,
    threshold: float,
) -> Floats:
    """Compute R of selected blocks within blocks of 64 x 64 pixels.

    The arguments are those of `block_ratios`, and `selected`, a (B,) uint32 array: bit k is set where ratio k
    of a block is selected. The blocks within a selected block that is not divided, by the `threshold` X, are
    skipped. The result is identical to that of `block_ratios` where computed, 0 elsewhere.
    """
    ratios = np.zeros((len(corners), RATIOS))
    table, present = np.zeros(SYMBOLS, np.uint64), np.zeros(SYMBOLS, np.uint64)
    symbols = np.empty(BLOCK * BLOCK, np.uint16)
    image = (grey, or_empty(valid), valid is None, bin_edges)
    _selected_ratios(*image, corners, selected, threshold, N_LN_N, table, present, symbols, ratios)
    return ratios


@inlined
def sum_of_packed(packed, width):  # type: ignore[no-untyped-def]
    """Sum the four counts packed into one word with `width` bits each."""
    mask = (np.uint64(1) << width) - np.uint64(1)
    return (
        (packed & mask)
        + ((packed >> width) & mask)
        + ((packed >> (np.uint64(2) * width)) & mask)
        + (packed >> (np.uint64(3) * width))
    )


@inlined
def ratio_of_children(packed, present, n_present, width, n_ln_n):  # type: ignore[no-untyped-def]
    """Compute R from four histograms packed in a table, over the first `n_present` symbols in `present`."""
    mask = (np.uint64(1) << width) - np.uint64(1)
    n0 = n1 = n2 = n3 = np.uint64(0)
    j01 = j02 = j03 = j12 = j13 = j23 = 0.0
    for k in range(n_present):
        word = packed[present[k]]
        a = word & mask
        b = (word >> width) & mask
        c = (word >> (np.uint64(2) * width)) & mask
        d = word >> (np.uint64(3) * width)
        n0 += a
        n1 += b
        n2 += c
        n3 += d
        la, lb, lc, ld = n_ln_n[a], n_ln_n[b], n_ln_n[c], n_ln_n[d]
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
            if g < MIN_G_PER_PIXEL * (first + second):
                g = 0.0
            smallest = min(smallest, g)
            largest = max(largest, g)
    if largest <= 0.0:
        return 0.0
    if smallest == 0.0:
        return np.inf
    return largest / smallest


@inlined
def ratios_of_block(symbols, n_ln_n, scratch, ratios, b):  # type: ignore[no-untyped-def]
    """Fill ratios[b] from the 4096 symbols of a block, from the smallest blocks up."""
    # Three tables hold four packed counts for each symbol (8 bits each for the cells of a block of 16, 16
    # bits for its parents). Three lists hold the symbols present in each table, so that only these are
    # visited.
    cells, cells_present, sixteens, sixteens_present, halves, halves_present = 0, 1, 2, 3, 4, 5
    eight, sixteen = np.uint64(8), np.uint64(16)
    n_halves = 0
    for half in range(4):
        n_sixteens = 0
        for quarter in range(4):
            row = (half // 2) * 32 + (quarter // 2) * 16
            col = (half % 2) * 32 + (quarter % 2) * 16
            n_present = 0
            for r in range(16):
                for c in range(16):
                    symbol = symbols[(row + r) * BLOCK + col + c]
                    if symbol != UNCOUNTED:
                        if scratch[cells, symbol] == 0:
                            scratch[cells_present, n_present] = symbol
                            n_present += 1
                        scratch[cells, symbol] += np.uint64(1) << np.uint64(8 * (2 * (r // 8) + c // 8))
            place = 5 + (row // 16) * 4 + col // 16
            ratios[b, place] = ratio_of_children(
                scratch[cells], scratch[cells_present], n_present, eight, n_ln_n
            )
            for k in range(n_present):
                symbol = scratch[cells_present, k]
                if scratch[sixteens, symbol] == 0:
                    scratch[sixteens_present, n_sixteens] = symbol
                    n_sixteens += 1
                scratch[sixteens, symbol] += sum_of_packed(scratch[cells, symbol], eight) << np.uint64(
                    16 * quarter
                )
                scratch[cells, symbol] = 0
        ratios[b, 1 + half] = ratio_of_children(
            scratch[sixteens], scratch[sixteens_present], n_sixteens, sixteen, n_ln_n
        )
        for k in range(n_sixteens):
            symbol = scratch[sixteens_present, k]
            if scratch[halves, symbol] == 0:
                scratch[halves_present, n_halves] = symbol
                n_halves += 1
            scratch[halves, symbol] += sum_of_packed(scratch[sixteens, symbol], sixteen) << np.uint64(
                16 * half
            )
            scratch[sixteens, symbol] = 0
    ratios[b, 0] = ratio_of_children(scratch[halves], scratch[halves_present], n_halves, sixteen, n_ln_n)
    for k in range(n_halves):
        scratch[halves, scratch[halves_present, k]] = 0


@kernel("void(u2[:,::1], u1[:,::1], b1, i4[::1], i8[:,::1], f8[::1], u8[:,::1], u2[::1], f8[:,::1])")
def _ratios(grey, valid, all_valid, bin_edges, corners, n_ln_n, scratch, symbols, ratios):  # type: ignore[no-untyped-def]
    edges = (bin_edges[0], bin_edges[1], bin_edges[2], bin_edges[3], bin_edges[4], bin_edges[5], bin_edges[6])
    for b in range(corners.shape[0]):
        fill_symbols(grey, valid, all_valid, edges, corners[b, 0] + 1, corners[b, 1] + 1, symbols)
        ratios_of_block(symbols, n_ln_n, scratch, ratios, b)


@inlined
def ratio_of_block(symbols, row, col, side, n_ln_n, table, present):  # type: ignore[no-untyped-def]
    """Compute R of one block within the symbols of a block of 64; the table is empty before and after."""
    # Blocks of 16 in the order of `ratios_of_block`, so that rounding is the same and R equal to the bit.
    half = side // 2
    n_present = 0
    for k in range(side // 16 * (side // 16)):
        top = k // 8 * 32 + k // 2 % 2 * 16
        left = k // 4 % 2 * 32 + k % 2 * 16
        for r in range(top, top + 16):
            for c in range(left, left + 16):
                symbol = symbols[(row + r) * BLOCK + col + c]
                if symbol != UNCOUNTED:
                    if table[symbol] == 0:
                        present[n_present] = symbol
                        n_present += 1
                    table[symbol] += np.uint64(1) << np.uint64(16 * (2 * (r // half) + c // half))
    ratio = ratio_of_children(table, present, n_present, np.uint64(16), n_ln_n)
    for k in range(n_present):
        table[present[k]] = 0
    return ratio


@inlined
def fill_symbols(grey, valid, all_valid, bin_edges, top, left, symbols):  # type: ignore[no-untyped-def]
    """Compute the symbols of a block of 64 whose first pixel is grey[top, left]."""
    top, left = max(top, 1), max(left, 1)  # always true; spares the compiler a check for negative indices
    for r in range(BLOCK):
        row = top + r
        for c in range(BLOCK):
            bin_index = contrast_bin(contrast(grey, row, left + c), bin_edges)
            symbols[r * BLOCK + c] = lbp_code(grey, row, left + c) * CONTRAST_BINS + bin_index
        if not all_valid:
            for c in range(BLOCK):
                if not is_counted(valid, row, left + c):
                    symbols[r * BLOCK + c] = UNCOUNTED


@kernel(
    "void(u2[:,::1], u1[:,::1], b1, i4[::1], i8[:,::1], u4[::1], f8, f8[::1], u8[::1], u8[::1], u2[::1], "
    "f8[:,::1])"
)
def _selected_ratios(  # type: ignore[no-untyped-def]
    grey, valid, all_valid, bin_edges, corners, selected, threshold, n_ln_n, table, present, symbols, ratios
):
    edges = (bin_edges[0], bin_edges[1], bin_edges[2], bin_edges[3], bin_edges[4], bin_edges[5], bin_edges[6])
    for b in range(corners.shape[0]):
        bits = selected[b]
        if bits == 0:
            continue
        fill_symbols(grey, valid, all_valid, edges, corners[b, 0] + 1, corners[b, 1] + 1, symbols)
        if bits & np.uint32(1):
            ratios[b, 0] = ratio_of_block(symbols, 0, 0, 64, n_ln_n, table, present)
            if ratios[b, 0] <= threshold:
                continue
        for half in range(4):
            row = half // 2 * 32
            col = half % 2 * 32
            if bits >> np.uint32(1 + half) & np.uint32(1):
                ratios[b, 1 + half] = ratio_of_block(symbols, row, col, 32, n_ln_n, table, present)
                if ratios[b, 1 + half] <= threshold:
                    continue
            for quarter in range(4):
                r = row + quarter // 2 * 16
                c = col + quarter % 2 * 16
                k = 5 + r // 16 * 4 + c // 16
                if bits >> np.uint32(k) & np.uint32(1):
                    ratios[b, k] = ratio_of_block(symbols, r, c, 16, n_ln_n, table, present)
